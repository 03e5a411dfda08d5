//! Eq. 4 and 10: every foot stays in its box 𝓡ᵢ, fixed to the base.
//!
//! ```text
//!   center − half_size ≤ R(t)ᵀ (p_i(t) − p(t)) ≤ center + half_size
//! ```
//!
//! Rows: for each place (foot, sample), x, y, z in the base frame, m.

use super::{Constraint, Place};
use crate::nlp::curvature::Curvature;
use crate::nlp::sink::Sink;
use crate::nlp::tangent::Tangent;
use crate::nlp::{Model, State};
use crate::trajectory::Instant;
use crate::trajectory::layout::Phase;
use crate::trajectory::rotation::cross_matrix;
use nalgebra::{Matrix3, Vector3};

/// Feet within reach at every sample.
#[derive(Clone, Debug)]
pub struct Reach {
    places: Vec<(usize, usize)>,
}

/// Taken off the box on each side, m, so that it holds between the samples. Between two samples a path with acceleration a
/// leaves the line through them by up to a Δt²/8: 0.5 mm for the body at 1.5 m/s², and 15 mm for a foot at 50 m/s².
const STANDING_MARGIN: f64 = 0.001;
/// At lift-off and touch-down; where these are variables, at their earliest and latest.
const SWITCH_MARGIN: f64 = 0.009;
/// In swing, or where a foot may swing.
const SWINGING_MARGIN: f64 = 0.015;

fn margin(model: &Model, i: usize, k: usize) -> f64 {
    let phase = &model.layout.phase[i];
    let swings = |k: usize| matches!(phase.get(k), Some(Phase::Swing(_)));
    if swings(k) {
        SWINGING_MARGIN
    } else if swings(k + 1) || (k > 0 && swings(k - 1)) {
        SWITCH_MARGIN
    } else {
        STANDING_MARGIN
    }
}

impl Reach {
    /// Every foot at every sample.
    pub fn new(model: &Model) -> Self {
        let samples = model.layout.intervals + 1;
        let places = (0..model.feet()).flat_map(|i| (0..samples).map(move |k| (i, k))).collect();
        Self { places }
    }
}

/// r = Rᵀ(p_i − p) of a foot at an instant, m; also used by costs and by rows of the legs.
pub(crate) fn value(model: &Model, state: &State, (i, at): (usize, impl Into<Instant>)) -> Vector3<f64> {
    let at = at.into();
    let base = state.base_at(at);
    base.rotation().tr_mul(&(state.foot(model, i, at).point.position - base.position()))
}

/// Its derivatives: a row that changes by `by` · (change of r).
pub(crate) fn say_row(
    model: &Model,
    state: &State,
    (i, at): (usize, impl Into<Instant>),
    by: &Vector3<f64>,
    row: usize,
    sink: &mut Sink,
) {
    let at = at.into();
    let world = state.base_at(at).rotation() * by;
    let arm = arm(model, state, (i, at));
    let [turn, base, foot] = tangents(model, state, (i, at));
    // d(Rᵀ r) = Rᵀ ([r] δ + dp_i − dp).
    turn.row(row, &(-arm.cross(&world)), sink);
    base.row(row, &-world, sink);
    foot.row(row, &world, sink);
}

/// Second derivatives of λ · Rᵀ(p_i − p).
pub(crate) fn say_curvature(
    model: &Model,
    state: &State,
    (i, at): (usize, impl Into<Instant>),
    lambda: &Vector3<f64>,
    curvature: &mut Curvature,
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

/// Second derivatives of ½ (change of r)ᵀ Q (change of r), Q symmetric, base frame; those of r itself are not in it.
pub(crate) fn say_quadratic(
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
pub(crate) fn arm(model: &Model, state: &State, (i, at): (usize, Instant)) -> Vector3<f64> {
    state.foot(model, i, at).point.position - state.base_at(at).position()
}

/// How the base turns, the base moves and the foot moves.
pub(crate) fn tangents<'a>(
    model: &'a Model,
    state: &'a State,
    (i, at): (usize, Instant),
) -> [Tangent<'a>; 3] {
    let (base, node) = (state.base_at(at), model.layout.base_at(at));
    [
        Tangent::turn(model, base, node),
        Tangent::position(model, &base.point, node),
        Tangent::position(model, &state.foot(model, i, at).point, state.foot_node(i, at)),
    ]
}

impl Constraint for Reach {
    fn name(&self) -> &'static str {
        "reach"
    }

    fn rows(&self) -> usize {
        3 * self.places.len()
    }

    fn bounds(&self, model: &Model, lower: &mut [f64], upper: &mut [f64]) {
        for (r, &(i, k)) in self.places.iter().enumerate() {
            let reach = &model.reach[i];
            let margin = margin(model, i, k);
            for c in 0..3 {
                lower[3 * r + c] = reach.center[c] - reach.half_size[c] + margin;
                upper[3 * r + c] = reach.center[c] + reach.half_size[c] - margin;
            }
        }
    }

    fn values(&self, model: &Model, state: &State, out: &mut [f64]) {
        for (r, &place) in self.places.iter().enumerate() {
            out[3 * r..3 * r + 3].copy_from_slice(value(model, state, place).as_slice());
        }
    }

    fn jacobian(&self, model: &Model, state: &State, first: usize, sink: &mut Sink) {
        for (r, &place) in self.places.iter().enumerate() {
            for c in 0..3 {
                let unit = Vector3::from_fn(|i, _| f64::from(u8::from(i == c)));
                say_row(model, state, place, &unit, first + 3 * r + c, sink);
            }
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
        for (r, &place) in self.places.iter().enumerate() {
            let lambda = Vector3::from_column_slice(&multipliers[3 * r..3 * r + 3]);
            say_curvature(model, state, place, &lambda, curvature, sink);
        }
    }

    fn place(&self, row: usize) -> Place {
        let (i, k) = self.places[row / 3];
        Place { foot: Some(i), sample: k as f64 }
    }
}
