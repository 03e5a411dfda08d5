//! Speed limits of hip and knee of a swinging leg.
//!
//! ```text
//!   −fraction ≤ (q(r(t + Δt/2)) − q(r(t))) / (Δt/2 · speed_limit) ≤ fraction,  q = (φ, κ),  r = Rᵀ(p_i − p)
//! ```
//!
//! φ and κ are the angles of thigh and knee, see [`crate::leg`]. The abduction is slow and has no row. Legs that the robot's
//! file does not describe have none either.
//!
//! Differences are over half intervals. Over whole ones, a foot that flicks over an edge within two of them would appear at
//! half its true speed.
//!
//! Rows: thigh, knee for each half of an interval of which at least one end lies in a swing; fraction of the limit.

use super::margins;
use crate::leg::Leg;
use crate::leg::jet::{Jet, Scalar};
use crate::nlp::curvature::NodeCurvature;
use crate::nlp::foot_in_base;
use crate::nlp::sink::Sink;
use crate::nlp::term::{Constraint, RowPlace};
use crate::nlp::{Model, State};
use crate::trajectory::Instant;
use crate::trajectory::layout::Phase;

/// Speeds of swinging legs.
#[derive(Clone, Debug)]
pub struct JointSpeed {
    /// Foot, the ends of the half interval, and the leg.
    places: Vec<(usize, [Instant; 2], Leg)>,
}

impl JointSpeed {
    /// For every swing of a leg whose geometry is known.
    pub fn new(model: &Model) -> Self {
        let mut places = Vec::new();
        for (i, leg) in model.legs.iter().enumerate() {
            let swings = |&at: &Instant| matches!(model.layout.phase_at(i, at), Phase::Swing(_));
            if let Some(leg) = leg {
                let halves = (0..model.layout.intervals).flat_map(|k| {
                    let middle = Instant::Between(k);
                    [[Instant::Sample(k), middle], [middle, Instant::Sample(k + 1)]]
                });
                places.extend(halves.filter(|ends| ends.iter().any(swings)).map(|ends| (i, ends, *leg)));
            }
        }
        Self { places }
    }
}

/// Number of the joint whose angle φ is; κ is that of the next.
const FIRST: usize = 1;

/// φ and κ at a sample.
fn angles<T: Scalar>(leg: &Leg, r: [T; 3]) -> [T; 2] {
    leg.posture(r).angles()
}

fn jets(model: &Model, state: &State, (i, ends, leg): &(usize, [Instant; 2], Leg), after: usize) -> [Jet; 2] {
    angles(leg, Jet::variables(&foot_in_base::value(model, state, (*i, ends[after]))))
}

/// Derivative of a row with respect to the angle at its start (0) or end (1).
fn scale(model: &Model, leg: &Leg, j: usize, after: usize) -> f64 {
    (2.0 * after as f64 - 1.0) / (0.5 * model.layout.time_step * leg.speed_limit[FIRST + j])
}

impl Constraint for JointSpeed {
    fn name(&self) -> &'static str {
        "joint speed"
    }

    fn rows(&self) -> usize {
        2 * self.places.len()
    }

    fn bounds(&self, _model: &Model, lower: &mut [f64], upper: &mut [f64]) {
        lower.fill(-margins::JOINT_SPEED);
        upper.fill(margins::JOINT_SPEED);
    }

    fn values(&self, model: &Model, state: &State, out: &mut [f64]) {
        for (rows, &(i, ends, leg)) in out.chunks_exact_mut(2).zip(&self.places) {
            let [before, after] =
                ends.map(|at| angles(&leg, foot_in_base::value(model, state, (i, at)).into()));
            for (j, row) in rows.iter_mut().enumerate() {
                *row = (after[j] - before[j]) * scale(model, &leg, j, 1);
            }
        }
    }

    fn jacobian(&self, model: &Model, state: &State, first: usize, sink: &mut Sink) {
        for (n, place) in self.places.iter().enumerate() {
            for after in 0..2 {
                let at = (place.0, place.1[after]);
                for (j, jet) in jets(model, state, place, after).iter().enumerate() {
                    let by_r = jet.first * scale(model, &place.2, j, after);
                    foot_in_base::add_derivative(model, state, at, &by_r, &mut sink.row(first + 2 * n + j));
                }
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
        for (lambda, place) in multipliers.chunks_exact(2).zip(&self.places) {
            for after in 0..2 {
                let at = (place.0, place.1[after]);
                let [thigh, knee] = jets(model, state, place, after);
                let weight = |j: usize| lambda[j] * scale(model, &place.2, j, after);
                let sum = thigh * weight(0) + knee * weight(1);
                foot_in_base::add_quadratic(model, state, at, &sum.second, curvature);
                foot_in_base::add_curvature(model, state, at, &sum.first, curvature);
            }
        }
    }

    fn place(&self, row: usize) -> RowPlace {
        let (i, [start, end], _) = self.places[row / 2];
        RowPlace { foot: Some(i), sample: 0.5 * (start.time() + end.time()) }
    }
}
