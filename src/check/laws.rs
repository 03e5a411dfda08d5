//! The laws that are checked: name, unit, limit, meaning.

use std::collections::BTreeMap;
use std::path::Path;

use crate::Result;
use crate::input::{Document, closest};
use crate::plan::MetaRobot;

/// One law.
#[derive(Debug, PartialEq)]
pub struct CheckedLaw {
    /// As in `checks` of a plan and in a file of limits.
    pub name: &'static str,
    /// Unit of its value.
    pub unit: &'static str,
    /// Largest value allowed by default for a robot of ANYmal's size; none if it is only reported.
    pub limit: Option<f64>,
    /// Limit under `--strict`, where that differs.
    pub strict: Option<f64>,
    /// What it means.
    pub meaning: &'static str,
}

macro_rules! laws {
    ($($constant:ident = $name:literal, $unit:literal, $limit:expr, $strict:expr, $meaning:literal;)*) => {
        $(pub(super) const $constant: &CheckedLaw =
            &CheckedLaw { name: $name, unit: $unit, limit: $limit, strict: $strict, meaning: $meaning };)*
        /// All laws, in the order of the report.
        pub const LAWS: &[&CheckedLaw] = &[$($constant),*];
    };
}

laws! {
    SOLVED = "solved", "1", Some(0.0), None, "0 if, according to the plan, every constraint of the NLP holds; else 1";
    CLAIMS = "claims", "1", Some(0.0), None,
        "number of statements on robot, limits, feet and formulation that differ from what the scenario asks for";
    MAGNITUDE = "magnitude", "1", Some(1e9), None, "the largest number in any member, the history aside";
    HISTORY = "history", "1", Some(1e-3), None,
        "a row of the history has the violation of the result, its times increase up to the total, and it is as it was written";
    HORIZON = "horizon", "s", Some(1e-6), None, "difference of the duration, and of that of all phases of a foot, from horizon";
    TERRAIN = "terrain", "mm", Some(1.0), None,
        "difference of the ground from the scenario's terrain, where that is a function";
    SMOOTHING = "smoothing", "mm", Some(1.0), None,
        "how far the ground of a heightmap leaves the range of the raw heights within reach of terrain.smoothing";
    SPLINE_BASE = "spline_base", "mm", Some(1e-3), None, "distance of the base's samples from its spline";
    SPLINE_TURN = "spline_turn", "mrad", Some(1e-3), None, "difference of the base's orientations from its spline";
    SPLINE_FEET = "spline_feet", "mm", Some(1e-3), None, "distance of the feet's samples from their footholds and splines";
    SPLINE_FORCES = "spline_forces", "% m g", Some(1e-3), None, "difference of the forces' samples from their nodes";
    PHASES = "phases", "1", Some(0.0), None, "foot_contact is as phase_durations have it";
    MAP = "map", "mm", Some(1e-3), None, "distance of positions from those that the map makes of their warped ones";
    MAP_FORCES = "map_forces", "% m g", Some(1e-3), None, "the same for forces";
    MAP_TURN = "map_turn", "mrad", Some(1e-2), None, "the same for the base's orientation";
    NEWTON_RMS = "newton_rms", "% m g", Some(0.5), None, "Newton's law, m p̈ = Σf + m g, root mean square";
    NEWTON_MAX = "newton_max", "% m g", Some(3.0), None, "Newton's law, worst sample";
    EULER_RMS = "euler_rms", "% m g·0.3 m", Some(0.5), None, "Euler's law about the center of mass, for the whole robot if its legs have mass; root mean square";
    EULER_MAX = "euler_max", "% m g·0.3 m", Some(3.0), None, "Euler's law, worst sample";
    SHIFT = "center_of_mass_shift", "mm", Some(0.5), None,
        "difference of the shift of the center of mass from that of the postures, by inverse kinematics";
    MOMENTUM = "angular_momentum", "% m g·0.3 m·s", Some(0.1), None,
        "difference of the angular momentum from that of trunk and legs, by inverse kinematics";
    JOINT_POSITION = "joint_position", "mrad", Some(1.0), None, "difference of the joint angles from inverse kinematics";
    JOINT_TORQUE = "joint_torque", "% of limit", Some(0.5), None, "difference of the motors' torques from inverse dynamics of the legs";
    JOINT_RANGE = "joint_range", "mrad", Some(1.0), None, "a joint beyond its range, by inverse kinematics";
    JOINT_SPEED_LIMIT = "joint_speed_limit", "% of limit", Some(100.0), None, "speed of a joint, by inverse kinematics";
    JOINT_TORQUE_LIMIT = "joint_torque_limit", "% of limit", Some(100.0), None, "torque of a motor, by inverse dynamics of the legs";
    LINEAR_CONSISTENCY = "linear_consistency", "% g", Some(0.1), None,
        "base velocity and acceleration are the derivatives of the position, root mean square";
    LINEAR_CONSISTENCY_MAX = "linear_consistency_max", "% g", Some(1.0), None, "the same, worst sample";
    ANGULAR_CONSISTENCY = "angular_consistency", "rad/s²", Some(0.1), None,
        "angular velocity and acceleration are the derivatives of the orientation, root mean square";
    ANGULAR_CONSISTENCY_MAX = "angular_consistency_max", "rad/s²", Some(2.0), None, "the same, worst sample";
    FOOT_VELOCITY = "foot_velocity", "m/s", Some(0.01), None, "foot velocity is the derivative of the position";
    FOOT_ACCELERATION = "foot_acceleration", "m/s²", Some(2.0), None,
        "foot acceleration is the derivative of the velocity; it may jump at lift-off and touch-down";
    STANCE_MOTION = "stance_motion", "m/s", Some(1e-6), None,
        "a standing foot has no velocity, and no acceleration over 0.1 s";
    REST = "rest", "m/s", Some(1e-6), None,
        "at both ends the base has no velocity, and no acceleration over 0.1 s (rotations: times 0.3 m), and all feet stand, but for those that gait.phases or start.state.swings have in the air (1 otherwise)";
    QUATERNION = "quaternion", "1", Some(1e-6), None, "quaternions have unit length and keep their sign";
    STANCE_GAP = "stance_gap", "mm", Some(1.0), None, "a standing foot is on the ground";
    STANCE_SLIP = "stance_slip", "mm", Some(0.1), None, "a standing foot does not move";
    SWING_PENETRATION = "swing_penetration", "mm", Some(0.1), None,
        "a swinging foot stays above the ground (allowance for rounding: 0.1 mm)";
    SWING_APEX = "swing_apex_shortfall", "mm", Some(0.2), None,
        "a swing rises to motion.swing_clearance (allowance for the sampling: 0.2 mm)";
    NORMAL = "normal", "°", Some(0.5), None, "the plan's normals are those of its terrain";
    FRICTION = "friction", "% m g", Some(0.5), None, "force beyond the friction cone, true normals, not for adhesive feet";
    SHEAR = "shear", "% m g", Some(0.5), None,
        "tangential force of an adhesive foot beyond friction times normal force plus motion.pull_limit";
    PULL = "pull", "% m g", Some(0.05), None, "pull of a foot that is not adhesive (allowance for rounding: 0.05 %)";
    FORCE_LIMIT = "force_limit", "% m g", Some(0.5), None, "normal force beyond motion.force_limit";
    PULL_LIMIT = "pull_limit", "% m g", Some(0.5), None, "pull of an adhesive foot beyond motion.pull_limit";
    SWING_FORCE = "swing_force", "% m g", Some(1e-4), None, "a swinging foot exerts no force";
    REACH = "reach", "mm", Some(1.0), None, "distance of a foot beyond its reach box";
    BASE_CLEARANCE = "base_clearance_shortfall", "mm", Some(0.2), None,
        "the torso's underside keeps motion.base_clearance from the ground (allowance: 0.2 mm)";
    FOOTHOLD_SLOPE = "foothold_slope", "1", Some(0.01), None, "slope of a foothold beyond contact.max_slope";
    INSIDE = "inside", "mm", Some(0.0), None, "distance of a standing foot beyond the edge of the terrain";
    KEEP_OUT = "keep_out", "mm", Some(0.0), None, "how deep the middle of a standing foot is inside a polygon of [[keep_out]]";
    PATCH = "patch", "mm", Some(1.0), None, "distance of a standing foot beyond the sides of its patch";
    PATCH_COUNT = "patch_count", "1", Some(0.0), None, "every stance has a patch";
    PATCH_ROUGHNESS = "patch_roughness", "mm", Some(15.0), None,
        "difference of the raw ground under a standing foot from the plane of its patch";
    PATCH_OFFSET = "patch_offset", "mm", Some(8.0), None,
        "mean difference of the raw ground under a standing foot from the plane of its patch";
    SWING_EDGE = "swing_edge", "mm", Some(0.1), None,
        "a swinging foot, as a ball, stays above raw ground with edges, or is no deeper in it than next to it, where it stands \
         (allowance for rounding: 0.1 mm)";
    UNKNOWN_GROUND = "unknown_ground", "1", Some(0.0), None,
        "footholds where the scan has no data (contact.on_known_ground)";
    GROUND_MOVED = "ground_moved", "mm", Some(15.0), None,
        "how far smoothing moved the ground under a foothold, which may be anywhere";
    START = "start", "mm", Some(1.0), None, "distance from start.position at the beginning";
    START_STATE = "start_state", "mm", Some(1.0), None, "distance of the base's height and of the feet from start.state at the beginning";
    START_FEET = "start_feet", "m/s", Some(1e-3), None, "difference of the velocities of feet in the air from start.state.feet_velocity at the beginning";
    START_TURN = "start_turn", "rad", Some(1e-3), None, "difference of the orientation from start.state.tilt and the heading at the beginning";
    START_FORCE = "start_force", "% m g", Some(0.5), None, "difference of the forces from start.state.forces at the beginning";
    START_YAW = "start_yaw", "rad", Some(1e-3), None, "difference from start.yaw, or the way to the first way-point or the goal, at the beginning";
    CYCLE = "cycle", "mm", Some(1.0), None,
        "of a cyclic motion: distance of base and feet at the end from where they are at the start, shifted and turned (no limit is met if a foot stands at one end only)";
    CYCLE_TURN = "cycle_turn", "rad", Some(1e-3), None, "of a cyclic motion: difference of the orientation at the end from that at the start, turned";
    CYCLE_MOTION = "cycle_motion", "m/s", Some(1e-3), None,
        "of a cyclic motion: differences of the velocities of base and feet, and of accelerations of the base over 0.1 s (rotations: times 0.3 m), at the end from those at the start, turned";
    CYCLE_FORCE = "cycle_force", "% m g", Some(0.5), None, "of a cyclic motion: difference of the forces at the end from those at the start, turned";
    GOAL = "goal", "mm", Some(1.0), None, "distance from goal.position at the end";
    GOAL_YAW = "goal_yaw", "rad", Some(1e-3), None, "difference from goal.yaw at the end, where given, and from goal.turns on the way there";
    WAYPOINT = "waypoint", "mm", Some(1.0), None,
        "distance from way-points at their times, and beyond goal.waypoint_distance from those without, in order, and from the points of a circle";
    WAYPOINT_YAW = "waypoint_yaw", "rad", Some(1e-3), None, "difference from the yaw of way-points at their times";
    HEIGHT = "height", "mm", Some(1.0), None,
        "difference from goal.height at the end, and from the height of way-points at their times, over the mean of the feet";
    POSTURE_HEIGHT = "posture_height", "mm", Some(1.0), None, "height over the mean of the feet beyond posture.height";
    POSTURE_TILT = "posture_tilt", "rad", Some(2e-3), None, "roll or pitch beyond posture.roll and posture.pitch";
    FIXED_FOOTHOLD = "fixed_foothold", "mm", Some(1.0), None, "distance of footholds from those that the scenario gives";
    BASE_JUMP = "base_jump", "mm", Some(0.5), None, "the base position has no jumps";
    FOOT_JUMP = "foot_jump", "mm", Some(0.5), None, "the foot positions have no jumps";
    FORCE_JUMP = "force_jump", "% m g", Some(3.0), None, "the forces have no jumps, not even at lift-off and touch-down";
    BASE_ACCELERATION = "base_acceleration_rms", "m/s²", None, Some(1.5), "acceleration of the base, root mean square";
    ANGULAR_SPEED = "angular_speed_max", "rad/s", None, Some(1.0), "largest angular speed of the base";
    FORCE_RATE = "force_rate_rms", "m g/s", None, None, "rate of change of the forces, root mean square";
    LEAST_APEX = "swing_apex_least", "mm", None, None, "the lowest apex of a swing above the ground";
    UNKNOWN_STANCES = "unknown_stances", "1", None, None,
        "footholds where the scan has no data, without contact.on_known_ground";
    LEAST_CLEARANCE = "base_clearance_least", "mm", None, None, "least distance of the torso's underside from the ground";
}

/// Limits that are for robots as tall as ANYmal: torques and lengths are compared with the robot's height. The allowances for rounding and
/// sampling, and for what a sample tells of a derivative, are the same for all robots.
const BY_HEIGHT: [&CheckedLaw; 16] = [
    EULER_RMS,
    EULER_MAX,
    SHIFT,
    MOMENTUM,
    STANCE_GAP,
    REACH,
    PATCH,
    GROUND_MOVED,
    START,
    START_STATE,
    CYCLE,
    GOAL,
    WAYPOINT,
    HEIGHT,
    POSTURE_HEIGHT,
    FIXED_FOOTHOLD,
];
/// Speeds, which are compared with √(g h).
const BY_SPEED: [&CheckedLaw; 2] = [START_FEET, CYCLE_MOTION];
/// Limits that are for ANYmal's feet: the ground under a foot is compared with the foot.
const BY_FOOT: [&CheckedLaw; 2] = [PATCH_ROUGHNESS, PATCH_OFFSET];
/// Standing height and radius of the feet for which they are, m.
const ANYMAL_HEIGHT: f64 = 0.42;
const ANYMAL_FOOT: f64 = 0.03;

/// Which part of a law's default limit holds for a robot. It is smaller for smaller robots, and not larger for larger ones.
fn part(law: &CheckedLaw, robot: &MetaRobot) -> f64 {
    let is_in = |laws: &[&CheckedLaw]| laws.iter().any(|known| known.name == law.name);
    let height = || robot.standing_height().map_or(1.0, |height| height / ANYMAL_HEIGHT);
    let part = if is_in(&BY_HEIGHT) {
        height()
    } else if is_in(&BY_SPEED) {
        height().max(0.0).sqrt()
    } else if is_in(&BY_FOOT) {
        robot.foot_radius / ANYMAL_FOOT
    } else {
        1.0
    };
    part.clamp(0.0, 1.0)
}

/// The limits in force.
#[derive(Clone, Debug, Default)]
pub struct CheckLimits {
    strict: bool,
    changed: BTreeMap<String, f64>,
}

impl CheckLimits {
    /// The default limits; with `strict`, limits on the base's acceleration and angular speed as well.
    pub fn new(strict: bool) -> Self {
        Self { strict, changed: BTreeMap::new() }
    }

    /// Reads `name = limit` from a TOML file; laws that it does not name keep their limit.
    pub fn read(mut self, path: &Path) -> Result<Self> {
        let (document, _) = Document::read(path)?;
        for (name, value) in document.table() {
            let names: Vec<&str> = LAWS.iter().map(|law| law.name).collect();
            if !names.contains(&name.as_str()) {
                let guess = closest(name, &names).map_or(String::new(), |n| format!("did you mean `{n}`? "));
                let what = format!("no such law; {guess}allowed: {}", names.join(", "));
                return Err(document.error(name, what));
            }
            let limit = value.as_float().or(value.as_integer().map(|n| n as f64));
            match limit.filter(|limit| limit.is_finite() && *limit >= 0.0) {
                Some(limit) => self.changed.insert(name.clone(), limit),
                None => {
                    let what = format!("given {value}, allowed: a finite number of at least 0");
                    return Err(document.error(name, what));
                }
            };
        }
        Ok(self)
    }

    /// The limit of a law for a robot, if it has one. One that was read from a file is as given.
    pub(super) fn of(&self, law: &CheckedLaw, robot: &MetaRobot) -> Option<f64> {
        let strict = if self.strict { law.strict } else { None };
        let usual = strict.or(law.limit).map(|limit| part(law, robot) * limit);
        self.changed.get(law.name).copied().or(usual)
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::scenario::load_text;

    fn limit(robot: &str, law: &CheckedLaw) -> f64 {
        let text = format!(
            "[robot]\nname = \"{robot}\"\n[terrain]\nkind = \"flat\"\n[start]\nposition = [0.0, 0.0]\n[goal]\nposition = [0.2, 0.0]\n"
        );
        let loaded = load_text("s.toml", &text, ".".as_ref(), &[]).expect("a scenario");
        CheckLimits::default().of(law, &MetaRobot::of(&loaded)).expect("a limit")
    }

    #[test]
    fn lengths_and_speeds_go_by_the_height_of_smaller_robots() {
        let height = 0.1904 / ANYMAL_HEIGHT;
        for (law, part) in [
            (STANCE_GAP, height),
            (REACH, height),
            (START_FEET, height.sqrt()),
            (FOOT_JUMP, 1.0),
            (SWING_PENETRATION, 1.0),
            (NEWTON_MAX, 1.0),
        ] {
            let usual = law.limit.expect("a limit");
            assert!((limit("solo12", law) - part * usual).abs() < 1e-9, "{}", law.name);
            for robot in ["anymal_b", "anymal_c", "anymal_towr", "b1", "hyq"] {
                assert_eq!(limit(robot, law), usual, "{robot}: {}", law.name);
            }
        }
    }
}
