//! The scenario file as a whole.

use std::fmt;

use schemars::JsonSchema;
use serde::{Deserialize, Serialize};

use super::conditions::{FootholdSpec, ForceSpec, PayloadSpec, PostureSpec};
use super::gait::GaitSpec;
use super::goal::GoalSpec;
use super::guess::GuessSpec;
use super::keep_out::KeepOutSpec;
use super::map::MapSpec;
use super::motion::{ContactSpec, DiscretizationSpec, Footholds, Legs, MotionSpec, PhysicsSpec};
use super::solver::SolverSpec;
use super::start::StartSpec;
use super::terrain::TerrainSpec;
use crate::input;
use crate::robot::RobotSpec;

/// A whole scenario file.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize, JsonSchema)]
#[serde(deny_unknown_fields)]
pub struct Scenario {
    /// Version of this format: 1.
    #[serde(default = "default_schema")]
    #[schemars(range(min = 1, max = 1))]
    pub schema: u32,
    /// The space in which the variables live; default: hybrid where feet stand on patches or the motion starts or ends
    /// moving, else warped.
    pub formulation: Option<Formulation>,
    /// Duration of the motion T, s.
    #[serde(default = "default_horizon")]
    #[schemars(range(min = 0.1, max = 600.0))]
    pub horizon: f64,
    /// Time between two samples of the constraints Δt, s.
    #[serde(default = "default_time_step")]
    #[schemars(range(min = 0.001, max = 1.0))]
    pub time_step: f64,
    /// The robot.
    #[serde(default)]
    pub robot: RobotSpec,
    /// The ground.
    pub terrain: TerrainSpec,
    /// Where the motion starts.
    pub start: StartSpec,
    /// Where the motion ends.
    pub goal: GoalSpec,
    /// Order and timing of the feet.
    #[serde(default)]
    pub gait: GaitSpec,
    /// Clearances, limits of force and weights of smoothness.
    #[serde(default)]
    pub motion: MotionSpec,
    /// Limits of the torso's height and tilt.
    #[serde(default)]
    pub posture: PostureSpec,
    /// A mass on the trunk.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub payload: Option<PayloadSpec>,
    /// Forces on the trunk.
    #[serde(default, skip_serializing_if = "Vec::is_empty")]
    pub force: Vec<ForceSpec>,
    /// Where no foot may stand.
    #[serde(default, skip_serializing_if = "Vec::is_empty")]
    pub keep_out: Vec<KeepOutSpec>,
    /// Footholds whose place is given.
    #[serde(default, skip_serializing_if = "Vec::is_empty")]
    pub foothold: Vec<FootholdSpec>,
    /// A motion to start the solve from.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub guess: Option<GuessSpec>,
    /// Friction and footholds.
    #[serde(default)]
    pub contact: ContactSpec,
    /// The form of the laws of motion.
    #[serde(default)]
    pub physics: PhysicsSpec,
    /// How finely the motion is discretized.
    #[serde(default)]
    pub discretization: DiscretizationSpec,
    /// How the map φ is computed.
    #[serde(default)]
    pub map: MapSpec,
    /// How the NLP is solved.
    #[serde(default)]
    pub solver: SolverSpec,
}

impl Scenario {
    /// The space in which the variables live.
    pub fn formulation(&self) -> Formulation {
        self.formulation.unwrap_or(match self.footholds() {
            // A shift in F is not one in ambient space.
            _ if self.gait.periodic => Formulation::Direct,
            Footholds::Anywhere if !self.moves_at_ends() => Formulation::Warped,
            _ => Formulation::Hybrid,
        })
    }

    /// Whether the base moves at the start or at the end.
    pub fn moves_at_ends(&self) -> bool {
        self.start.moves() || self.goal.velocity.is_some() || self.gait.periodic
    }

    /// By foot, whether it is in the air at the start and at the end, as far as these are given.
    pub fn in_air(&self, foot: usize) -> [bool; 2] {
        let row = self.gait.phases.as_ref().and_then(|rows| rows.get(foot));
        let none = |duration: Option<&f64>| duration == Some(&0.0);
        [
            none(row.and_then(|row| row.first())) || self.start.swing(foot).is_some(),
            none(row.and_then(|row| row.last())),
        ]
    }

    /// Whether a foot is in the air at the start or at the end, as far as that is given.
    pub fn is_in_air(&self) -> bool {
        let swings = self.start.state.as_ref().and_then(|state| state.swings.as_ref());
        let feet = self.gait.phases.as_ref().map_or(0, Vec::len).max(swings.map_or(0, Vec::len));
        (0..feet).any(|foot| self.in_air(foot) != [false; 2])
    }

    /// What the legs weigh, for a robot whose links have masses. Over ground with edges, where swings are high and quick, the default is
    /// massless: massive legs cost iterations and reach there (docs/results.md). So it is where the motion starts or ends moving or with
    /// feet in the air.
    pub fn legs(&self) -> Legs {
        self.physics.legs.unwrap_or(match self.footholds() {
            Footholds::Anywhere if !self.moves_at_ends() && !self.is_in_air() => Legs::Massive,
            _ => Legs::Massless,
        })
    }

    /// Where feet may stand.
    pub fn footholds(&self) -> Footholds {
        self.contact.footholds.unwrap_or(match self.terrain {
            TerrainSpec::Heightmap(_) => Footholds::Patches,
            _ => Footholds::Anywhere,
        })
    }
}

fn default_schema() -> u32 {
    1
}
fn default_horizon() -> f64 {
    10.0
}
fn default_time_step() -> f64 {
    0.05
}

/// The space in which the variables live.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Serialize, Deserialize, JsonSchema)]
#[serde(rename_all = "kebab-case")]
pub enum Formulation {
    /// Eq. 7–13: variables in F, pushed forward by φ.
    Warped,
    /// Eq. 1–5: variables in ambient space (the baseline).
    Direct,
    /// The base in ambient space, feet and forces in F.
    Hybrid,
}

impl fmt::Display for Formulation {
    fn fmt(&self, f: &mut fmt::Formatter) -> fmt::Result {
        f.write_str(match self {
            Self::Warped => "warped",
            Self::Direct => "direct",
            Self::Hybrid => "hybrid",
        })
    }
}

/// The JSON Schema (draft 2020-12) of a scenario file.
pub fn json_schema() -> serde_json::Value {
    input::json_schema::<Scenario>()
}
