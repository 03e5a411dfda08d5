//! Eq. 3 and 8, second line, with an apex: a swinging foot clears the ground.
//!
//! ```text
//!   (zᵀp_i − h(p_i)) n_z ≥ clearance
//! ```
//!
//! The left side is the distance to the tangent plane of the ground below the foot. In the middle of a swing the clearance
//! is the scenario's `swing_clearance`; at the samples before and after it a share of it that falls off towards both ends
//! like the parabola 4u(1−u), so that feet leave and land steeply enough to pass stones. In the space of the variables the
//! free control points are bounded as well where that is sound (see `nlp::problem`).
//!
//! Rows: one for each sample strictly inside a swing, then one for the middle of each swing; m.

use nalgebra::Vector3;

use super::{Constraint, Normal, Place};
use crate::nlp::sink::Sink;
use crate::nlp::state::{Curvature, FootNode, Tangent};
use crate::nlp::{Model, State};
use crate::trajectory::LinearNode;
use crate::trajectory::layout::Phase;

/// Share of the parabola that is asked for away from the middle.
const FALL_OFF: f64 = 0.5;

/// Where a row acts.
#[derive(Clone, Copy, Debug)]
enum At {
    Sample { foot: usize, k: usize, u: f64 },
    Apex { foot: usize, swing: usize, sample: f64 },
}

/// Swinging feet over the ground.
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
                if let Phase::Swing(j) = phase {
                    let s = variables.swings[*j].swing;
                    places.push(At::Sample { foot, k, u: (k - s.start) as f64 / (s.end - s.start) as f64 });
                }
            }
            for (swing, s) in variables.swings.iter().enumerate() {
                places.push(At::Apex { foot, swing, sample: (s.swing.start + s.swing.end) as f64 / 2.0 });
            }
        }
        Self { clearance, places }
    }

    fn node<'a>(&self, model: &'a Model, state: &'a State, at: At) -> (&'a FootNode, &'a LinearNode) {
        match at {
            At::Sample { foot, k, .. } => (&state.swings[foot][k], &model.layout.foot_nodes[foot][k]),
            At::Apex { foot, swing, .. } => (&state.apexes[foot][swing], &state.apex_nodes[foot][swing]),
        }
    }
}

/// (gap · n_z) and its derivative in the ambient position.
fn distance(node: &FootNode) -> (f64, Vector3<f64>, Normal) {
    let (gap, by_gap) = node.gap();
    let normal = Normal::new(&node.ground);
    let nz = normal.n.z;
    let by_nz = Vector3::new(normal.first[0].z, normal.first[1].z, 0.0);
    (gap * nz, by_gap * nz + by_nz * gap, normal)
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
                At::Sample { u, .. } => FALL_OFF * self.clearance * 4.0 * u * (1.0 - u),
                At::Apex { .. } => self.clearance,
            };
        }
    }

    fn values(&self, model: &Model, state: &State, out: &mut [f64]) {
        for (value, &at) in out.iter_mut().zip(&self.places) {
            *value = distance(self.node(model, state, at).0).0;
        }
    }

    fn jacobian(&self, model: &Model, state: &State, first: usize, sink: &mut Sink) {
        for (r, &at) in self.places.iter().enumerate() {
            let (foot, node) = self.node(model, state, at);
            Tangent::position(model, &foot.point, node).row(first + r, &distance(foot).1, sink);
        }
    }

    fn hessian(
        &self,
        model: &Model,
        state: &State,
        multipliers: &[f64],
        curvature: &mut Curvature,
        sink: &mut Sink,
    ) {
        for (&lambda, &at) in multipliers.iter().zip(&self.places) {
            let (foot, node) = self.node(model, state, at);
            let (_, by_position, normal) = distance(foot);
            match at {
                At::Sample { foot, k, .. } => curvature.swings[foot][k] += by_position * lambda,
                At::Apex { foot, swing, .. } => curvature.apexes[foot][swing] += by_position * lambda,
            }
            let (gap, by_gap) = foot.gap();
            let by_nz = Vector3::new(normal.first[0].z, normal.first[1].z, 0.0);
            let form = super::height_form(&foot.ground) * -normal.n.z
                + by_gap * by_nz.transpose()
                + by_nz * by_gap.transpose()
                + normal.curvature(&Vector3::z()) * gap;
            Tangent::position(model, &foot.point, node).quadratic(&(form * lambda), sink);
        }
    }

    fn place(&self, row: usize) -> Place {
        match self.places[row] {
            At::Sample { foot, k, .. } => Place { foot: Some(foot), sample: k as f64 },
            At::Apex { foot, sample, .. } => Place { foot: Some(foot), sample },
        }
    }
}
