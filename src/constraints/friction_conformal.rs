//! Eq. 9, the friction cone in F as if φ were conformal: a constant cone about z̄ on the pulled-back force.
//!
//! ```text
//!   √(f̄_x² + f̄_y²) ≤ ν f̄_z,  in the form of [`super::friction`] with n = z̄
//! ```
//!
//! Rows: one for each free force of a foot that does not adhere, in m g.

use nalgebra::Vector3;

use super::friction::FrictionCone;
use crate::nlp::contact_force::{ForceSample, force_node, force_samples};
use crate::nlp::curvature::NodeCurvature;
use crate::nlp::sink::Sink;
use crate::nlp::term::{Constraint, RowPlace};
use crate::nlp::{Model, State};

/// Pulled-back forces inside the constant cone.
#[derive(Clone, Debug)]
pub struct FrictionConformal {
    friction: f64,
    samples: Vec<ForceSample>,
}

impl FrictionConformal {
    /// For all feet that do not adhere.
    pub fn new(model: &Model, friction: f64) -> Self {
        Self { friction, samples: force_samples(model, |i| !model.adhesive[i]) }
    }
}

impl Constraint for FrictionConformal {
    fn name(&self) -> &'static str {
        "friction (Eq. 9)"
    }

    fn rows(&self) -> usize {
        self.samples.len()
    }

    fn bounds(&self, _model: &Model, lower: &mut [f64], upper: &mut [f64]) {
        lower.fill(0.0);
        upper.fill(f64::INFINITY);
    }

    fn values(&self, _model: &Model, state: &State, out: &mut [f64]) {
        for (value, at) in out.iter_mut().zip(&self.samples) {
            let f = &state.warped_full_forces[at.foot][at.sample];
            *value = FrictionCone::new(self.friction, f.z, f.norm_squared()).g;
        }
    }

    fn jacobian(&self, model: &Model, state: &State, first: usize, sink: &mut Sink) {
        for (r, &at) in self.samples.iter().enumerate() {
            let f = &state.warped_full_forces[at.foot][at.sample];
            let cone = FrictionCone::new(self.friction, f.z, f.norm_squared());
            let gradient = f * (2.0 * cone.w) + Vector3::z() * cone.u;
            for d in 0..3 {
                sink.node(first + r, force_node(model, at), d, gradient[d]);
            }
        }
    }

    fn hessian(
        &self,
        model: &Model,
        state: &State,
        multipliers: &[f64],
        _curvature: &mut NodeCurvature,
        sink: &mut Sink,
    ) {
        for (&lambda, &at) in multipliers.iter().zip(&self.samples) {
            let f = &state.warped_full_forces[at.foot][at.sample];
            let cone = FrictionCone::new(self.friction, f.z, f.norm_squared());
            let node = force_node(model, at);
            sink.own(node, 0, 0, lambda * 2.0 * cone.w);
            sink.own(node, 1, 1, lambda * 2.0 * cone.w);
            sink.own(node, 2, 0, lambda * 2.0 * cone.uw * f.x);
            sink.own(node, 2, 1, lambda * 2.0 * cone.uw * f.y);
            sink.own(node, 2, 2, lambda * (2.0 * cone.w + cone.uu + 4.0 * cone.uw * f.z));
        }
    }

    fn place(&self, row: usize) -> RowPlace {
        self.samples[row].place()
    }
}
