//! Eq. 4 and 10: every foot stays in its box 𝓡ᵢ, fixed to the base.
//!
//! ```text
//!   center − half_size ≤ R(t)ᵀ (p_i(t) − p(t)) + s(t) ≤ center + half_size
//! ```
//!
//! Of a foot that moves in a plane of the base, it is the center that does, not the contact point below it on a slope. So y is that of
//! p_i + r n, with the normal n of the ground and the radius r.
//!
//! Rows: x, y, z in the base frame for each foot and sample, m; also halfway between samples in which a known leg swings over ground with
//! edges, or high and briefly, because such a foot leaves the straight line between them by more than the margin.

use crate::nlp::curvature::NodeCurvature;
use crate::nlp::foot_in_base;
use crate::nlp::ground_normal::GroundNormal;
use crate::nlp::sink::{Differential, Sink};
use crate::nlp::tangent::{PoseTangent, Tangent};
use crate::nlp::term::{Constraint, RowPlace};
use crate::nlp::{Model, State};
use crate::trajectory::Instant;
use crate::trajectory::layout::Phase;
use crate::trajectory::rotation::cross_matrix;
use crate::trajectory::switches::ramp;
use nalgebra::{Matrix3, Vector3};

use super::margins;

/// Largest acceleration of a swing, in its height over its duration squared: 70 m/s² for 15 cm in 0.3 s, measured.
const SWING_ACCELERATION: f64 = 42.0;

/// Feet within reach at every sample.
#[derive(Clone, Debug)]
pub struct Reach {
    places: Vec<(usize, Instant)>,
    /// By place, of feet that move in planes of the base.
    centers: Vec<Option<Center>>,
}

/// Taken off the box on each side for foot `i` at an instant, m, for a robot of ANYmal's size.
fn margin(model: &Model, i: usize, at: Instant) -> f64 {
    let Instant::Sample(k) = at else { return margins::REACH_SWINGING };
    let phase = &model.layout.phase[i];
    let swings = |k: usize| matches!(phase.get(k), Some(Phase::Swing(_)));
    if swings(k) {
        margins::REACH_SWINGING
    } else if swings(k + 1) || (k > 0 && swings(k - 1)) {
        margins::REACH_SWITCHING
    } else {
        margins::REACH_STANDING
    }
}

/// Whether a swing is so brief for its height that the foot leaves the line between two samples by more than the margin.
fn is_brief(model: &Model, i: usize, swing: usize, height: f64) -> bool {
    let duration = model.layout.feet[i].swings[swing].swing;
    let acceleration = SWING_ACCELERATION * height / (duration.end - duration.start).powi(2);
    acceleration / 8.0 > model.size * margins::REACH_SWINGING
}

impl Reach {
    /// Every foot at every sample, and in between where it may hurry. Swings rise to `swing_clearance`, m, or more.
    pub fn new(model: &Model, swing_clearance: f64) -> Self {
        let samples = model.layout.intervals + 1;
        let mut places = Vec::new();
        for i in 0..model.feet() {
            places.extend((0..samples).map(|k| (i, Instant::Sample(k))));
            if model.legs[i].is_some() {
                let between = (0..model.layout.intervals).map(Instant::Between);
                let hurries = |at: &Instant| match model.layout.phase_at(i, *at) {
                    Phase::Swing(j) => model.surfaces.have_edges() || is_brief(model, i, j, swing_clearance),
                    Phase::Stance(_) => false,
                };
                places.extend(between.filter(hurries).map(|at| (i, at)));
            }
        }
        let centers = places.iter().map(|&(i, at)| {
            let radius = model.sagittal.get(i).copied().flatten()?;
            Some(Center { foot: i, at, stances: around(model, i, at, radius) })
        });
        let centers = centers.collect();
        Self { places, centers }
    }
}

/// From the contact point of a foot to its center: Σ w_j n_j with the normals n_j at its footholds, of which two count in a swing. Where
/// durations are variables, they count as at nominal times.
#[derive(Clone, Debug)]
struct Center {
    foot: usize,
    at: Instant,
    /// j with w_j, m.
    stances: Vec<(usize, f64)>,
}

/// The stances of foot `i` around an instant with their parts of its radius.
fn around(model: &Model, i: usize, at: Instant, radius: f64) -> Vec<(usize, f64)> {
    match model.layout.phase_at(i, at) {
        Phase::Stance(j) => vec![(j, radius)],
        Phase::Swing(j) => {
            let swing = &model.layout.feet[i].swings[j].swing;
            let after = ramp((at.time() - swing.start) / (swing.end - swing.start))[0];
            vec![(j, radius * (1.0 - after)), (j + 1, radius * after)]
        }
    }
}

impl Center {
    /// The y axis of the base.
    fn left(&self, state: &State) -> Vector3<f64> {
        state.base_at(self.at).rotation().column(1).into()
    }

    /// The stances with their footholds, normals and weights.
    fn footholds<'a>(
        &'a self,
        model: &'a Model,
        state: &'a State,
    ) -> impl Iterator<Item = (usize, Tangent<'a>, GroundNormal, f64)> + 'a {
        self.stances.iter().map(move |&(j, weight)| {
            let contact = &state.contacts[self.foot][j];
            let node = &model.layout.feet[self.foot].stances[j].foothold;
            (j, Tangent::foot(model, contact, node), GroundNormal::new(&contact.ground), weight)
        })
    }

    /// How far the center is to the left of the contact point, m.
    fn value(&self, model: &Model, state: &State) -> f64 {
        let left = self.left(state);
        self.footholds(model, state).map(|(_, _, normal, by)| by * left.dot(&normal.n)).sum()
    }

    fn add_derivative(&self, model: &Model, state: &State, scalar: &mut impl Differential) {
        let left = self.left(state);
        let mut by_turn = Vector3::zeros();
        for (_, foothold, normal, by) in self.footholds(model, state) {
            by_turn += left.cross(&normal.n) * by;
            foothold.add_along(&(normal.along(&left).1 * by), scalar);
        }
        PoseTangent::new(model, state, self.at).add_along(&by_turn, &Vector3::zeros(), scalar);
    }

    /// The second derivatives of λ times the value.
    fn add_curvature(
        &self,
        model: &Model,
        state: &State,
        lambda: f64,
        curvature: &mut NodeCurvature,
        sink: &mut Sink,
    ) {
        let left = self.left(state);
        let pose = PoseTangent::new(model, state, self.at);
        for (j, foothold, normal, by) in self.footholds(model, state) {
            let by = lambda * by;
            curvature.add_base(self.at, &Vector3::zeros(), &(normal.n * by * Vector3::y().transpose()));
            curvature.contacts[self.foot][j] += normal.along(&left).1 * by;
            foothold.quadratic(&(normal.curvature(&left) * by), sink);
            // (δ × left) · dn = δᵀ [left] dn.
            let turn = cross_matrix(&left) * normal.jacobian() * by;
            pose.cross(&turn, &Matrix3::zeros(), &foothold, sink);
        }
    }
}

impl Constraint for Reach {
    fn name(&self) -> &'static str {
        "reach"
    }

    fn rows(&self) -> usize {
        3 * self.places.len()
    }

    fn bounds(&self, model: &Model, lower: &mut [f64], upper: &mut [f64]) {
        for (r, &(i, at)) in self.places.iter().enumerate() {
            let reach = &model.reach[i];
            let margin = model.size * margin(model, i, at) + model.tighter.reach;
            for c in 0..3 {
                let half = (reach.half_size[c] - margin).max(margins::REACH_FRACTION * reach.half_size[c]);
                lower[3 * r + c] = reach.center[c] - half;
                upper[3 * r + c] = reach.center[c] + half;
            }
        }
    }

    fn values(&self, model: &Model, state: &State, out: &mut [f64]) {
        for (r, (&place, center)) in self.places.iter().zip(&self.centers).enumerate() {
            out[3 * r..3 * r + 3].copy_from_slice(foot_in_base::value(model, state, place).as_slice());
            if let Some(center) = center {
                out[3 * r + 1] += center.value(model, state);
            }
        }
    }

    fn jacobian(&self, model: &Model, state: &State, first: usize, sink: &mut Sink) {
        for (r, &place) in self.places.iter().enumerate() {
            for c in 0..3 {
                let unit = Vector3::from_fn(|i, _| f64::from(u8::from(i == c)));
                foot_in_base::add_derivative(model, state, place, &unit, &mut sink.row(first + 3 * r + c));
            }
            if let Some(center) = &self.centers[r] {
                center.add_derivative(model, state, &mut sink.row(first + 3 * r + 1));
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
        for (r, &place) in self.places.iter().enumerate() {
            let lambda = Vector3::from_column_slice(&multipliers[3 * r..3 * r + 3]);
            foot_in_base::add_curvature(model, state, place, &lambda, curvature);
            if let Some(center) = &self.centers[r] {
                center.add_curvature(model, state, lambda.y, curvature, sink);
            }
        }
    }

    fn place(&self, row: usize) -> RowPlace {
        let (i, at) = self.places[row / 3];
        RowPlace { foot: Some(i), sample: at.time() }
    }
}
