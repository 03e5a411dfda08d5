//! Squares of linear functions of the variables: accelerations and force rates.
//!
//! ```text
//!   ½ Σ_r w_r ‖y_r(x)‖²
//! ```

use super::Cost;
use crate::nlp::sink::Sink;
use crate::nlp::state::Curvature;
use crate::nlp::{Model, State};
use crate::trajectory::LinearNode;
use crate::trajectory::spline::SWING_INTERVALS;

/// A sum of squared linear nodes.
#[derive(Clone, Debug)]
pub struct Smoothness {
    name: &'static str,
    terms: Vec<(LinearNode, usize, f64)>,
}

impl Smoothness {
    /// w ∫ ‖(p̄̈, θ̄̈)‖² dt, exact up to the trapezoidal rule: the base's acceleration is linear between the samples.
    pub fn base_acceleration(model: &Model, weight: f64) -> Self {
        let layout = &model.layout;
        let terms = (0..=layout.intervals)
            .map(|k| (layout.base_node(k as f64, 2), 6, 2.0 * weight * layout.time_step))
            .collect();
        Self { name: "base acceleration", terms }
    }

    /// w ∫ ‖f̄̇‖² dt in (m g)²/s: the rate is constant between the samples.
    pub fn force_rate(model: &Model, weight: f64) -> Self {
        let layout = &model.layout;
        let mut terms = Vec::new();
        let rate = 1.0 / layout.time_step;
        for stance in layout.feet.iter().flat_map(|f| &f.stances) {
            for pair in stance.forces.windows(2) {
                let mut node = LinearNode::default();
                for (end, sign) in pair.iter().zip([-rate, rate]) {
                    for &(variable, weight) in end.iter().flat_map(|f| &f.terms) {
                        node.push(variable, sign * weight);
                    }
                }
                terms.push((node, 3, 2.0 * weight * layout.time_step));
            }
        }
        Self { name: "force rate", terms }
    }

    /// w ∫ ‖p̄̈_i‖² dt over the swings, by the trapezoidal rule on the swing's own knots, between which it is linear.
    pub fn swing_acceleration(model: &Model, weight: f64) -> Self {
        let layout = &model.layout;
        let mut terms = Vec::new();
        for (foot, variables) in layout.feet.iter().enumerate() {
            for (j, swing) in variables.swings.iter().enumerate() {
                let duration = (swing.swing.end - swing.swing.start) as f64 * layout.time_step;
                for knot in 0..=SWING_INTERVALS {
                    let share = if knot == 0 || knot == SWING_INTERVALS { 0.5 } else { 1.0 };
                    let node = layout.swing_node(foot, j, knot as f64 / SWING_INTERVALS as f64, 2);
                    terms.push((node, 3, 2.0 * weight * share * duration / SWING_INTERVALS as f64));
                }
            }
        }
        Self { name: "swing acceleration", terms }
    }
}

impl Cost for Smoothness {
    fn name(&self) -> &'static str {
        self.name
    }

    fn value(&self, _model: &Model, _state: &State, x: &[f64]) -> f64 {
        let square = |node: &LinearNode, components: usize| -> f64 {
            (0..components).map(|d| node.terms.iter().map(|&(v, w)| w * x[v + d]).sum::<f64>().powi(2)).sum()
        };
        self.terms.iter().map(|(node, components, weight)| 0.5 * weight * square(node, *components)).sum()
    }

    fn gradient(&self, _model: &Model, _state: &State, x: &[f64], sink: &mut Sink) {
        for (node, components, weight) in &self.terms {
            for d in 0..*components {
                let value: f64 = node.terms.iter().map(|&(v, w)| w * x[v + d]).sum();
                sink.node(0, node, d, weight * value);
            }
        }
    }

    fn hessian(
        &self,
        _model: &Model,
        _state: &State,
        factor: f64,
        _curvature: &mut Curvature,
        sink: &mut Sink,
    ) {
        for (node, components, weight) in &self.terms {
            for d in 0..*components {
                sink.own(node, d, d, factor * weight);
            }
        }
    }
}
