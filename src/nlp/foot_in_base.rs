//! A foot as the trunk sees it, r = Rᵀ(p_i − p) + s in m, at an instant, with derivatives: what reach, posture and the joints of a
//! leg are functions of. s is the shift of the center of mass ([`super::leg_terms`]), which is known. Places are (foot, instant).

use nalgebra::{Matrix3, Vector3};

use super::curvature::NodeCurvature;
use super::leg_terms::FootInertia;
use super::model::Model;
use super::sink::Differential;
use super::state::State;
use super::tangent::{PoseTangent, Tangent};
use crate::trajectory::Instant;
use crate::trajectory::rotation::cross_matrix;

/// r = Rᵀ(p_i − p) + s, m.
pub fn value(model: &Model, state: &State, (i, at): (usize, impl Into<Instant>)) -> Vector3<f64> {
    let at = at.into();
    let base = state.base_at(at);
    let arm = state.foot(model, i, at).point.position - base.position();
    base.rotation().tr_mul(&arm) + model.leg_terms.shift(at)
}

/// The torque on the row of Euler's law that follows a swinging foot, A (r_k−1 − 2 r_k + r_k+1); world frame, m g · 1 m.
pub fn inertial_torque(model: &Model, state: &State, inertia: &FootInertia) -> Vector3<f64> {
    let bent = inertia.stencil().map(|(l, weight)| value(model, state, (inertia.foot, l)) * weight);
    inertia.form * bent.iter().sum::<Vector3<f64>>()
}

/// Adds the derivatives of a scalar that changes by `by` · (change of r).
pub fn add_derivative(
    model: &Model,
    state: &State,
    (i, at): (usize, impl Into<Instant>),
    by: &Vector3<f64>,
    scalar: &mut impl Differential,
) {
    let at = at.into();
    let world = state.base_at(at).rotation() * by;
    let arm = arm(model, state, (i, at));
    // dr = Rᵀ ([p_i − p] δ + dp_i − dp).
    PoseTangent::new(model, state, at).add_along(&-arm.cross(&world), &-world, scalar);
    let foot = Tangent::foot(model, state.foot(model, i, at), state.foot_node(i, at));
    foot.add_along(&world, scalar);
}

/// Accumulates the second derivatives of λ · r.
pub fn add_curvature(
    model: &Model,
    state: &State,
    (i, at): (usize, impl Into<Instant>),
    lambda: &Vector3<f64>,
    curvature: &mut NodeCurvature,
) {
    let at = at.into();
    let world = state.base_at(at).rotation() * lambda;
    curvature.add_base(at, &-world, &(arm(model, state, (i, at)) * lambda.transpose()));
    curvature.add_foot(model, i, at, world);
    // (δ × Rλ) · (dp_i − dp) = δᵀ [Rλ] (dp_i − dp).
    let cross = cross_matrix(&world);
    let form = curvature.forms.foot_mut(i, at);
    form.turn_foot += cross;
    form.pose.turn_base -= cross;
}

/// Accumulates the second derivatives of ½ (change of r)ᵀ Q (change of r), with Q symmetric and in the base frame, without those of
/// r itself.
pub fn add_quadratic(
    model: &Model,
    state: &State,
    (i, at): (usize, impl Into<Instant>),
    q: &Matrix3<f64>,
    curvature: &mut NodeCurvature,
) {
    let at = at.into();
    let r = state.base_at(at).rotation();
    let q = r * q * r.transpose();
    // R (change of r) = [arm] δ + dp_i − dp.
    let arm = cross_matrix(&arm(model, state, (i, at)));
    let by_turn = arm.transpose() * q;
    let form = curvature.forms.foot_mut(i, at);
    form.pose.turn += by_turn * arm;
    form.pose.turn_base -= by_turn;
    form.pose.base += q;
    form.turn_foot += by_turn;
    form.base_foot -= q;
    form.foot += q;
}

/// p_i − p, m.
pub fn arm(model: &Model, state: &State, (i, at): (usize, Instant)) -> Vector3<f64> {
    state.foot(model, i, at).point.position - state.base_at(at).position()
}
