//! Eq. 3 and 8, first line: a standing foot is on the ground.
//!
//! ```text
//!   zᵀp_i − h(p_i) = 0
//! ```
//!
//! In F the ground is z̄ = 0 up to the misfit of the map's bottom face; imposing it in ambient space makes the gap exactly
//! zero there, and z̄ is then minus that misfit. Each stance has one foothold, so a foot cannot slip.
//!
//! Rows: one for each stance, m.

use crate::nlp::curvature::NodeCurvature;
use crate::nlp::ground_normal::height_form;
use crate::nlp::sink::Sink;
use crate::nlp::tangent::Tangent;
use crate::nlp::term::{Constraint, RowPlace};
use crate::nlp::{Model, State};

/// Footholds on the ground.
#[derive(Clone, Debug)]
pub struct OnGround {
    places: Vec<(usize, usize)>,
    samples: Vec<f64>,
}

/// All (foot, stance), and the sample at which each begins.
pub(crate) fn all_stances(model: &Model) -> (Vec<(usize, usize)>, Vec<f64>) {
    model
        .layout
        .feet
        .iter()
        .enumerate()
        .flat_map(|(i, f)| f.stances.iter().enumerate().map(move |(j, s)| ((i, j), s.stance.start)))
        .unzip()
}

impl OnGround {
    /// For every stance.
    pub fn new(model: &Model) -> Self {
        let (places, samples) = all_stances(model);
        Self { places, samples }
    }
}

impl Constraint for OnGround {
    fn name(&self) -> &'static str {
        "stance on ground"
    }

    fn rows(&self) -> usize {
        self.places.len()
    }

    fn bounds(&self, _model: &Model, lower: &mut [f64], upper: &mut [f64]) {
        lower.fill(0.0);
        upper.fill(0.0);
    }

    fn values(&self, _model: &Model, state: &State, out: &mut [f64]) {
        for (value, &(i, j)) in out.iter_mut().zip(&self.places) {
            *value = state.contacts[i][j].gap().0;
        }
    }

    fn jacobian(&self, model: &Model, state: &State, first: usize, sink: &mut Sink) {
        for (r, &(i, j)) in self.places.iter().enumerate() {
            let contact = &state.contacts[i][j];
            let node = &model.layout.feet[i].stances[j].foothold;
            Tangent::foot(model, contact, node).add_along(&contact.gap().1, &mut sink.row(first + r));
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
            let contact = &state.contacts[i][j];
            let node = &model.layout.feet[i].stances[j].foothold;
            curvature.contacts[i][j] += contact.gap().1 * lambda;
            let form = height_form(&contact.ground) * -lambda;
            Tangent::foot(model, contact, node).quadratic(&form, sink);
        }
    }

    fn place(&self, row: usize) -> RowPlace {
        RowPlace { foot: Some(self.places[row].0), sample: self.samples[row] }
    }
}
