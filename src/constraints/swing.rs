//! Eq. 3 and 8, second line, with an apex: a swinging foot clears the ground.
//!
//! ```text
//!   (zᵀp_i − h(p_i)) n_z ≥ clearance
//! ```
//!
//! The left side is the distance to the tangent plane of the ground below the foot; over ground with edges it is the height above the
//! surface that the foot rolls over, without n_z. In the middle of a swing the clearance
//! is the scenario's `swing_clearance`. At the samples before and after it, a fraction of it is required that falls off toward
//! both ends like the parabola 4u(1−u), so that feet lift off and touch down steeply enough to clear stones. In F the free
//! control points are bounded as well (see `planner::problem`).
//!
//! Rows: by foot, one for each sample strictly inside a swing, then one for the middle of each swing; m. Where durations are
//! optimized or the ground has edges, one for each of further points of the path (see `nlp::state`).

use nalgebra::{Matrix3, Vector3};

use crate::nlp::curvature::NodeCurvature;
use crate::nlp::ground_normal::clearance;
use crate::nlp::sink::Sink;
use crate::nlp::state::{FootNode, has_points, swing_points};
use crate::nlp::tangent::Tangent;
use crate::nlp::term::{Constraint, RowPlace};
use crate::nlp::{Model, State};
use crate::trajectory::LinearNode;
use crate::trajectory::layout::Phase;

/// Fraction of the parabola that is required away from the middle.
const FALL_OFF: f64 = 0.5;

/// Where a row acts.
#[derive(Clone, Copy, Debug)]
enum At {
    Sample { foot: usize, k: usize, u: f64 },
    Point { foot: usize, n: usize, u: f64, apex: bool, sample: f64 },
}

/// The clearance of swinging feet.
#[derive(Clone, Debug)]
pub struct SwingClearance {
    clearance: f64,
    places: Vec<At>,
}

impl SwingClearance {
    /// For every swing.
    pub fn new(model: &Model, clearance: f64) -> Self {
        let mut places = Vec::new();
        for (foot, variables) in model.layout.feet.iter().enumerate() {
            for (k, phase) in model.layout.phase[foot].iter().enumerate() {
                if let Phase::Swing(j) = *phase
                    && !has_points(model, &variables.swings[j])
                {
                    let s = variables.swings[j].swing;
                    places.push(At::Sample { foot, k, u: (k as f64 - s.start) / (s.end - s.start) });
                }
            }
            for (n, at) in swing_points(model, foot).iter().enumerate() {
                let s = variables.swings[at.swing].swing;
                let sample = s.start + at.u * (s.end - s.start);
                places.push(At::Point { foot, n, u: at.u, apex: at.apex, sample });
            }
        }
        Self { clearance, places }
    }

    fn node<'a>(&self, state: &'a State, at: At) -> (&'a FootNode, &'a LinearNode) {
        match at {
            At::Sample { foot, k, .. } => (&state.swings[foot][k], state.foot_node(foot, k)),
            At::Point { foot, n, .. } => (&state.points[foot][n], &state.swing_points[foot][n].node),
        }
    }

    fn distance(&self, model: &Model, state: &State, at: At) -> (f64, Vector3<f64>, Matrix3<f64>) {
        let foot = self.node(state, at).0;
        clearance(model, &foot.point.position, &foot.ground)
    }
}

impl Constraint for SwingClearance {
    fn name(&self) -> &'static str {
        "swing clearance"
    }

    fn rows(&self) -> usize {
        self.places.len()
    }

    fn bounds(&self, _model: &Model, lower: &mut [f64], upper: &mut [f64]) {
        upper.fill(f64::INFINITY);
        for (r, at) in self.places.iter().enumerate() {
            lower[r] = match at {
                At::Point { apex: true, .. } => self.clearance,
                At::Sample { u, .. } | At::Point { u, .. } => FALL_OFF * self.clearance * 4.0 * u * (1.0 - u),
            };
        }
    }

    fn values(&self, model: &Model, state: &State, out: &mut [f64]) {
        for (value, &at) in out.iter_mut().zip(&self.places) {
            *value = self.distance(model, state, at).0;
        }
    }

    fn jacobian(&self, model: &Model, state: &State, first: usize, sink: &mut Sink) {
        for (r, &at) in self.places.iter().enumerate() {
            let (foot, node) = self.node(state, at);
            Tangent::foot(model, foot, node)
                .add_along(&self.distance(model, state, at).1, &mut sink.row(first + r));
        }
    }

    fn hessian(
        &self,
        model: &Model,
        state: &State,
        multipliers: &[f64],
        curvature: &mut NodeCurvature,
        sink: &mut Sink,
    ) {
        for (&lambda, &at) in multipliers.iter().zip(&self.places) {
            let (foot, node) = self.node(state, at);
            let (_, by_position, form) = self.distance(model, state, at);
            match at {
                At::Sample { foot, k, .. } => curvature.swings[foot][k] += by_position * lambda,
                At::Point { foot, n, .. } => curvature.points[foot][n] += by_position * lambda,
            }
            Tangent::foot(model, foot, node).quadratic(&(form * lambda), sink);
        }
    }

    fn place(&self, row: usize) -> RowPlace {
        match self.places[row] {
            At::Sample { foot, k, .. } => RowPlace { foot: Some(foot), sample: k as f64 },
            At::Point { foot, sample, .. } => RowPlace { foot: Some(foot), sample },
        }
    }
}
