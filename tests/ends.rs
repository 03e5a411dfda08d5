//! Motions that start or end moving, from a given state, and one after the other.

use std::ops::ControlFlow;
use std::path::Path;

use crate::common::solved_in;
use warpgait::check::{CheckReport, check};
use warpgait::pipeline::Prepared;
use warpgait::plan::Plan;

fn failed(report: &CheckReport) -> Vec<String> {
    report.rows.iter().filter(|row| !row.passed).map(|row| format!("{} = {}", row.name, row.value)).collect()
}

/// Solved with every check held.
fn plan(folder: &Path, text: &str) -> Plan {
    let (motion, plan) = solved_in(folder, text);
    assert!(motion.solved, "{}; {:?}", motion.status, motion.violations);
    assert_eq!(failed(&check(&plan).expect("a sound plan")), Vec::<String>::new());
    plan
}

const GROUND: &str = "horizon = 3.0\n[terrain]\nkind = \"rippled\"\nlevel = \"easy\"\nspacing = 0.05\n[gait]\nkind = \"trot\"\ncycle = 0.8\nduty = 0.6\n";

fn last<T: Copy>(values: &[T]) -> T {
    values[values.len() - 1]
}

fn distance(a: [f64; 3], b: [f64; 3]) -> f64 {
    (0..3).map(|c| (a[c] - b[c]).powi(2)).sum::<f64>().sqrt()
}

#[test]
fn a_plan_goes_on_where_another_ends_in_motion_or_at_rest() {
    let folder = tempfile::tempdir().expect("a folder");
    for (robot, velocity) in [("anymal_towr", "velocity = [0.25, 0.05]\n"), ("anymal_c", "")] {
        let head = format!("{GROUND}[robot]\nname = \"{robot}\"\n");
        let first = plan(
            folder.path(),
            &format!("{head}[start]\nposition = [-0.5, 0.0]\n[goal]\nposition = [0.0, 0.1]\n{velocity}"),
        );
        first.write(&folder.path().join("first.plan.npz")).expect("a file");
        let text = format!("{head}[start]\nplan = \"first.plan.npz\"\n[goal]\nposition = [0.5, 0.0]\n");
        let second = plan(folder.path(), &text);
        for (what, a, b, tolerance) in [
            ("position", last(&first.base_position), second.base_position[0], 1e-6),
            ("velocity", last(&first.base_linear_velocity), second.base_linear_velocity[0], 1e-6),
            ("acceleration", last(&first.base_linear_acceleration), second.base_linear_acceleration[0], 1e-5),
            ("turning", last(&first.base_angular_velocity), second.base_angular_velocity[0], 1e-6),
        ] {
            assert!(distance(a, b) < tolerance, "{robot}: {what} jumps from {a:?} to {b:?}");
        }
        let feet = first.foot_position.len() - 4;
        for e in 0..4 {
            let (a, b) = (first.foot_position[feet + e], second.foot_position[e]);
            assert!(distance(a, b) < 1e-6, "{robot}: foot {e} jumps from {a:?} to {b:?}");
            let (a, b) = (first.foot_force[feet + e], second.foot_force[e]);
            assert!(distance(a, b) < 1e-3, "{robot}: force {e} jumps from {a:?} to {b:?}");
        }
        // The plan is whole without the one before it, and its splines can be read.
        assert!(!second.meta.scenario.contains("first.plan.npz") && second.motion().is_ok());
        assert!(second.meta.inputs.iter().any(|(name, _)| name == "first.plan.npz"));
    }
}

#[test]
fn a_plan_goes_on_from_the_middle_of_a_step() {
    let folder = tempfile::tempdir().expect("a folder");
    for formulation in ["direct", "hybrid"] {
        let head = format!("formulation = \"{formulation}\"\n{GROUND}[robot]\nname = \"anymal_towr\"\n");
        let first = plan(
            folder.path(),
            &format!("{head}[start]\nposition = [-0.5, 0.0]\n[goal]\nposition = [0.0, 0.1]\n"),
        );
        first.write(&folder.path().join("first.plan.npz")).expect("a file");
        // The middle of a swing, and not a sample of the planner.
        let n = (100..first.t.len())
            .find(|n| (n - 3..n + 3).all(|n| !first.foot_contact[4 * n]))
            .expect("a swing");
        let text = format!(
            "{head}[start]\nplan = \"first.plan.npz\"\ntime = {:?}\n[goal]\nposition = [0.3, 0.1]\n",
            first.t[n]
        );
        let second = plan(folder.path(), &text);
        assert_eq!(second.foot_contact[..4], first.foot_contact[4 * n..4 * n + 4]);
        for (what, a, b) in [
            ("base", &first.base_position[n..=n], &second.base_position[..1]),
            ("velocity", &first.base_linear_velocity[n..=n], &second.base_linear_velocity[..1]),
            ("feet", &first.foot_position[4 * n..4 * n + 4], &second.foot_position[..4]),
            ("their velocities", &first.foot_velocity[4 * n..4 * n + 4], &second.foot_velocity[..4]),
        ] {
            for (a, b) in a.iter().zip(b) {
                assert!(distance(*a, *b) < 1e-4, "{formulation}: {what} from {a:?} to {b:?}");
            }
        }
        let mut spoiled = second.clone();
        let e = (0..4).find(|e| !second.foot_contact[*e]).expect("a foot in the air");
        spoiled.foot_velocity[e][2] += 0.01;
        assert!(failed(&check(&spoiled).expect("a plan")).iter().any(|row| row.starts_with("start_feet = ")));
    }
}

#[test]
fn a_table_of_phases_begins_and_ends_in_the_air() {
    let text = "formulation = \"direct\"\nhorizon = 2.0\n[robot]\nname = \"anymal_towr\"\n[terrain]\nkind = \"flat\"\n\
                [start]\nposition = [0.0, 0.0]\n[goal]\nposition = [0.1, 0.0]\n[gait]\nkind = \"custom\"\n\
                phases = [[0.0, 0.4, 1.6], [2.0], [0.8, 0.4, 0.8], [1.7, 0.3, 0.0]]\n";
    let mut plan = plan(".".as_ref(), text);
    assert_eq!(plan.foot_contact[..4], [false, true, true, true]);
    assert_eq!(plan.foot_contact[plan.foot_contact.len() - 4..], [true, true, true, false]);
    let beyond = plan.swing_beyond.as_flattened();
    assert!(beyond.iter().zip([0.4, 0.0, 0.0, 0.0, 0.0, 0.0, 0.0, 0.3]).all(|(a, b)| (a - b).abs() < 1e-9));
    plan.meta.scenario = plan.meta.scenario.replace("0.0, 0.4, 1.6", "0.5, 0.4, 1.1");
    let found = failed(&check(&plan).expect("a sound plan"));
    assert!(found.iter().any(|row| row.starts_with("rest = 1")), "{found:?}");
}

#[test]
fn a_motion_starts_with_a_given_velocity_and_the_check_sees_another() {
    let text = format!(
        "formulation = \"direct\"\n{GROUND}[robot]\nname = \"anymal_towr\"\n[start]\nposition = [0.0, 0.0]\nstate = {{ velocity = [0.3, 0.0, 0.0], angular_velocity = [0.0, 0.0, 0.2] }}\n\
         [goal]\nposition = [0.6, 0.1]\nvelocity = [0.3, 0.1]\n"
    );
    let mut plan = plan(".".as_ref(), &text);
    assert!(distance(plan.base_linear_velocity[0], [0.3, 0.0, 0.0]) < 1e-9);
    for (from, to) in [
        ("velocity = [0.3, 0.0, 0.0]", "velocity = [0.31, 0.0, 0.0]"),
        ("velocity = [0.3, 0.1]", "velocity = [0.3, 0.0]"),
    ] {
        let scenario = plan.meta.scenario.clone();
        assert!(scenario.contains(from));
        plan.meta.scenario = scenario.replace(from, to);
        let found = failed(&check(&plan).expect("a sound plan"));
        assert!(found.iter().any(|row| row.starts_with("rest = ")), "{to}: {found:?}");
        plan.meta.scenario = scenario;
    }
}

#[test]
fn starts_that_contradict_themselves_are_refused() {
    let folder = tempfile::tempdir().expect("a folder");
    let head = format!("{GROUND}[robot]\nname = \"anymal_towr\"\n[goal]\nposition = [0.5, 0.0]\n[start]\n");
    let path = folder.path().join("before.plan.npz");
    crate::common::standing().write(&path).expect("a file");
    for (start, words) in [
        ("plan = \"absent.plan.npz\"", "start.plan: "),
        (
            "plan = \"before.plan.npz\"\nposition = [0.0, 0.0]",
            "start.position: given together with start.plan (start.plan, line",
        ),
        ("plan = \"before.plan.npz\"\ntime = \"mid\"", "start.time: given \"mid\", allowed: a number"),
        (
            "position = [0.0, 0.0]\nstate.swings = [[0.1, 0.2], [0.0, 0.0], [0.0, 0.0], [0.0, 0.0]]",
            "start.state.swings: given without",
        ),
        ("plan = \"before.plan.npz\"\ntime = 5.0", "start.time: given 5 s, allowed: 0 to 1 s"),
        ("position = [0.0, 0.0]\ntime = 1.0", "start.time: given without start.plan"),
        (
            "position = [0.0, 0.0]\nstate.forces = [[0.0, 0.0, 0.0]]",
            "start.state.forces: given without start.state.feet",
        ),
        ("position = [0.0, 0.0]\nstate.feet = [[0.0, 0.0, 0.0]]", "start.state.feet: given 1 rows"),
        (
            "position = [0.0, 0.0]\nstate.swings = [[0.1, 0.2], [0.0, 0.0], [0.0, 0.1], [0.0, 0.0]]",
            "start.state.swings[2]: given [0, 0.1], allowed: for how long",
        ),
        (
            "position = [0.0, 0.0]\nstate.swings = [[0.1, 0.2], [0.0, 0.0], [0.0, 0.0], [0.0, 0.0]]\n[contact]\nfootholds = \"patches\"",
            "contact.footholds: patches are for feet that stand",
        ),
        (
            "position = [0.0, 0.0]\nstate.velocity = [0.1, 0.0, 0.0]\n[physics]\nlegs = \"massive\"",
            "physics.legs: given \"massive\", but the base moves",
        ),
    ] {
        let text = format!("{head}{start}\n");
        let message =
            warpgait::scenario::load_text("s.toml", &text, folder.path(), &[]).expect_err(start).to_string();
        assert!(message.contains(words), "{message}");
    }
}

/// Why a start is refused before anything is solved.
fn refusal(folder: &Path, text: &str) -> Option<String> {
    let prepared = warpgait::scenario::load_text("s.toml", text, folder, &[])
        .and_then(|loaded| Prepared::new(&loaded, &mut |_| ControlFlow::Continue(())).map(|_| ()));
    prepared.err().map(|e| e.to_string())
}

#[test]
fn a_plan_of_another_robot_or_on_other_ground_is_refused() {
    let folder = tempfile::tempdir().expect("a folder");
    crate::common::standing().write(&folder.path().join("before.plan.npz")).expect("a file");
    let text = |robot: &str, terrain: &str, more: &str| {
        format!(
            "formulation = \"direct\"\n[robot]\nname = \"{robot}\"\n[terrain]\n{terrain}\n[start]\nplan = \"before.plan.npz\"\n[goal]\nposition = [0.3, 0.0]\n{more}"
        )
    };
    let flat = "kind = \"flat\"\nextent = [-2.0, 2.0, -1.0, 1.0]";
    assert_eq!(refusal(folder.path(), &text("anymal_towr", flat, "")), None);
    for (robot, terrain, more, words) in [
        (
            "solo12",
            flat,
            "",
            "s.toml:8: start.plan: given \"before.plan.npz\", a plan for the robot anymal_towr, but here it is solo12 (robot.name, line 3)",
        ),
        (
            "monoped_towr",
            flat,
            "",
            "a plan for the robot anymal_towr, but here it is monoped_towr (robot.name, line 3)",
        ),
        (
            "anymal_towr",
            flat,
            "[payload]\nmass = 2.0\n",
            "a plan for anymal_towr of 29.5 kg, but here it has 31.5 kg (robot.name, line 3; payload.mass, line 12)",
        ),
        (
            "anymal_towr",
            "kind = \"formula\"\nexpression = \"0.05 * x\"",
            "",
            "s.toml:8: start.plan: sets start.state.feet[0]: given [0.34, 0.19, 0], where LF would stand 17 mm below the ground; plan on the same ground as that plan",
        ),
        (
            "anymal_towr",
            "kind = \"flat\"\nextent = [0.5, 2.0, -1.0, 1.0]",
            "",
            "s.toml:8: start.plan: sets start.position: given [0, 0], outside the terrain (terrain.extent, line 6)",
        ),
    ] {
        let message = refusal(folder.path(), &text(robot, terrain, more)).expect(words);
        assert!(message.contains(words) && !message.contains("--set"), "{message}");
    }
}

#[test]
fn a_state_that_fails_a_law_is_refused_before_solving() {
    let feet = "[[0.34, 0.19, 0.0], [0.34, -0.19, 0.0], [-0.34, 0.19, 0.0], [-0.34, -0.19, 0.0]]";
    let rest = "[0.0, 0.0, 0.0], [0.0, 0.0, 0.0], [0.0, 0.0, 0.0]";
    let load = 29.5 * 9.81 / 4.0;
    let forces = format!("[{}]", vec![format!("[0.0, 0.0, {load:?}]"); 4].join(", "));
    let text = |state: &str, more: &str| {
        format!(
            "formulation = \"direct\"\nhorizon = 3.0\n[robot]\nname = \"anymal_towr\"\n[terrain]\nkind = \"flat\"\n[goal]\nposition = [0.3, 0.0]\n[start]\nposition = [0.0, 0.0]\n[start.state]\nheight = 0.42\n{state}\n{more}"
        )
    };
    let lifted = |z: f64| format!("feet = {}", feet.replacen("0.19, 0.0", &format!("0.19, {z:?}"), 1));
    let swing = "swings = [[0.1, 0.2], [0.0, 0.0], [0.0, 0.0], [0.0, 0.0]]";
    for sound in [
        format!("feet = {feet}\nforces = {forces}"),
        format!("{}\n{swing}", lifted(0.05)),
        "velocity = [0.5, 0.0, 0.0]\nacceleration = [1.0, 0.0, 0.0]".to_owned(),
    ] {
        assert_eq!(refusal(".".as_ref(), &text(&sound, "")), None, "{sound}");
    }
    for (state, more, words) in [
        (
            lifted(0.03),
            "",
            "s.toml:13: start.state.feet[0]: given [0.34, 0.19, 0.03], where LF would stand 30 mm above the ground; put it on the ground, at z = 0.0000",
        ),
        (
            lifted(-0.002),
            "",
            "start.state.feet[0]: given [0.34, 0.19, -0.002], where LF would stand 2 mm below the ground",
        ),
        (
            format!("{}\n{swing}", lifted(-0.01)),
            "",
            "where LF, which is in the air (start.state.swings, line 14), would be 10.0 mm below the ground",
        ),
        (
            format!("feet = {}", feet.replacen("0.34", "0.64", 1)),
            "",
            "start.state.feet[0]: given [0.64, 0.19, 0], 150 mm outside the reach box of LF, as the base is at [0, 0, 0.42] (start.position, line 10; start.state.height, line 12)",
        ),
        (
            format!("feet = {feet}\nfeet_velocity = [[0.1, 0.0, 0.0], {rest}]"),
            "",
            "start.state.feet_velocity[0]: given [0.1, 0.0, 0.0] m/s for LF, which stands",
        ),
        (
            format!("feet = {feet}\nforces = {}", forces.replacen(&format!("{load:?}"), "10.0", 1)),
            "",
            "start.state.forces: their sum is [0, 0, 227.046",
        ),
        (
            format!("feet = {feet}\nforces = {}", forces.replace("[0.0, 0.0, ", "[60.0, 0.0, ")),
            "",
            "start.state.forces[0]: given [60, 0, 72.3488] N for LF, outside of its friction cone; allowed: 0.600 times the normal force",
        ),
        (
            format!("feet = {feet}\nforces = {}", forces.replacen(&format!("{load:?}"), "-5.0", 1)),
            "",
            "which pulls on the ground",
        ),
        (
            format!("{}\n{swing}\nforces = {forces}", lifted(0.05)),
            "",
            "start.state.forces[0]: given [0, 0, 72.3488] N for LF, which is in the air",
        ),
        (
            format!("feet = {feet}\nangular_acceleration = [0.0, 20.0, 0.0]\nforces = {forces}"),
            "",
            "their torque about the center of mass is [0, 0, 0] N m, but the motion takes",
        ),
        (
            "tilt = [0.2, 0.0]".to_owned(),
            "[posture]\nroll = [-0.1, 0.1]",
            "start.state.tilt: given a roll of 0.2 rad, outside [-0.1, 0.1] (posture.roll, line",
        ),
        (
            format!("feet = {feet}"),
            "[posture]\nheight = [0.45, 0.5]",
            "start.state.height: the base is 0.420 m over the mean of the feet, outside [0.45, 0.5] (posture.height, line",
        ),
        (
            String::new(),
            "[motion]\nbase_clearance = 0.4",
            "start.state.height: given 0.42 m, where the torso's underside is",
        ),
        (
            format!("{}\nswings = [[1e-6, 0.3], [0.0, 0.0], [0.0, 0.0], [0.0, 0.0]]", lifted(0.05)),
            "",
            "start.state.feet[0]: given 0.050 m above the ground 0.000001 s after LF has left it at rest (start.state.swings[0], line 14); allowed: at most",
        ),
        (
            format!(
                "{}\nswings = [[1e-4, 0.3], [0.0, 0.0], [0.0, 0.0], [0.0, 0.0]]\nfeet_velocity = [[0.0, 0.0, 2.0], {rest}]",
                lifted(0.0)
            ),
            "",
            "start.state.feet_velocity[0]: given 2.000 m/s 0.0001 s after LF has left it at rest",
        ),
        (
            "velocity = [3.2, 0.0, 0.0]".to_owned(),
            "",
            "start.state.velocity: given [3.2, 0.0, 0.0] m/s, so fast that",
        ),
        (
            "velocity = [15.0, 0.0, 0.0]".to_owned(),
            "",
            "start.state.velocity: given [15.0, 0.0, 0.0] m/s, so fast that LF is out of its reach before it lifts off",
        ),
        (
            "acceleration = [50.0, 0.0, 0.0]".to_owned(),
            "",
            "start.state.acceleration: given [50.0, 0.0, 0.0] m/s², which takes a force outside of all friction cones (contact.friction, by default)",
        ),
        (
            "acceleration = [0.0, 0.0, 150.0]".to_owned(),
            "",
            "which takes 16.3 m g from 4 feet; allowed: 2 m g of each (motion.force_limit, by default)",
        ),
        (
            format!("{}\nswings = [[0.1, 0.004], [0.0, 0.0], [0.0, 0.0], [0.0, 0.0]]", lifted(0.05)),
            "",
            "start.state.swings[0]: given [0.1, 0.004], but a plan has no sample before the foot lands; allowed: it lands after at least 0.005 s",
        ),
        (
            format!("{}\nswings = [[0.05, 0.03], [0.0, 0.0], [0.0, 0.0], [0.0, 0.0]]", lifted(0.05)),
            "",
            "start.state.swings[0]: given [0.05, 0.03], a swing of 0.08 s, which has no sample of the laws within it; allowed: at least 0.1 s, two time steps of 0.05 s",
        ),
    ] {
        let message =
            refusal(".".as_ref(), &text(&state, more)).unwrap_or_else(|| panic!("{state} {more}: {words}"));
        assert!(message.starts_with("s.toml:") && message.contains(words), "{message}\nexpected: {words}");
    }
}

#[test]
fn a_goal_at_the_edge_is_refused_with_the_heading_of_arrival() {
    let text = "formulation = \"direct\"\n[robot]\nname = \"anymal_towr\"\n[terrain]\nkind = \"flat\"\nextent = [-1.0, 1.0, -1.0, 1.0]\n[start]\nposition = [0.0, 0.0]\n\
                [goal]\nposition = [0.4, 0.7]\n[[goal.waypoints]]\nposition = [0.4, 0.2]\n";
    let prepared = |text: &str| {
        let loaded = warpgait::scenario::load_text("s.toml", text, ".".as_ref(), &[]).expect("a scenario");
        Prepared::new(&loaded, &mut |_| ControlFlow::Continue(()))
            .and_then(|p| p.task(&loaded, None).problem())
    };
    let message = prepared(text).err().expect("a refusal").to_string();
    assert!(message.contains("goal.position: given [0.4, 0.7], where foot LF would stand 0.0"), "{message}");
    assert!(prepared(&text.replace("0.7]", "0.5]")).is_ok());
}
