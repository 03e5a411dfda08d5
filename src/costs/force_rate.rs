//! How fast the forces change: w ∫ ‖f̄̇‖² dt in (m g)²/s.
//!
//! Exact: the rate is constant between the samples. It is that of the forces which act, also where durations are optimized
//! and these are shares of their variables: so a foot is loaded and unloaded gently at its switches as well.

use nalgebra::Vector3;

use super::Cost;
use crate::nlp::sink::Sink;
use crate::nlp::state::Curvature;
use crate::nlp::{Model, State};

/// Forces that change slowly.
#[derive(Clone, Debug)]
pub struct ForceRate {
    /// (foot, sample): the interval from there to the next sample, where one of its ends may bear something.
    intervals: Vec<(usize, usize)>,
    weight: f64,
}

impl ForceRate {
    /// Of all feet.
    pub fn new(model: &Model, weight: f64) -> Self {
        let layout = &model.layout;
        let intervals = (0..model.feet())
            .flat_map(|i| (0..layout.intervals).map(move |k| (i, k)))
            .filter(|&(i, k)| layout.force(i, k).is_some() || layout.force(i, k + 1).is_some())
            .collect();
        Self { intervals, weight: 2.0 * weight / layout.time_step }
    }

    /// f̄ at sample k + 1 less f̄ at sample k; a force that is not free is zero.
    fn change(state: &State, (i, k): (usize, usize)) -> Vector3<f64> {
        state.warped_forces[i][k + 1] - state.warped_forces[i][k]
    }
}

impl Cost for ForceRate {
    fn name(&self) -> &'static str {
        "force rate"
    }

    fn value(&self, _model: &Model, state: &State, _x: &[f64]) -> f64 {
        let sum: f64 = self.intervals.iter().map(|&at| Self::change(state, at).norm_squared()).sum();
        0.5 * self.weight * sum
    }

    fn gradient(&self, model: &Model, state: &State, _x: &[f64], sink: &mut Sink) {
        for &(i, k) in &self.intervals {
            let change = Self::change(state, (i, k)) * self.weight;
            for (sample, sign) in [(k, -1.0), (k + 1, 1.0)] {
                let Some((_, node)) = state.force_node(model, i, sample) else { continue };
                for d in 0..3 {
                    sink.node(0, node, d, sign * change[d]);
                }
            }
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
        for &(i, k) in &self.intervals {
            let change = Self::change(state, (i, k)) * weight;
            curvature.warped_forces[i][k] -= change;
            curvature.warped_forces[i][k + 1] += change;
            let [before, after] = [k, k + 1].map(|k| state.force_node(model, i, k).map(|(_, node)| node));
            for d in 0..3 {
                for node in before.iter().chain(&after) {
                    sink.own(node, d, d, weight);
                }
                if let (Some(before), Some(after)) = (before, after) {
                    sink.pair((after, d), (before, d), -weight);
                }
            }
        }
    }
}
