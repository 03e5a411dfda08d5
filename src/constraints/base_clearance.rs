//! The torso's underside keeps clear of the ground; s is the shift of the center of mass ([`crate::nlp::leg_terms`]).
//!
//! ```text
//!   zᵀq − h(q) ≥ base_clearance,  q = p + R (b − s), for points b of the underside
//! ```
//!
//! Rows: all points of the grid at every `STRIDE`-th sample, m. `check` evaluates every sample.

use nalgebra::Vector3;

use super::margins;
use crate::heightfield::HeightJet;
use crate::nlp::curvature::NodeCurvature;
use crate::nlp::ground_normal::height_form;
use crate::nlp::sink::Sink;
use crate::nlp::state::BaseNode;
use crate::nlp::tangent::PoseTangent;
use crate::nlp::term::{Constraint, RowPlace};
use crate::nlp::{Model, State};
use crate::trajectory::Instant;
use crate::trajectory::rotation::cross_matrix;

/// Every how many samples there are rows.
const STRIDE: usize = 4;

/// The clearance of the underside.
#[derive(Clone, Debug)]
pub struct BaseClearance {
    clearance: f64,
    places: Vec<(usize, Vector3<f64>)>,
}

impl BaseClearance {
    /// Over the whole motion.
    pub fn new(model: &Model, clearance: f64) -> Self {
        let places = (0..=model.layout.intervals)
            .step_by(STRIDE)
            .flat_map(|k| model.underside.iter().map(move |&b| (k, b)))
            .collect();
        Self { clearance, places }
    }
}

/// A point of the underside at sample k, as seen from the center of mass, base frame, m.
fn from_center(model: &Model, (k, b): &(usize, Vector3<f64>)) -> Vector3<f64> {
    b - model.leg_terms.shift(*k)
}

/// R b, the ground under q, the gap and its derivative in q, for b as seen from the center of mass.
fn point(model: &Model, base: &BaseNode, b: &Vector3<f64>) -> (Vector3<f64>, HeightJet, f64, Vector3<f64>) {
    let arm = base.rotation() * b;
    let q = base.position() + arm;
    let ground = model.surfaces.feet.jet(q.x, q.y);
    (arm, ground, q.z - ground.h, Vector3::new(-ground.d1[0], -ground.d1[1], 1.0))
}

impl Constraint for BaseClearance {
    fn name(&self) -> &'static str {
        "base clearance"
    }

    fn rows(&self) -> usize {
        self.places.len()
    }

    fn bounds(&self, model: &Model, lower: &mut [f64], upper: &mut [f64]) {
        lower.fill(self.clearance + model.size * margins::BASE_CLEARANCE);
        upper.fill(f64::INFINITY);
    }

    fn values(&self, model: &Model, state: &State, out: &mut [f64]) {
        for (value, place) in out.iter_mut().zip(&self.places) {
            *value = point(model, &state.base[place.0], &from_center(model, place)).2;
        }
    }

    fn jacobian(&self, model: &Model, state: &State, first: usize, sink: &mut Sink) {
        for (r, place) in self.places.iter().enumerate() {
            let (k, b) = (&place.0, from_center(model, place));
            let (arm, _, _, by_q) = point(model, &state.base[*k], &b);
            // dq = dp + δ × R b.
            let pose = PoseTangent::new(model, state, Instant::Sample(*k));
            pose.add_along(&arm.cross(&by_q), &by_q, &mut sink.row(first + r));
        }
    }

    fn hessian(
        &self,
        model: &Model,
        state: &State,
        multipliers: &[f64],
        curvature: &mut NodeCurvature,
        _sink: &mut Sink,
    ) {
        for (&lambda, place) in multipliers.iter().zip(&self.places) {
            let (k, b) = (&place.0, from_center(model, place));
            let (arm, ground, _, by_q) = point(model, &state.base[*k], &b);
            curvature.base_position[*k] += by_q * lambda;
            curvature.base_rotation[*k] += by_q * b.transpose() * lambda;
            // dq = dp − [R b] δ.
            let (by_turn, q) = (-cross_matrix(&arm), height_form(&ground) * -lambda);
            let form = &mut curvature.forms.base[*k];
            form.turn += by_turn.transpose() * q * by_turn;
            form.turn_base += by_turn.transpose() * q;
            form.base += q;
        }
    }

    fn place(&self, row: usize) -> RowPlace {
        RowPlace { foot: None, sample: self.places[row].0 as f64 }
    }
}
