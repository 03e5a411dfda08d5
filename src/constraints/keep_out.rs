//! A foothold is outside of all places that the scenario keeps free.
//!
//! ```text
//!   D(p_i,x, p_i,y) ≥ radius of the foot,   D the distance from the nearest polygon, negative inside, a C² spline
//! ```
//!
//! Rows: one for each stance, m.

use nalgebra::Vector3;

use super::stance::all_stances;
use crate::heightfield::HeightJet;
use crate::nlp::curvature::NodeCurvature;
use crate::nlp::ground_normal::height_form;
use crate::nlp::sink::Sink;
use crate::nlp::tangent::Tangent;
use crate::nlp::term::{Constraint, RowPlace};
use crate::nlp::{Model, State};
use crate::terrain::KeepOut;

/// Footholds outside of polygons.
#[derive(Clone, Debug)]
pub struct OutOfPolygons {
    keep_out: KeepOut,
    places: Vec<(usize, usize)>,
    samples: Vec<f64>,
}

impl OutOfPolygons {
    /// For every stance.
    pub fn new(model: &Model, keep_out: &KeepOut) -> Self {
        let (places, samples) = all_stances(model);
        Self { keep_out: keep_out.clone(), places, samples }
    }

    fn jet(&self, state: &State, (i, j): (usize, usize)) -> HeightJet {
        let p = state.contacts[i][j].point.position;
        self.keep_out.distance.jet(p.x, p.y)
    }
}

impl Constraint for OutOfPolygons {
    fn name(&self) -> &'static str {
        "keep out"
    }

    fn rows(&self) -> usize {
        self.places.len()
    }

    fn bounds(&self, _model: &Model, lower: &mut [f64], upper: &mut [f64]) {
        lower.fill(self.keep_out.margin);
        upper.fill(f64::INFINITY);
    }

    fn values(&self, _model: &Model, state: &State, out: &mut [f64]) {
        for (value, &place) in out.iter_mut().zip(&self.places) {
            *value = self.jet(state, place).h;
        }
    }

    fn jacobian(&self, model: &Model, state: &State, first: usize, sink: &mut Sink) {
        for (r, &(i, j)) in self.places.iter().enumerate() {
            let jet = self.jet(state, (i, j));
            let node = &model.layout.feet[i].stances[j].foothold;
            let by = Vector3::new(jet.d1[0], jet.d1[1], 0.0);
            Tangent::foot(model, &state.contacts[i][j], node).add_along(&by, &mut sink.row(first + r));
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
        for (&lambda, &(i, j)) in multipliers.iter().zip(&self.places) {
            let jet = self.jet(state, (i, j));
            let node = &model.layout.feet[i].stances[j].foothold;
            curvature.contacts[i][j] += Vector3::new(jet.d1[0], jet.d1[1], 0.0) * lambda;
            let tangent = Tangent::foot(model, &state.contacts[i][j], node);
            tangent.quadratic(&(height_form(&jet) * lambda), sink);
        }
    }

    fn place(&self, row: usize) -> RowPlace {
        RowPlace { foot: Some(self.places[row].0), sample: self.samples[row] }
    }
}
