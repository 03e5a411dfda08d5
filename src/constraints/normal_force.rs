//! Limits of the normal force: how hard a foot may push, and how hard an adhesive one may pull.
//!
//! ```text
//!   −pull_limit ≤ n·f ≤ force_limit      (adhesive feet)
//!     least ≤ n·f ≤ force_limit          (others: a standing foot presses on the ground by [`LEAST_NORMAL_FORCE`])
//! ```
//!
//! Rows: one for each free force, in m g; where durations are optimized, for the full force as in [`super::friction`].

use crate::nlp::contact_force::{ForceSample, ForceTangents, force_samples};
use crate::nlp::curvature::NodeCurvature;
use crate::nlp::ground_normal::GroundNormal;
use crate::nlp::model::LEAST_NORMAL_FORCE;
use crate::nlp::sink::Sink;
use crate::nlp::term::{Constraint, RowPlace};
use crate::nlp::{Model, State};

/// Normal forces within limits.
#[derive(Clone, Debug)]
pub struct NormalForce {
    force_limit: f64,
    pull_limit: f64,
    samples: Vec<ForceSample>,
}

impl NormalForce {
    /// For all feet.
    pub fn new(model: &Model, force_limit: f64, pull_limit: f64) -> Self {
        Self { force_limit, pull_limit, samples: force_samples(model, |_| true) }
    }
}

impl Constraint for NormalForce {
    fn name(&self) -> &'static str {
        "normal force"
    }

    fn rows(&self) -> usize {
        self.samples.len()
    }

    fn bounds(&self, model: &Model, lower: &mut [f64], upper: &mut [f64]) {
        for (r, at) in self.samples.iter().enumerate() {
            lower[r] = if model.adhesive[at.foot] { -self.pull_limit } else { LEAST_NORMAL_FORCE };
            upper[r] = self.force_limit;
        }
    }

    fn values(&self, _model: &Model, state: &State, out: &mut [f64]) {
        for (value, at) in out.iter_mut().zip(&self.samples) {
            let normal = GroundNormal::new(&state.contacts[at.foot][at.stance].ground);
            *value = normal.n.dot(&state.full_forces[at.foot][at.sample]);
        }
    }

    fn jacobian(&self, model: &Model, state: &State, first: usize, sink: &mut Sink) {
        for (r, &at) in self.samples.iter().enumerate() {
            let normal = GroundNormal::new(&state.contacts[at.foot][at.stance].ground);
            let (_, by_position) = normal.along(&state.full_forces[at.foot][at.sample]);
            let tangents = ForceTangents::new(model, state, at);
            let mut row = sink.row(first + r);
            tangents.force.add_along(&normal.n, &mut row);
            tangents.by_foothold.add_along(&normal.n, &mut row);
            tangents.foothold.add_along(&by_position, &mut row);
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
        for (&lambda, &at) in multipliers.iter().zip(&self.samples) {
            let normal = GroundNormal::new(&state.contacts[at.foot][at.stance].ground);
            let f = state.full_forces[at.foot][at.sample];
            let (_, by_position) = normal.along(&f);
            curvature.full_forces[at.foot][at.sample] += normal.n * lambda;
            curvature.contacts[at.foot][at.stance] += by_position * lambda;
            let (fp, pp) = (normal.jacobian() * lambda, normal.curvature(&f) * lambda);
            ForceTangents::new(model, state, at).add_blocks(None, &fp, &pp, sink);
        }
    }

    fn place(&self, row: usize) -> RowPlace {
        self.samples[row].place()
    }
}
