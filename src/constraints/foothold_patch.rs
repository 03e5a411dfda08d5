//! A foothold lies within the rectangle of its patch. The paper has no such law: its ground can be stood on everywhere.
//!
//! ```text
//!   lower_k ≤ a_k · (p_i − c) ≤ upper_k,   k = 1, 2: the sides of the rectangle, a_k horizontal
//! ```
//!
//! [`super::stance`] keeps the foothold on the patch's plane, and [`super::friction`] uses its normal.
//!
//! Rows: two for each stance, m. The map's curvature enters; the rows themselves are linear.

use nalgebra::Vector3;

use super::stance::all_stances;
use crate::nlp::curvature::NodeCurvature;
use crate::nlp::sink::Sink;
use crate::nlp::tangent::Tangent;
use crate::nlp::term::{Constraint, RowPlace};
use crate::nlp::{Model, State};
use crate::terrain::Patch;

/// Its name.
pub const FOOTHOLD_PATCH: &str = "foothold patch";

/// Footholds on their patches.
#[derive(Clone, Debug)]
pub struct FootholdPatch {
    places: Vec<(usize, usize, Patch)>,
    samples: Vec<f64>,
}

impl FootholdPatch {
    /// For every stance that has a patch.
    pub fn new(model: &Model) -> Self {
        let (stances, begins) = all_stances(model);
        let (places, samples) = stances
            .into_iter()
            .zip(begins)
            .filter_map(|((i, j), begin)| Some(((i, j, *model.patch(i, j)?), begin)))
            .unzip();
        Self { places, samples }
    }

    /// a_1 and a_2.
    fn axes(patch: &Patch) -> [Vector3<f64>; 2] {
        patch.axes().map(|[x, y]| Vector3::new(x, y, 0.0))
    }
}

impl Constraint for FootholdPatch {
    fn name(&self) -> &'static str {
        FOOTHOLD_PATCH
    }

    fn rows(&self) -> usize {
        2 * self.places.len()
    }

    fn bounds(&self, _model: &Model, lower: &mut [f64], upper: &mut [f64]) {
        for (r, [least, most]) in self.places.iter().flat_map(|(_, _, patch)| patch.sides).enumerate() {
            (lower[r], upper[r]) = (least, most);
        }
    }

    fn values(&self, _model: &Model, state: &State, out: &mut [f64]) {
        for (rows, &(i, j, patch)) in out.chunks_exact_mut(2).zip(&self.places) {
            let p = state.contacts[i][j].point.position;
            rows.copy_from_slice(&patch.coordinates([p.x, p.y]));
        }
    }

    fn jacobian(&self, model: &Model, state: &State, first: usize, sink: &mut Sink) {
        for (r, (i, j, patch)) in self.places.iter().enumerate() {
            let node = &model.layout.feet[*i].stances[*j].foothold;
            let foothold = Tangent::foot(model, &state.contacts[*i][*j], node);
            for (k, axis) in Self::axes(patch).iter().enumerate() {
                foothold.add_along(axis, &mut sink.row(first + 2 * r + k));
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
        for (lambda, (i, j, patch)) in multipliers.chunks_exact(2).zip(&self.places) {
            let [along, across] = Self::axes(patch);
            curvature.contacts[*i][*j] += along * lambda[0] + across * lambda[1];
        }
    }

    fn place(&self, row: usize) -> RowPlace {
        RowPlace { foot: Some(self.places[row / 2].0), sample: self.samples[row / 2] }
    }
}
