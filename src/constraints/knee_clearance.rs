//! Knees and shanks keep clear of the ground. On cliffs they are the first parts to hit it.
//!
//! ```text
//!   (zᵀq − h(q)) n_z ≥ radius + margin,  q = p + R v(r),  r = Rᵀ(p_i − p)
//! ```
//!
//! v(r) is a point of the shank in the base frame by inverse kinematics, see [`crate::leg`]: the knee with its radius, and the
//! shank's outermost corner. Legs that the robot's file does not describe have no rows.
//!
//! Rows: knee, corner for each foot at every `STRIDE`-th sample, m.

use nalgebra::{Matrix3, Vector3};

use super::margins;
use crate::leg::Leg;
use crate::leg::jet::{Jet, Scalar};
use crate::nlp::curvature::NodeCurvature;
use crate::nlp::foot_in_base;
use crate::nlp::ground_normal::distance;
use crate::nlp::sink::Sink;
use crate::nlp::tangent::Tangent;
use crate::nlp::term::{Constraint, RowPlace};
use crate::nlp::{Model, State};
use crate::trajectory::Instant;
use crate::trajectory::rotation::cross_matrix;

/// Every how many samples there are rows.
const STRIDE: usize = 2;

/// The clearance of knees and shanks.
#[derive(Clone, Debug)]
pub struct KneeClearance {
    places: Vec<(usize, Instant, Leg)>,
}

impl KneeClearance {
    /// Over the whole motion.
    pub fn new(model: &Model) -> Self {
        let mut places = Vec::new();
        for (i, leg) in model.legs.iter().enumerate() {
            if let Some(leg) = leg {
                places.extend((0..=model.layout.intervals).step_by(STRIDE).map(|k| (i, k.into(), *leg)));
            }
        }
        Self { places }
    }
}

/// The points v(r).
fn points<T: Scalar>(leg: &Leg, r: [T; 3]) -> [[T; 3]; 2] {
    let posture = leg.posture(r);
    [posture.knee(), posture.on_shank(leg.corner)]
}

/// A point and how it moves: dq = by_turn δ + by_base dp + by_foot dp_i.
struct Moved {
    /// v in the base frame, with derivatives in r.
    local: [Jet; 3],
    /// The distance to the ground, and its derivatives in q.
    distance: (f64, Vector3<f64>, Matrix3<f64>),
    /// R ∂v/∂r Rᵀ.
    with_foot: Matrix3<f64>,
    /// \[p_i − p\].
    arm: Matrix3<f64>,
    by_turn: Matrix3<f64>,
}

impl Moved {
    fn new(model: &Model, state: &State, (i, at): (usize, Instant), local: [Jet; 3]) -> Self {
        let base = state.base_at(at);
        let rotation = base.rotation();
        let out = rotation * Vector3::from_fn(|c, _| local[c].value);
        let q = base.position() + out;
        let by_r = Matrix3::from_fn(|c, d| local[c].first[d]);
        let with_foot = rotation * by_r * rotation.transpose();
        let arm = cross_matrix(&foot_in_base::arm(model, state, (i, at)));
        Self {
            local,
            distance: distance(&q, &model.ground.jet(q.x, q.y)),
            with_foot,
            arm,
            by_turn: with_foot * arm - cross_matrix(&out),
        }
    }

    fn by_base(&self) -> Matrix3<f64> {
        Matrix3::identity() - self.with_foot
    }
}

impl KneeClearance {
    fn moved(&self, model: &Model, state: &State, place: usize) -> [Moved; 2] {
        let (i, at, leg) = &self.places[place];
        let r = foot_in_base::value(model, state, (*i, *at));
        points(leg, Jet::variables(&r)).map(|local| Moved::new(model, state, (*i, *at), local))
    }

    fn tangents<'a>(&self, model: &'a Model, state: &'a State, place: usize) -> [Tangent<'a>; 3] {
        let (i, at, _) = self.places[place];
        foot_in_base::tangents(model, state, (i, at))
    }
}

impl Constraint for KneeClearance {
    fn name(&self) -> &'static str {
        "knee clearance"
    }

    fn rows(&self) -> usize {
        2 * self.places.len()
    }

    fn bounds(&self, _model: &Model, lower: &mut [f64], upper: &mut [f64]) {
        for (rows, (_, _, leg)) in lower.chunks_exact_mut(2).zip(&self.places) {
            rows.copy_from_slice(&[leg.knee_radius + margins::KNEE_CLEARANCE, margins::KNEE_CLEARANCE]);
        }
        upper.fill(f64::INFINITY);
    }

    fn values(&self, model: &Model, state: &State, out: &mut [f64]) {
        for (rows, (i, at, leg)) in out.chunks_exact_mut(2).zip(&self.places) {
            let (base, r) = (state.base_at(*at), foot_in_base::value(model, state, (*i, *at)));
            for (row, local) in rows.iter_mut().zip(points(leg, r.into())) {
                let q = base.position() + base.rotation() * Vector3::from(local);
                *row = distance(&q, &model.ground.jet(q.x, q.y)).0;
            }
        }
    }

    fn jacobian(&self, model: &Model, state: &State, first: usize, sink: &mut Sink) {
        for place in 0..self.places.len() {
            let [turn, base, foot] = self.tangents(model, state, place);
            for (j, moved) in self.moved(model, state, place).iter().enumerate() {
                let (row, by_q) = (first + 2 * place + j, moved.distance.1);
                turn.add_along(&moved.by_turn.tr_mul(&by_q), &mut sink.row(row));
                base.add_along(&moved.by_base().tr_mul(&by_q), &mut sink.row(row));
                foot.add_along(&moved.with_foot.tr_mul(&by_q), &mut sink.row(row));
            }
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
        for (place, lambda) in multipliers.chunks_exact(2).enumerate() {
            let (i, at, _) = self.places[place];
            let rotation = state.base_at(at).rotation();
            let [turn, base, foot] = self.tangents(model, state, place);
            for (moved, lambda) in self.moved(model, state, place).iter().zip(lambda) {
                // The ground's curvature, and the normal's.
                let form = moved.distance.2 * *lambda;
                let (by_turn, by_base, by_foot) = (moved.by_turn, moved.by_base(), moved.with_foot);
                turn.quadratic(&(by_turn.transpose() * form * by_turn), sink);
                base.quadratic(&(by_base.transpose() * form * by_base), sink);
                foot.quadratic(&(by_foot.transpose() * form * by_foot), sink);
                turn.cross(&(by_turn.transpose() * form * by_base), &base, sink);
                turn.cross(&(by_turn.transpose() * form * by_foot), &foot, sink);
                base.cross(&(by_base.transpose() * form * by_foot), &foot, sink);
                // w · d²q for q = p + R v(r): w · d²p, w · d²R v, w · dR dv, w · R d²v.
                let w = moved.distance.1 * *lambda;
                let v = Vector3::from_fn(|c, _| moved.local[c].value);
                curvature.add_base(at, &w, &(w * v.transpose()));
                // (δ × R dv) · w = −δᵀ [w] (R dv), R dv = R ∂v/∂r Rᵀ ([arm] δ + dp_i − dp).
                let mixed = -cross_matrix(&w) * moved.with_foot;
                turn.cross(&(mixed * moved.arm), &turn, sink);
                turn.cross(&mixed, &foot, sink);
                turn.cross(&-mixed, &base, sink);
                let u = rotation.tr_mul(&w);
                let sum = moved.local[0] * u.x + moved.local[1] * u.y + moved.local[2] * u.z;
                foot_in_base::add_quadratic(model, state, (i, at), &sum.second, sink);
                foot_in_base::add_curvature(model, state, (i, at), &sum.first, curvature, sink);
            }
        }
    }

    fn place(&self, row: usize) -> RowPlace {
        let (i, at, _) = self.places[row / 2];
        RowPlace { foot: Some(i), sample: at.time() }
    }
}
