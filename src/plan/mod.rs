//! The plan: the result, sampled in ambient space and as exact splines (`NAME.plan.npz`, schema 1).

pub mod exact;
mod read;
pub mod sampled;
mod write;

pub use read::PLAN_SCHEMA;

use serde::{Deserialize, Deserializer, Serialize};

use crate::digest::sha256_hex;
use crate::heightfield::Grid;
use crate::leg::LegSpec;
use crate::planner::{Explanation, Seconds};
use crate::robot::{Box3, Robot};
use crate::scenario::{Formulation, Legs, Scenario};
use crate::warp::MapGrid;

/// Name, shape, values in C order.
pub type NamedArray = (String, Vec<usize>, Vec<f64>);

/// A plan in memory. Arrays are flat: `(N, E)` arrays are indexed `n * feet + e`. SI units, world frame.
#[derive(Clone, Debug)]
pub struct Plan {
    /// (N,) s.
    pub t: Vec<f64>,
    /// (N,) center of mass, m.
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
    /// What follows from the legs' mass, where they have one.
    pub legs: Option<LegSamples>,
    /// Counterparts in F, when planned there.
    pub warped: Option<WarpedSamples>,
    /// Alternating stance and swing durations within the plan by foot, s, stance first; a foot that begins or ends in the air has a stance
    /// without duration there.
    pub phase_durations: Vec<Vec<f64>>,
    /// By foot, s: for how long the first swing lasted before the start, and the last one goes on after the end; zero where the foot stands.
    pub swing_beyond: Vec<[f64; 2]>,
    /// Spline coefficients and knots by member name under `spline/`: (name, shape, values in C order).
    pub splines: Vec<NamedArray>,
    /// The ground as planned on.
    pub ground: GroundGrid,
    /// `patches[foot][stance]`: the corners, in order around a rectangle of a plane, m, within which each foothold lies; empty where
    /// feet may stand anywhere.
    pub patches: Vec<Vec<[[f64; 3]; 4]>>,
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

impl Plan {
    /// Start and end of each phase of a foot, s, stance and swing in turn, stance first. Swings over the start or the end are whole; the stance
    /// beyond them has no duration.
    pub fn phases(&self, foot: usize) -> Vec<[f64; 2]> {
        let (durations, [before, after]) = (&self.phase_durations[foot], self.swing_beyond[foot]);
        let mut time = 0.0;
        let mut edges = vec![0.0];
        edges.extend(durations.iter().map(|duration| {
            time += duration;
            time
        }));
        let last = edges.len() - 1;
        if before > 0.0 {
            edges[..2.min(last + 1)].fill(-before);
        }
        if after > 0.0 {
            edges[last.saturating_sub(1)..].fill(time + after);
        }
        edges.windows(2).map(|pair| [pair[0], pair[1]]).collect()
    }

    /// Lift-off and touch-down of the swing of a foot around a time, s.
    pub fn swing_at(&self, foot: usize, time: f64) -> Option<[f64; 2]> {
        let mut swings = self.phases(foot).into_iter().skip(1).step_by(2);
        swings.find(|[start, end]| (*start..=*end).contains(&time))
    }

    /// SHA-256 (hexadecimal) of the history and the largest violation, as in `meta.solver`.
    pub fn history_sha256(&self) -> String {
        let columns = [&self.history_objective, &self.history_constraint_violation, &self.history_seconds];
        let result = &self.meta.solver.max_violation;
        let values = columns.into_iter().flatten().chain(std::iter::once(result));
        let bytes: Vec<u8> = values.flat_map(|value| value.to_le_bytes()).collect();
        sha256_hex(bytes)
    }
}

/// What follows from the legs' mass.
#[derive(Clone, Debug)]
pub struct LegSamples {
    /// (N,) the center of mass from where it is in the trunk at the nominal stance; base frame, m.
    pub shift: Vec<[f64; 3]>,
    /// (N,) of the whole robot about its center of mass; world frame, kg m²/s.
    pub angular_momentum: Vec<[f64; 3]>,
    /// Of the joints; none in plans of versions that did not write them.
    pub joints: Option<JointSamples>,
}

/// The joints of the legs, from the base down.
#[derive(Clone, Debug)]
pub struct JointSamples {
    /// J: joints of the leg with the most of them, at least 3. The joints of a leg with fewer are the last ones of a row.
    pub joints: usize,
    /// (N·E·J,) rad.
    pub position: Vec<f64>,
    /// (N·E·J,) of the motors, N m.
    pub torque: Vec<f64>,
}

/// Warped-space counterparts of the samples.
#[derive(Clone, Debug)]
pub struct WarpedSamples {
    /// Those of the base, where it was planned in F.
    pub base: Option<WarpedBase>,
    /// (N·E,)
    pub foot_position: Vec<[f64; 3]>,
    /// (N·E,) N.
    pub foot_force: Vec<[f64; 3]>,
}

/// Warped-space counterparts of the base's samples.
#[derive(Clone, Debug)]
pub struct WarpedBase {
    /// (N,)
    pub position: Vec<[f64; 3]>,
    /// (N,) ZYX Euler angles θ̄ as (roll, pitch, yaw), rad.
    pub euler: Vec<[f64; 3]>,
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
    /// Heights, m. Between the samples a C² spline; bilinear where the plan has patches, because the ground then has edges.
    pub height: Vec<f64>,
    /// The same grid before smoothing, where the input was a raster.
    pub raw: Option<Vec<f64>>,
    /// The same grid: where nothing was measured and the heights are a guess; none if there is no such place.
    pub unknown: Option<Vec<bool>>,
}

impl GroundGrid {
    /// Where the samples are.
    pub fn grid(&self) -> Grid {
        Grid { origin: self.origin, spacing: self.spacing, columns: self.columns, rows: self.rows }
    }
}

/// The `meta` member of a plan.
#[derive(Clone, Debug, Serialize, Deserialize)]
pub struct Meta {
    /// 1.
    pub schema: u32,
    /// Version of the program.
    pub warpgait_version: String,
    /// The commit that the program was built from, `-dirty` if it had other changes, or `unknown`; empty in plans of version 0.1.0 and
    /// before.
    #[serde(default)]
    pub warpgait_commit: String,
    /// RFC 3339.
    pub created: String,
    /// The space of the variables.
    pub formulation: Formulation,
    /// Samples per second.
    pub sample_rate_hz: f64,
    /// The whole scenario, overrides included, as TOML.
    pub scenario: String,
    /// The scenario as the user wrote it; empty in plans of version 0.1.0 and before.
    #[serde(default)]
    pub scenario_source: String,
    /// Values set from the command line or from Python, each `key=value`.
    #[serde(default)]
    pub overrides: Vec<String>,
    /// The robot as planned with.
    pub robot: MetaRobot,
    /// The limits as planned with; missing in plans of version 0.1.0 and before.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub limits: Option<MetaLimits>,
    /// How the solve went.
    pub solver: MetaSolver,
    /// Why no motion was found, where that is known.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub explanation: Option<Explanation>,
    /// The results of the check.
    pub checks: Vec<CheckRow>,
    /// File name → SHA-256.
    pub inputs: std::collections::BTreeMap<String, String>,
}

/// `meta.robot`.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
pub struct MetaRobot {
    /// Name.
    pub name: String,
    /// kg.
    pub mass: f64,
    /// kg m², about the center of mass, base frame.
    pub inertia: [[f64; 3]; 3],
    /// ν.
    pub friction: f64,
    /// m/s².
    pub gravity: [f64; 3],
    /// By foot.
    pub reach: Vec<Box3>,
    /// The torso's box.
    pub torso: Box3,
    /// Radius of a foot, m; 0 in plans of version 0.1.0 and before.
    #[serde(default)]
    pub foot_radius: f64,
    /// The legs by foot, with the masses of their links; empty where the plan has massless legs.
    #[serde(default, skip_serializing_if = "Vec::is_empty")]
    pub legs: Vec<LegSpec>,
    /// By foot, its radius, m, if it moves in a plane of the base, as those of legs of two joints do; empty where none does.
    #[serde(default, skip_serializing_if = "Vec::is_empty")]
    pub sagittal: Vec<Option<f64>>,
    /// The nominal places of the feet, base frame, m; empty in plans of version 0.1.0 and before.
    #[serde(default, skip_serializing_if = "Vec::is_empty")]
    pub nominal: Vec<[f64; 3]>,
}

impl MetaRobot {
    /// Mean height of the nominal places of the feet below the center of mass, m; none in plans of version 0.1.0 and before.
    pub fn standing_height(&self) -> Option<f64> {
        let sum: f64 = self.nominal.iter().map(|foot| -foot[2]).sum();
        (!self.nominal.is_empty()).then(|| sum / self.nominal.len() as f64)
    }

    /// [`Self::legs`] of a robot in a scenario.
    pub fn legs_of(robot: &Robot, scenario: &Scenario) -> Vec<LegSpec> {
        if scenario.legs() == Legs::Massless || robot.body().is_none() {
            return Vec::new();
        }
        robot.feet.iter().filter_map(|foot| foot.leg.clone()).collect()
    }
}

/// `meta.limits`: what the scenario sets, defaults included.
#[derive(Clone, Copy, Debug, PartialEq, Serialize, Deserialize)]
pub struct MetaLimits {
    /// Largest normal force of a foot, in m g.
    pub force_limit: f64,
    /// Largest pull of an adhesive foot, in m g.
    pub pull_limit: f64,
    /// Least apex of a swing above the ground, m.
    pub swing_clearance: f64,
    /// Least distance of the torso's underside from the ground, m.
    pub base_clearance: f64,
    /// Friction coefficient ν.
    pub friction: f64,
    /// Fraction of ν that the plan leaves unused.
    pub friction_margin: f64,
}

/// `meta.solver`.
#[derive(Clone, Debug, Serialize, Deserialize)]
pub struct MetaSolver {
    /// How the solve ended, in words.
    pub status: String,
    /// Every constraint of the NLP holds to the tolerance.
    pub success: bool,
    /// Iterations.
    pub iterations: usize,
    /// Largest violation, units of the NLP; NaN (in the file: null) where it was not finite.
    #[serde(deserialize_with = "number_or_nan")]
    pub max_violation: f64,
    /// SHA-256 (hexadecimal) of the elements of `history_objective`, `history_constraint_violation` and `history_seconds`, and of
    /// `max_violation`, in this order; none in plans of older versions.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub history_sha256: Option<String>,
    /// What solved the systems of equations inside Ipopt: `faer` or `mumps`; no text in plans of versions that knew only MUMPS.
    #[serde(default)]
    pub linear_solver: String,
    /// Where the time went.
    pub seconds: Seconds,
}

/// One law, as checked.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
pub struct CheckRow {
    /// Which law.
    pub name: String,
    /// Its worst value; NaN (in the file: null) where the law cannot be evaluated.
    #[serde(deserialize_with = "number_or_nan")]
    pub value: f64,
    /// Its unit.
    pub unit: String,
    /// The largest allowed value.
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

/// A number; NaN for null, as which JSON has numbers that are not finite.
fn number_or_nan<'de, D: Deserializer<'de>>(deserializer: D) -> Result<f64, D::Error> {
    Ok(Option::deserialize(deserializer)?.unwrap_or(f64::NAN))
}

#[cfg(test)]
mod tests {
    use super::CheckRow;

    #[test]
    fn a_law_that_could_not_be_evaluated_is_read_again() {
        let row = CheckRow {
            name: "reach".into(),
            value: f64::NAN,
            unit: "mm".into(),
            limit: 1.0,
            passed: false,
            time: None,
            foot: None,
        };
        let text = serde_json::to_string(&row).expect("JSON");
        let read: CheckRow = serde_json::from_str(&text).expect("what was written");
        assert!(read.value.is_nan() && !read.passed, "{text}");
    }
}
