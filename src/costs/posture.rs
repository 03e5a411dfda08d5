//! Feet under the body: w Σ ‖R(t)ᵀ(p_i − p(t)) − nominal_i‖² at the middle of every stance.
//!
//! The laws of motion leave the footholds free within their boxes; this is what makes the steps of a pair of legs alike.

use nalgebra::Matrix3;

use super::Cost;
use crate::constraints::reach;
use crate::nlp::curvature::Curvature;
use crate::nlp::sink::Sink;
use crate::nlp::{Model, State};

/// Footholds near the nominal ones.
#[derive(Clone, Debug)]
pub struct Posture {
    weight: f64,
    places: Vec<(usize, usize)>,
}

impl Posture {
    /// For every stance; for the first and the last at the very start and end.
    pub fn new(model: &Model, weight: f64) -> Self {
        let mut places = Vec::new();
        let last = model.layout.intervals;
        for (i, foot) in model.layout.feet.iter().enumerate() {
            for stance in &foot.stances {
                let s = stance.stance;
                let k = if s.start == 0.0 {
                    0
                } else if s.end == last as f64 {
                    last
                } else {
                    (0.5 * (s.start + s.end)) as usize
                };
                places.push((i, k));
            }
        }
        Self { weight: 2.0 * weight, places }
    }
}

impl Cost for Posture {
    fn name(&self) -> &'static str {
        "posture"
    }

    fn value(&self, model: &Model, state: &State, _x: &[f64]) -> f64 {
        let square = |place: (usize, usize)| {
            (reach::value(model, state, place) - model.nominal[place.0]).norm_squared()
        };
        self.places.iter().map(|&place| 0.5 * self.weight * square(place)).sum()
    }

    fn gradient(&self, model: &Model, state: &State, _x: &[f64], sink: &mut Sink) {
        for &place in &self.places {
            let error = reach::value(model, state, place) - model.nominal[place.0];
            reach::say_row(model, state, place, &(error * self.weight), 0, sink);
        }
    }

    fn hessian(
        &self,
        model: &Model,
        state: &State,
        _x: &[f64],
        factor: f64,
        curvature: &mut Curvature,
        sink: &mut Sink,
    ) {
        let weight = factor * self.weight;
        for &(i, k) in &self.places {
            let error = reach::value(model, state, (i, k)) - model.nominal[i];
            reach::say_curvature(model, state, (i, k), &(error * weight), curvature, sink);
            reach::say_quadratic(model, state, (i, k), &(Matrix3::identity() * weight), sink);
        }
    }
}
