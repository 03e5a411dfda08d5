//! Every constraint and cost, in both formulations, on curved terrains, at random points, against central differences: first
//! and second derivatives, with NaN-poisoned buffers, and no entry missing from the patterns.

use proptest::strategy::{Strategy, ValueTree};
use proptest::test_runner::{Config, RngAlgorithm, TestRng, TestRunner};
use warpgait::ipopt::NlpProblem;
use warpgait::nlp::{Constraint, LegTerms, Tighter};
use warpgait::planner::{GaitProblem, Steps, Task, derivatives};
use warpgait::robot::Robot;
use warpgait::scenario::{Formulation, Scenario};
use warpgait::terrain::Surfaces;
use warpgait::warp::WarpMap;

use crate::common::chains;

/// Largest relative error allowed; the step of the differences is 1e-5, their own error some 1e-9.
const TOLERANCE: f64 = 1e-6;

const TERRAINS: [(&str, &str); 5] = [
    ("rippled", "kind = \"rippled\""),
    ("conic", "kind = \"conic\""),
    ("hilly", "kind = \"hilly\""),
    ("pit", "kind = \"pit\""),
    ("formula", "kind = \"formula\"\nexpression = \"0.1*sin(2*x)*cos(1.5*y) + 0.05*x*y\""),
];

/// A short motion over a terrain, with everything that can be switched on.
fn problem(terrain: &str, formulation: &str, extra: &str) -> GaitProblem {
    problem_of("anymal_towr", terrain, formulation, extra)
}

/// `robot`: a name, or a robot file.
fn problem_of(robot: &str, terrain: &str, formulation: &str, extra: &str) -> GaitProblem {
    let key = if robot.ends_with(".toml") { "file" } else { "name" };
    let text = format!(
        "schema = 1\nformulation = \"{formulation}\"\nhorizon = 2.5\n\
         [robot]\n{key} = \"{robot}\"\nadhesive_feet = [\"RF\"]\n\
         [terrain]\n{terrain}\nspacing = 0.05\nextent = [-2.0, 2.0, -2.0, 2.0]\n\
         [start]\nposition = [0.3, 0.2]\n[goal]\nposition = [0.6, 0.1]\nyaw = 0.2\n\
         [map]\nmethod = \"shear\"\ncells = [24, 24, 12]\n{extra}"
    );
    let scenario: Scenario = toml::from_str(&text).expect("a scenario");
    let robot = Robot::load(&scenario.robot, ".".as_ref()).expect("a robot");
    let ground = warpgait::terrain::build(&scenario, &robot, ".".as_ref()).expect("a ground");
    let surfaces = Surfaces::of(&scenario, &robot, &ground).expect("surfaces");
    // The shear leans with the slope, so that no block of J vanishes by symmetry; a second one bends x and y too.
    let map = bent(&WarpMap::shear(&surfaces.posture, &scenario.map).expect("a map"));
    let steps = Steps::of(&scenario, &robot, &surfaces).expect("steps");
    let map = (scenario.formulation() != Formulation::Direct).then_some(&map);
    let task = Task {
        scenario: &scenario,
        robot: &robot,
        steps: &steps,
        surfaces: &surfaces,
        guess: None,
        tighter: Tighter::default(),
        map,
    };
    task.problem().expect("a problem")
}

/// The map with its control points moved smoothly in all three coordinates.
fn bent(map: &WarpMap) -> WarpMap {
    let mut grid = map.to_grid();
    for p in &mut grid.control_points {
        let [x, y, z] = *p;
        p[0] += 0.05 * (1.3 * x + 0.7 * z).sin();
        p[1] += 0.05 * (0.9 * y - 0.8 * x).cos();
        p[2] += 0.04 * (1.1 * x + 0.6 * y + 0.5 * z).sin();
    }
    WarpMap::from_grid(&grid).expect("a map")
}

fn initial(problem: &GaitProblem) -> Vec<f64> {
    let mut x = vec![0.0; problem.num_variables()];
    problem.initial_point(&mut x);
    x
}

fn check(mut problem: GaitProblem, name: &str) {
    let start = initial(&problem);
    let rng = TestRng::deterministic_rng(RngAlgorithm::ChaCha);
    let mut runner = TestRunner::new_with_rng(Config { cases: 1, ..Config::default() }, rng);
    for _ in 0..2 {
        let noise = proptest::collection::vec(-0.03..0.03_f64, start.len())
            .new_tree(&mut runner)
            .expect("noise")
            .current();
        let mut x: Vec<f64> = start.iter().zip(&noise).map(|(x, n)| x + n).collect();
        move_switches(&problem, &noise, &mut x);
        let picks =
            proptest::collection::vec(0..start.len(), 150).new_tree(&mut runner).expect("picks").current();
        for error in derivatives::check(&mut problem, &x, &picks) {
            assert!(
                error.largest < TOLERANCE && error.missing == 0,
                "{name}, {}: relative error {:.2e} at {}, {} entries missing",
                error.block,
                error.largest,
                error.place,
                error.missing
            );
        }
    }
}

/// Switches go anywhere within their room, so that samples change phase from where the patterns were recorded; but not onto
/// samples, where a foot sets off with a jump of its acceleration.
fn move_switches(problem: &GaitProblem, noise: &[f64], x: &mut [f64]) {
    for swing in problem.model.layout.feet.iter().flat_map(|f| &f.swings) {
        let Some(lift_off) = swing.switches else { continue };
        for (n, nominal) in [swing.swing.start, swing.swing.end].into_iter().enumerate() {
            let at = nominal + swing.swing.room[n] * noise[lift_off + n] / 0.03;
            x[lift_off + n] = if (at - at.round()).abs() < 0.01 { at + 0.02 } else { at };
        }
    }
}

#[test]
fn durations_match_differences_wherever_the_switches_are() {
    let gait = "[gait]\ncycle = 0.8\noptimize_durations = true";
    for formulation in ["warped", "direct", "hybrid"] {
        for (name, terrain) in [TERRAINS[0], TERRAINS[2]] {
            check(problem(terrain, formulation, gait), &format!("{name}, {formulation}"));
        }
        let law = format!("{gait}\n[physics]\nlaw = \"pcdm-backward\"\n[contact]\ncone = \"conformal\"");
        check(problem(TERRAINS[1].1, formulation, &law), "pcdm-backward, conformal");
    }
    // With known legs: their speeds and torques follow the switches too.
    for formulation in ["warped", "direct", "hybrid"] {
        for robot in ["anymal_b", "anymal_c"] {
            for (name, terrain) in TERRAINS {
                check(
                    problem_of(robot, terrain, formulation, gait),
                    &format!("{robot}, {name}, {formulation}"),
                );
            }
        }
    }
    // The switches themselves, all of them, and samples that are in another phase than at the guess.
    let mut problem = problem(TERRAINS[4].1, "warped", gait);
    let start = initial(&problem);
    let noise: Vec<f64> = (0..start.len()).map(|v| 0.029 * (1.7 * v as f64).sin()).collect();
    let mut x: Vec<f64> = start.iter().zip(&noise).map(|(x, n)| x + n).collect();
    move_switches(&problem, &noise, &mut x);
    let swings = || problem.model.layout.feet.iter().flat_map(|f| &f.swings);
    let switches: Vec<usize> = swings().filter_map(|s| s.switches).flat_map(|v| [v, v + 1]).collect();
    let moved = switches.iter().filter(|&&v| x[v].floor() != start[v].floor()).count();
    assert!(switches.len() == 16 && moved > 5, "{moved} of {} switches have passed a sample", switches.len());
    for error in derivatives::check(&mut problem, &x, &switches) {
        assert!(error.largest < TOLERANCE && error.missing == 0, "{error:?}");
    }
}

#[test]
fn warped_blocks_match_differences_on_all_terrains() {
    for (name, terrain) in TERRAINS {
        check(problem(terrain, "warped", "[contact]\nmax_slope = 0.9"), name);
    }
}

#[test]
fn direct_blocks_match_differences_on_all_terrains() {
    for (name, terrain) in TERRAINS {
        check(problem(terrain, "direct", "[contact]\nmax_slope = 0.9"), name);
    }
}

#[test]
fn hybrid_blocks_match_differences_on_all_terrains() {
    for (name, terrain) in TERRAINS {
        check(problem(terrain, "hybrid", "[contact]\nmax_slope = 0.9"), name);
    }
}

/// With edges: patches, surfaces for swings and knees, and points of the shanks' tubes. The map is bent over the posture surface.
#[test]
fn blocks_over_edges_match_differences() {
    let steps = "kind = \"formula\"\nexpression = \"0.04*floor(4*x + y) + 0.02*x\"";
    for formulation in ["warped", "direct", "hybrid"] {
        for (robot, legs) in [
            ("anymal_towr", "massless"),
            ("anymal_b", "massless"),
            ("anymal_c", "massless"),
            ("anymal_c", "massive"),
        ] {
            let extra = format!("[physics]\nlegs = \"{legs}\"\n[contact]\nfootholds = \"patches\"");
            let problem = problem_of(robot, steps, formulation, &extra);
            let rows = |name: &str| {
                let found = problem.blocks().find(|(block, _)| block.name() == name);
                found.map_or(0, |(block, _)| block.rows())
            };
            assert!(rows("foothold patch") > 0 && rows("foothold slope") == 0);
            // More than knee and corner at every second sample.
            assert!(robot == "anymal_towr" || rows("knee clearance") > 2 * 4 * 26, "{robot}");
            check(problem, &format!("{robot}, edges, {formulation}"));
        }
    }
}

/// Way-points with and without times, with headings and heights, also while feet swing.
#[test]
fn way_points_match_differences() {
    let extra = "[[goal.waypoints]]\nposition = [0.4, 0.2]\n\
                 [[goal.waypoints]]\nposition = [0.5, 0.1]\ntime = 1.1\nyaw = 0.3\nheight = 0.45\n";
    for formulation in ["warped", "direct", "hybrid"] {
        for (terrain, text) in TERRAINS {
            let problem = problem(text, formulation, extra);
            let rows = |name: &str| {
                let found = problem.blocks().find(|(block, _)| block.name() == name);
                found.map_or(0, |(block, _)| block.rows())
            };
            assert_eq!([rows("way-points"), rows("goal")], [7, 3]);
            let swings = |k: usize| {
                problem
                    .model
                    .layout
                    .feet
                    .iter()
                    .flat_map(|f| &f.swings)
                    .any(|s| s.swing.start < k as f64 && (k as f64) < s.swing.end)
            };
            assert!(swings(22));
            check(problem, &format!("{terrain}, {formulation}"));
        }
    }
}

/// Posture, payload, forces on the trunk, fixed footholds and polygons, for massless and massive legs.
#[test]
fn conditions_match_differences() {
    let extra = "[posture]\nheight = [0.3, 0.6]\nroll = [-0.2, 0.3]\npitch = [-0.3, 0.2]\n\
                 [payload]\nmass = 5.0\nposition = [0.1, -0.05, 0.2]\n\
                 [[force]]\nvector = [40.0, -30.0, 20.0]\nfrom = 0.3\nuntil = 2.0\npoint = [0.2, 0.1, -0.1]\n\
                 [[foothold]]\nfoot = \"LF\"\nstep = 1\nposition = [0.8, 0.4]\n\
                 [[keep_out]]\npolygon = [[0.5, -0.3], [1.1, -0.2], [0.7, 0.1]]\n";
    for formulation in ["warped", "direct", "hybrid"] {
        for (terrain, text) in [TERRAINS[0], TERRAINS[4]] {
            for robot in ["anymal_towr", "anymal_c"] {
                let problem = problem_of(robot, text, formulation, extra);
                let rows = |name: &str| {
                    let found = problem.blocks().find(|(block, _)| block.name() == name);
                    found.map_or(0, |(block, _)| block.rows())
                };
                assert_eq!([rows("posture"), rows("fixed footholds")], [4 * 50, 2]);
                assert!(rows("keep out") >= 8 && problem.model.applied(20).len() == 1);
                check(problem, &format!("{robot}, {terrain}, {formulation}"));
            }
        }
    }
    let law = format!("{extra}[physics]\nlaw = \"newton-euler\"\n");
    check(problem(TERRAINS[4].1, "hybrid", &law), "newton-euler with conditions");
}

#[test]
fn other_laws_and_cones_match_differences() {
    for formulation in ["warped", "direct", "hybrid"] {
        for extra in ["[physics]\nlaw = \"pcdm-backward\"", "[contact]\ncone = \"conformal\""] {
            check(problem(TERRAINS[1].1, formulation, extra), extra);
        }
    }
}

#[test]
fn coarse_knots_and_newton_euler_match_differences() {
    let coarse = "[discretization]\nbase_knots = 3\nforce_knots = 2";
    for formulation in ["warped", "direct", "hybrid"] {
        check(problem(TERRAINS[2].1, formulation, coarse), coarse);
    }
    for formulation in ["direct", "hybrid"] {
        check(problem(TERRAINS[2].1, formulation, "[physics]\nlaw = \"newton-euler\""), "newton-euler");
    }
}

/// For a robot with known legs: joint speeds, torques and knee clearance as well.
#[test]
fn blocks_of_known_legs_match_differences_on_all_terrains() {
    for formulation in ["warped", "direct", "hybrid"] {
        for robot in ["anymal_b", "anymal_c"] {
            for (terrain, text) in TERRAINS {
                let problem = problem_of(robot, text, formulation, "");
                has_leg_terms(&problem);
                for name in ["joint speed", "joint torque", "knee clearance"] {
                    let has = |(block, _): (&dyn Constraint, usize)| block.name() == name && block.rows() > 0;
                    assert!(problem.blocks().any(has), "{name}");
                }
                check(problem, &format!("{robot}, {terrain}, {formulation}"));
            }
        }
    }
}

/// Legs of two joints: no torque of the abduction that they lack, thin reach boxes for the centers of feet, and the base on its rails.
#[test]
fn blocks_of_legs_of_two_joints_match_differences() {
    for formulation in ["warped", "direct", "hybrid"] {
        let problem = problem_of("solo8", TERRAINS[4].1, formulation, "");
        for name in ["joint speed", "joint torque", "rails"] {
            let has = |(block, _): (&dyn Constraint, usize)| block.name() == name && block.rows() > 0;
            assert!(problem.blocks().any(has), "{name}");
        }
        check(problem, &format!("solo8, {formulation}"));
    }
}

/// Legs of four to seven joints, all of whose joints have rows, and upper links that keep clear of the ground.
#[test]
fn blocks_of_legs_of_many_joints_match_differences() {
    for (counts, (name, terrain)) in
        [([4; 4], TERRAINS[0]), ([3, 4, 5, 6], TERRAINS[2]), ([7; 4], TERRAINS[4])]
    {
        let folder = tempfile::tempdir().unwrap();
        let file = chains::robot(folder.path(), counts);
        for formulation in ["warped", "direct", "hybrid"] {
            let problem = problem_of(file.to_str().unwrap(), terrain, formulation, "");
            for name in ["joint speed", "joint torque", "knee clearance"] {
                let has = |(block, _): (&dyn Constraint, usize)| block.name() == name && block.rows() > 0;
                assert!(problem.blocks().any(has), "{name}");
            }
            check(problem, &format!("{counts:?}, {name}, {formulation}"));
        }
    }
}

/// The same for legs without a closed form: the abduction is not about x, and all three joints have rows of speed.
#[test]
fn blocks_of_legs_with_other_axes_match_differences() {
    let anymal = include_str!("../robots/anymal_c.toml");
    let turned =
        anymal.replace("axis = [1.000000, 0.000000, 0.000000]", "axis = [0.999800, 0.020000, 0.000000]");
    assert_ne!(turned, anymal);
    let folder = tempfile::tempdir().unwrap();
    let file = folder.path().join("turned.toml");
    std::fs::write(&file, turned).unwrap();
    let rows = |problem: &GaitProblem, name: &str| -> usize {
        problem.blocks().filter(|(block, _)| block.name() == name).map(|(block, _)| block.rows()).sum()
    };
    for formulation in ["warped", "direct", "hybrid"] {
        let problem = problem_of(file.to_str().unwrap(), TERRAINS[1].1, formulation, "");
        let closed = problem_of("anymal_c", TERRAINS[1].1, formulation, "");
        assert_eq!(2 * rows(&problem, "joint speed"), 3 * rows(&closed, "joint speed"));
        check(problem, &format!("turned axes, {formulation}"));
    }
}

/// What the legs' mass adds is not zero.
fn has_leg_terms(problem: &GaitProblem) {
    let terms = &problem.model.leg_terms;
    let largest = |values: &[nalgebra::Vector3<f64>]| values.iter().map(|v| v.norm()).fold(0.0, f64::max);
    assert!(largest(&terms.shift) > 1e-4 && largest(&terms.shift_between) > 1e-4);
    assert!(largest(&terms.torque) > 1e-4 && terms.inertia.iter().any(|term| term.form.norm() > 1e-3));
    assert!(terms.joint_torque.iter().flatten().flatten().any(|torque| torque.abs() > 1.0));
}

#[test]
fn other_laws_of_legs_with_mass_match_differences() {
    for (formulation, law) in [
        ("warped", "pcdm-backward"),
        ("hybrid", "pcdm-backward"),
        ("hybrid", "newton-euler"),
        ("direct", "newton-euler"),
    ] {
        let extra = format!("[physics]\nlaw = \"{law}\"\nlegs = \"massive\"");
        let problem = problem_of("anymal_c", TERRAINS[4].1, formulation, &extra);
        has_leg_terms(&problem);
        check(problem, &format!("{law}, {formulation}"));
    }
    let massless = problem_of("anymal_c", TERRAINS[4].1, "hybrid", "[physics]\nlegs = \"massless\"");
    assert_eq!(massless.model.leg_terms, LegTerms::default());
    check(massless, "massless");
}

/// Two threads add what one adds, up to the order of sums, and the same bits each time.
#[test]
fn two_threads_evaluate_what_one_does() {
    let durations = "[gait]\ncycle = 0.8\noptimize_durations = true\n";
    for formulation in ["warped", "direct", "hybrid"] {
        for (robot, gait) in [("anymal_towr", ""), ("anymal_c", ""), ("anymal_towr", durations)] {
            let values = |threads: usize| {
                let extra = format!("{gait}[solver]\nthreads = {threads}");
                let mut problem = problem_of(robot, TERRAINS[4].1, formulation, &extra);
                assert_eq!(problem.model.threads, threads);
                let x: Vec<f64> =
                    initial(&problem).iter().enumerate().map(|(v, x)| x + 0.01 * (v as f64).sin()).collect();
                let multipliers: Vec<f64> =
                    (0..problem.num_constraints()).map(|r| (1.3 * r as f64).cos()).collect();
                let rows = [problem.jacobian_structure().0, problem.hessian_structure().unwrap().0]
                    .map(<[i32]>::to_vec);
                let mut evaluate = || {
                    let mut values = [0, 1].map(|which| vec![f64::NAN; rows[which].len()]);
                    problem.jacobian_values(&x, true, &mut values[0]);
                    problem.hessian_values(&x, true, 0.7, &multipliers, true, &mut values[1]);
                    values
                };
                let first = evaluate();
                assert_eq!(first, evaluate(), "{robot}, {formulation}, {threads} threads");
                (rows, first)
            };
            let (rows, one) = values(1);
            let (same_rows, two) = values(2);
            assert_eq!(rows, same_rows);
            for (rows, (one, two)) in rows.iter().zip(one.iter().zip(&two)) {
                let mut scale = vec![0.0_f64; 1 + *rows.last().unwrap() as usize];
                rows.iter().zip(one).for_each(|(&r, v)| scale[r as usize] = scale[r as usize].max(v.abs()));
                for ((&row, one), two) in rows.iter().zip(one).zip(two) {
                    let error = (one - two).abs();
                    let scale = scale[row as usize];
                    assert!(error <= 1e-12 * scale, "{robot}, {formulation}, row {row}: {one} and {two}");
                }
            }
        }
    }
}

/// The check itself must see a wrong derivative: one entry of the Jacobian, or of the Hessian, off by a hundred thousandth.
#[test]
fn the_check_is_not_blind() {
    let mut problem = problem(TERRAINS[0].1, "warped", "");
    // Off the guess, which stands on knots of the ground, where third derivatives jump.
    let x: Vec<f64> =
        initial(&problem).iter().enumerate().map(|(i, x)| x + 0.01 * (i as f64).sin()).collect();
    let all: Vec<usize> = (0..x.len()).collect();
    assert!(derivatives::check(&mut problem, &x, &all).iter().all(|e| e.largest < TOLERANCE));
    let tamper = |values: &mut [f64]| values[17] += 1e-5 * values[17].abs().max(1.0);
    let wrong = derivatives::check_with(&mut problem, &x, &all, tamper, |_| {});
    assert!(wrong.iter().any(|e| e.largest > TOLERANCE && e.block != "hessian"));
    let wrong = derivatives::check_with(&mut problem, &x, &all, |_| {}, tamper);
    assert!(wrong.iter().all(|e| (e.largest > TOLERANCE) == (e.block == "hessian")));
}

#[test]
fn a_start_in_motion_has_true_derivatives() {
    let start = "[start.state]\nvelocity = [0.3, 0.1, -0.05]\nangular_velocity = [0.1, -0.2, 0.3]\n\
                 acceleration = [0.5, -0.4, 1.0]\nangular_acceleration = [1.0, 0.5, -0.7]\n";
    for formulation in ["direct", "hybrid"] {
        let (name, terrain) = TERRAINS[0];
        check(problem(terrain, formulation, start), &format!("{name} {formulation} moving"));
    }
}

#[test]
fn a_cyclic_motion_has_true_derivatives() {
    let problem = problem(
        "kind = \"formula\"\nexpression = \"0\"",
        "direct",
        "[gait]\nkind = \"trot\"\ncycle = 1.25\nduty = 0.6\nperiodic = true",
    );
    assert!(problem.blocks().any(|(block, _)| block.name() == "closure" && block.rows() == 4 + 12 + 4 * 5));
    check(problem, "cyclic");
}

#[test]
fn feet_in_the_air_at_the_start_have_true_derivatives() {
    let start = "[start.state]\nvelocity = [0.3, 0.1, -0.05]\nswings = [[0.1, 0.25], [0.0, 0.0], [0.0, 0.0], [0.2, 0.13]]\n\
                 feet = [[0.6, 0.4, 0.1], [0.6, 0.0, 0.0], [0.0, 0.4, 0.0], [0.0, 0.0, 0.15]]\n\
                 feet_velocity = [[0.5, 0.0, 0.1], [0.0, 0.0, 0.0], [0.0, 0.0, 0.0], [0.6, 0.1, -0.2]]\n";
    for formulation in ["direct", "hybrid"] {
        let (name, terrain) = TERRAINS[4];
        let problem = problem(terrain, formulation, start);
        assert!(problem.blocks().any(|(block, _)| block.name() == "feet at start" && block.rows() == 12));
        check(problem, &format!("{name} {formulation} in the air"));
    }
}
