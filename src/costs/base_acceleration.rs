//! How the base accelerates: w ∫ ‖(p̄̈, θ̄̈)‖² dt.
//!
//! Exact up to the trapezoidal rule: the base's acceleration is linear between the samples, and linear in the variables.

use super::Cost;
use crate::nlp::sink::Sink;
use crate::nlp::state::Curvature;
use crate::nlp::{Model, State};
use crate::trajectory::LinearNode;

/// A base that moves evenly.
#[derive(Clone, Debug)]
pub struct BaseAcceleration {
    /// Accelerations at the samples.
    nodes: Vec<LinearNode>,
    weight: f64,
}

impl BaseAcceleration {
    /// Over the whole motion.
    pub fn new(model: &Model, weight: f64) -> Self {
        let layout = &model.layout;
        let nodes = (0..=layout.intervals).map(|k| layout.base_node(k as f64, 2)).collect();
        Self { nodes, weight: 2.0 * weight * layout.time_step }
    }
}

impl Cost for BaseAcceleration {
    fn name(&self) -> &'static str {
        "base acceleration"
    }

    fn value(&self, _model: &Model, _state: &State, x: &[f64]) -> f64 {
        let square = |node: &LinearNode| node.value::<6>(x).iter().map(|v| v * v).sum::<f64>();
        0.5 * self.weight * self.nodes.iter().map(square).sum::<f64>()
    }

    fn gradient(&self, _model: &Model, _state: &State, x: &[f64], sink: &mut Sink) {
        for node in &self.nodes {
            for (d, value) in node.value::<6>(x).into_iter().enumerate() {
                sink.node(0, node, d, self.weight * value);
            }
        }
    }

    fn hessian(
        &self,
        _model: &Model,
        _state: &State,
        _x: &[f64],
        factor: f64,
        _curvature: &mut Curvature,
        sink: &mut Sink,
    ) {
        for node in &self.nodes {
            for d in 0..6 {
                sink.own(node, d, d, factor * self.weight);
            }
        }
    }
}
