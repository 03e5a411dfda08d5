//! Rows that are linear in ambient quantities: the position and the rotation of the base at a sample, and footholds.
//!
//! ```text
//!   lower ≤ a · p_k + ⟨B, R_k⟩ + Σ c_ij · p_ij ≤ upper
//! ```
//!
//! The blocks are made elsewhere: the goal and the way-points in [`super::goal`].

use nalgebra::{Matrix3, Vector3};

use crate::nlp::curvature::NodeCurvature;
use crate::nlp::sink::Sink;
use crate::nlp::tangent::Tangent;
use crate::nlp::term::{Constraint, RowPlace};
use crate::nlp::{Model, State};
use crate::trajectory::rotation::skew_part;

/// One row.
#[derive(Clone, Debug)]
pub struct LinearRow {
    /// k.
    pub sample: usize,
    /// a.
    pub position: Vector3<f64>,
    /// B.
    pub rotation: Matrix3<f64>,
    /// Foot, stance and c.
    pub footholds: Vec<(usize, usize, Vector3<f64>)>,
    /// The foot that the row is about.
    pub foot: Option<usize>,
    /// Lower and upper.
    pub range: [f64; 2],
}

impl LinearRow {
    /// A row that is zero, at a sample.
    pub fn at(sample: usize, range: [f64; 2]) -> Self {
        let (position, rotation) = (Vector3::zeros(), Matrix3::zeros());
        Self { sample, position, rotation, footholds: Vec::new(), foot: None, range }
    }
}

/// A named block of them.
#[derive(Clone, Debug)]
pub struct LinearRows {
    /// Its name.
    pub name: &'static str,
    /// Its rows.
    pub rows: Vec<LinearRow>,
}

impl Constraint for LinearRows {
    fn name(&self) -> &'static str {
        self.name
    }

    fn rows(&self) -> usize {
        self.rows.len()
    }

    fn bounds(&self, _model: &Model, lower: &mut [f64], upper: &mut [f64]) {
        for (r, row) in self.rows.iter().enumerate() {
            [lower[r], upper[r]] = row.range;
        }
    }

    fn values(&self, _model: &Model, state: &State, out: &mut [f64]) {
        for (value, row) in out.iter_mut().zip(&self.rows) {
            let base = &state.base[row.sample];
            let feet = row.footholds.iter().map(|(i, j, by)| by.dot(&state.contacts[*i][*j].point.position));
            *value =
                row.position.dot(&base.position()) + row.rotation.dot(base.rotation()) + feet.sum::<f64>();
        }
    }

    fn jacobian(&self, model: &Model, state: &State, first: usize, sink: &mut Sink) {
        for (r, row) in self.rows.iter().enumerate() {
            let (base, node) = (&state.base[row.sample], &model.layout.base[row.sample]);
            if row.position != Vector3::zeros() {
                Tangent::base(model, base, node).add_along(&row.position, &mut sink.row(first + r));
            }
            if row.rotation != Matrix3::zeros() {
                // ⟨B, [δ] R⟩ = δ · axis(B Rᵀ − R Bᵀ).
                let by = skew_part(&(row.rotation * base.rotation().transpose()));
                Tangent::turn(model, base, node).add_along(&by, &mut sink.row(first + r));
            }
            for (i, j, by) in &row.footholds {
                let foothold = &model.layout.feet[*i].stances[*j].foothold;
                let tangent = Tangent::foot(model, &state.contacts[*i][*j], foothold);
                tangent.add_along(by, &mut sink.row(first + r));
            }
        }
    }

    fn hessian(
        &self,
        _model: &Model,
        _state: &State,
        multipliers: &[f64],
        curvature: &mut NodeCurvature,
        _sink: &mut Sink,
    ) {
        for (&lambda, row) in multipliers.iter().zip(&self.rows) {
            curvature.base_position[row.sample] += row.position * lambda;
            curvature.base_rotation[row.sample] += row.rotation * lambda;
            for (i, j, by) in &row.footholds {
                curvature.contacts[*i][*j] += by * lambda;
            }
        }
    }

    fn place(&self, row: usize) -> RowPlace {
        RowPlace { foot: self.rows[row].foot, sample: self.rows[row].sample as f64 }
    }
}
