//! A plan from a motion: everything at ten times the sample rate of the NLP, in ambient space.

use std::time::{SystemTime, UNIX_EPOCH};

use nalgebra::Vector3;

use super::{
    GroundGrid, JointSamples, LegSamples, Meta, MetaLimits, MetaRobot, MetaSolver, PLAN_SCHEMA, Plan,
    WarpedBase, WarpedSamples,
};
use crate::ipopt::IterationRecord;
use crate::leg::chain::ByJoint;
use crate::nlp::Model;
use crate::nlp::model::GRAVITY;
use crate::planner::{LegMotion, Motion, Seconds};
use crate::program;
use crate::scenario::{LoadedScenario, Scenario};
use crate::terrain::{Ground, Patch};
use crate::trajectory::Layout;
use crate::trajectory::sampling::{self, FootMotion};
use crate::trajectory::variables::{FootVariables, SwingVariables};
use crate::warp::WarpMap;

/// Samples of a plan within one time step.
pub const SAMPLES_A_STEP: usize = crate::planner::FINE;

/// What a plan carries besides the motion.
pub struct Provenance<'a> {
    /// The scenario with its robot and its files.
    pub loaded: &'a LoadedScenario,
    /// The ground.
    pub ground: &'a Ground,
    /// Time spent on the map, s.
    pub map_seconds: f64,
}

impl Plan {
    /// Samples a motion. `checks` are left empty.
    pub fn from_motion(motion: &Motion, provenance: &Provenance) -> Self {
        let (model, x) = (&motion.model, &motion.x);
        let (layout, spaces) = (&model.layout, &model.spaces);
        let count = layout.intervals * SAMPLES_A_STEP + 1;
        let unit = model.mass * GRAVITY;
        let mut plan = Self::empty(motion, provenance);
        let mut base_in_f = WarpedBase { position: vec![], euler: vec![] };
        let mut feet_in_f = WarpedSamples { base: None, foot_position: vec![], foot_force: vec![] };
        let mut quaternion = [1.0, 0.0, 0.0, 0.0];
        for n in 0..count {
            let k = n as f64 / SAMPLES_A_STEP as f64;
            let base = sampling::base(layout, &spaces.base, x, k);
            quaternion = base.quaternion_wxyz(quaternion);
            plan.t.push(k * layout.time_step);
            plan.base_position.push(base.position.into());
            plan.base_quaternion_wxyz.push(quaternion);
            plan.base_linear_velocity.push(base.velocity.into());
            plan.base_linear_acceleration.push(base.acceleration.into());
            plan.base_angular_velocity.push(base.angular_velocity.into());
            plan.base_angular_acceleration.push(base.angular_acceleration.into());
            let [px, py, pz, roll, pitch, yaw] = base.variables;
            base_in_f.position.push([px, py, pz]);
            base_in_f.euler.push([roll, pitch, yaw]);
            for i in 0..model.feet() {
                let foot = sampling::foot(layout, &spaces.feet, x, i, k);
                plan.foot_position.push(foot.position.into());
                plan.foot_velocity.push(foot.velocity.into());
                plan.foot_acceleration.push(foot.acceleration.into());
                plan.foot_force.push((foot.force * unit).into());
                plan.foot_contact.push(foot.contact);
                plan.foot_normal.push(normal(model, i, k, &foot));
                feet_in_f.foot_position.push(foot.warped_position.into());
                feet_in_f.foot_force.push((foot.warped_force * unit).into());
            }
        }
        feet_in_f.base = spaces.base.is_warped().then_some(base_in_f);
        plan.warped = spaces.feet.is_warped().then_some(feet_in_f);
        plan
    }

    /// Everything but the samples.
    fn empty(motion: &Motion, provenance: &Provenance) -> Self {
        let model = &motion.model;
        let history = |value: fn(&IterationRecord) -> f64| motion.history.iter().map(value).collect();
        let mut plan = Self {
            t: vec![],
            base_position: vec![],
            base_quaternion_wxyz: vec![],
            base_linear_velocity: vec![],
            base_linear_acceleration: vec![],
            base_angular_velocity: vec![],
            base_angular_acceleration: vec![],
            foot_position: vec![],
            foot_velocity: vec![],
            foot_acceleration: vec![],
            foot_force: vec![],
            foot_contact: vec![],
            foot_normal: vec![],
            foot_names: model.foot_names.clone(),
            foot_adhesive: model.adhesive.clone(),
            warped: None,
            legs: motion.legs.as_ref().map(|legs| LegSamples {
                shift: legs.shift.iter().map(|v| (*v).into()).collect(),
                angular_momentum: legs.angular_momentum.iter().map(|v| (*v).into()).collect(),
                joints: Some(joint_samples(legs)),
            }),
            phase_durations: phase_durations(&model.layout),
            swing_beyond: swing_beyond(&model.layout),
            splines: splines(motion),
            ground: ground_grid(provenance.ground),
            patches: patches(model),
            map: model.spaces.map().map(WarpMap::to_grid),
            history_objective: history(|r| r.objective),
            history_constraint_violation: history(|r| r.violation),
            history_seconds: history(|r| r.seconds),
            meta: meta(motion, provenance),
        };
        plan.meta.solver.history_sha256 = Some(plan.history_sha256());
        plan
    }
}

fn joint_samples(legs: &LegMotion) -> JointSamples {
    let joints = legs.joint_position.iter().map(ByJoint::len).max().unwrap_or(0);
    let rows = |legs: &[ByJoint<f64>]| {
        let row = |leg: &ByJoint<f64>| std::iter::repeat_n(0.0, joints - leg.len()).chain(leg.clone());
        legs.iter().flat_map(row).collect()
    };
    JointSamples { joints, position: rows(&legs.joint_position), torque: rows(&legs.joint_torque) }
}

/// The upward unit normal of the ground under a foot at time k, in samples: that of its patch in stance, that of the surface
/// which it clears in swing. Without patches there is only one surface.
fn normal(model: &Model, foot: usize, k: f64, motion: &FootMotion) -> [f64; 3] {
    let stance = model.layout.feet[foot].swings.iter().filter(|s| s.swing.end <= k).count();
    match model.patch(foot, stance).filter(|_| motion.contact) {
        Some(patch) => patch.normal(),
        None => model.surfaces.feet.normal(motion.position.x, motion.position.y),
    }
}

/// The corners of each stance's patch.
fn patches(model: &Model) -> Vec<Vec<[[f64; 3]; 4]>> {
    model.patches.iter().map(|stances| stances.iter().map(Patch::corners).collect()).collect()
}

/// By how much swings go beyond the start and the end by foot, s.
fn swing_beyond(layout: &Layout) -> Vec<[f64; 2]> {
    let of = |foot: &FootVariables| {
        let before = foot.swings.first().map_or(0.0, |s| -s.swing.start);
        let after = foot.swings.last().map_or(0.0, |s| s.swing.end - layout.intervals as f64);
        [before, after].map(|beyond| beyond.max(0.0) * layout.time_step)
    };
    layout.feet.iter().map(of).collect()
}

/// Stance and swing durations within the motion by foot, s.
fn phase_durations(layout: &Layout) -> Vec<Vec<f64>> {
    let within = |time: f64| time.clamp(0.0, layout.intervals as f64);
    let of = |foot: &FootVariables| {
        let edges = foot.stances.iter().flat_map(|s| [s.stance.start, s.stance.end]);
        let edges: Vec<f64> = edges.map(within).collect();
        edges.windows(2).map(|e| (e[1] - e[0]) * layout.time_step).collect()
    };
    layout.feet.iter().map(of).collect()
}

fn ground_grid(ground: &Ground) -> GroundGrid {
    let grid = ground.field.grid();
    GroundGrid {
        rows: grid.rows,
        columns: grid.columns,
        origin: grid.origin,
        spacing: grid.spacing,
        height: ground.field.samples().to_vec(),
        raw: ground.raw.clone(),
        unknown: ground.unknown.clone(),
    }
}

fn meta(motion: &Motion, provenance: &Provenance) -> Meta {
    let (model, loaded) = (&motion.model, provenance.loaded);
    let scenario = &loaded.scenario;
    Meta {
        schema: PLAN_SCHEMA,
        warpgait_version: env!("CARGO_PKG_VERSION").into(),
        warpgait_commit: program::commit().into(),
        created: rfc3339(SystemTime::now()),
        formulation: scenario.formulation(),
        sample_rate_hz: SAMPLES_A_STEP as f64 / model.layout.time_step,
        scenario: loaded.effective_text.clone(),
        scenario_source: loaded.source_text.clone(),
        overrides: loaded.overrides.clone(),
        robot: MetaRobot::of(loaded),
        limits: Some(limits(scenario)),
        solver: MetaSolver {
            status: motion.status.clone(),
            success: motion.solved,
            iterations: motion.iterations,
            max_violation: motion.max_violation(),
            history_sha256: None,
            linear_solver: motion.linear_solver.to_string(),
            seconds: Seconds {
                map: provenance.map_seconds,
                total: motion.seconds.total + provenance.map_seconds,
                ..motion.seconds
            },
        },
        explanation: motion.explanation.clone(),
        checks: vec![],
        inputs: loaded.inputs.iter().chain(&provenance.ground.inputs).cloned().collect(),
    }
}

impl MetaRobot {
    /// The robot of a scenario, as its plan names it.
    pub fn of(loaded: &LoadedScenario) -> Self {
        let robot = &loaded.robot;
        Self {
            name: robot.name.clone(),
            mass: robot.mass,
            inertia: robot.inertia,
            friction: loaded.scenario.contact.friction,
            gravity: [0.0, 0.0, -GRAVITY],
            reach: robot.feet.iter().map(|foot| foot.reach).collect(),
            torso: robot.torso,
            foot_radius: robot.foot_radius(),
            legs: Self::legs_of(robot, &loaded.scenario),
            sagittal: robot.sagittal_radii(),
            nominal: robot.feet.iter().map(|foot| foot.nominal).collect(),
        }
    }
}

fn limits(scenario: &Scenario) -> MetaLimits {
    let (motion, contact) = (&scenario.motion, &scenario.contact);
    MetaLimits {
        force_limit: motion.force_limit,
        pull_limit: motion.pull_limit,
        swing_clearance: motion.swing_clearance,
        base_clearance: motion.base_clearance,
        friction: contact.friction,
        friction_margin: contact.friction_margin,
    }
}

/// The variables by set, in the space they were optimized in (forces in N), with the knots of each spline.
fn splines(motion: &Motion) -> Vec<(String, Vec<usize>, Vec<f64>)> {
    let (model, x) = (&motion.model, &motion.x);
    let layout = &model.layout;
    let (step, intervals) = (layout.time_step, layout.intervals);
    let unit = model.mass * GRAVITY;
    let spline = &layout.base_spline;
    let points = spline.points();
    let base = (0..points).flat_map(|i| spline.point(i).value::<6>(x)).collect();
    // Uniform knots: control point i has the support [t_i, t_{i+4}], t_3 = 0.
    let knots = (0..points + 4).map(|i| (i as f64 - 3.0) * spline.spacing).collect();
    let mut splines = vec![
        ("base_control_points".to_string(), vec![points, 6], base),
        ("base_knots".to_string(), vec![points + 4], knots),
    ];
    for (name, foot) in model.foot_names.iter().zip(&layout.feet) {
        let footholds: Vec<f64> = foot.stances.iter().flat_map(|s| s.foothold.value::<3>(x)).collect();
        splines.push((format!("{name}_footholds"), vec![foot.stances.len(), 3], footholds));
        let free = layout.swing_shape.free();
        let points = |s: &SwingVariables| x[s.control_points..][..3 * free].to_vec();
        let swings: Vec<f64> = foot.swings.iter().flat_map(points).collect();
        splines.push((format!("{name}_swing_control_points"), vec![foot.swings.len(), free, 3], swings));
        let mut forces = vec![0.0; 3 * (intervals + 1)];
        for stance in &foot.stances {
            for (k, node) in stance.free_forces() {
                let force = Vector3::from(node.value::<3>(x)) * unit;
                forces[3 * k..3 * k + 3].copy_from_slice(force.as_slice());
            }
        }
        splines.push((format!("{name}_force_nodes"), vec![intervals + 1, 3], forces));
    }
    splines.push((
        "force_knots".to_string(),
        vec![intervals + 1],
        (0..=intervals).map(|k| k as f64 * step).collect(),
    ));
    splines
}

/// Seconds since 1970 as a date and time of day, UTC (the civil-from-days formula).
fn rfc3339(time: SystemTime) -> String {
    let seconds = time.duration_since(UNIX_EPOCH).map_or(0, |d| d.as_secs());
    let (days, rest) = (seconds / 86400, seconds % 86400);
    let z = days as i64 + 719_468;
    let era = z.div_euclid(146_097);
    let day_of_era = z.rem_euclid(146_097);
    let year_of_era = (day_of_era - day_of_era / 1460 + day_of_era / 36_524 - day_of_era / 146_096) / 365;
    let day_of_year = day_of_era - (365 * year_of_era + year_of_era / 4 - year_of_era / 100);
    let m = (5 * day_of_year + 2) / 153;
    let day = day_of_year - (153 * m + 2) / 5 + 1;
    let month = if m < 10 { m + 3 } else { m - 9 };
    let year = year_of_era + era * 400 + i64::from(month <= 2);
    format!("{year:04}-{month:02}-{day:02}T{:02}:{:02}:{:02}Z", rest / 3600, rest / 60 % 60, rest % 60)
}

#[cfg(test)]
mod tests {
    use super::*;
    use std::time::Duration;

    #[test]
    fn dates_are_right_around_leap_days() {
        let at = |s: u64| rfc3339(UNIX_EPOCH + Duration::from_secs(s));
        assert_eq!(at(0), "1970-01-01T00:00:00Z");
        assert_eq!(at(951_827_696), "2000-02-29T12:34:56Z");
        assert_eq!(at(1_709_251_199), "2024-02-29T23:59:59Z");
    }
}
