//! The torso's underside keeps clear of the ground.
//!
//! ```text
//!   zᵀq − h(q) ≥ base_clearance,  q = p + R b, for points b of the underside
//! ```
//!
//! Rows: all points of the grid at every `STRIDE`-th sample, m. `check` evaluates every sample.

use nalgebra::{Matrix3, Vector3};

use super::margins;
use crate::heightfield::HeightJet;
use crate::nlp::curvature::NodeCurvature;
use crate::nlp::ground_normal::height_form;
use crate::nlp::sink::Sink;
use crate::nlp::state::BaseNode;
use crate::nlp::tangent::Tangent;
use crate::nlp::term::{Constraint, RowPlace};
use crate::nlp::{Model, State};
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

/// R b, the ground under q, the gap and its derivative in q.
fn point(model: &Model, base: &BaseNode, b: &Vector3<f64>) -> (Vector3<f64>, HeightJet, f64, Vector3<f64>) {
    let arm = base.rotation() * b;
    let q = base.position() + arm;
    let ground = model.ground.jet(q.x, q.y);
    (arm, ground, q.z - ground.h, Vector3::new(-ground.d1[0], -ground.d1[1], 1.0))
}

impl Constraint for BaseClearance {
    fn name(&self) -> &'static str {
        "base clearance"
    }

    fn rows(&self) -> usize {
        self.places.len()
    }

    fn bounds(&self, _model: &Model, lower: &mut [f64], upper: &mut [f64]) {
        lower.fill(self.clearance + margins::BASE_CLEARANCE);
        upper.fill(f64::INFINITY);
    }

    fn values(&self, model: &Model, state: &State, out: &mut [f64]) {
        for (value, (k, b)) in out.iter_mut().zip(&self.places) {
            *value = point(model, &state.base[*k], b).2;
        }
    }

    fn jacobian(&self, model: &Model, state: &State, first: usize, sink: &mut Sink) {
        for (r, (k, b)) in self.places.iter().enumerate() {
            let (base, node) = (&state.base[*k], &model.layout.base[*k]);
            let (arm, _, _, by_q) = point(model, base, b);
            // dq = dp + δ × R b.
            Tangent::base(model, base, node).add_along(&by_q, &mut sink.row(first + r));
            Tangent::turn(model, base, node).add_along(&arm.cross(&by_q), &mut sink.row(first + r));
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
        let mut multipliers = multipliers.iter();
        for points in self.places.chunk_by(|a, b| a.0 == b.0) {
            let k = points[0].0;
            let (base, node) = (&state.base[k], &model.layout.base[k]);
            // All points of a sample depend on the same pose, so their forms are summed before they are scattered.
            let [mut moves, mut both, mut turns] = [Matrix3::zeros(); 3];
            for ((_, b), &lambda) in points.iter().zip(&mut multipliers) {
                let (arm, ground, _, by_q) = point(model, base, b);
                curvature.base_position[k] += by_q * lambda;
                curvature.base_rotation[k] += by_q * b.transpose() * lambda;
                let form = height_form(&ground) * -lambda;
                // dq = dp − [R b] δ.
                let by_turn = -cross_matrix(&arm);
                moves += form;
                both += form * by_turn;
                turns += by_turn.transpose() * form * by_turn;
            }
            let position = Tangent::base(model, base, node);
            let turn = Tangent::turn(model, base, node);
            position.quadratic(&moves, sink);
            position.cross(&both, &turn, sink);
            turn.quadratic(&turns, sink);
        }
    }

    fn place(&self, row: usize) -> RowPlace {
        RowPlace { foot: None, sample: self.places[row].0 as f64 }
    }
}
