//! Limits of the normal force: how hard a foot may push, and an adhesive one pull.
//!
//! ```text
//!   −pull_limit ≤ n·f ≤ force_limit      (adhesive feet)
//!     least ≤ n·f ≤ force_limit          (others: a standing foot presses on the ground, [`LEAST_NORMAL_FORCE`])
//! ```
//!
//! Rows: one for each free force, in m g; as in [`super::friction`] for the full one.

use super::friction::{ForcePlace, force_places, say_blocks, with_tangents};
use super::{Constraint, Normal, Place};
use crate::nlp::curvature::Curvature;
use crate::nlp::model::LEAST_NORMAL_FORCE;
use crate::nlp::sink::Sink;
use crate::nlp::{Model, State};

/// Normal forces within limits.
#[derive(Clone, Debug)]
pub struct NormalForce {
    force_limit: f64,
    pull_limit: f64,
    places: Vec<ForcePlace>,
}

impl NormalForce {
    /// For all feet.
    pub fn new(model: &Model, force_limit: f64, pull_limit: f64) -> Self {
        Self { force_limit, pull_limit, places: force_places(model, |_| true) }
    }
}

impl Constraint for NormalForce {
    fn name(&self) -> &'static str {
        "normal force"
    }

    fn rows(&self) -> usize {
        self.places.len()
    }

    fn bounds(&self, model: &Model, lower: &mut [f64], upper: &mut [f64]) {
        for (r, &(i, ..)) in self.places.iter().enumerate() {
            lower[r] = if model.adhesive[i] { -self.pull_limit } else { LEAST_NORMAL_FORCE };
            upper[r] = self.force_limit;
        }
    }

    fn values(&self, _model: &Model, state: &State, out: &mut [f64]) {
        for (value, &(i, j, k)) in out.iter_mut().zip(&self.places) {
            *value = Normal::new(&state.contacts[i][j].ground).n.dot(&state.full_forces[i][k]);
        }
    }

    fn jacobian(&self, model: &Model, state: &State, first: usize, sink: &mut Sink) {
        for (r, &place) in self.places.iter().enumerate() {
            let (i, j, k) = place;
            let normal = Normal::new(&state.contacts[i][j].ground);
            let (_, by_position) = normal.along(&state.full_forces[i][k]);
            with_tangents(model, state, place, |force, by_foothold, position| {
                force.row(first + r, &normal.n, sink);
                by_foothold.row(first + r, &normal.n, sink);
                position.row(first + r, &by_position, sink);
            });
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
        for (&lambda, &place) in multipliers.iter().zip(&self.places) {
            let (i, j, k) = place;
            let normal = Normal::new(&state.contacts[i][j].ground);
            let f = state.full_forces[i][k];
            let (_, by_position) = normal.along(&f);
            curvature.full_forces[i][k] += normal.n * lambda;
            curvature.contacts[i][j] += by_position * lambda;
            let (fp, pp) = (normal.jacobian() * lambda, normal.curvature(&f) * lambda);
            say_blocks(model, state, place, None, &fp, &pp, sink);
        }
    }

    fn place(&self, row: usize) -> Place {
        let (i, _, k) = self.places[row];
        Place { foot: Some(i), sample: k as f64 }
    }
}
