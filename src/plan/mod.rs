//! The plan: what comes out, sampled in ambient space and exact (`NAME.plan.npz`, schema 1).

pub mod exact;
pub mod npz;
mod read;
pub mod sampled;
mod write;

pub use read::PLAN_SCHEMA;

use serde::{Deserialize, Serialize};

use crate::robot::Box3;

/// Name, shape, values in C order.
pub type NamedArray = (String, Vec<usize>, Vec<f64>);

/// A plan in memory. Arrays are flat: `(N, E)` arrays are indexed `n * feet + e`. SI units, world frame.
#[derive(Clone, Debug)]
pub struct Plan {
    /// (N,) s.
    pub t: Vec<f64>,
    /// (N,) centre of mass, m.
    pub base_position: Vec<[f64; 3]>,
    /// (N,) body to world, w x y z.
    pub base_quaternion_wxyz: Vec<[f64; 4]>,
    /// (N,) m/s.
    pub base_linear_velocity: Vec<[f64; 3]>,
    /// (N,) m/s².
    pub base_linear_acceleration: Vec<[f64; 3]>,
    /// (N,) rad/s, world.
    pub base_angular_velocity: Vec<[f64; 3]>,
    /// (N,) rad/s², world.
    pub base_angular_acceleration: Vec<[f64; 3]>,
    /// (N·E,) m.
    pub foot_position: Vec<[f64; 3]>,
    /// (N·E,) m/s.
    pub foot_velocity: Vec<[f64; 3]>,
    /// (N·E,) m/s².
    pub foot_acceleration: Vec<[f64; 3]>,
    /// (N·E,) N, ground on robot.
    pub foot_force: Vec<[f64; 3]>,
    /// (N·E,) true in stance.
    pub foot_contact: Vec<bool>,
    /// (N·E,) unit normal of the true terrain under the foot.
    pub foot_normal: Vec<[f64; 3]>,
    /// (E,)
    pub foot_names: Vec<String>,
    /// (E,)
    pub foot_adhesive: Vec<bool>,
    /// Counterparts in F, when planned there.
    pub warped: Option<WarpedSamples>,
    /// Alternating stance and swing durations by foot, s, stance first.
    pub phase_durations: Vec<Vec<f64>>,
    /// Spline coefficients and knots by member name under `spline/`: (name, shape, values in C order).
    pub splines: Vec<NamedArray>,
    /// The ground as planned on.
    pub ground: GroundGrid,
    /// The warp map's control points, where one was used.
    pub map: Option<MapGrid>,
    /// (iterations,)
    pub history_objective: Vec<f64>,
    /// (iterations,) max norm, unscaled.
    pub history_constraint_violation: Vec<f64>,
    /// (iterations,) s since the start of the solve.
    pub history_seconds: Vec<f64>,
    /// The `meta` member.
    pub meta: Meta,
}

/// Warped-space counterparts of the samples.
#[derive(Clone, Debug)]
pub struct WarpedSamples {
    /// (N,)
    pub base_position: Vec<[f64; 3]>,
    /// (N,) ZYX Euler angles θ̄ as (roll, pitch, yaw), rad.
    pub base_euler: Vec<[f64; 3]>,
    /// (N·E,)
    pub foot_position: Vec<[f64; 3]>,
    /// (N·E,) N.
    pub foot_force: Vec<[f64; 3]>,
}

/// A raster of heights: `heightfield[row * columns + column]`, rows along y, columns along x.
#[derive(Clone, Debug)]
pub struct GroundGrid {
    /// Samples along y.
    pub rows: usize,
    /// Samples along x.
    pub columns: usize,
    /// x, y of element [0, 0], m.
    pub origin: [f64; 2],
    /// Spacing along x, y, m.
    pub spacing: [f64; 2],
    /// Heights, m.
    pub height: Vec<f64>,
    /// The same grid before smoothing, where the input was a raster or mesh.
    pub raw: Option<Vec<f64>>,
}

/// The warp map as stored.
#[derive(Clone, Debug)]
pub struct MapGrid {
    /// (Nx+3, Ny+3, Nz+3)
    pub shape: [usize; 3],
    /// (shape, 3) in C order, m.
    pub control_points: Vec<[f64; 3]>,
    /// Corner of the box in F, m.
    pub origin: [f64; 3],
    /// Knots by axis, m.
    pub knots: [Vec<f64>; 3],
}

/// The `meta` member of a plan.
#[derive(Clone, Debug, Serialize, Deserialize)]
pub struct Meta {
    /// 1.
    pub schema: u32,
    /// Version of the program.
    pub warpgait_version: String,
    /// RFC 3339.
    pub created: String,
    /// `warped` or `direct`.
    pub formulation: String,
    /// Samples a second.
    pub sample_rate_hz: f64,
    /// The whole scenario file.
    pub scenario: String,
    /// The robot as planned with.
    pub robot: MetaRobot,
    /// How the solve went.
    pub solver: MetaSolver,
    /// What the check said.
    pub checks: Vec<CheckRow>,
    /// File name → SHA-256.
    pub inputs: std::collections::BTreeMap<String, String>,
}

/// `meta.robot`.
#[derive(Clone, Debug, Serialize, Deserialize)]
pub struct MetaRobot {
    /// Name.
    pub name: String,
    /// kg.
    pub mass: f64,
    /// kg m², about the centre of mass, base frame.
    pub inertia: [[f64; 3]; 3],
    /// ν.
    pub friction: f64,
    /// m/s².
    pub gravity: [f64; 3],
    /// By foot.
    pub reach: Vec<Box3>,
    /// The torso's box.
    pub torso: Box3,
}

/// `meta.solver`.
#[derive(Clone, Debug, Serialize, Deserialize)]
pub struct MetaSolver {
    /// In words.
    pub status: String,
    /// Every constraint of the NLP holds to the tolerance.
    pub success: bool,
    /// Iterations.
    pub iterations: usize,
    /// Largest violation, units of the NLP.
    pub max_violation: f64,
    /// What solved the systems of equations inside Ipopt: `faer` or `mumps`; no text in plans of versions that knew only MUMPS.
    #[serde(default)]
    pub linear_solver: String,
    /// Where the time went.
    pub seconds: Seconds,
}

/// `meta.solver.seconds`.
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

/// One law, as checked.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
pub struct CheckRow {
    /// Which law.
    pub name: String,
    /// What was found, at its worst.
    pub value: f64,
    /// Its unit.
    pub unit: String,
    /// The largest value allowed.
    pub limit: f64,
    /// Verdict: value ≤ limit.
    pub passed: bool,
    /// When it was worst, s.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub time: Option<f64>,
    /// The foot at which it was worst.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub foot: Option<String>,
}
