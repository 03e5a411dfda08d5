//! Eq. 5, the friction cone about the true normal of the ground, for feet that do not adhere.
//!
//! ```text
//!   ‖f − (n·f) n‖ ≤ ν n·f,  as  ν u − ‖f − u n‖²/√(ν² u² + ε²) ≥ 0,  u = n·f
//! ```
//!
//! For u > 0 this is the same convex set up to ε = [`CONE_ROUNDING`] m g (too large by ε²/(4 ν u), below 10⁻⁴ m g where
//! [`super::normal_force`] holds). The quotient curves along ‖f_t‖ as well as around the axis; the root of Eq. 5 does not,
//! so that Newton's steps would jump from one side of a slim cone to the other for ever. The normal is constant during a
//! stance, f is linear between its samples and the cone is convex: what holds at the samples holds in between.
//!
//! Rows: one for each free force, in m g. Where durations are optimized the rows are on the full force that f is a share of,
//! which the cone then holds as well.

use nalgebra::{Matrix3, Vector3};

use super::{Constraint, Normal, Place};
use crate::nlp::curvature::Curvature;
use crate::nlp::model::CONE_ROUNDING;
use crate::nlp::sink::Sink;
use crate::nlp::tangent::Tangent;
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

/// The node of a force, the full one where durations are optimized.
pub(crate) fn force_node(model: &Model, (i, j, k): ForcePlace) -> &LinearNode {
    let stance = &model.layout.feet[i].stances[j];
    stance.force(k).expect("places are those of free forces")
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
        &Tangent::force_by_foothold(model, contact, foothold, &state.warped_full_forces[i][k]),
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

/// g(u, w) = ν u − (w − u²)/r(u), r = √(ν² u² + ε²), with its derivatives; u = n·f, w = ‖f‖².
pub(crate) struct Cone {
    pub g: f64,
    pub u: f64,
    pub w: f64,
    pub uu: f64,
    pub uw: f64,
}

impl Cone {
    pub fn new(friction: f64, u: f64, w: f64) -> Self {
        let square = friction * friction;
        let r = (square * u * u + CONE_ROUNDING * CONE_ROUNDING).sqrt();
        let r1 = square * u / r;
        let r2 = square * CONE_ROUNDING * CONE_ROUNDING / (r * r * r);
        let q = w - u * u;
        Self {
            g: friction * u - q / r,
            u: friction + q * r1 / (r * r) + 2.0 * u / r,
            w: -1.0 / r,
            uu: q * (r2 / (r * r) - 2.0 * r1 * r1 / (r * r * r)) + 2.0 / r - 4.0 * u * r1 / (r * r),
            uw: r1 / (r * r),
        }
    }
}

/// The normal, f, ∂u/∂p, and the cone there.
fn parts(friction: f64, state: &State, (i, j, k): ForcePlace) -> (Normal, Vector3<f64>, Vector3<f64>, Cone) {
    let normal = Normal::new(&state.contacts[i][j].ground);
    let f = state.full_forces[i][k];
    let (u, du) = normal.along(&f);
    (normal, f, du, Cone::new(friction, u, f.norm_squared()))
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
            *value = parts(self.friction, state, place).3.g;
        }
    }

    fn jacobian(&self, model: &Model, state: &State, first: usize, sink: &mut Sink) {
        for (r, &place) in self.places.iter().enumerate() {
            let (normal, f, du, cone) = parts(self.friction, state, place);
            let by_force = normal.n * cone.u + f * (2.0 * cone.w);
            with_tangents(model, state, place, |force, by_foothold, position| {
                force.row(first + r, &by_force, sink);
                by_foothold.row(first + r, &by_force, sink);
                position.row(first + r, &(du * cone.u), sink);
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
            let (normal, f, du, cone) = parts(self.friction, state, place);
            let ((i, j, k), n) = (place, normal.n);
            curvature.full_forces[i][k] += (n * cone.u + f * (2.0 * cone.w)) * lambda;
            curvature.contacts[i][j] += du * (cone.u * lambda);
            // By the chain rule through u(f, p) and w(f).
            let mixed = n * cone.uu + f * (2.0 * cone.uw);
            let ff = Matrix3::identity() * (2.0 * cone.w)
                + n * mixed.transpose()
                + f * n.transpose() * (2.0 * cone.uw);
            let fp = normal.jacobian() * cone.u + mixed * du.transpose();
            let pp = normal.curvature(&f) * cone.u + du * du.transpose() * cone.uu;
            say_blocks(model, state, place, Some(&(ff * lambda)), &(fp * lambda), &(pp * lambda), sink);
        }
    }

    fn place(&self, row: usize) -> Place {
        let (i, _, k) = self.places[row];
        Place { foot: Some(i), sample: k as f64 }
    }
}
