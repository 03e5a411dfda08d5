//! The acceleration of swinging feet: w ∫ ‖p̄̈_i‖² dt over the swings.
//!
//! ```text
//!   w T⁻³ Σ_m w_m ‖S''(u_m)‖²,  T = b − a the duration of the swing
//! ```
//!
//! By the trapezoidal rule on the swing's own knots u_m, between which S'' is linear. The path S(u) does not depend on time,
//! so T is a common factor, whether it is given or optimized.

use nalgebra::Vector3;

use crate::nlp::curvature::NodeCurvature;
use crate::nlp::sink::{Differential, Gradient, Sink};
use crate::nlp::term::Cost;
use crate::nlp::{Model, State};
use crate::trajectory::LinearNode;

/// Penalizes acceleration of swinging feet.
#[derive(Clone, Debug)]
pub struct SwingAcceleration {
    swings: Vec<WeightedSwing>,
    time_step: f64,
}

#[derive(Clone, Debug)]
struct WeightedSwing {
    foot: usize,
    swing: usize,
    /// Its lift-off, if it is a variable; touch-down is the next one.
    switches: Option<usize>,
    /// S'' at the knots, with their weights.
    knots: Vec<(LinearNode, f64)>,
}

impl SwingAcceleration {
    /// Of all feet.
    pub fn new(model: &Model, weight: f64) -> Self {
        let layout = &model.layout;
        let mut swings = Vec::new();
        let intervals = layout.swing_shape.intervals();
        for (foot, variables) in layout.feet.iter().enumerate() {
            for (swing, s) in variables.swings.iter().enumerate() {
                let knots = (0..=intervals).map(|knot| {
                    let end = if knot == 0 || knot == intervals { 0.5 } else { 1.0 };
                    let node = layout.swing_node(foot, swing, knot as f64 / intervals as f64, 2);
                    (node, 2.0 * weight * end / intervals as f64)
                });
                swings.push(WeightedSwing { foot, swing, switches: s.switches, knots: knots.collect() });
            }
        }
        Self { swings, time_step: layout.time_step }
    }

    /// T⁻³ and its first and second derivatives with respect to touch-down; each differentiation with respect to lift-off changes the sign.
    fn factor(&self, state: &State, swing: &WeightedSwing) -> [f64; 3] {
        let [a, b] = state.switches[swing.foot][swing.swing];
        let duration = (b - a) * self.time_step;
        let value = duration.powi(-3);
        let rate = self.time_step / duration;
        [value, -3.0 * value * rate, 12.0 * value * rate * rate]
    }
}

/// Σ ½ w ‖S''‖²
fn sum(swing: &WeightedSwing, x: &[f64]) -> f64 {
    let square = |node: &LinearNode| Vector3::from(node.value::<3>(x)).norm_squared();
    swing.knots.iter().map(|(node, weight)| 0.5 * weight * square(node)).sum()
}

impl Cost for SwingAcceleration {
    fn name(&self) -> &'static str {
        "swing acceleration"
    }

    fn value(&self, _model: &Model, state: &State, x: &[f64]) -> f64 {
        self.swings.iter().map(|swing| self.factor(state, swing)[0] * sum(swing, x)).sum()
    }

    fn gradient(&self, _model: &Model, state: &State, x: &[f64], gradient: &mut Gradient) {
        for swing in &self.swings {
            let [value, slope, _] = self.factor(state, swing);
            for (node, weight) in &swing.knots {
                for (d, y) in node.value::<3>(x).into_iter().enumerate() {
                    gradient.node(node, d, value * weight * y);
                }
            }
            if let Some(switches) = swing.switches {
                let sum = sum(swing, x);
                gradient.add(switches, -slope * sum);
                gradient.add(switches + 1, slope * sum);
            }
        }
    }

    fn hessian(
        &self,
        _model: &Model,
        state: &State,
        x: &[f64],
        factor: f64,
        _curvature: &mut NodeCurvature,
        sink: &mut Sink,
    ) {
        for swing in &self.swings {
            let [value, slope, bend] = self.factor(state, swing).map(|v| v * factor);
            for (node, weight) in &swing.knots {
                for d in 0..3 {
                    sink.own(node, d, d, value * weight);
                }
            }
            let Some(switches) = swing.switches else { continue };
            for (node, weight) in &swing.knots {
                for (d, y) in node.value::<3>(x).into_iter().enumerate() {
                    node.differential(d).for_each(|(v, by)| {
                        for (switch, sign) in [(switches, -1.0), (switches + 1, 1.0)] {
                            sink.add(v.max(switch), v.min(switch), sign * slope * weight * y * by);
                        }
                    });
                }
            }
            let sum = sum(swing, x);
            sink.add(switches, switches, bend * sum);
            sink.add(switches + 1, switches, -bend * sum);
            sink.add(switches + 1, switches + 1, bend * sum);
        }
    }
}
