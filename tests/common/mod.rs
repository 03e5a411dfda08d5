//! Motions and hand-made plans for the tests.

pub mod files;
pub mod inputs;

use std::ops::ControlFlow;

use warpgait::heightfield::Heightfield;
use warpgait::pipeline::Prepared;
use warpgait::plan::sampled::Provenance;
use warpgait::plan::{GroundGrid, Meta, MetaRobot, MetaSolver, Plan};
use warpgait::planner::{Host, Motion, Progress, Seconds, solve};
use warpgait::robot::Box3;
use warpgait::scenario::{Formulation, Scenario, load_text};
use warpgait::warp::{self, WarpMap};

/// Never asks to stop, and builds the maps of continuations anew.
struct Patient<'a>(&'a Scenario);

impl Host for Patient<'_> {
    fn on_iteration(&mut self, _: &Progress) -> ControlFlow<()> {
        ControlFlow::Continue(())
    }

    fn build_map(&mut self, ground: &Heightfield) -> warpgait::Result<Option<WarpMap>> {
        Ok(Some(warp::build(ground, &self.0.map, &mut |_| ControlFlow::Continue(()))?.0))
    }
}

/// Solves a scenario given as text, its map made anew, and samples the motion.
pub fn solved(text: &str) -> (Motion, Plan) {
    let loaded = load_text("scenario", text, ".".as_ref(), &[]).expect("a scenario");
    let scenario = &loaded.scenario;
    let prepared = Prepared::new(&loaded, &mut |_| ControlFlow::Continue(())).expect("a ground");
    let build = || warp::build(&prepared.surfaces.posture, &scenario.map, &mut |_| ControlFlow::Continue(()));
    let map = (scenario.formulation() != Formulation::Direct).then(|| build().expect("a map").0);
    let task = prepared.task(&loaded, map.as_ref());
    let motion = solve(&task, &mut Patient(scenario)).expect("a motion");
    let provenance = Provenance { loaded: &loaded, ground: &prepared.ground, map_seconds: 0.0 };
    let plan = Plan::from_motion(&motion, &provenance);
    (motion, plan)
}

/// kg
pub const MASS: f64 = 29.5;
/// m/s²
pub const GRAVITY: f64 = 9.81;
/// Horizontal places of the feet, LF RF LH RH, m.
pub const FEET: [[f64; 2]; 4] = [[0.34, 0.19], [0.34, -0.19], [-0.34, 0.19], [-0.34, -0.19]];
/// Height of the base, m.
pub const HEIGHT: f64 = 0.42;

const SCENARIO: &str = r#"schema = 1
[robot]
name = "anymal_towr"
[terrain]
kind = "flat"
extent = [-2.0, 2.0, -1.0, 1.0]
[start]
position = [0.0, 0.0]
[goal]
position = [0.0, 0.0]
[gait]
kind = "stand"
"#;

/// A robot that stands still on flat ground for one second, 200 samples a second, its weight on four feet.
pub fn standing() -> Plan {
    let n = 201;
    let (rows, columns) = (41, 81);
    let per_sample = |point: [f64; 3]| vec![point; n];
    let per_foot = |point: [f64; 3]| vec![point; n * 4];
    Plan {
        t: (0..n).map(|i| i as f64 / 200.0).collect(),
        base_position: per_sample([0.0, 0.0, HEIGHT]),
        base_quaternion_wxyz: vec![[1.0, 0.0, 0.0, 0.0]; n],
        base_linear_velocity: per_sample([0.0; 3]),
        base_linear_acceleration: per_sample([0.0; 3]),
        base_angular_velocity: per_sample([0.0; 3]),
        base_angular_acceleration: per_sample([0.0; 3]),
        foot_position: (0..n).flat_map(|_| FEET.map(|[x, y]| [x, y, 0.0])).collect(),
        foot_velocity: per_foot([0.0; 3]),
        foot_acceleration: per_foot([0.0; 3]),
        foot_force: per_foot([0.0, 0.0, MASS * GRAVITY / 4.0]),
        foot_contact: vec![true; n * 4],
        foot_normal: per_foot([0.0, 0.0, 1.0]),
        foot_names: ["LF", "RF", "LH", "RH"].map(String::from).to_vec(),
        foot_adhesive: vec![false; 4],
        warped: None,
        phase_durations: vec![vec![1.0]; 4],
        splines: vec![("base_position".into(), vec![2, 3], vec![0.0, 0.0, HEIGHT, 0.0, 0.0, HEIGHT])],
        ground: GroundGrid {
            rows,
            columns,
            origin: [-2.0, -1.0],
            spacing: [0.05, 0.05],
            height: vec![0.0; rows * columns],
            raw: None,
        },
        patches: Vec::new(),
        map: None,
        history_objective: vec![1.0, 0.5, 0.25],
        history_constraint_violation: vec![1.0, 1e-2, 1e-6],
        history_seconds: vec![0.1, 0.2, 0.3],
        meta: Meta {
            schema: 1,
            warpgait_version: "0.1.0".into(),
            created: "2024-01-01T00:00:00Z".into(),
            formulation: Formulation::Direct,
            sample_rate_hz: 200.0,
            scenario_source: String::new(),
            overrides: Vec::new(),
            scenario: SCENARIO.into(),
            robot: MetaRobot {
                name: "anymal_towr".into(),
                mass: MASS,
                inertia: [[0.946, 0.0, 0.0], [0.0, 1.945, 0.0], [0.0, 0.0, 2.018]],
                friction: 0.75,
                gravity: [0.0, 0.0, -GRAVITY],
                reach: FEET
                    .map(|[x, y]| Box3 { center: [x, y, -0.42], half_size: [0.15, 0.10, 0.10] })
                    .to_vec(),
                torso: Box3 { center: [0.0; 3], half_size: [0.32, 0.14, 0.10] },
                foot_radius: 0.03,
            },
            limits: None,
            solver: MetaSolver {
                status: "solved".into(),
                success: true,
                iterations: 3,
                max_violation: 1e-6,
                linear_solver: "faer".into(),
                seconds: Seconds { total: 0.3, ..Default::default() },
            },
            checks: Vec::new(),
            inputs: Default::default(),
        },
    }
}

/// The standing robot that shifts its weight onto RF and LH, lifts LF by `height` m for half a second, and stands again.
pub fn lifting(height: f64) -> Plan {
    let mut plan = standing();
    let quarter = MASS * GRAVITY / 4.0;
    for n in 0..plan.t.len() {
        // 1 on four feet, 0 on two; smooth from 10 to 50 and back from 150 to 190.
        let ramp = |from: usize| ((n as f64 - from as f64) / 40.0).clamp(0.0, 1.0);
        let smooth = |s: f64| s * s * (3.0 - 2.0 * s);
        let share = 1.0 - smooth(ramp(10)) + smooth(ramp(150));
        for (foot, force) in [share, 2.0 - share, 2.0 - share, share].into_iter().enumerate() {
            plan.foot_force[4 * n + foot] = [0.0, 0.0, quarter * force];
        }
        if n > 50 && n < 150 {
            let rate = std::f64::consts::PI / 0.5;
            let phase = rate * (plan.t[n] - 0.25);
            plan.foot_contact[4 * n] = false;
            plan.foot_position[4 * n][2] = height * phase.sin().powi(2);
            plan.foot_velocity[4 * n][2] = height * rate * (2.0 * phase).sin();
            plan.foot_acceleration[4 * n][2] = 2.0 * height * rate * rate * (2.0 * phase).cos();
        }
    }
    plan.phase_durations[0] = vec![0.25, 0.5, 0.25];
    plan
}

/// The standing robot on ground that rises by `slope` along x.
pub fn on_slope(slope: f64) -> Plan {
    let mut plan = standing();
    for (i, h) in plan.ground.height.iter_mut().enumerate() {
        *h = slope * (-2.0 + 0.05 * (i % plan.ground.columns) as f64);
    }
    let length = slope.hypot(1.0);
    plan.foot_normal.fill([-slope / length, 0.0, 1.0 / length]);
    for point in &mut plan.foot_position {
        point[2] = slope * point[0];
    }
    plan
}

/// Adds a line to a section of the plan's scenario, which must not be there yet.
pub fn ask(plan: &mut Plan, section: &str, line: &str) {
    plan.meta.scenario.push_str(&format!("[{section}]\n{line}\n"));
}
