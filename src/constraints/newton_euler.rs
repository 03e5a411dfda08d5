//! Eq. 2, the centroidal law itself, at every sample.
//!
//! ```text
//!   Σ_i f_i + m g                 = m p̈
//!   Σ_i (p_i − p) × f_i           = R (I ω̇ + ω × I ω) + λ        (right-hand sides: `body_rates`)
//! ```
//!
//! It needs second derivatives of position and orientation in time. In F
//! those of 𝒫(J) involve third derivatives of φ, which jump from cell to cell, so this law is for the direct formulation only.
//! Forces and p̈ are both linear between samples there: if Newton's law holds at the samples, it holds everywhere.
//!
//! λ is what the legs' own mass adds ([`crate::nlp::leg_terms`]): a known function of time, zero for massless legs.
//!
//! Rows: 6 a sample, force then torque about the center of mass, world frame, in m g and m g · 1 m.

use super::body_rates::BodyRates;
use super::dynamics::Dynamics;
use crate::nlp::Model;
use crate::nlp::curvature::NodeCurvature;
use crate::nlp::sink::Sink;
use crate::nlp::state::State;
use crate::nlp::term::{Constraint, RowPlace};

/// Newton's and Euler's law at every sample, in ambient space.
#[derive(Clone, Debug)]
pub struct NewtonEuler {
    /// The left-hand sides: forces with gravity, and torques.
    wrench: Dynamics,
    rates: BodyRates,
}

impl NewtonEuler {
    /// At every sample of a model.
    pub fn new(model: &Model) -> Self {
        let samples = 0..model.layout.intervals + 1;
        Self { wrench: Dynamics::wrench(model.layout.intervals), rates: BodyRates::new(model, samples) }
    }
}

impl Constraint for NewtonEuler {
    fn name(&self) -> &'static str {
        "Newton-Euler"
    }

    fn rows(&self) -> usize {
        self.wrench.rows()
    }

    fn bounds(&self, model: &Model, lower: &mut [f64], upper: &mut [f64]) {
        self.wrench.bounds(model, lower, upper);
    }

    fn values(&self, model: &Model, state: &State, out: &mut [f64]) {
        self.wrench.values(model, state, out);
        self.rates.subtract(model, state, out);
    }

    fn jacobian(&self, model: &Model, state: &State, first: usize, sink: &mut Sink) {
        self.wrench.jacobian(model, state, first, sink);
        self.rates.jacobian(model, state, first, sink);
    }

    fn hessian(
        &self,
        model: &Model,
        state: &State,
        multipliers: &[f64],
        curvature: &mut NodeCurvature,
        sink: &mut Sink,
    ) {
        self.wrench.hessian(model, state, multipliers, curvature, sink);
        self.rates.hessian(model, state, multipliers, sink);
    }

    fn place(&self, row: usize) -> RowPlace {
        self.wrench.place(row)
    }
}
