//! Feet under the body: w Σ ‖R(t)ᵀ(p_i − p(t)) − nominal_i‖² at the middle of every stance.
//!
//! The laws of motion leave the footholds free within their boxes; this cost makes the steps of left and right legs alike.

use nalgebra::Matrix3;

use crate::nlp::curvature::NodeCurvature;
use crate::nlp::foot_in_base;
use crate::nlp::sink::{Gradient, Sink};
use crate::nlp::term::Cost;
use crate::nlp::{Model, State};

/// Penalizes footholds away from the nominal ones.
#[derive(Clone, Debug)]
pub struct Posture {
    weight: f64,
    places: Vec<(usize, usize)>,
}

impl Posture {
    /// For every stance; for the first and the last at the very start and end, unless the motion is cyclic.
    pub fn new(model: &Model, weight: f64) -> Self {
        let mut places = Vec::new();
        let within = 0.0..=model.layout.intervals as f64;
        for (i, foot) in model.layout.feet.iter().enumerate() {
            // In a cyclic motion the other part of the stance has its middle.
            let middles = (0..foot.stances.len()).map(|j| model.halfway(i, j));
            places.extend(middles.filter(|k| within.contains(k)).map(|k| (i, k as usize)));
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
            (foot_in_base::value(model, state, place) - model.nominal[place.0]).norm_squared()
        };
        self.places.iter().map(|&place| 0.5 * self.weight * square(place)).sum()
    }

    fn gradient(&self, model: &Model, state: &State, _x: &[f64], gradient: &mut Gradient) {
        for &place in &self.places {
            let error = foot_in_base::value(model, state, place) - model.nominal[place.0];
            foot_in_base::add_derivative(model, state, place, &(error * self.weight), gradient);
        }
    }

    fn hessian(
        &self,
        model: &Model,
        state: &State,
        _x: &[f64],
        factor: f64,
        curvature: &mut NodeCurvature,
        _sink: &mut Sink,
    ) {
        let weight = factor * self.weight;
        for &(i, k) in &self.places {
            let error = foot_in_base::value(model, state, (i, k)) - model.nominal[i];
            foot_in_base::add_curvature(model, state, (i, k), &(error * weight), curvature);
            foot_in_base::add_quadratic(model, state, (i, k), &(Matrix3::identity() * weight), curvature);
        }
    }
}
