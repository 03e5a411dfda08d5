//! Ground with edges: planned on patches, checked against the raw ground; what cannot be walked is refused before the NLP.

use std::ops::ControlFlow;
use std::path::Path;

use crate::common::solved;
use warpgait::check::check;
use warpgait::pipeline::{Event, Prepared, run};
use warpgait::plan::Plan;
use warpgait::planner::{Reassignment, Trouble, reassignments};
use warpgait::scenario::{load, load_text};
use warpgait::trajectory::Gait;

/// A short walk over a formula with edges.
fn scenario(robot: &str, formulation: &str, expression: &str, goal: f64) -> String {
    format!(
        "formulation = \"{formulation}\"\nhorizon = 6.0\n[robot]\nname = \"{robot}\"\n\
         [terrain]\nkind = \"formula\"\nexpression = \"{expression}\"\nspacing = 0.02\n\
         extent = [-1.4, 2.4, -1.0, 1.0]\n[start]\nposition = [-0.4, 0.0]\n[goal]\nposition = [{goal}, 0.0]\n\
         [contact]\nfootholds = \"patches\"\n"
    )
}

/// A step up of 12 cm at x = 0.6 m.
const STEP: &str = "0.06*(1 + sign(x - 0.61))";

fn objections(plan: &Plan) -> Vec<String> {
    let report = check(plan).expect("a sound plan");
    report.rows.iter().filter(|row| !row.passed).map(|row| row.name.clone()).collect()
}

#[test]
fn steps_and_gaps_are_walked_in_every_formulation() {
    let gap = "-0.2*(sign(x - 0.61) - sign(x - 0.81))";
    for formulation in ["warped", "direct", "hybrid"] {
        for (robot, expression) in [("anymal_towr", STEP), ("anymal_c", STEP), ("anymal_c", gap)] {
            let (motion, plan) = solved(&scenario(robot, formulation, expression, 1.0));
            assert!(motion.solved, "{robot}, {formulation}, {expression}: {}", motion.status);
            assert_eq!(objections(&plan), Vec::<String>::new(), "{robot}, {formulation}, {expression}");
            assert!(plan.patches.iter().zip(&plan.phase_durations).all(|(p, d)| 2 * p.len() == d.len() + 1));
        }
    }
}

#[test]
fn a_plan_with_patches_survives_its_file_and_every_lie_about_them_is_noticed() {
    let (_, plan) = solved(&scenario("anymal_towr", "direct", STEP, 1.0));
    let folder = tempfile::tempdir().unwrap();
    let path = folder.path().join("step.plan.npz");
    plan.write(&path).unwrap();
    let read = Plan::read(&path).unwrap();
    assert_eq!(read.patches, plan.patches);
    assert_eq!(objections(&read), Vec::<String>::new());

    // What is no rectangle of a plane is refused by the reader.
    let bad: [fn(&mut [[f64; 3]; 4]); 4] = [
        |corners| corners[2][2] += 0.05,
        |corners| corners.swap(1, 2),
        |corners| *corners = [corners[0]; 4],
        |corners| corners[2][0] = 1e308,
    ];
    for spoil in bad {
        let mut plan = plan.clone();
        spoil(&mut plan.patches[2][1]);
        plan.write(&path).unwrap();
        let message = Plan::read(&path).unwrap_err().to_string();
        assert!(message.contains("patch_corners") && message.contains("[2, 1]"), "{message}");
    }

    let spoiled = |spoil: &dyn Fn(&mut Plan)| {
        let mut plan = plan.clone();
        spoil(&mut plan);
        objections(&plan)
    };
    let shift = |by: [f64; 3]| {
        spoiled(&move |plan| {
            for corner in plan.patches.iter_mut().flatten().flatten() {
                (0..3).for_each(|c| corner[c] += by[c]);
            }
        })
    };
    let has =
        |found: Vec<String>, law: &str| assert!(found.iter().any(|name| name == law), "{law}: {found:?}");
    has(shift([0.0, 0.0, 0.05]), "stance_gap");
    has(shift([0.5, 0.0, 0.0]), "patch");
    has(spoiled(&|plan| plan.patches[1].truncate(2)), "patch_count");
    // Nothing is known about a point: its normal is not a number, and no law may hold because of that.
    has(spoiled(&|plan| plan.patches.iter_mut().flatten().for_each(|p| *p = [p[0]; 4])), "stance_gap");
    has(spoiled(&|plan| plan.ground.height.iter_mut().for_each(|h| *h += 0.03)), "patch_roughness");
    has(spoiled(&|plan| plan.ground.height.iter_mut().for_each(|h| *h += 0.012)), "patch_offset");
    // A wall in the way of the swings, between the footholds.
    let wall = |plan: &mut Plan| {
        let ground = &mut plan.ground;
        for (cell, height) in ground.height.iter_mut().enumerate() {
            let x = ground.origin[0] + ground.spacing[0] * (cell % ground.columns) as f64;
            *height += if (0.55..0.62).contains(&x) { 0.3 } else { 0.0 };
        }
    };
    has(spoiled(&wall), "swing_edge");
    // Without its patches, feet would stand on a spline through the edges.
    has(spoiled(&|plan| plan.patches.clear()), "normal");
}

#[test]
fn ground_that_cannot_be_walked_is_refused_with_the_place() {
    let wall = "0.3*(1 + sign(x - 0.61))";
    let gap = "-0.5*(sign(x - 0.41) - sign(x - 1.21))";
    let needles = "0.5*(sin(40*x)*sin(40*y))";
    let fence = "0.3*(sign(x - 0.61) - sign(x - 0.69))";
    for (expression, words) in [
        (wall, vec!["foot ", "would have to step from x = ", "0.60 m up"]),
        (fence, vec!["foot ", "would have to step from x = ", "over 0.60 m of ground"]),
        (gap, vec!["foot ", "x = ", "y = "]),
        (needles, vec!["there is no place where a foot can stand"]),
    ] {
        let text = scenario("anymal_c", "hybrid", expression, 1.6);
        let loaded = load_text("s.toml", &text, ".".as_ref(), &[]).expect("a scenario");
        let message = match Prepared::new(&loaded, &mut |_| ControlFlow::Continue(())) {
            Ok(_) => panic!("{expression}: not refused"),
            Err(error) => error.to_string(),
        };
        assert!(words.iter().all(|part| message.contains(part)), "{message}");
    }
}

#[test]
fn ground_far_above_zero_is_walked_as_well() {
    for formulation in ["hybrid", "warped"] {
        let (motion, plan) = solved(&scenario("anymal_towr", formulation, &format!("500 + {STEP}"), 1.0));
        assert!(motion.solved, "{formulation}: {}", motion.status);
        assert_eq!(objections(&plan), Vec::<String>::new(), "{formulation}");
    }
}

#[test]
fn cells_that_are_too_fine_are_refused_at_once() {
    let text = scenario("anymal_c", "hybrid", STEP, 1.0).replace("spacing = 0.02", "spacing = 0.001");
    let loaded = load_text("s.toml", &text, ".".as_ref(), &[]).expect("a scenario");
    let refused = Prepared::new(&loaded, &mut |_| ControlFlow::Continue(())).err().expect("a refusal");
    assert!(refused.to_string().contains("too fine"), "{refused}");
    // What it asks for is accepted.
    let message = refused.to_string();
    let spacing =
        message.rsplit("cells of ").next().and_then(|rest| rest.split(' ').next()).expect("a spacing");
    let text =
        scenario("anymal_c", "hybrid", STEP, 1.0).replace("spacing = 0.02", &format!("spacing = {spacing}"));
    let loaded = load_text("s.toml", &text, ".".as_ref(), &[]).expect("a scenario");
    let prepared = Prepared::new(&loaded, &mut |_| ControlFlow::Continue(()));
    assert!(
        prepared.is_ok(),
        "{spacing}: {}",
        prepared.err().map(|error| error.to_string()).unwrap_or_default()
    );
}

#[test]
fn short_treads_get_more_steps() {
    let steps = |expression: &str| {
        let text = scenario("anymal_c", "hybrid", expression, 2.6)
            .replace("horizon = 6.0", "horizon = 10.0")
            .replace("2.4, -1.0", "3.6, -1.0");
        let loaded = load_text("s.toml", &text, ".".as_ref(), &[]).expect("a scenario");
        let prepared = Prepared::new(&loaded, &mut |_| ControlFlow::Continue(())).expect("stairs");
        prepared.steps.gait.swings[0].len()
    };
    let [stairs, flat] = ["0.15*max(0, min(5, 1 + floor((x - 0.6)/0.32)))", "0*x"].map(steps);
    assert!(stairs > flat, "{stairs} steps on the stairs and {flat} on the flat");
}

/// Nothing in the choice of steps and footholds is of ANYmal's size: lengths go by the robot's, and times by its root.
#[test]
fn a_robot_of_a_quarter_of_the_size_takes_steps_of_a_quarter_of_the_length_in_half_of_the_time() {
    let folder = tempfile::tempdir().unwrap();
    let steps = |ground: &str, size: f64| {
        let lengths = |values: [f64; 3]| values.map(|value| size * value);
        let feet: Vec<String> = [("LF", 1.0, 1.0), ("RF", 1.0, -1.0), ("LH", -1.0, 1.0), ("RH", -1.0, -1.0)]
            .map(|(name, ahead, left)| {
                let nominal = lengths([0.34 * ahead, 0.19 * left, -0.43]);
                let half_size = lengths([0.15, 0.1, 0.1]);
                format!("[[feet]]\nname = \"{name}\"\nnominal = {nominal:?}\nreach = {{ center = {nominal:?}, half_size = {half_size:?} }}\n")
            })
            .into();
        let robot = format!(
            "name = \"r\"\nsource = \"a test\"\nmass = 30.0\ninertia = [[1.0, 0.0, 0.0], [0.0, 2.0, 0.0], [0.0, 0.0, 2.0]]\ntorso = {{ center = [0.0, 0.0, 0.0], half_size = {:?} }}\n{}",
            lengths([0.32, 0.14, 0.1]),
            feet.concat()
        );
        std::fs::write(folder.path().join("r.toml"), robot).unwrap();
        let ground = ground.replace('X', &format!("(x/{size})")).replace('Y', &format!("(y/{size})"));
        let text = format!(
            "formulation = \"direct\"\nhorizon = {:?}\ntime_step = {:?}\n[robot]\nfile = \"r.toml\"\n[terrain]\nkind = \"formula\"\nexpression = \"{size} * ({ground})\"\n\
             spacing = {:?}\nextent = {:?}\n[contact]\nfootholds = \"patches\"\n[start]\nposition = {:?}\n[goal]\nposition = {:?}\n",
            10.0 * size.sqrt(),
            0.05 * size.sqrt(),
            0.02 * size,
            [-1.4, 4.4, -1.0, 1.0].map(|value| size * value),
            [-0.4 * size, 0.0],
            [3.0 * size, 0.0],
        );
        let loaded = load_text("s.toml", &text, folder.path(), &[]).expect("a scenario");
        let prepared = Prepared::new(&loaded, &mut |_| ControlFlow::Continue(())).expect("stairs");
        prepared.steps
    };
    // Treads of 32 cm, and blocks with few places to choose from.
    let stairs = "0.15*max(0, min(5, 1 + floor((X - 0.6)/0.32)))";
    let blocks = "0.03*sign(sin(17*X + 0.5)*sin(15*Y + 2*X))";
    for ground in [stairs, blocks] {
        let [whole, small] = [1.0, 0.25].map(|size| steps(ground, size));
        assert!(whole.patches[0].len() > 6 && whole.gait == small.gait, "{ground}");
        for (whole, small) in whole.patches.iter().flatten().zip(small.patches.iter().flatten()) {
            for (whole, small) in whole.corners().iter().flatten().zip(small.corners().iter().flatten()) {
                assert!((0.25 * whole - small).abs() < 1e-9, "{ground}: {whole} and {small}");
            }
        }
    }
}

#[test]
fn a_robot_with_a_short_reach_finds_footholds_on_stairs() {
    let file = Path::new(env!("CARGO_MANIFEST_DIR")).join("scenarios/stairs.toml");
    let loaded = load(&file, &["robot.name=anymal_b".to_owned()]).expect("a scenario");
    let prepared = Prepared::new(&loaded, &mut |_| ControlFlow::Continue(()));
    assert!(prepared.is_ok(), "{}", prepared.err().map(|error| error.to_string()).unwrap_or_default());
}

#[test]
fn other_steps_are_other_patches_for_the_stance_in_question_and_then_other_numbers_of_steps() {
    let text = scenario("anymal_c", "direct", "0*x", 2.6)
        .replace("horizon = 6.0", "horizon = 10.0")
        .replace("2.4, -1.0", "3.6, -1.0");
    let text = format!("{text}[solver]\nmax_iterations = 1\nexplain = false\n");
    let (motion, _) = solved(&text);
    let loaded = load_text("s.toml", &text, ".".as_ref(), &[]).expect("a scenario");
    let prepared = Prepared::new(&loaded, &mut |_| ControlFlow::Continue(())).expect("a ground");
    let task = prepared.task(&loaded, None);
    let second = motion.model.layout.feet[0].stances[1].stance;
    let time = 0.5 * (second.start + second.end) * motion.model.layout.time_step;
    let others: Vec<_> = reassignments(&task, &motion, &[Trouble { foot: 0, time }]).collect();
    let moved = &others[0];
    assert!(moved.goes_on && moved.steps.gait == prepared.steps.gait, "{}", moved.words);
    let [x, y] = moved.steps.patches[0][1].center;
    assert!(!prepared.steps.patches[0][1].covers([x, y]), "({x}, {y})");
    let steps = |gait: &Gait| gait.swings[0].len();
    let differs = |other: &Reassignment| steps(&other.steps.gait) != steps(&prepared.steps.gait);
    assert!(others[1..].iter().any(differs) && !others[1..].iter().any(|other| other.goes_on));
}

#[test]
fn high_swings_hold_every_law_with_tighter_limits_if_need_be() {
    let text = "formulation = \"warped\"\nhorizon = 6.0\n[robot]\nname = \"anymal_c\"\n[terrain]\nkind = \"flat\"\n\
                [start]\nposition = [0.0, 0.0]\n[goal]\nposition = [1.0, 0.0]\n[motion]\nswing_clearance = 0.15\n";
    let loaded = load_text("s.toml", text, ".".as_ref(), &[]).expect("a scenario");
    let mut notes = Vec::new();
    let planned = run(&loaded, false, &mut |event| {
        notes.extend(if let Event::Note(note) = event { Some(note.to_string()) } else { None });
        ControlFlow::Continue(())
    });
    let planned = planned.expect("no error").expect("a plan");
    assert!(planned.check.passed, "{notes:?}");
    // What was changed is said in the progress and in the plan.
    let tried = notes.last().and_then(|note| note.split_once("trying ")).map_or("", |(_, words)| words);
    let status = &planned.plan.meta.solver.status;
    assert!(status.ends_with(tried) && *status == planned.motion.status, "{notes:?}: {status}");
}
