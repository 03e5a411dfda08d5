//! The base's acceleration: w ∫ ‖(p̄̈, θ̄̈)‖² dt.
//!
//! Exact up to the trapezoidal rule: the base's acceleration is linear between the samples, and linear in the variables.

use crate::nlp::curvature::NodeCurvature;
use crate::nlp::sink::{Differential, Gradient, Sink};
use crate::nlp::term::Cost;
use crate::nlp::{Model, State};

/// Penalizes acceleration of the base.
#[derive(Clone, Debug)]
pub struct BaseAcceleration {
    weight: f64,
}

impl BaseAcceleration {
    /// Over the whole motion.
    pub fn new(model: &Model, weight: f64) -> Self {
        Self { weight: 2.0 * weight * model.layout.time_step }
    }
}

impl Cost for BaseAcceleration {
    fn name(&self) -> &'static str {
        "base acceleration"
    }

    fn value(&self, _model: &Model, state: &State, _x: &[f64]) -> f64 {
        let squares = state.base_motion.iter().flat_map(|[_, _, acceleration]| acceleration.map(|v| v * v));
        0.5 * self.weight * squares.sum::<f64>()
    }

    fn gradient(&self, model: &Model, state: &State, _x: &[f64], gradient: &mut Gradient) {
        for ([_, node], [_, _, acceleration]) in model.layout.base_rates.iter().zip(&state.base_motion) {
            for (d, value) in acceleration.iter().enumerate() {
                gradient.node(node, d, self.weight * value);
            }
        }
    }

    fn hessian(
        &self,
        model: &Model,
        _state: &State,
        _x: &[f64],
        factor: f64,
        _curvature: &mut NodeCurvature,
        sink: &mut Sink,
    ) {
        for [_, node] in &model.layout.base_rates {
            for d in 0..6 {
                sink.own(node, d, d, factor * self.weight);
            }
        }
    }
}
