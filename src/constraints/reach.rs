//! Eq. 4 and 10: every foot stays in its box 𝓡ᵢ, fixed to the base.
//!
//! ```text
//!   center − half_size ≤ R(t)ᵀ (p_i(t) − p(t)) + s(t) ≤ center + half_size
//! ```
//!
//! Rows: x, y, z in the base frame for each foot and sample, m; also halfway between samples in which a known leg swings over ground with
//! edges, or high and briefly, because such a foot leaves the straight line between them by more than the margin.

use crate::nlp::curvature::NodeCurvature;
use crate::nlp::foot_in_base;
use crate::nlp::sink::Sink;
use crate::nlp::term::{Constraint, RowPlace};
use crate::nlp::{Model, State};
use crate::trajectory::Instant;
use crate::trajectory::layout::Phase;
use nalgebra::Vector3;

use super::margins;

/// Largest acceleration of a swing, in its height over its duration squared: 70 m/s² for 15 cm in 0.3 s, measured.
const SWING_ACCELERATION: f64 = 42.0;

/// Feet within reach at every sample.
#[derive(Clone, Debug)]
pub struct Reach {
    places: Vec<(usize, Instant)>,
}

/// Taken off the box on each side for foot `i` at an instant, m, for a robot of ANYmal's size.
fn margin(model: &Model, i: usize, at: Instant) -> f64 {
    let Instant::Sample(k) = at else { return margins::REACH_SWINGING };
    let phase = &model.layout.phase[i];
    let swings = |k: usize| matches!(phase.get(k), Some(Phase::Swing(_)));
    if swings(k) {
        margins::REACH_SWINGING
    } else if swings(k + 1) || (k > 0 && swings(k - 1)) {
        margins::REACH_SWITCHING
    } else {
        margins::REACH_STANDING
    }
}

/// Whether a swing is so brief for its height that the foot leaves the line between two samples by more than the margin.
fn is_brief(model: &Model, i: usize, swing: usize, height: f64) -> bool {
    let duration = model.layout.feet[i].swings[swing].swing;
    let acceleration = SWING_ACCELERATION * height / (duration.end - duration.start).powi(2);
    acceleration / 8.0 > model.size * margins::REACH_SWINGING
}

impl Reach {
    /// Every foot at every sample, and in between where it may hurry. Swings rise to `swing_clearance`, m, or more.
    pub fn new(model: &Model, swing_clearance: f64) -> Self {
        let samples = model.layout.intervals + 1;
        let mut places = Vec::new();
        for i in 0..model.feet() {
            places.extend((0..samples).map(|k| (i, Instant::Sample(k))));
            if model.legs[i].is_some() {
                let between = (0..model.layout.intervals).map(Instant::Between);
                let hurries = |at: &Instant| match model.layout.phase_at(i, *at) {
                    Phase::Swing(j) => model.surfaces.have_edges() || is_brief(model, i, j, swing_clearance),
                    Phase::Stance(_) => false,
                };
                places.extend(between.filter(hurries).map(|at| (i, at)));
            }
        }
        Self { places }
    }
}

impl Constraint for Reach {
    fn name(&self) -> &'static str {
        "reach"
    }

    fn rows(&self) -> usize {
        3 * self.places.len()
    }

    fn bounds(&self, model: &Model, lower: &mut [f64], upper: &mut [f64]) {
        for (r, &(i, at)) in self.places.iter().enumerate() {
            let reach = &model.reach[i];
            let margin = model.size * margin(model, i, at) + model.tighter.reach;
            for c in 0..3 {
                let half = (reach.half_size[c] - margin).max(margins::REACH_FRACTION * reach.half_size[c]);
                lower[3 * r + c] = reach.center[c] - half;
                upper[3 * r + c] = reach.center[c] + half;
            }
        }
    }

    fn values(&self, model: &Model, state: &State, out: &mut [f64]) {
        for (r, &place) in self.places.iter().enumerate() {
            out[3 * r..3 * r + 3].copy_from_slice(foot_in_base::value(model, state, place).as_slice());
        }
    }

    fn jacobian(&self, model: &Model, state: &State, first: usize, sink: &mut Sink) {
        for (r, &place) in self.places.iter().enumerate() {
            for c in 0..3 {
                let unit = Vector3::from_fn(|i, _| f64::from(u8::from(i == c)));
                foot_in_base::add_derivative(model, state, place, &unit, &mut sink.row(first + 3 * r + c));
            }
        }
    }

    fn hessian(
        &self,
        model: &Model,
        state: &State,
        multipliers: &[f64],
        curvature: &mut NodeCurvature,
        _sink: &mut Sink,
    ) {
        for (r, &place) in self.places.iter().enumerate() {
            let lambda = Vector3::from_column_slice(&multipliers[3 * r..3 * r + 3]);
            foot_in_base::add_curvature(model, state, place, &lambda, curvature);
        }
    }

    fn place(&self, row: usize) -> RowPlace {
        let (i, at) = self.places[row / 3];
        RowPlace { foot: Some(i), sample: at.time() }
    }
}
