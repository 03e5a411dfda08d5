//! The rate of change of the forces: w ∫ ‖f̄̇‖² dt in (m g)²/s.
//!
//! Exact: the rate is constant between the samples. It is that of the forces that act; where durations are
//! optimized, these are f̄ = σ ḡ with the variables ḡ, so that a foot is loaded and unloaded gently at its switches as well. Next
//! to switches, a small fraction of the same cost is on ḡ, which would otherwise grow without bound where σ vanishes.

use nalgebra::Vector3;

use crate::nlp::curvature::NodeCurvature;
use crate::nlp::sink::{Differential, Gradient, Sink};
use crate::nlp::term::Cost;
use crate::nlp::{Model, State};
use crate::trajectory::LinearNode;

/// Weight of the rate of ḡ, relative to that of f̄.
const FULL_FRACTION: f64 = 2e-3;

/// Penalizes fast changes of force.
#[derive(Clone, Debug)]
pub struct ForceRate {
    /// (foot, sample): the interval from there to the next sample, where a force may act at either end.
    intervals: Vec<(usize, usize)>,
    /// Those of them in which f̄ differs from ḡ.
    timed: Vec<(usize, usize)>,
    weight: f64,
}

impl ForceRate {
    /// Of all feet.
    pub fn new(model: &Model, weight: f64) -> Self {
        let layout = &model.layout;
        let all = || (0..model.feet()).flat_map(|i| (0..layout.intervals).map(move |k| (i, k)));
        let free = |i: usize, k: usize| layout.force(i, k).is_some();
        let timed = |i: usize, k: usize| layout.timed_force(i, k).is_some_and(|node| node.is_timed());
        let intervals = all().filter(|&(i, k)| free(i, k) || free(i, k + 1)).collect();
        let timed = all()
            .filter(|&(i, k)| free(i, k) && free(i, k + 1) && (timed(i, k) || timed(i, k + 1)))
            .collect();
        Self { intervals, timed, weight: 2.0 * weight / layout.time_step }
    }

    /// f̄ at sample k + 1 less f̄ at sample k; a force that is not free is zero.
    fn change(state: &State, (i, k): (usize, usize)) -> Vector3<f64> {
        state.warped_forces[i][k + 1] - state.warped_forces[i][k]
    }

    /// The same for ḡ.
    fn full_change(state: &State, (i, k): (usize, usize)) -> Vector3<f64> {
        state.warped_full_forces[i][k + 1] - state.warped_full_forces[i][k]
    }

    /// ḡ at both ends of the timed intervals, in terms of the variables.
    fn full_nodes<'a>(
        &'a self,
        model: &'a Model,
    ) -> impl Iterator<Item = ((usize, usize), [&'a LinearNode; 2])> + 'a {
        self.timed.iter().filter_map(|&(i, k)| {
            let node = |k| model.layout.force(i, k).map(|(_, node)| node);
            Some(((i, k), [node(k)?, node(k + 1)?]))
        })
    }
}

impl Cost for ForceRate {
    fn name(&self) -> &'static str {
        "force rate"
    }

    fn value(&self, _model: &Model, state: &State, _x: &[f64]) -> f64 {
        let sum: f64 = self.intervals.iter().map(|&at| Self::change(state, at).norm_squared()).sum();
        let full: f64 = self.timed.iter().map(|&at| Self::full_change(state, at).norm_squared()).sum();
        0.5 * self.weight * (sum + FULL_FRACTION * full)
    }

    fn gradient(&self, model: &Model, state: &State, _x: &[f64], gradient: &mut Gradient) {
        for &(i, k) in &self.intervals {
            let change = Self::change(state, (i, k)) * self.weight;
            for (sample, sign) in [(k, -1.0), (k + 1, 1.0)] {
                let Some((_, node)) = state.force_node(model, i, sample) else { continue };
                for d in 0..3 {
                    gradient.node(node, d, sign * change[d]);
                }
            }
        }
        for (at, [before, after]) in self.full_nodes(model) {
            let change = Self::full_change(state, at) * (FULL_FRACTION * self.weight);
            for d in 0..3 {
                gradient.node(before, d, -change[d]);
                gradient.node(after, d, change[d]);
            }
        }
    }

    fn hessian(
        &self,
        model: &Model,
        state: &State,
        _x: &[f64],
        factor: f64,
        curvature: &mut NodeCurvature,
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
        let weight = FULL_FRACTION * weight;
        for (_, [before, after]) in self.full_nodes(model) {
            for d in 0..3 {
                sink.own(before, d, d, weight);
                sink.own(after, d, d, weight);
                sink.pair((after, d), (before, d), -weight);
            }
        }
    }
}
