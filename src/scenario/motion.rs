//! `[motion]`, `[contact]`, `[physics]` and `[discretization]`: which laws the motion obeys.

use schemars::JsonSchema;
use serde::{Deserialize, Serialize};

/// `[motion]`.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize, JsonSchema)]
#[serde(deny_unknown_fields, default)]
pub struct MotionSpec {
    /// Lowest allowed apex of a swing above the ground, m.
    #[schemars(range(min = 0.0, max = 1.0))]
    pub swing_clearance: f64,
    /// Smallest allowed distance of the torso's underside from the ground, m.
    #[schemars(range(min = 0.0, max = 2.0))]
    pub base_clearance: f64,
    /// Largest normal force on a foot, in units of m g.
    #[schemars(range(min = 0.1, max = 100.0))]
    pub force_limit: f64,
    /// Largest pull of an adhesive foot, in units of m g.
    #[schemars(range(min = 0.0, max = 100.0))]
    pub pull_limit: f64,
    /// Weights of base acceleration and force rate.
    #[schemars(inner(range(min = 0.0, max = 1e6)))]
    pub smoothness: [f64; 2],
}

impl Default for MotionSpec {
    fn default() -> Self {
        Self {
            swing_clearance: 0.06,
            base_clearance: 0.10,
            force_limit: 2.0,
            pull_limit: 1.2,
            smoothness: [1e-3, 1e-4],
        }
    }
}

/// The form of the friction cone.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq, Serialize, Deserialize, JsonSchema)]
#[serde(rename_all = "kebab-case")]
pub enum Cone {
    /// Eq. 5, with the true normal of the terrain.
    #[default]
    Exact,
    /// Eq. 9.
    Conformal,
}

/// Where feet may stand.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Serialize, Deserialize, JsonSchema)]
#[serde(rename_all = "kebab-case")]
pub enum Footholds {
    /// Each stance within a patch of even ground, chosen before the motion is optimized; the ground may have edges.
    Patches,
    /// Anywhere on the ground, which must be smooth.
    Anywhere,
}

/// `[contact]`.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize, JsonSchema)]
#[serde(deny_unknown_fields, default)]
pub struct ContactSpec {
    /// Coefficient of friction ν.
    #[schemars(range(min = 0.01, max = 10.0))]
    pub friction: f64,
    /// Fraction of ν that the plan leaves to the controller and to slippery spots: forces stay within (1 − margin) ν.
    #[schemars(range(min = 0.0, max = 0.9))]
    pub friction_margin: f64,
    /// The form of the friction cone.
    pub cone: Cone,
    /// Where feet may stand; default: patches on a heightmap, anywhere on a terrain that is a function.
    pub footholds: Option<Footholds>,
    /// Feet stand on measured ground only, not where a scan has no data and the ground is a guess. With `footholds = "anywhere"` this
    /// is checked, not planned for.
    pub on_known_ground: bool,
    /// Largest slope |∇h| at a foothold; default: no limit.
    #[schemars(range(min = 0.01, max = 100.0))]
    pub max_slope: Option<f64>,
    /// With `max_slope`: how far a foothold must stay from steeper ground, m.
    #[schemars(range(min = 0.0, max = 1.0))]
    pub edge_margin: f64,
}

impl Default for ContactSpec {
    fn default() -> Self {
        Self {
            friction: 0.75,
            friction_margin: 0.2,
            cone: Cone::Exact,
            footholds: None,
            on_known_ground: true,
            max_slope: None,
            edge_margin: 0.03,
        }
    }
}

/// The form of the laws of motion.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq, Serialize, Deserialize, JsonSchema)]
#[serde(rename_all = "kebab-case")]
pub enum Law {
    /// Position-based, centered differences.
    #[default]
    Pcdm,
    /// Position-based, backward differences: Eq. 11.
    PcdmBackward,
    /// Newton and Euler, Eq. 2.
    NewtonEuler,
}

/// What the legs weigh in the plan.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Serialize, Deserialize, JsonSchema)]
#[serde(rename_all = "kebab-case")]
pub enum Legs {
    /// The laws are those of a trunk and its legs' links.
    Massive,
    /// As in the paper: the robot is one rigid body.
    Massless,
}

/// `[physics]`.
#[derive(Clone, Debug, Default, PartialEq, Serialize, Deserialize, JsonSchema)]
#[serde(deny_unknown_fields, default)]
pub struct PhysicsSpec {
    /// The form of the laws of motion.
    pub law: Law,
    /// What the legs weigh; by default massive where the robot's file has the masses of their links and feet
    /// may stand anywhere. With flight, by default, massless if no motion is found with massive ones.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub legs: Option<Legs>,
}

/// `[discretization]`.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize, JsonSchema)]
#[serde(deny_unknown_fields, default)]
pub struct DiscretizationSpec {
    /// Distance between the knots of the base's spline, in time steps. More than 1 leaves fewer unknowns per row of physics.
    #[schemars(range(min = 1, max = 100))]
    pub base_knots: usize,
    /// Distance between the nodes of the forces, in time steps.
    #[schemars(range(min = 1, max = 100))]
    pub force_knots: usize,
}

impl Default for DiscretizationSpec {
    fn default() -> Self {
        Self { base_knots: 1, force_knots: 1 }
    }
}
