//! A foot as the base sees it, r = Rᵀ(p_i − p) in m, at an instant, with derivatives: what reach, posture and the joints of a
//! leg are functions of. Places are (foot, instant).

use nalgebra::{Matrix3, Vector3};

use super::curvature::NodeCurvature;
use super::model::Model;
use super::sink::{Differential, Sink};
use super::state::State;
use super::tangent::Tangent;
use crate::trajectory::Instant;
use crate::trajectory::rotation::cross_matrix;

/// r = Rᵀ(p_i − p), m.
pub fn value(model: &Model, state: &State, (i, at): (usize, impl Into<Instant>)) -> Vector3<f64> {
    let at = at.into();
    let base = state.base_at(at);
    base.rotation().tr_mul(&(state.foot(model, i, at).point.position - base.position()))
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
    let [turn, base, foot] = tangents(model, state, (i, at));
    // d(Rᵀ r) = Rᵀ ([r] δ + dp_i − dp).
    turn.add_along(&(-arm.cross(&world)), scalar);
    base.add_along(&-world, scalar);
    foot.add_along(&world, scalar);
}

/// Adds the second derivatives of λ · Rᵀ(p_i − p).
pub fn add_curvature(
    model: &Model,
    state: &State,
    (i, at): (usize, impl Into<Instant>),
    lambda: &Vector3<f64>,
    curvature: &mut NodeCurvature,
    sink: &mut Sink,
) {
    let at = at.into();
    let world = state.base_at(at).rotation() * lambda;
    curvature.add_base(at, &-world, &(arm(model, state, (i, at)) * lambda.transpose()));
    curvature.add_foot(model, i, at, world);
    // (δ × Rλ) · (dp_i − dp) = δᵀ [Rλ] (dp_i − dp).
    let form = cross_matrix(&world);
    let [turn, base, foot] = tangents(model, state, (i, at));
    turn.cross(&form, &foot, sink);
    turn.cross(&-form, &base, sink);
}

/// Adds the second derivatives of ½ (change of r)ᵀ Q (change of r), with Q symmetric and in the base frame, without those of r itself.
pub fn add_quadratic(
    model: &Model,
    state: &State,
    (i, at): (usize, impl Into<Instant>),
    form: &Matrix3<f64>,
    sink: &mut Sink,
) {
    let at = at.into();
    let r = state.base_at(at).rotation();
    let form = r * form * r.transpose();
    // R (change of r) = [arm] δ + dp_i − dp.
    let arm = cross_matrix(&arm(model, state, (i, at)));
    let by_turn = arm.transpose() * form;
    let [turn, base, foot] = tangents(model, state, (i, at));
    turn.quadratic(&(by_turn * arm), sink);
    base.quadratic(&form, sink);
    foot.quadratic(&form, sink);
    turn.cross(&by_turn, &foot, sink);
    turn.cross(&-by_turn, &base, sink);
    base.cross(&-form, &foot, sink);
}

/// p_i − p, m.
pub fn arm(model: &Model, state: &State, (i, at): (usize, Instant)) -> Vector3<f64> {
    state.foot(model, i, at).point.position - state.base_at(at).position()
}

/// How the base turns, how the base moves, and how the foot moves.
pub fn tangents<'a>(model: &'a Model, state: &'a State, (i, at): (usize, Instant)) -> [Tangent<'a>; 3] {
    let (base, node) = (state.base_at(at), model.layout.base_at(at));
    [
        Tangent::turn(model, base, node),
        Tangent::base(model, base, node),
        Tangent::foot(model, state.foot(model, i, at), state.foot_node(i, at)),
    ]
}
