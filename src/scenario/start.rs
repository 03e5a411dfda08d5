//! `[start]`: where, and how, the motion starts.

use schemars::JsonSchema;
use serde::{Deserialize, Serialize};

/// `[start]`.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize, JsonSchema)]
#[serde(deny_unknown_fields)]
pub struct StartSpec {
    /// x, y of the base, m.
    pub position: [f64; 2],
    /// Heading, rad; default: toward the goal.
    pub yaw: Option<f64>,
    /// A plan to go on from, relative to the scenario: sets `position`, `yaw` and `state`.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub plan: Option<String>,
    /// When that plan is left, s; default: at its end.
    #[serde(skip_serializing_if = "Option::is_none")]
    #[schemars(range(min = 0.0, max = 600.0))]
    pub time: Option<f64>,
    /// What else is given of the start; default: a standing pose at rest.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub state: Option<StartState>,
}

/// `[start.state]`: all in the world frame.
#[derive(Clone, Debug, Default, PartialEq, Serialize, Deserialize, JsonSchema)]
#[serde(deny_unknown_fields, default)]
pub struct StartState {
    /// Height of the center of mass, z, m.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub height: Option<f64>,
    /// Roll and pitch, rad.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub tilt: Option<[f64; 2]>,
    /// Of the center of mass, m/s.
    #[schemars(inner(range(min = -20.0, max = 20.0)))]
    pub velocity: [f64; 3],
    /// rad/s.
    #[schemars(inner(range(min = -50.0, max = 50.0)))]
    pub angular_velocity: [f64; 3],
    /// Of the center of mass, m/s².
    #[schemars(inner(range(min = -200.0, max = 200.0)))]
    pub acceleration: [f64; 3],
    /// rad/s².
    #[schemars(inner(range(min = -2000.0, max = 2000.0)))]
    pub angular_acceleration: [f64; 3],
    /// Where each foot is, in the robot's order, m.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub feet: Option<Vec<[f64; 3]>>,
    /// By foot, for how long it has been in the air and when it lands, s; 0 and 0 for one that stands. Default: all stand, unless `gait.phases`
    /// begin with a swing.
    #[serde(skip_serializing_if = "Option::is_none")]
    #[schemars(inner(inner(range(min = 0.0, max = 20.0))))]
    pub swings: Option<Vec<[f64; 2]>>,
    /// Velocity of each foot, m/s, which counts for those in the air; default: free.
    #[serde(skip_serializing_if = "Option::is_none")]
    #[schemars(inner(inner(range(min = -50.0, max = 50.0))))]
    pub feet_velocity: Option<Vec<[f64; 3]>>,
    /// The force of the ground on each foot, in the robot's order, N.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub forces: Option<Vec<[f64; 3]>>,
}

/// Slower than this, m/s or rad/s, and with less acceleration, m/s² or rad/s², the robot is at rest.
const AT_REST: f64 = 1e-6;

impl StartSpec {
    /// For how long a foot has been in the air and when it lands, s, if the state has it in the air.
    pub fn swing(&self, foot: usize) -> Option<[f64; 2]> {
        let swings = self.state.as_ref()?.swings.as_ref()?;
        swings.get(foot).copied().filter(|[since, left]| *since > 0.0 && *left > 0.0)
    }

    /// Whether the robot moves at the start.
    pub fn moves(&self) -> bool {
        self.state.as_ref().is_some_and(|state| {
            let rates =
                [state.velocity, state.angular_velocity, state.acceleration, state.angular_acceleration];
            rates.as_flattened().iter().any(|rate| rate.abs() > AT_REST)
        })
    }
}
