//! The scenario: everything a user asks for, as plain data (`scenarios/*.toml`, schema 1).

pub mod document;
mod load;
mod schema;
mod template;
#[cfg(test)]
mod tests;
mod validate;

pub use load::{LoadedScenario, load, load_text, parse};
pub(crate) use schema::closest as closest_word;
pub use schema::json_schema;
pub use template::template;

use schemars::JsonSchema;
use serde::{Deserialize, Serialize};

/// A whole scenario file.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize, JsonSchema)]
#[serde(deny_unknown_fields)]
pub struct Scenario {
    /// Version of this format: 1.
    #[serde(default = "default_schema")]
    #[schemars(range(min = 1, max = 1))]
    pub schema: u32,
    /// Which space the variables live in.
    #[serde(default)]
    pub formulation: Formulation,
    /// T, s.
    #[serde(default = "default_horizon")]
    #[schemars(range(min = 0.1, max = 600.0))]
    pub horizon: f64,
    /// Δt, s.
    #[serde(default = "default_time_step")]
    #[schemars(range(min = 0.001, max = 1.0))]
    pub time_step: f64,
    /// Which robot.
    #[serde(default)]
    pub robot: RobotSpec,
    /// Which ground.
    pub terrain: TerrainSpec,
    /// Where it starts.
    pub start: StartSpec,
    /// Where it goes.
    pub goal: GoalSpec,
    /// Order and timing of the feet.
    #[serde(default)]
    pub gait: GaitSpec,
    /// How the motion should be.
    #[serde(default)]
    pub motion: MotionSpec,
    /// Friction and footholds.
    #[serde(default)]
    pub contact: ContactSpec,
    /// Which form of the laws of motion.
    #[serde(default)]
    pub physics: PhysicsSpec,
    /// How finely the motion is divided.
    #[serde(default)]
    pub discretization: DiscretizationSpec,
    /// How φ is found.
    #[serde(default)]
    pub map: MapSpec,
    /// How the NLP is solved.
    #[serde(default)]
    pub solver: SolverSpec,
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

/// The space of the variables.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq, Serialize, Deserialize, JsonSchema)]
#[serde(rename_all = "kebab-case")]
pub enum Formulation {
    /// Eq. 7–13: variables in F, pushed forward by φ.
    #[default]
    Warped,
    /// Eq. 1–5: variables in ambient space (the baseline).
    Direct,
}

/// `[robot]`.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize, JsonSchema)]
#[serde(deny_unknown_fields, default)]
pub struct RobotSpec {
    /// Name of a shipped robot.
    pub name: String,
    /// A robot file instead, relative to the scenario.
    pub file: Option<String>,
    /// Feet that may pull on the ground.
    pub adhesive_feet: Vec<String>,
}

impl Default for RobotSpec {
    fn default() -> Self {
        Self { name: "anymal_b".into(), file: None, adhesive_feet: Vec::new() }
    }
}

/// `level` of a terrain of the paper.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq, Serialize, Deserialize, JsonSchema)]
#[serde(rename_all = "kebab-case")]
pub enum Level {
    /// Gentle.
    Easy,
    /// As in the paper, as far as its figures show.
    #[default]
    Medium,
    /// Steep.
    Hard,
}

/// Which terrain, by `kind`.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Serialize, Deserialize, JsonSchema)]
#[serde(rename_all = "kebab-case")]
pub enum TerrainKind {
    /// h = 0.
    Flat,
    /// A sin(kx) sin(ky).
    Rippled,
    /// A smooth cone.
    Conic,
    /// A Gaussian hill.
    Hilly,
    /// A round pit with a smooth edge.
    Pit,
    /// An expression in x and y.
    Formula,
    /// An image or array.
    Heightmap,
    /// A triangle mesh seen from above.
    Mesh,
}

/// `[terrain]`. Which keys are allowed depends on `kind`; see the scenario format.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize, JsonSchema)]
#[serde(deny_unknown_fields)]
pub struct TerrainSpec {
    /// Kind of terrain.
    pub kind: TerrainKind,
    /// Parameters by name, for the four of the paper.
    pub level: Option<Level>,
    /// rippled: A, m.
    #[schemars(range(min = -10.0, max = 10.0))]
    pub amplitude: Option<f64>,
    /// rippled: 2π/k, m.
    #[schemars(range(min = 0.05, max = 1000.0))]
    pub wavelength: Option<f64>,
    /// conic: s.
    #[schemars(range(min = -10.0, max = 10.0))]
    pub slope: Option<f64>,
    /// conic, pit: ρ0, m.
    #[schemars(range(min = 0.01, max = 1000.0))]
    pub radius: Option<f64>,
    /// conic: ε, m.
    #[schemars(range(min = 0.001, max = 100.0))]
    pub tip: Option<f64>,
    /// conic: β, m.
    #[schemars(range(min = 0.001, max = 100.0))]
    pub foot: Option<f64>,
    /// hilly: H, m.
    #[schemars(range(min = -100.0, max = 100.0))]
    pub height: Option<f64>,
    /// hilly: w, m.
    #[schemars(range(min = 0.01, max = 1000.0))]
    pub width: Option<f64>,
    /// pit: D, m.
    #[schemars(range(min = -100.0, max = 100.0))]
    pub depth: Option<f64>,
    /// pit: δ, m.
    #[schemars(range(min = 0.001, max = 100.0))]
    pub edge: Option<f64>,
    /// formula: h(x, y) in m.
    pub expression: Option<String>,
    /// heightmap, mesh: file, relative to the scenario.
    pub file: Option<String>,
    /// heightmap: m a pixel; others: spacing of the grid that h is sampled on, m.
    #[schemars(range(min = 0.001, max = 10.0))]
    pub spacing: Option<f64>,
    /// heightmap: m from black to white (image) or a factor (.npy).
    #[schemars(range(min = -1000.0, max = 1000.0))]
    pub height_scale: Option<f64>,
    /// heightmap, mesh: length over which h is smoothed, m.
    #[schemars(range(min = 0.0, max = 10.0))]
    pub smoothing: Option<f64>,
    /// heightmap: x, y of the centre, m.
    pub origin: Option<[f64; 2]>,
    /// x_min, x_max, y_min, y_max, m.
    pub extent: Option<[f64; 4]>,
}

/// `[start]`.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize, JsonSchema)]
#[serde(deny_unknown_fields)]
pub struct StartSpec {
    /// x, y of the base, m.
    pub position: [f64; 2],
    /// Heading, rad; default: towards the goal.
    pub yaw: Option<f64>,
}

/// `[goal]`.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize, JsonSchema)]
#[serde(deny_unknown_fields)]
pub struct GoalSpec {
    /// x, y of the base at the end, m; a hard constraint.
    pub position: [f64; 2],
    /// Heading at the end, rad; a hard constraint when given.
    pub yaw: Option<f64>,
}

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
    /// Phase tables by foot.
    Custom,
}

/// `[gait]`.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize, JsonSchema)]
#[serde(deny_unknown_fields, default)]
pub struct GaitSpec {
    /// Which pattern.
    pub kind: GaitKind,
    /// Length of a cycle, s; default: the robot's (anymal_c 1.2), else 1.
    #[schemars(range(min = 0.1, max = 20.0))]
    pub cycle: Option<f64>,
    /// Share of the cycle that a foot stands; default by kind: walk 0.75, others 0.6.
    #[schemars(range(min = 0.1, max = 1.0))]
    pub duty: Option<f64>,
    /// Make the phase durations variables.
    pub optimize_durations: bool,
    /// Least and greatest phase duration, s.
    #[schemars(inner(range(min = 0.01, max = 100.0)))]
    pub duration_bounds: [f64; 2],
    /// custom: by foot, alternating stance and swing durations in s, stance first, their sum the horizon.
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
            duration_bounds: [0.1, 1.0],
            phases: None,
        }
    }
}

/// `[motion]`.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize, JsonSchema)]
#[serde(deny_unknown_fields, default)]
pub struct MotionSpec {
    /// Least apex of a swing over the ground, m.
    #[schemars(range(min = 0.0, max = 1.0))]
    pub swing_clearance: f64,
    /// Least distance of the torso's underside from the ground, m.
    #[schemars(range(min = 0.0, max = 2.0))]
    pub base_clearance: f64,
    /// Greatest normal force of a foot, of m g.
    #[schemars(range(min = 0.1, max = 100.0))]
    pub force_limit: f64,
    /// Greatest pull of an adhesive foot, of m g.
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

/// Which friction cone.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq, Serialize, Deserialize, JsonSchema)]
#[serde(rename_all = "kebab-case")]
pub enum Cone {
    /// Eq. 5 with the true terrain normal.
    #[default]
    Exact,
    /// Eq. 9.
    Conformal,
}

/// `[contact]`.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize, JsonSchema)]
#[serde(deny_unknown_fields, default)]
pub struct ContactSpec {
    /// ν.
    #[schemars(range(min = 0.01, max = 10.0))]
    pub friction: f64,
    /// Share of ν that the plan leaves to the controller: forces stay within (1 − margin) ν.
    #[schemars(range(min = 0.0, max = 0.9))]
    pub friction_margin: f64,
    /// Which cone.
    pub cone: Cone,
    /// Greatest slope |∇h| of a foothold; default: none.
    #[schemars(range(min = 0.01, max = 100.0))]
    pub max_slope: Option<f64>,
    /// With `max_slope`: how far from steeper ground a foothold must be, m.
    #[schemars(range(min = 0.0, max = 1.0))]
    pub edge_margin: f64,
}

impl Default for ContactSpec {
    fn default() -> Self {
        Self { friction: 0.75, friction_margin: 0.0, cone: Cone::Exact, max_slope: None, edge_margin: 0.03 }
    }
}

/// Which form of the laws of motion.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq, Serialize, Deserialize, JsonSchema)]
#[serde(rename_all = "kebab-case")]
pub enum Law {
    /// Position-based, centred.
    #[default]
    Pcdm,
    /// Position-based, backward: Eq. 11.
    PcdmBackward,
    /// Eq. 2.
    NewtonEuler,
}

/// `[physics]`.
#[derive(Clone, Debug, Default, PartialEq, Serialize, Deserialize, JsonSchema)]
#[serde(deny_unknown_fields, default)]
pub struct PhysicsSpec {
    /// The law.
    pub law: Law,
}

/// `[discretization]`.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize, JsonSchema)]
#[serde(deny_unknown_fields, default)]
pub struct DiscretizationSpec {
    /// Distance of the knots of the base's spline, in time steps. More than 1 leaves fewer unknowns for each row of physics.
    #[schemars(range(min = 1, max = 100))]
    pub base_knots: usize,
    /// Distance of the nodes of the forces, in time steps.
    #[schemars(range(min = 1, max = 100))]
    pub force_knots: usize,
}

impl Default for DiscretizationSpec {
    fn default() -> Self {
        Self { base_knots: 1, force_knots: 1 }
    }
}

/// How the map is found.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq, Serialize, Deserialize, JsonSchema)]
#[serde(rename_all = "kebab-case")]
pub enum MapMethod {
    /// The scale-invariant energy ¼(‖J‖²/det^⅔ − 3).
    #[default]
    Mips,
    /// As conformal as possible by Algorithm 1; may fold.
    AcapLocalGlobal,
    /// The same with a barrier against folds, by Gauss–Newton.
    AcapNewton,
    /// Laplace; may fold.
    Dirichlet,
    /// As rigid as possible; may fold.
    Arap,
    /// (x, y, z + h).
    Shear,
    /// The cheapest that is good enough.
    Auto,
}

impl MapMethod {
    /// As in a scenario.
    pub fn name(self) -> &'static str {
        match self {
            MapMethod::Mips => "mips",
            MapMethod::AcapLocalGlobal => "acap-local-global",
            MapMethod::AcapNewton => "acap-newton",
            MapMethod::Dirichlet => "dirichlet",
            MapMethod::Arap => "arap",
            MapMethod::Shear => "shear",
            MapMethod::Auto => "auto",
        }
    }
}

/// The scale of the scaled rotation that J is compared with, in the `acap` methods.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq, Serialize, Deserialize, JsonSchema)]
#[serde(rename_all = "kebab-case")]
pub enum MapScale {
    /// tr Σ/3, the nearest.
    #[default]
    Trace,
    /// |Σ|^⅓, as in the paper.
    Determinant,
}

/// `[map]`.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize, JsonSchema)]
#[serde(deny_unknown_fields, default)]
pub struct MapSpec {
    /// The method.
    pub method: MapMethod,
    /// acap-local-global, acap-newton: the scale.
    pub scale: MapScale,
    /// Cells along x, y, z; default: 48, 48, 16 over a square, over an oblong about as many and about square, and twice as many
    /// along x and y where the terrain bends too much for them.
    #[schemars(inner(range(min = 4, max = 512)))]
    pub cells: Option<[usize; 3]>,
    /// Height of the box, m.
    #[schemars(range(min = 0.1, max = 100.0))]
    pub thickness: f64,
    /// What the energy counts well above the ground, where the torso is, of what it counts at the ground. More makes the map
    /// gentler there and less conformal at the ground. (dirichlet counts everything alike, shear nothing.)
    #[schemars(range(min = 0.001, max = 10.0))]
    pub torso_weight: f64,
}

impl Default for MapSpec {
    fn default() -> Self {
        Self {
            method: MapMethod::Mips,
            scale: MapScale::Trace,
            cells: None,
            thickness: 2.5,
            torso_weight: 0.03,
        }
    }
}

impl MapSpec {
    /// The cells to begin with over a rectangle (x_min, x_max, y_min, y_max), m.
    pub fn cells(&self, [x_min, x_max, y_min, y_max]: [f64; 4]) -> [usize; 3] {
        let oblong = ((x_max - x_min) / (y_max - y_min)).sqrt().clamp(1.0 / 6.0, 6.0);
        // Multiples of 8, so that there are coarser grids to start from.
        let along = |share: f64| 8 * (6.0 * share).round() as usize;
        self.cells.unwrap_or([along(oblong), along(1.0 / oblong), 16])
    }
}

/// Which Hessian Ipopt gets.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq, Serialize, Deserialize, JsonSchema)]
#[serde(rename_all = "kebab-case")]
pub enum Hessian {
    /// L-BFGS.
    #[default]
    LimitedMemory,
    /// Analytic second derivatives.
    Exact,
}

/// How far to go.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq, Serialize, Deserialize, JsonSchema)]
#[serde(rename_all = "kebab-case")]
pub enum Effort {
    /// Stop at the first feasible point, without a cost.
    Feasible,
    /// With the cost, stop when feasible and no longer getting better.
    #[default]
    Smooth,
    /// To the optimum.
    Optimal,
}

/// `continuation`.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Serialize, Deserialize, JsonSchema)]
#[serde(untagged)]
pub enum Continuation {
    /// `"auto"` or `"off"`.
    Mode(ContinuationMode),
    /// A number of steps.
    Steps(#[schemars(range(min = 1, max = 100))] u32),
}

/// `"auto"` or `"off"`.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Serialize, Deserialize, JsonSchema)]
#[serde(rename_all = "kebab-case")]
pub enum ContinuationMode {
    /// When the plain solve fails.
    Auto,
    /// Never.
    Off,
}

/// `solver.linear_solver`: what solves the systems of equations inside Ipopt.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Serialize, Deserialize, JsonSchema)]
#[serde(rename_all = "kebab-case")]
pub enum LinearSolver {
    /// Faer where the Ipopt that is installed can take it, else MUMPS.
    Auto,
    /// Condensed and factored in Rust.
    Faer,
    /// Ipopt's own.
    Mumps,
}

/// `[solver]`.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize, JsonSchema)]
#[serde(deny_unknown_fields, default)]
pub struct SolverSpec {
    /// Iterations, those of a continuation included.
    #[schemars(range(min = 1, max = 100000))]
    pub max_iterations: usize,
    /// Largest violation, in the units of the NLP.
    #[schemars(range(min = 1e-12, max = 0.1))]
    pub tolerance: f64,
    /// Whether to grow the terrain out of the plane when the plain solve fails.
    pub continuation: Continuation,
    /// Which Hessian; default: exact where there is a cost, limited memory where there is none.
    pub hessian: Option<Hessian>,
    /// How many steps the limited-memory Hessian remembers.
    #[schemars(range(min = 1, max = 1000))]
    pub hessian_memory: usize,
    /// What solves the systems of equations inside Ipopt.
    pub linear_solver: LinearSolver,
    /// How far to go.
    pub effort: Effort,
    /// Threads that evaluate the derivatives of the NLP; the linear solver keeps to one.
    #[schemars(range(min = 1, max = 2))]
    pub threads: usize,
}

impl Default for SolverSpec {
    fn default() -> Self {
        Self {
            max_iterations: 200,
            tolerance: 1e-4,
            continuation: Continuation::Mode(ContinuationMode::Auto),
            hessian: None,
            hessian_memory: 6,
            linear_solver: LinearSolver::Auto,
            effort: Effort::Smooth,
            threads: 1,
        }
    }
}
