//! Eq. 5, the friction cone about the true normal of the ground, for feet that do not adhere.
//!
//! ```text
//!   ν n·f − √(‖f − (n·f) n‖² + ε²) + ε ≥ 0
//! ```
//!
//! with ε = [`CONE_ROUNDING`] m g, which keeps the row smooth at f = 0. The normal is constant during a stance, f is linear
//! between its samples and the cone is convex: what holds at the samples holds in between.
//!
//! Rows: one for each free force, in m g.

use nalgebra::{Matrix3, Vector3};

use super::{Constraint, Normal, Place};
use crate::nlp::model::CONE_ROUNDING;
use crate::nlp::sink::Sink;
use crate::nlp::state::{Curvature, Tangent};
use crate::nlp::{Model, State};
use crate::trajectory::LinearNode;

/// A force of a foot: (foot, stance, sample).
pub(crate) type ForcePlace = (usize, usize, usize);

/// All free forces of the feet that `wanted` says yes to.
pub(crate) fn force_places(model: &Model, wanted: impl Fn(usize) -> bool) -> Vec<ForcePlace> {
    let mut places = Vec::new();
    for (i, foot) in model.layout.feet.iter().enumerate() {
        if wanted(i) {
            for (j, stance) in foot.stances.iter().enumerate() {
                places.extend(stance.free_forces().map(|(k, _)| (i, j, k)));
            }
        }
    }
    places
}

/// Forces inside the cone.
#[derive(Clone, Debug)]
pub struct Friction {
    friction: f64,
    places: Vec<ForcePlace>,
}

impl Friction {
    /// For all feet that do not adhere.
    pub fn new(model: &Model, friction: f64) -> Self {
        Self { friction, places: force_places(model, |i| !model.adhesive[i]) }
    }
}

/// The node of a force.
pub(crate) fn force_node(model: &Model, (i, j, k): ForcePlace) -> &LinearNode {
    let stance = &model.layout.feet[i].stances[j];
    stance.forces[k - stance.stance.start].as_ref().expect("places are those of free forces")
}

/// The tangents of a force and of its foothold.
pub(crate) fn with_tangents<T>(
    model: &Model,
    state: &State,
    (i, j, k): ForcePlace,
    act: impl FnOnce(&Tangent, &Tangent, &Tangent) -> T,
) -> T {
    let contact = &state.contacts[i][j];
    let foothold = &model.layout.feet[i].stances[j].foothold;
    act(
        &Tangent::force(model, contact, force_node(model, (i, j, k))),
        &Tangent::force_by_foothold(model, contact, foothold, &state.warped_forces[i][k]),
        &Tangent::position(model, &contact.point, foothold),
    )
}

/// Says the second derivatives of a function of (f, p_i) with blocks ∂²/∂f², ∂²/∂f∂p and ∂²/∂p².
pub(crate) fn say_blocks(
    model: &Model,
    state: &State,
    place: ForcePlace,
    ff: Option<&Matrix3<f64>>,
    fp: &Matrix3<f64>,
    pp: &Matrix3<f64>,
    sink: &mut Sink,
) {
    with_tangents(model, state, place, |force, by_foothold, position| {
        if let Some(ff) = ff {
            force.quadratic(ff, sink);
            by_foothold.quadratic(ff, sink);
            force.cross(ff, by_foothold, sink);
        }
        force.cross(fp, position, sink);
        by_foothold.cross(fp, position, sink);
        position.quadratic(pp, sink);
    });
}

/// Normal n, share u = n·f along it, ∂u/∂p, and s = √(‖f‖² − u² + ε²).
fn parts(state: &State, (i, j, k): ForcePlace) -> (Normal, Vector3<f64>, f64, Vector3<f64>, f64) {
    let normal = Normal::new(&state.contacts[i][j].ground);
    let f = state.forces[i][k];
    let (u, du) = normal.along(&f);
    let s = ((f - normal.n * u).norm_squared() + CONE_ROUNDING * CONE_ROUNDING).sqrt();
    (normal, f, u, du, s)
}

impl Constraint for Friction {
    fn name(&self) -> &'static str {
        "friction"
    }

    fn rows(&self) -> usize {
        self.places.len()
    }

    fn bounds(&self, _model: &Model, lower: &mut [f64], upper: &mut [f64]) {
        lower.fill(0.0);
        upper.fill(f64::INFINITY);
    }

    fn values(&self, _model: &Model, state: &State, out: &mut [f64]) {
        for (value, &place) in out.iter_mut().zip(&self.places) {
            let (_, _, u, _, s) = parts(state, place);
            *value = self.friction * u - s + CONE_ROUNDING;
        }
    }

    fn jacobian(&self, model: &Model, state: &State, first: usize, sink: &mut Sink) {
        for (r, &place) in self.places.iter().enumerate() {
            let (normal, f, u, du, s) = parts(state, place);
            let a = self.friction + u / s;
            let by_force = normal.n * a - f / s;
            with_tangents(model, state, place, |force, by_foothold, position| {
                force.row(first + r, &by_force, sink);
                by_foothold.row(first + r, &by_force, sink);
                position.row(first + r, &(du * a), sink);
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
            let (normal, f, u, du, s) = parts(state, place);
            let (i, j, k) = place;
            let (a, n) = (self.friction + u / s, normal.n);
            curvature.forces[i][k] += (n * a - f / s) * lambda;
            curvature.contacts[i][j] += du * (a * lambda);
            // s(f, u): s_ff = 1/s − f fᵀ/s³, s_fu = f u/s³, s_uu = −1/s − u²/s³.
            let s3 = s * s * s;
            let s_uu = -1.0 / s - u * u / s3;
            let s_fu = f * (u / s3);
            let ff = Matrix3::identity() / s - f * f.transpose() / s3
                + s_fu * n.transpose()
                + n * s_fu.transpose()
                + n * n.transpose() * s_uu;
            let fp = normal.jacobian() * a - (s_fu + n * s_uu) * du.transpose();
            let pp = normal.curvature(&f) * a - du * du.transpose() * s_uu;
            say_blocks(model, state, place, Some(&(ff * -lambda)), &(fp * lambda), &(pp * lambda), sink);
        }
    }

    fn place(&self, row: usize) -> Place {
        let (i, _, k) = self.places[row];
        Place { foot: Some(i), sample: k as f64 }
    }
}
