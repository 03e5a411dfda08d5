//! `[gait]`: the order and timing of the feet.

use schemars::JsonSchema;
use serde::{Deserialize, Serialize};

use super::gait_kind::GaitKind;
use super::section::SectionSpec;

/// `[gait]`.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize, JsonSchema)]
#[serde(deny_unknown_fields, default)]
pub struct GaitSpec {
    /// The pattern.
    pub kind: GaitKind,
    /// Duration of a cycle, s; default: the robot's (anymal_c 1.2), or 1 if it has none; for a walk over smooth ground 1.25 times that; for
    /// walk and wave a quarter of it for each foot; with flight from the robot's height.
    #[schemars(range(min = 0.1, max = 20.0))]
    pub cycle: Option<f64>,
    /// Fraction of the cycle that a foot stands; default for four feet: walk over smooth ground 5/6, over patches and wave 0.75; trot,
    /// tripod, pace and bound 0.6, flying-trot 0.4, hop and pronk 0.55 (on one foot 0.65).
    #[schemars(range(min = 0.1, max = 1.0))]
    pub duty: Option<f64>,
    /// Whether the motion is cyclic: its end is its start, shifted to the goal and turned by the goal's yaw, with nothing at rest, so that
    /// it can be repeated. As many cycles as fill the horizon.
    #[serde(skip_serializing_if = "std::ops::Not::not")]
    pub periodic: bool,
    /// Whether the phase durations are variables.
    pub optimize_durations: bool,
    /// Shortest and longest phase duration, s.
    #[schemars(inner(range(min = 0.01, max = 100.0)))]
    pub duration_bounds: [f64; 2],
    /// Gaits one after the other, instead of `kind`, `cycle` and `duty`.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub sequence: Option<Vec<SectionSpec>>,
    /// custom: for each foot, alternating stance and swing durations in s, stance first; they sum to the horizon. A first or last stance of 0 s
    /// is none: the foot begins or ends in the air.
    #[schemars(inner(inner(range(min = 0.0, max = 600.0))))]
    pub phases: Option<Vec<Vec<f64>>>,
}

impl Default for GaitSpec {
    fn default() -> Self {
        Self {
            kind: GaitKind::Walk,
            cycle: None,
            duty: None,
            periodic: false,
            optimize_durations: false,
            duration_bounds: [0.1, 2.0],
            sequence: None,
            phases: None,
        }
    }
}
