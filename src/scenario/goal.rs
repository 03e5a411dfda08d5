//! `[goal]`: where the motion ends, and over which way-points it goes there.

use schemars::JsonSchema;
use serde::{Deserialize, Serialize};

/// `[goal]`.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize, JsonSchema)]
#[serde(deny_unknown_fields)]
pub struct GoalSpec {
    /// x, y of the base at the end, m; a hard constraint.
    pub position: [f64; 2],
    /// Heading at the end, rad; if given, a hard constraint.
    pub yaw: Option<f64>,
    /// Height of the center of mass above the mean of the feet at the end, m; if given, a hard constraint.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    #[schemars(range(min = 0.01, max = 10.0))]
    pub height: Option<f64>,
    /// Whole turns to the left (negative: to the right), in addition to the shortest turn to `yaw`, or to the heading at the start.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    #[schemars(range(min = -20, max = 20))]
    pub turns: Option<i32>,
    /// Velocity of the base at the end along x and y, m/s; default: at rest.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    #[schemars(inner(range(min = -20.0, max = 20.0)))]
    pub velocity: Option<[f64; 2]>,
    /// Mean speed along the way, m/s, from which the horizon follows where that is not given.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    #[schemars(range(min = 0.001, max = 10.0))]
    pub speed: Option<f64>,
    /// The way is an arc.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub circle: Option<CircleSpec>,
    /// Whether the way may lead around what cannot be walked, where that blocks the straight one.
    #[serde(default = "default_detours")]
    pub detours: bool,
    /// Where the way leads, in order.
    #[serde(default, skip_serializing_if = "Vec::is_empty")]
    pub waypoints: Vec<WaypointSpec>,
    /// How near the base passes a way-point without a time, m.
    #[serde(default = "default_distance")]
    #[schemars(range(min = 0.001, max = 10.0))]
    pub waypoint_distance: f64,
}

fn default_detours() -> bool {
    true
}

fn default_distance() -> f64 {
    0.1
}

/// `[[goal.waypoints]]`.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize, JsonSchema)]
#[serde(deny_unknown_fields)]
pub struct WaypointSpec {
    /// x, y of the base, m. Without a time it is passed within `goal.waypoint_distance`, in order.
    pub position: [f64; 2],
    /// Heading there, rad; with a time a hard constraint, else the way turns to it.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub yaw: Option<f64>,
    /// Height of the center of mass above the mean of the feet, m; only with a time.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    #[schemars(range(min = 0.01, max = 10.0))]
    pub height: Option<f64>,
    /// When the base is there, s; a hard constraint.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    #[schemars(range(min = 0.0, max = 600.0))]
    pub time: Option<f64>,
}

/// `goal.circle`: the way is an arc around a center, from the start to the goal.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize, JsonSchema)]
#[serde(deny_unknown_fields)]
pub struct CircleSpec {
    /// x, y, m.
    pub center: [f64; 2],
    /// How often the base goes around the center, to the left (negative: to the right); default: the shorter arc to the goal, or once.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    #[schemars(range(min = -20.0, max = 20.0))]
    pub turns: Option<f64>,
}
