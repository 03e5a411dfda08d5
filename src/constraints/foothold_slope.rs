//! Footholds where the ground is not too steep, with a margin to steeper ground.
//!
//! ```text
//!   ‖∇h(p_i + d)‖² ≤ max_slope²,   d = 0, (±margin, 0, 0), (0, ±margin, 0)
//! ```
//!
//! Rows: five for each stance, dimensionless.

use nalgebra::{Matrix3, Vector3};

use super::stance::all_stances;
use crate::heightfield::HeightJet;
use crate::nlp::curvature::NodeCurvature;
use crate::nlp::sink::Sink;
use crate::nlp::state::FootNode;
use crate::nlp::tangent::Tangent;
use crate::nlp::term::{Constraint, RowPlace};
use crate::nlp::{Model, State};

/// Footholds on gentle ground.
#[derive(Clone, Debug)]
pub struct FootholdSlope {
    max_slope: f64,
    /// Foot, stance, and offset d.
    places: Vec<(usize, usize, [f64; 2])>,
    samples: Vec<f64>,
}

/// The offsets d from a foothold, in margins.
const AROUND: [[f64; 2]; 5] = [[0.0, 0.0], [1.0, 0.0], [-1.0, 0.0], [0.0, 1.0], [0.0, -1.0]];

impl FootholdSlope {
    /// For every stance; `margin` in m.
    pub fn new(model: &Model, max_slope: f64, margin: f64) -> Self {
        let (stances, middles) = all_stances(model);
        let (mut places, mut samples) = (Vec::new(), Vec::new());
        for ((i, j), sample) in stances.into_iter().zip(middles) {
            places.extend(AROUND.map(|[x, y]| (i, j, [margin * x, margin * y])));
            samples.extend([sample; AROUND.len()]);
        }
        Self { max_slope, places, samples }
    }
}

fn ground(model: &Model, contact: &FootNode, d: [f64; 2]) -> HeightJet {
    model.surfaces.feet.jet(contact.point.position.x + d[0], contact.point.position.y + d[1])
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

    fn values(&self, model: &Model, state: &State, out: &mut [f64]) {
        for (value, &(i, j, d)) in out.iter_mut().zip(&self.places) {
            let [x, y] = ground(model, &state.contacts[i][j], d).d1;
            *value = x * x + y * y;
        }
    }

    fn jacobian(&self, model: &Model, state: &State, first: usize, sink: &mut Sink) {
        for (r, &(i, j, d)) in self.places.iter().enumerate() {
            let contact = &state.contacts[i][j];
            let node = &model.layout.feet[i].stances[j].foothold;
            let slope = gradient(&ground(model, contact, d));
            Tangent::foot(model, contact, node).add_along(&slope, &mut sink.row(first + r));
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
        for (&lambda, &(i, j, d)) in multipliers.iter().zip(&self.places) {
            let contact = &state.contacts[i][j];
            let node = &model.layout.feet[i].stances[j].foothold;
            let ground = ground(model, contact, d);
            curvature.contacts[i][j] += gradient(&ground) * lambda;
            let form = curvature_form(&ground) * lambda;
            Tangent::foot(model, contact, node).quadratic(&form, sink);
        }
    }

    fn place(&self, row: usize) -> RowPlace {
        RowPlace { foot: Some(self.places[row].0), sample: self.samples[row] }
    }
}
