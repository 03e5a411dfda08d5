//! Phase durations within bounds, where they are optimized.
//!
//! ```text
//!   least ≤ (b_j − a_j) Δt ≤ most            swing j, from lift-off a_j to touch-down b_j
//!   least ≤ (a_{j+1} − b_j) Δt ≤ most        the stance after it
//!   least ≤ a_0 Δt,  least ≤ T − b_last Δt   the first and the last stance, which include standing at both ends
//! ```
//!
//! A swing also takes at least [`SHORTEST_SWING`] time steps. The durations of a foot sum to the horizon T without a row,
//! because the variables are the switches.
//!
//! Rows: for each foot, its phases in order of time, s.

use crate::nlp::curvature::NodeCurvature;
use crate::nlp::sink::Sink;
use crate::nlp::term::{Constraint, RowPlace};
use crate::nlp::{Model, State};
use crate::trajectory::switches::SHORTEST_SWING;

/// Durations within bounds.
#[derive(Clone, Debug)]
pub struct Durations {
    bounds: [f64; 2],
    phases: Vec<BoundedPhase>,
}

#[derive(Clone, Copy, Debug)]
struct BoundedPhase {
    foot: usize,
    start: Edge,
    end: Edge,
}

/// Where a phase begins or ends.
#[derive(Clone, Copy, Debug)]
enum Edge {
    /// At an end of the motion, this sample.
    End(f64),
    /// At a switch.
    Switch { swing: usize, which: usize, variable: usize, nominal: f64 },
}

impl Durations {
    /// For the feet whose switches are variables.
    pub fn new(model: &Model, bounds: [f64; 2]) -> Self {
        let layout = &model.layout;
        let mut phases = Vec::new();
        for (foot, variables) in layout.feet.iter().enumerate() {
            let mut start = Edge::End(0.0);
            for (swing, s) in variables.swings.iter().enumerate() {
                let Some(lift_off) = s.switches else { continue };
                for which in 0..2 {
                    let nominal = [s.swing.start, s.swing.end][which];
                    let end = Edge::Switch { swing, which, variable: lift_off + which, nominal };
                    phases.push(BoundedPhase { foot, start, end });
                    start = end;
                }
            }
            if matches!(start, Edge::Switch { .. }) {
                phases.push(BoundedPhase { foot, start, end: Edge::End(layout.intervals as f64) });
            }
        }
        Self { bounds, phases }
    }
}

/// In samples.
fn time(state: &State, foot: usize, edge: Edge) -> f64 {
    match edge {
        Edge::End(sample) => sample,
        Edge::Switch { swing, which, .. } => state.switches[foot][swing][which],
    }
}

impl Constraint for Durations {
    fn name(&self) -> &'static str {
        "phase durations"
    }

    fn rows(&self) -> usize {
        self.phases.len()
    }

    fn bounds(&self, model: &Model, lower: &mut [f64], upper: &mut [f64]) {
        for (r, phase) in self.phases.iter().enumerate() {
            let inner = matches!((phase.start, phase.end), (Edge::Switch { .. }, Edge::Switch { .. }));
            let swings = matches!(phase.start, Edge::Switch { which: 0, .. });
            let least = if swings { SHORTEST_SWING * model.layout.time_step } else { 0.0 };
            lower[r] = self.bounds[0].max(least);
            upper[r] = if inner { self.bounds[1] } else { f64::INFINITY };
        }
    }

    fn values(&self, model: &Model, state: &State, out: &mut [f64]) {
        for (value, phase) in out.iter_mut().zip(&self.phases) {
            let duration = time(state, phase.foot, phase.end) - time(state, phase.foot, phase.start);
            *value = duration * model.layout.time_step;
        }
    }

    fn jacobian(&self, model: &Model, _state: &State, first: usize, sink: &mut Sink) {
        for (r, phase) in self.phases.iter().enumerate() {
            for (edge, sign) in [(phase.start, -1.0), (phase.end, 1.0)] {
                if let Edge::Switch { variable, .. } = edge {
                    sink.add(first + r, variable, sign * model.layout.time_step);
                }
            }
        }
    }

    /// The rows are linear.
    fn hessian(
        &self,
        _model: &Model,
        _state: &State,
        _multipliers: &[f64],
        _curvature: &mut NodeCurvature,
        _sink: &mut Sink,
    ) {
    }

    fn place(&self, row: usize) -> RowPlace {
        let phase = &self.phases[row];
        let (Edge::End(sample) | Edge::Switch { nominal: sample, .. }) = phase.start;
        RowPlace { foot: Some(phase.foot), sample }
    }
}
