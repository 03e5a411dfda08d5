//! Eq. 5, the friction cone about the true normal of the ground, for feet that do not adhere.
//!
//! ```text
//!   ‖f − (n·f) n‖ ≤ ν n·f,  as  ν u − ‖f − u n‖²/√(ν² u² + ε²) ≥ 0,  u = n·f
//! ```
//!
//! For u > 0 this is the same convex set up to ε = [`CONE_ROUNDING`] m g (too large by ε²/(4 ν u), below 10⁻⁴ m g where
//! [`super::normal_force`] holds). The quotient has curvature along ‖f_t‖ as well as around the axis. The root of Eq. 5
//! does not, and Newton's steps can then jump from one side of a slim cone to the other forever. The normal is constant
//! during a stance, f is linear between samples, and the cone is convex: what holds at the samples holds in between.
//!
//! Rows: one for each free force, in m g. Where durations are optimized, the rows are on the full force ḡ; the cone then
//! also contains f = σ ḡ.

use nalgebra::{Matrix3, Vector3};

use crate::nlp::contact_force::{ForceSample, ForceTangents, force_samples};
use crate::nlp::curvature::NodeCurvature;
use crate::nlp::ground_normal::GroundNormal;
use crate::nlp::model::CONE_ROUNDING;
use crate::nlp::sink::Sink;
use crate::nlp::term::{Constraint, RowPlace};
use crate::nlp::{Model, State};

/// Forces inside the cone.
#[derive(Clone, Debug)]
pub struct Friction {
    friction: f64,
    samples: Vec<ForceSample>,
}

impl Friction {
    /// For all feet that do not adhere.
    pub fn new(model: &Model, friction: f64) -> Self {
        Self { friction, samples: force_samples(model, |i| !model.adhesive[i]) }
    }
}

/// g(u, w) = ν u − (w − u²)/r(u), r = √(ν² u² + ε²), with its derivatives; u = n·f, w = ‖f‖².
pub(crate) struct FrictionCone {
    pub g: f64,
    pub u: f64,
    pub w: f64,
    pub uu: f64,
    pub uw: f64,
}

impl FrictionCone {
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
fn parts(
    friction: f64,
    state: &State,
    at: ForceSample,
) -> (GroundNormal, Vector3<f64>, Vector3<f64>, FrictionCone) {
    let normal = GroundNormal::new(&state.contacts[at.foot][at.stance].ground);
    let f = state.full_forces[at.foot][at.sample];
    let (u, du) = normal.along(&f);
    (normal, f, du, FrictionCone::new(friction, u, f.norm_squared()))
}

impl Constraint for Friction {
    fn name(&self) -> &'static str {
        "friction"
    }

    fn rows(&self) -> usize {
        self.samples.len()
    }

    fn bounds(&self, _model: &Model, lower: &mut [f64], upper: &mut [f64]) {
        lower.fill(0.0);
        upper.fill(f64::INFINITY);
    }

    fn values(&self, _model: &Model, state: &State, out: &mut [f64]) {
        for (value, &at) in out.iter_mut().zip(&self.samples) {
            *value = parts(self.friction, state, at).3.g;
        }
    }

    fn jacobian(&self, model: &Model, state: &State, first: usize, sink: &mut Sink) {
        for (r, &at) in self.samples.iter().enumerate() {
            let (normal, f, du, cone) = parts(self.friction, state, at);
            let by_force = normal.n * cone.u + f * (2.0 * cone.w);
            let tangents = ForceTangents::new(model, state, at);
            let mut row = sink.row(first + r);
            tangents.force.add_along(&by_force, &mut row);
            tangents.by_foothold.add_along(&by_force, &mut row);
            tangents.foothold.add_along(&(du * cone.u), &mut row);
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
        for (&lambda, &at) in multipliers.iter().zip(&self.samples) {
            let (normal, f, du, cone) = parts(self.friction, state, at);
            let n = normal.n;
            curvature.full_forces[at.foot][at.sample] += (n * cone.u + f * (2.0 * cone.w)) * lambda;
            curvature.contacts[at.foot][at.stance] += du * (cone.u * lambda);
            // By the chain rule through u(f, p) and w(f).
            let mixed = n * cone.uu + f * (2.0 * cone.uw);
            let ff = Matrix3::identity() * (2.0 * cone.w)
                + n * mixed.transpose()
                + f * n.transpose() * (2.0 * cone.uw);
            let fp = normal.jacobian() * cone.u + mixed * du.transpose();
            let pp = normal.curvature(&f) * cone.u + du * du.transpose() * cone.uu;
            let tangents = ForceTangents::new(model, state, at);
            tangents.add_blocks(Some(&(ff * lambda)), &(fp * lambda), &(pp * lambda), sink);
        }
    }

    fn place(&self, row: usize) -> RowPlace {
        self.samples[row].place()
    }
}
