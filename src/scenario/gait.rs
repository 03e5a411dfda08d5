//! `[gait]`: the order and timing of the feet.

use schemars::JsonSchema;
use serde::{Deserialize, Serialize};

/// `gait.kind`.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq, Serialize, Deserialize, JsonSchema)]
#[serde(rename_all = "kebab-case")]
pub enum GaitKind {
    /// One foot at a time: LH, LF, RH, RF.
    #[default]
    Walk,
    /// Diagonal pairs.
    Trot,
    /// Lateral pairs.
    Pace,
    /// Front and hind pairs.
    Bound,
    /// No steps.
    Stand,
    /// A table of phase durations per foot.
    Custom,
}

/// `[gait]`.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize, JsonSchema)]
#[serde(deny_unknown_fields, default)]
pub struct GaitSpec {
    /// The pattern.
    pub kind: GaitKind,
    /// Duration of a cycle, s; default: the robot's (anymal_c 1.2), or 1 if it has none; for a walk over smooth ground 1.25 times that.
    #[schemars(range(min = 0.1, max = 20.0))]
    pub cycle: Option<f64>,
    /// Fraction of the cycle that a foot stands; default: walk over smooth ground 5/6, over patches 0.75, others 0.6.
    #[schemars(range(min = 0.1, max = 1.0))]
    pub duty: Option<f64>,
    /// Whether the phase durations are variables.
    pub optimize_durations: bool,
    /// Shortest and longest phase duration, s.
    #[schemars(inner(range(min = 0.01, max = 100.0)))]
    pub duration_bounds: [f64; 2],
    /// custom: for each foot, alternating stance and swing durations in s, stance first; they sum to the horizon.
    #[schemars(inner(inner(range(min = 0.01, max = 600.0))))]
    pub phases: Option<Vec<Vec<f64>>>,
}

impl Default for GaitSpec {
    fn default() -> Self {
        Self {
            kind: GaitKind::Walk,
            cycle: None,
            duty: None,
            optimize_durations: false,
            duration_bounds: [0.1, 2.0],
            phases: None,
        }
    }
}
