//! Knees and shanks keep clear of the ground. On cliffs they are the first parts to hit it.
//!
//! ```text
//!   (zᵀq − h(q)) n_z ≥ radius + margin,  q = p + R v(r),  r = Rᵀ(p_i − p) + s
//! ```
//!
//! v(r) is a point of the shank by inverse kinematics, as seen from the center of mass, see [`crate::leg`]: the knee with its radius, and the
//! shank's outermost corner. Over ground with edges, n_z is left out, h is the surface over which a ball of the knee's or the
//! foot's size rolls, and near edges points on the axis of the shank's tube are constrained as well: an edge can reach between knee
//! and foot. Legs that the robot's file does not describe have no rows.
//!
//! Rows: knee, corner for each foot at every `STRIDE`-th sample; near edges knee, corner and tube at every sample, and in
//! swing also halfway to the next; m.

use nalgebra::{Matrix3, Vector3};

use super::margins;
use crate::leg::jet::{Jet, Scalar};
use crate::leg::{Leg, ShankShape};
use crate::nlp::curvature::NodeCurvature;
use crate::nlp::foot_in_base;
use crate::nlp::ground_normal::clearance;
use crate::nlp::sink::Sink;
use crate::nlp::tangent::{PoseTangent, Tangent};
use crate::nlp::term::{Constraint, RowPlace};
use crate::nlp::{Model, State};
use crate::trajectory::Instant;
use crate::trajectory::layout::Phase;
use crate::trajectory::rotation::cross_matrix;

/// Every how many samples there are rows.
const STRIDE: usize = 2;

/// Near edges, largest distance between the points of the shank's tube that have rows, in radii of the foot: an edge between two of
/// them cannot reach the tube then.
const TUBE_SPACING: f64 = 1.2;
/// A foot counts as at least this thick in that, in lengths of the shank.
const LEAST_RADIUS: f64 = 0.03;

/// The clearance of knees and shanks.
#[derive(Clone, Debug)]
pub struct KneeClearance {
    places: Vec<LegPlace>,
    /// First row of each place, and the number of rows.
    offsets: Vec<usize>,
}

/// A leg at an instant.
#[derive(Clone, Copy, Debug)]
struct LegPlace {
    foot: usize,
    at: Instant,
    leg: Leg,
    near_edge: bool,
}

impl KneeClearance {
    /// Over the whole motion.
    pub fn new(model: &Model) -> Self {
        let mut places = Vec::new();
        for (foot, leg) in model.legs.iter().enumerate() {
            let Some(leg) = *leg else { continue };
            for k in 0..=model.layout.intervals {
                let near_edge = is_near_edge(model, foot, k, leg.shank_length());
                if near_edge || k % STRIDE == 0 {
                    places.push(LegPlace { foot, at: k.into(), leg, near_edge });
                }
                // A swinging leg moves by a hand's breadth from sample to sample.
                let swings = matches!(model.layout.phase[foot][k], Phase::Swing(_));
                if near_edge && swings && k < model.layout.intervals {
                    places.push(LegPlace { foot, at: Instant::Between(k), leg, near_edge });
                }
            }
        }
        let mut offsets = vec![0];
        for place in &places {
            offsets.push(offsets[offsets.len() - 1] + place.rows());
        }
        Self { places, offsets }
    }

    /// The places with their first rows.
    fn numbered(&self) -> impl Iterator<Item = (&LegPlace, usize)> {
        self.places.iter().zip(self.offsets.iter().copied())
    }
}

/// Whether the foot's shank is over an edge at a sample: near one of its footholds there is ground on which no foot can stand.
fn is_near_edge(model: &Model, foot: usize, k: usize, shank: f64) -> bool {
    let Some(contact) = &model.surfaces.contact else { return false };
    let stances = match model.layout.phase[foot][k] {
        Phase::Stance(j) => j..=j,
        Phase::Swing(j) => j..=j + 1,
    };
    let mut patches = stances.filter_map(|j| model.patch(foot, j));
    patches.any(|patch| contact.has_edge_within(patch.center, shank))
}

impl LegPlace {
    fn rows(&self) -> usize {
        2 + self.tube_points()
    }

    /// Points of the tube from its upper end on; the foot itself is not among them.
    fn tube_points(&self) -> usize {
        let Leg { shank: shape, foot_radius, .. } = self.leg;
        let (tube, shank) = (shape.tube, self.leg.shank_length());
        let spacing = TUBE_SPACING * foot_radius.max(LEAST_RADIUS * shank);
        if self.near_edge { ((shank - tube[0]).hypot(tube[1]) / spacing).ceil() as usize } else { 0 }
    }

    /// The points v(r): knee, corner, and near edges those of the tube.
    fn points<T: Scalar>(&self, model: &Model, r: [T; 3]) -> impl Iterator<Item = [T; 3]> {
        let shift = model.leg_terms.shift(self.at);
        let ShankShape { corner, tube, .. } = self.leg.shank;
        let shank = self.leg.shank_length();
        let posture = self.leg.posture(r);
        let count = self.tube_points();
        let of_tube = (0..count).map(move |n| {
            let s = n as f64 / count as f64;
            [tube[0] + s * (shank - tube[0]), (1.0 - s) * tube[1]]
        });
        let on_shank = [[0.0, 0.0], corner].into_iter().chain(of_tube);
        on_shank.map(move |point| {
            let q = posture.on_shank(point);
            std::array::from_fn(|c| q[c] + -shift[c])
        })
    }
}

/// How far a point of the shank is above the surface for it, with the derivatives in q.
fn above_ground(model: &Model, q: &Vector3<f64>, point: usize) -> (f64, Vector3<f64>, Matrix3<f64>) {
    let surface = if point == 0 { &model.surfaces.knees } else { &model.surfaces.feet };
    clearance(model, q, &surface.jet(q.x, q.y))
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
    fn new(
        model: &Model,
        state: &State,
        (i, at): (usize, Instant),
        (point, local): (usize, [Jet; 3]),
    ) -> Self {
        let base = state.base_at(at);
        let rotation = base.rotation();
        let out = rotation * Vector3::from_fn(|c, _| local[c].value);
        let q = base.position() + out;
        let by_r = Matrix3::from_fn(|c, d| local[c].first[d]);
        let with_foot = rotation * by_r * rotation.transpose();
        let arm = cross_matrix(&foot_in_base::arm(model, state, (i, at)));
        Self {
            local,
            distance: above_ground(model, &q, point),
            with_foot,
            arm,
            by_turn: with_foot * arm - cross_matrix(&out),
        }
    }

    fn by_base(&self) -> Matrix3<f64> {
        Matrix3::identity() - self.with_foot
    }
}

impl LegPlace {
    fn moved(&self, model: &Model, state: &State) -> impl Iterator<Item = Moved> {
        let at = (self.foot, self.at);
        let r = foot_in_base::value(model, state, at);
        self.points(model, Jet::variables(&r))
            .enumerate()
            .map(move |point| Moved::new(model, state, at, point))
    }
}

impl Constraint for KneeClearance {
    fn name(&self) -> &'static str {
        "knee clearance"
    }

    fn rows(&self) -> usize {
        self.offsets[self.places.len()]
    }

    fn bounds(&self, model: &Model, lower: &mut [f64], upper: &mut [f64]) {
        lower.fill(model.size * margins::KNEE_CLEARANCE);
        for (place, first) in self.numbered() {
            lower[first] += place.leg.shank.knee_radius;
            let tube = place.leg.shank.tube_radius + model.size * margins::SHANK_CLEARANCE;
            lower[first + 2..first + place.rows()].fill(tube);
        }
        upper.fill(f64::INFINITY);
    }

    fn values(&self, model: &Model, state: &State, out: &mut [f64]) {
        for (place, first) in self.numbered() {
            let base = state.base_at(place.at);
            let r = foot_in_base::value(model, state, (place.foot, place.at));
            for (point, local) in place.points(model, r.into()).enumerate() {
                let q = base.position() + base.rotation() * Vector3::from(local);
                out[first + point] = above_ground(model, &q, point).0;
            }
        }
    }

    fn jacobian(&self, model: &Model, state: &State, first: usize, sink: &mut Sink) {
        for (place, offset) in self.numbered() {
            let (i, at) = (place.foot, place.at);
            let pose = PoseTangent::new(model, state, at);
            let foot = Tangent::foot(model, state.foot(model, i, at), state.foot_node(i, at));
            for (point, moved) in place.moved(model, state).enumerate() {
                let (row, by_q) = (first + offset + point, moved.distance.1);
                let (by_turn, by_base) = (moved.by_turn.tr_mul(&by_q), moved.by_base().tr_mul(&by_q));
                pose.add_along(&by_turn, &by_base, &mut sink.row(row));
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
        _sink: &mut Sink,
    ) {
        for (place, first) in self.numbered() {
            let (i, at) = (place.foot, place.at);
            let rotation = state.base_at(at).rotation();
            for (moved, lambda) in place.moved(model, state).zip(&multipliers[first..]) {
                // The ground's curvature, and the normal's.
                let q = moved.distance.2 * *lambda;
                let (by_turn, by_base, by_foot) = (moved.by_turn, moved.by_base(), moved.with_foot);
                // w · d²q for q = p + R v(r): w · d²p, w · d²R v, w · dR dv, w · R d²v.
                let w = moved.distance.1 * *lambda;
                let v = Vector3::from_fn(|c, _| moved.local[c].value);
                curvature.add_base(at, &w, &(w * v.transpose()));
                // (δ × R dv) · w = −δᵀ [w] (R dv), R dv = R ∂v/∂r Rᵀ ([arm] δ + dp_i − dp).
                let mixed = -cross_matrix(&w) * moved.with_foot;
                let turns = mixed * moved.arm;
                let form = curvature.forms.foot_mut(i, at);
                form.pose.turn += by_turn.transpose() * q * by_turn + turns + turns.transpose();
                form.pose.turn_base += by_turn.transpose() * q * by_base - mixed;
                form.pose.base += by_base.transpose() * q * by_base;
                form.turn_foot += by_turn.transpose() * q * by_foot + mixed;
                form.base_foot += by_base.transpose() * q * by_foot;
                form.foot += by_foot.transpose() * q * by_foot;
                let u = rotation.tr_mul(&w);
                let sum = moved.local[0] * u.x + moved.local[1] * u.y + moved.local[2] * u.z;
                foot_in_base::add_quadratic(model, state, (i, at), &sum.second, curvature);
                foot_in_base::add_curvature(model, state, (i, at), &sum.first, curvature);
            }
        }
    }

    fn place(&self, row: usize) -> RowPlace {
        let place = &self.places[self.offsets.partition_point(|&first| first <= row) - 1];
        RowPlace { foot: Some(place.foot), sample: place.at.time() }
    }
}
