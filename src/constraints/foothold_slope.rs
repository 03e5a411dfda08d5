//! Footholds where the ground is not too steep: ‖∇h(p_i)‖² ≤ max_slope².
//!
//! Rows: one a stance, no unit.

use nalgebra::{Matrix3, Vector3};

use super::stance::all_stances;
use super::{Constraint, Place};
use crate::heightfield::HeightJet;
use crate::nlp::sink::Sink;
use crate::nlp::state::{Curvature, Tangent};
use crate::nlp::{Model, State};

/// Footholds on gentle ground.
#[derive(Clone, Debug)]
pub struct FootholdSlope {
    max_slope: f64,
    places: Vec<(usize, usize)>,
    samples: Vec<f64>,
}

impl FootholdSlope {
    /// For every stance of a foot that does not adhere.
    pub fn new(model: &Model, max_slope: f64) -> Self {
        let (places, samples) = all_stances(model);
        let (places, samples) =
            places.into_iter().zip(samples).filter(|((i, _), _)| !model.adhesive[*i]).unzip();
        Self { max_slope, places, samples }
    }
}

/// ∇(‖∇h‖²) in the ambient position.
fn gradient(g: &HeightJet) -> Vector3<f64> {
    let ([x, y], [xx, xy, yy]) = (g.d1, g.d2);
    Vector3::new(x * xx + y * xy, x * xy + y * yy, 0.0) * 2.0
}

/// ∇²(‖∇h‖²) in the ambient position.
fn curvature_form(g: &HeightJet) -> Matrix3<f64> {
    let ([x, y], [xx, xy, yy], [xxx, xxy, xyy, yyy]) = (g.d1, g.d2, g.d3);
    let a = xx * xx + xy * xy + x * xxx + y * xxy;
    let b = xx * xy + xy * yy + x * xxy + y * xyy;
    let c = xy * xy + yy * yy + x * xyy + y * yyy;
    Matrix3::new(a, b, 0.0, b, c, 0.0, 0.0, 0.0, 0.0) * 2.0
}

impl Constraint for FootholdSlope {
    fn name(&self) -> &'static str {
        "foothold slope"
    }

    fn rows(&self) -> usize {
        self.places.len()
    }

    fn bounds(&self, _model: &Model, lower: &mut [f64], upper: &mut [f64]) {
        lower.fill(f64::NEG_INFINITY);
        upper.fill(self.max_slope * self.max_slope);
    }

    fn values(&self, _model: &Model, state: &State, out: &mut [f64]) {
        for (value, &(i, j)) in out.iter_mut().zip(&self.places) {
            let [x, y] = state.contacts[i][j].ground.d1;
            *value = x * x + y * y;
        }
    }

    fn jacobian(&self, model: &Model, state: &State, first: usize, sink: &mut Sink) {
        for (r, &(i, j)) in self.places.iter().enumerate() {
            let contact = &state.contacts[i][j];
            let node = &model.layout.feet[i].stances[j].foothold;
            Tangent::position(model, &contact.point, node).row(first + r, &gradient(&contact.ground), sink);
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
        for (&lambda, &(i, j)) in multipliers.iter().zip(&self.places) {
            let contact = &state.contacts[i][j];
            let node = &model.layout.feet[i].stances[j].foothold;
            curvature.contacts[i][j] += gradient(&contact.ground) * lambda;
            let form = curvature_form(&contact.ground) * lambda;
            Tangent::position(model, &contact.point, node).quadratic(&form, sink);
        }
    }

    fn place(&self, row: usize) -> Place {
        Place { foot: Some(self.places[row].0), sample: self.samples[row] }
    }
}
