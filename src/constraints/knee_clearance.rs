//! Knees and shanks keep clear of the ground. On cliffs they are the first parts to hit it.
//!
//! ```text
//!   (zᵀq − h(q)) n_z ≥ radius + margin,  q = p + R v(r),  r = Rᵀ(p_i − p) + s
//! ```
//!
//! v(r) is a point of the leg by inverse kinematics, as seen from the center of mass, see [`crate::leg`]: the knee with its radius, the
//! shank's outermost corner, and the upper joints of a leg of more than three. Over ground with edges, n_z is left out, h is the surface
//! over which a ball of the knee's or the foot's size rolls, and near edges points on the axes of the tubes of these links are constrained
//! as well: an edge can reach between knee and foot. Legs that the robot's file does not describe have no rows.
//!
//! Rows: knee, corner and upper joints for each foot at every `STRIDE`-th sample; near edges these and the tubes at every sample, and in
//! swing also halfway to the next; m.

use nalgebra::{Matrix3, Vector3};

use super::margins;
use crate::leg::jet::{Jet, Scalar};
use crate::leg::{Leg, LegPosture, LinkShape};
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
    near_edge: bool,
}

/// A point of a leg that keeps clear of the ground.
#[derive(Clone, Copy, Debug)]
enum Point<'a> {
    /// The knee: the last joint.
    Knee,
    /// In the coordinates of the shank.
    Corner([f64; 2]),
    /// Of the axis of the shank's tube, likewise.
    Tube([f64; 2]),
    /// At a fraction of the line of a link.
    Link(&'a LinkShape, f64),
}

impl KneeClearance {
    /// Over the whole motion.
    pub fn new(model: &Model) -> Self {
        let mut places = Vec::new();
        for (foot, leg) in model.legs.iter().enumerate() {
            let Some(leg) = leg else { continue };
            for k in 0..=model.layout.intervals {
                let near_edge = is_near_edge(model, foot, k, leg.shank_length());
                if near_edge || k % STRIDE == 0 {
                    places.push(LegPlace { foot, at: k.into(), near_edge });
                }
                // A swinging leg moves by a hand's breadth from sample to sample.
                let swings = matches!(model.layout.phase[foot][k], Phase::Swing(_));
                if near_edge && swings && k < model.layout.intervals {
                    places.push(LegPlace { foot, at: Instant::Between(k), near_edge });
                }
            }
        }
        let mut offsets = vec![0];
        for place in &places {
            offsets.push(offsets[offsets.len() - 1] + place.points(model.leg(place.foot)).len());
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

/// Fractions of a line of some length, m, that are near enough to each other for a tube around it, from its start on and without its end.
fn along(length: f64, leg: &Leg) -> impl Iterator<Item = f64> + use<> {
    let spacing = TUBE_SPACING * leg.foot_radius.max(LEAST_RADIUS * leg.shank_length());
    let count = (length / spacing).ceil() as usize;
    (0..count).map(move |n| n as f64 / count as f64)
}

impl LegPlace {
    /// Those that have rows.
    fn points<'a>(&self, leg: &'a Leg) -> Vec<Point<'a>> {
        let ([start, across], shank) = (leg.shank.tube, leg.shank_length());
        let mut points = vec![Point::Knee, Point::Corner(leg.shank.corner)];
        if self.near_edge {
            let fractions = along((shank - start).hypot(across), leg);
            points.extend(fractions.map(|s| Point::Tube([start + s * (shank - start), (1.0 - s) * across])));
        }
        for link in &leg.links {
            points.push(Point::Link(link, 0.0));
            if self.near_edge {
                let fractions = along((link.ends[1] - link.ends[0]).norm(), leg).skip(1);
                points.extend(fractions.map(|s| Point::Link(link, s)));
            }
        }
        points
    }
}

impl Point<'_> {
    /// v, as seen from the center of mass.
    fn place<T: Scalar>(&self, posture: &LegPosture<'_, T>, shift: &Vector3<f64>) -> [T; 3] {
        let q = match self {
            Self::Knee => posture.on_shank([0.0; 2]),
            Self::Corner(point) | Self::Tube(point) => posture.on_shank(*point),
            Self::Link(link, fraction) => posture.on_link(link, *fraction),
        };
        std::array::from_fn(|c| q[c] + -shift[c])
    }

    /// How far it keeps from the ground, m.
    fn least(&self, model: &Model, leg: &Leg) -> f64 {
        let [knees, shanks] =
            [margins::KNEE_CLEARANCE, margins::SHANK_CLEARANCE].map(|margin| model.size * margin);
        match self {
            Self::Knee => leg.shank.knee_radius + knees,
            Self::Corner(_) => knees,
            Self::Tube(_) => leg.shank.tube_radius + shanks,
            Self::Link(link, 0.0) => link.radius + knees,
            Self::Link(link, _) => link.radius + shanks,
        }
    }
}

/// How far a point is above the surface for it, with the derivatives in q.
fn above_ground(model: &Model, q: &Vector3<f64>, point: Point) -> (f64, Vector3<f64>, Matrix3<f64>) {
    let surface = match point {
        Point::Knee | Point::Link(..) => &model.surfaces.knees,
        Point::Corner(_) | Point::Tube(_) => &model.surfaces.feet,
    };
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
        (point, local): (Point, [Jet; 3]),
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
        let (at, leg, shift) = ((self.foot, self.at), model.leg(self.foot), model.leg_terms.shift(self.at));
        let r = foot_in_base::value(model, state, at);
        let posture = leg.posture(Jet::variables(&r));
        let points = self.points(leg).into_iter();
        points.map(move |point| Moved::new(model, state, at, (point, point.place(&posture, &shift))))
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
        for (place, first) in self.numbered() {
            let leg = model.leg(place.foot);
            for (row, point) in lower[first..].iter_mut().zip(place.points(leg)) {
                *row = point.least(model, leg);
            }
        }
        upper.fill(f64::INFINITY);
    }

    fn values(&self, model: &Model, state: &State, out: &mut [f64]) {
        for (place, first) in self.numbered() {
            let base = state.base_at(place.at);
            let r = foot_in_base::value(model, state, (place.foot, place.at));
            let (leg, shift) = (model.leg(place.foot), model.leg_terms.shift(place.at));
            let posture = leg.posture::<f64>(r.into());
            for (row, point) in out[first..].iter_mut().zip(place.points(leg)) {
                let local = point.place(&posture, &shift);
                let q = base.position() + base.rotation() * Vector3::from(local);
                *row = above_ground(model, &q, point).0;
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
