//! Motions and hand-made plans for the tests.

pub mod chains;
pub mod files;
pub mod inputs;

use std::ops::ControlFlow;
use std::path::Path;

use warpgait::heightfield::Heightfield;
use warpgait::pipeline::Prepared;
use warpgait::plan::sampled::Provenance;
use warpgait::plan::{GroundGrid, Meta, MetaRobot, MetaSolver, Plan};
use warpgait::planner::{Host, Motion, Progress, Seconds, attempt, explain};
use warpgait::robot::{Robot, RobotSpec};
use warpgait::scenario::{Formulation, Scenario, load_text};
use warpgait::trajectory::spline::{SwingShape, swing_basis};
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
    solved_in(".".as_ref(), text)
}

/// The same with terrain files in a folder.
pub fn solved_in(folder: &Path, text: &str) -> (Motion, Plan) {
    let loaded = load_text("scenario", text, folder, &[]).expect("a scenario");
    let scenario = &loaded.scenario;
    let prepared = Prepared::new(&loaded, &mut |_| ControlFlow::Continue(())).expect("a ground");
    let build = || warp::build(&prepared.surfaces.posture, &scenario.map, &mut |_| ControlFlow::Continue(()));
    let map = (scenario.formulation() != Formulation::Direct).then(|| build().expect("a map").0);
    let task = prepared.task(&loaded, map.as_ref());
    let mut motion = attempt(&task, &mut Patient(scenario)).expect("a motion");
    explain(&task, &mut Patient(scenario), &mut motion).expect("a reason");
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

/// Time between the nodes of the splines, s.
const STEP: f64 = 0.05;

const SCENARIO: &str = r#"schema = 1
formulation = "direct"
horizon = 1.0
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
    let spec = RobotSpec { name: "anymal_towr".into(), ..Default::default() };
    let robot = Robot::load(&spec, ".".as_ref()).expect("a shipped robot");
    let mut plan = Plan {
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
        legs: None,
        warped: None,
        phase_durations: vec![vec![1.0]; 4],
        swing_beyond: vec![[0.0; 2]; 4],
        splines: Vec::new(),
        ground: GroundGrid {
            rows,
            columns,
            origin: [-2.0, -1.0],
            spacing: [0.05, 0.05],
            height: vec![0.0; rows * columns],
            raw: None,
            unknown: None,
        },
        patches: Vec::new(),
        map: None,
        history_objective: vec![1.0, 0.5, 0.25],
        history_constraint_violation: vec![1.0, 1e-2, 1e-6],
        history_seconds: vec![0.1, 0.2, 0.3],
        meta: Meta {
            schema: 1,
            warpgait_version: "0.1.0".into(),
            warpgait_commit: String::new(),
            created: "2024-01-01T00:00:00Z".into(),
            formulation: Formulation::Direct,
            sample_rate_hz: 200.0,
            scenario_source: String::new(),
            overrides: Vec::new(),
            scenario: SCENARIO.into(),
            robot: MetaRobot {
                name: "anymal_towr".into(),
                mass: robot.mass,
                inertia: robot.inertia,
                friction: 0.75,
                gravity: [0.0, 0.0, -GRAVITY],
                reach: robot.feet.iter().map(|foot| foot.reach).collect(),
                torso: robot.torso,
                foot_radius: robot.foot_radius(),
                sagittal: robot.sagittal_radii(),
                legs: Vec::new(),
                nominal: robot.feet.iter().map(|foot| foot.nominal).collect(),
            },
            limits: None,
            solver: MetaSolver {
                status: "solved".into(),
                success: true,
                iterations: 3,
                max_violation: 1e-6,
                history_sha256: None,
                linear_solver: "faer".into(),
                seconds: Seconds { total: 0.3, ..Default::default() },
            },
            explanation: None,
            checks: Vec::new(),
            inputs: Default::default(),
        },
    };
    set_splines(&mut plan, 0.0);
    plan
}

/// The splines of a base that does not move, feet that stand or are lifted by `lift` m at the control points of their swings, and the
/// forces of every tenth sample.
fn set_splines(plan: &mut Plan, lift: f64) {
    let nodes = (plan.t.len() - 1) / 10 + 1;
    let [x, y, z] = plan.base_position[0];
    let points = nodes + 2;
    let row = |count: usize, value: &dyn Fn(usize) -> f64| (0..count).map(value).collect::<Vec<f64>>();
    let mut splines = vec![
        ("base_control_points".to_owned(), vec![points, 6], [x, y, z, 0.0, 0.0, 0.0].repeat(points)),
        ("base_knots".to_owned(), vec![points + 4], row(points + 4, &|i| (i as f64 - 3.0) * STEP)),
        ("force_knots".to_owned(), vec![nodes], row(nodes, &|k| k as f64 * STEP)),
    ];
    for (e, name) in plan.foot_names.iter().enumerate() {
        let [x, y, z] = plan.foot_position[e];
        let swings = plan.phase_durations[e].len() / 2;
        let footholds = [x, y, z].repeat(swings + 1);
        let lifted = [x, y, z + lift].repeat(3 * swings);
        let forces = (0..nodes).flat_map(|k| plan.foot_force[40 * k + e]).collect();
        splines.push((format!("{name}_footholds"), vec![swings + 1, 3], footholds));
        splines.push((format!("{name}_swing_control_points"), vec![swings, 3, 3], lifted));
        splines.push((format!("{name}_force_nodes"), vec![nodes, 3], forces));
    }
    // In the order in which they are read from a file.
    splines.sort_by(|a, b| a.0.cmp(&b.0));
    plan.splines = splines;
}

/// The standing robot that shifts its weight onto RF and LH, lifts LF by `height` m for half a second, and stands again.
pub fn lifting(height: f64) -> Plan {
    let mut plan = standing();
    let quarter = MASS * GRAVITY / 4.0;
    // At the middle of a swing, the three control points between the footholds have this weight.
    let lift = height / swing_basis(SwingShape::Light, 0.5)[0][1..4].iter().sum::<f64>();
    for n in 0..plan.t.len() {
        // 1 on four feet, 0 on two; between the nodes of the forces, every tenth sample, linear.
        let share = |n: usize| {
            let ramp = |from: usize| ((n as f64 - from as f64) / 40.0).clamp(0.0, 1.0);
            let smooth = |s: f64| s * s * (3.0 - 2.0 * s);
            1.0 - smooth(ramp(10)) + smooth(ramp(150))
        };
        let (node, u) = (n / 10 * 10, (n % 10) as f64 / 10.0);
        let share = (1.0 - u) * share(node) + u * share(node + 10);
        for (foot, force) in [share, 2.0 - share, 2.0 - share, share].into_iter().enumerate() {
            plan.foot_force[4 * n + foot] = [0.0, 0.0, quarter * force];
        }
        if n > 50 && n < 150 {
            let duration = 0.5;
            let [value, first, second] = swing_basis(SwingShape::Light, (plan.t[n] - 0.25) / duration)
                .map(|b| lift * b[1..4].iter().sum::<f64>());
            plan.foot_contact[4 * n] = false;
            plan.foot_position[4 * n][2] = value;
            plan.foot_velocity[4 * n][2] = first / duration;
            plan.foot_acceleration[4 * n][2] = second / (duration * duration);
        }
    }
    plan.phase_durations[0] = vec![0.25, 0.5, 0.25];
    set_splines(&mut plan, lift);
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
    let flat = "kind = \"flat\"";
    let formula = format!("kind = \"formula\"\nexpression = \"{slope} * x\"");
    assert!(plan.meta.scenario.contains(flat));
    plan.meta.scenario = plan.meta.scenario.replace(flat, &formula);
    set_splines(&mut plan, 0.0);
    plan
}

/// Adds a line to a section of the plan's scenario, which must not be there yet.
pub fn ask(plan: &mut Plan, section: &str, line: &str) {
    plan.meta.scenario.push_str(&format!("[{section}]\n{line}\n"));
}
