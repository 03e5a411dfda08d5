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
