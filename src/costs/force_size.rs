//! The size of the forces: w ∫ Σ_i ‖f̄_i‖² dt in (m g)² s.
//!
//! The laws of motion leave it open how standing feet share the load; the rate of the forces alone would put most of it on one diagonal,
//! ready for the first step. The least sum of squares shares it evenly. By the trapezoidal rule; the forces vanish at the ends of stances.

use crate::nlp::curvature::NodeCurvature;
use crate::nlp::sink::{Differential, Gradient, Sink};
use crate::nlp::term::Cost;
use crate::nlp::{Model, State};

/// Penalizes large forces, and so uneven ones.
#[derive(Clone, Debug)]
pub struct ForceSize {
    /// (foot, sample, weight) of the free forces.
    samples: Vec<(usize, usize, f64)>,
}

impl ForceSize {
    /// Of all feet.
    pub fn new(model: &Model, weight: f64) -> Self {
        let last = model.layout.intervals;
        let weight_at = |k: usize| {
            let part = if k == 0 || k == last { 0.5 } else { 1.0 };
            2.0 * weight * model.layout.time_step * part
        };
        let all = (0..model.feet()).flat_map(|i| (0..=last).map(move |k| (i, k)));
        let free = all.filter(|&(i, k)| model.layout.force(i, k).is_some());
        Self { samples: free.map(|(i, k)| (i, k, weight_at(k))).collect() }
    }
}

impl Cost for ForceSize {
    fn name(&self) -> &'static str {
        "force size"
    }

    fn value(&self, _model: &Model, state: &State, _x: &[f64]) -> f64 {
        let square =
            |&(i, k, weight): &(usize, usize, f64)| 0.5 * weight * state.warped_forces[i][k].norm_squared();
        self.samples.iter().map(square).sum()
    }

    fn gradient(&self, model: &Model, state: &State, _x: &[f64], gradient: &mut Gradient) {
        for &(i, k, weight) in &self.samples {
            let Some((_, node)) = state.force_node(model, i, k) else { continue };
            for d in 0..3 {
                gradient.node(node, d, weight * state.warped_forces[i][k][d]);
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
        for &(i, k, weight) in &self.samples {
            let weight = factor * weight;
            curvature.warped_forces[i][k] += state.warped_forces[i][k] * weight;
            let Some((_, node)) = state.force_node(model, i, k) else { continue };
            for d in 0..3 {
                sink.own(node, d, d, weight);
            }
        }
    }
}
