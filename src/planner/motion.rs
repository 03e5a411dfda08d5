//! What a solve returns.

use serde::{Deserialize, Serialize};

use super::elastic::Explanation;
use super::legs::LegMotion;
use super::violation::BlockViolation;
use crate::ipopt::{IterationRecord, LinearSolver};
use crate::nlp::Model;

/// Where the wall time of a solve went, s.
#[derive(Clone, Copy, Debug, Default, PartialEq, Serialize, Deserialize)]
pub struct Seconds {
    /// Building the map.
    pub map: f64,
    /// Building the guess.
    pub guess: f64,
    /// Evaluating the NLP.
    pub evaluation: f64,
    /// Everything else in Ipopt.
    pub linear_solver: f64,
    /// All of it.
    pub total: f64,
}

/// A foot at a time at which something is wrong.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Trouble {
    /// Which foot.
    pub foot: usize,
    /// When, s.
    pub time: f64,
}

/// A motion, solved or not.
pub struct Motion {
    /// What it is a motion of.
    pub model: Model,
    /// The variables.
    pub x: Vec<f64>,
    /// What follows from the legs' mass, where they have one.
    pub legs: Option<LegMotion>,
    /// How the solve ended, in words.
    pub status: String,
    /// Why it is not solved, where that was found.
    pub explanation: Option<Explanation>,
    /// Footholds on the border of their patch that would rather be beyond it, the most urgent first.
    pub pressed: Vec<Trouble>,
    /// Every constraint holds to the tolerance.
    pub solved: bool,
    /// By Ctrl-C, or by the host.
    pub interrupted: bool,
    /// Iterations of all stages.
    pub iterations: usize,
    /// Largest violation by block.
    pub violations: Vec<BlockViolation>,
    /// Every iteration of every stage; seconds count from the start of the solve.
    pub history: Vec<IterationRecord>,
    /// The linear solver that Ipopt used in the last stage.
    pub linear_solver: LinearSolver,
    /// Where the time went; the map's is not included.
    pub seconds: Seconds,
}

impl Motion {
    /// The largest violation of all blocks.
    pub fn max_violation(&self) -> f64 {
        self.violations.iter().map(|v| v.largest).fold(0.0, f64::max)
    }
}
