//! Speed limits of the joints of a swinging leg.
//!
//! ```text
//!   −fraction ≤ (q(r(t + Δt/2)) − q(r(t))) / (Δt/2 · speed_limit) ≤ fraction,  r = Rᵀ(p_i − p) + s
//! ```
//!
//! q are the angles of thigh and knee for a leg with a closed form, of which the abduction is slow and has no row, and otherwise those of
//! all joints, see [`crate::leg`]. Legs that the robot's file does not describe have no rows.
//!
//! Differences are over half intervals. Over whole ones, a foot that flicks over an edge within two of them would appear at
//! half its true speed.
//!
//! Rows: each of these joints for each half of an interval of which at least one end lies in a swing; fraction of the limit.

use nalgebra::{Matrix3, Vector3};

use super::margins;
use crate::leg::chain::ByJoint;
use crate::leg::jet::Jet;
use crate::nlp::curvature::NodeCurvature;
use crate::nlp::foot_in_base;
use crate::nlp::sink::Sink;
use crate::nlp::term::{Constraint, RowPlace};
use crate::nlp::{Model, State};
use crate::trajectory::Instant;
use crate::trajectory::layout::Phase;

/// Name of the block.
pub const JOINT_SPEED: &str = "joint speed";

/// Speeds of swinging legs.
#[derive(Clone, Debug)]
pub struct JointSpeed {
    places: Vec<Half>,
    /// First row of each place, and the number of rows.
    offsets: Vec<usize>,
}

/// Half of an interval.
#[derive(Clone, Debug)]
struct Half {
    foot: usize,
    ends: [Instant; 2],
}

impl JointSpeed {
    /// For every swing of a leg whose geometry is known.
    pub fn new(model: &Model) -> Self {
        let (mut places, mut offsets) = (Vec::new(), vec![0]);
        for (foot, leg) in model.legs.iter().enumerate() {
            let swings = |&at: &Instant| matches!(model.layout.phase_at(foot, at), Phase::Swing(_));
            if let Some(leg) = leg {
                let halves = (0..model.layout.intervals).flat_map(|k| {
                    let middle = Instant::Between(k);
                    [[Instant::Sample(k), middle], [middle, Instant::Sample(k + 1)]]
                });
                let halves = halves.filter(|ends| ends.iter().any(swings));
                for ends in halves {
                    places.push(Half { foot, ends });
                    offsets.push(offsets[offsets.len() - 1] + leg.swing_joints().len());
                }
            }
        }
        Self { places, offsets }
    }

    /// The places with their first rows.
    fn numbered(&self) -> impl Iterator<Item = (&Half, usize)> {
        self.places.iter().zip(self.offsets.iter().copied())
    }
}

impl Half {
    /// The foot's number and the instant of the start (0) or end (1).
    fn place(&self, after: usize) -> (usize, Instant) {
        (self.foot, self.ends[after])
    }

    /// The angles of the fast joints at its start (0) or end (1).
    fn jets(&self, model: &Model, state: &State, after: usize) -> ByJoint<Jet> {
        let r = foot_in_base::value(model, state, self.place(after));
        model.leg(self.foot).posture(Jet::variables(&r)).swing_angles()
    }

    /// Derivatives of the rows with respect to the angles at its start (0) or end (1).
    fn scales<'a>(&self, model: &'a Model, after: usize) -> impl Iterator<Item = f64> + use<'a> {
        let rate = (2.0 * after as f64 - 1.0) / (0.5 * model.layout.time_step);
        let leg = model.leg(self.foot);
        leg.swing_joints().map(move |j| rate / leg.speed_limit[j])
    }
}

impl Constraint for JointSpeed {
    fn name(&self) -> &'static str {
        JOINT_SPEED
    }

    fn rows(&self) -> usize {
        self.offsets[self.places.len()]
    }

    fn bounds(&self, model: &Model, lower: &mut [f64], upper: &mut [f64]) {
        let limit = margins::JOINT_SPEED - model.tighter.joint_speed;
        lower.fill(-limit);
        upper.fill(limit);
    }

    fn values(&self, model: &Model, state: &State, out: &mut [f64]) {
        for (place, first) in self.numbered() {
            let [before, after] = [0, 1].map(|after| {
                let r = foot_in_base::value(model, state, place.place(after));
                model.leg(place.foot).posture::<f64>(r.into()).swing_angles()
            });
            let rows = out[first..].iter_mut().zip(before.into_iter().zip(after)).zip(place.scales(model, 1));
            for ((row, (before, after)), scale) in rows {
                *row = (after - before) * scale;
            }
        }
    }

    fn jacobian(&self, model: &Model, state: &State, first: usize, sink: &mut Sink) {
        for (place, offset) in self.numbered() {
            for after in 0..2 {
                let rows = place.jets(model, state, after).into_iter().zip(place.scales(model, after));
                for (j, (jet, scale)) in rows.enumerate() {
                    foot_in_base::add_derivative(
                        model,
                        state,
                        place.place(after),
                        &(jet.first * scale),
                        &mut sink.row(first + offset + j),
                    );
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
        for (place, first) in self.numbered() {
            for after in 0..2 {
                let (mut by_r, mut by_rr) = (Vector3::zeros(), Matrix3::zeros());
                let rows = place.jets(model, state, after).into_iter().zip(place.scales(model, after));
                for ((jet, scale), lambda) in rows.zip(&multipliers[first..]) {
                    by_r += jet.first * (scale * lambda);
                    by_rr += jet.second * (scale * lambda);
                }
                foot_in_base::add_quadratic(model, state, place.place(after), &by_rr, curvature);
                foot_in_base::add_curvature(model, state, place.place(after), &by_r, curvature);
            }
        }
    }

    fn place(&self, row: usize) -> RowPlace {
        let place = &self.places[self.offsets.partition_point(|&first| first <= row) - 1];
        let [start, end] = place.ends;
        RowPlace { foot: Some(place.foot), sample: 0.5 * (start.time() + end.time()) }
    }
}
