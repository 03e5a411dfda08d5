//! Eq. 9, the friction cone in F as if φ were conformal: a constant cone about z̄ on the pulled-back force.
//!
//! ```text
//!   ν f̄_z − √(f̄_x² + f̄_y² + ε²) + ε ≥ 0
//! ```
//!
//! Rows: one for each free force of a foot that does not adhere, in m g.

use nalgebra::Vector3;

use super::friction::{ForcePlace, force_node, force_places};
use super::{Constraint, Place};
use crate::nlp::model::CONE_ROUNDING;
use crate::nlp::sink::Sink;
use crate::nlp::state::Curvature;
use crate::nlp::{Model, State};

/// Pulled-back forces inside the constant cone.
#[derive(Clone, Debug)]
pub struct FrictionConformal {
    friction: f64,
    places: Vec<ForcePlace>,
}

impl FrictionConformal {
    /// For all feet that do not adhere.
    pub fn new(model: &Model, friction: f64) -> Self {
        Self { friction, places: force_places(model, |i| !model.adhesive[i]) }
    }
}

fn tangential(f: &Vector3<f64>) -> f64 {
    (f.x * f.x + f.y * f.y + CONE_ROUNDING * CONE_ROUNDING).sqrt()
}

impl Constraint for FrictionConformal {
    fn name(&self) -> &'static str {
        "friction (Eq. 9)"
    }

    fn rows(&self) -> usize {
        self.places.len()
    }

    fn bounds(&self, _model: &Model, lower: &mut [f64], upper: &mut [f64]) {
        lower.fill(0.0);
        upper.fill(f64::INFINITY);
    }

    fn values(&self, _model: &Model, state: &State, out: &mut [f64]) {
        for (value, &(i, _, k)) in out.iter_mut().zip(&self.places) {
            let f = &state.warped_forces[i][k];
            *value = self.friction * f.z - tangential(f) + CONE_ROUNDING;
        }
    }

    fn jacobian(&self, model: &Model, state: &State, first: usize, sink: &mut Sink) {
        for (r, &(i, j, k)) in self.places.iter().enumerate() {
            let f = &state.warped_forces[i][k];
            let s = tangential(f);
            let node = force_node(model, (i, j, k));
            for (d, value) in [-f.x / s, -f.y / s, self.friction].into_iter().enumerate() {
                sink.node(first + r, node, d, value);
            }
        }
    }

    fn hessian(
        &self,
        model: &Model,
        state: &State,
        multipliers: &[f64],
        _curvature: &mut Curvature,
        sink: &mut Sink,
    ) {
        for (&lambda, &(i, j, k)) in multipliers.iter().zip(&self.places) {
            let f = &state.warped_forces[i][k];
            let s = tangential(f);
            let s3 = s * s * s;
            let node = force_node(model, (i, j, k));
            sink.own(node, 0, 0, lambda * (f.x * f.x / s3 - 1.0 / s));
            sink.own(node, 1, 0, lambda * f.x * f.y / s3);
            sink.own(node, 1, 1, lambda * (f.y * f.y / s3 - 1.0 / s));
        }
    }

    fn place(&self, row: usize) -> Place {
        let (i, _, k) = self.places[row];
        Place { foot: Some(i), sample: k as f64 }
    }
}
