//! A case: one computation of a bench, done in a process of its own, and its result.

use super::measured::{MapMeasured, Measured, MotionMeasured};
use crate::replay::Tracked;

/// What a case computes.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Work {
    /// A plan.
    Plan,
    /// A plan, and its replay on the full robot.
    Track,
    /// A plan, and how long the functions of its NLP take.
    Speed,
    /// A map.
    Map,
}

impl Work {
    /// All of them.
    pub const ALL: [Work; 4] = [Work::Plan, Work::Track, Work::Speed, Work::Map];

    /// The name on the command line of the case's process.
    pub fn name(self) -> &'static str {
        match self {
            Work::Plan => "plan",
            Work::Track => "track",
            Work::Speed => "speed",
            Work::Map => "map",
        }
    }
}

/// One computation.
#[derive(Clone, Debug, PartialEq)]
pub struct Case {
    /// A unique name, also that of its files.
    pub name: String,
    /// What is computed.
    pub work: Work,
    /// Name of the robot.
    pub robot: String,
    /// Kind of terrain.
    pub terrain: String,
    /// Level of the terrain, or the one whose parameter is varied.
    pub level: String,
    /// Formulation, or method of the map.
    pub method: String,
    /// Name and value of a parameter that the bench varies besides.
    pub parameter: Option<(&'static str, f64)>,
    /// Heading or direction of the goal θ, degrees, counted as in the paper: from +y to +x.
    pub heading: Option<f64>,
    /// The scenario file.
    pub scenario: String,
}

/// A case and its result.
#[derive(Clone, Debug)]
pub struct CaseRow {
    /// The case.
    pub case: Case,
    /// What was measured, or why there is no result.
    pub outcome: Result<Measured, String>,
}

impl CaseRow {
    /// What was measured; none without a result.
    pub fn measured(&self) -> Option<&Measured> {
        self.outcome.as_ref().ok()
    }

    /// The motion, if there is one.
    pub fn motion(&self) -> Option<&MotionMeasured> {
        self.measured()?.motion.as_ref()
    }

    /// The map, if there is one.
    pub fn map(&self) -> Option<&MapMeasured> {
        self.measured()?.map.as_ref()
    }

    /// The replay, if there is one.
    pub fn track(&self) -> Option<&Tracked> {
        self.measured()?.track.as_ref()
    }

    /// Whether there is a motion that meets the tolerance.
    pub fn is_solved(&self) -> bool {
        self.motion().is_some_and(|motion| motion.solved)
    }

    /// Whether there is a result without fault: see [`Measured::is_good`].
    pub fn is_good(&self) -> bool {
        self.measured().is_some_and(Measured::is_good)
    }
}
