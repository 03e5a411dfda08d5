//! Cyclic motions: the end is the start, shifted and turned.

use crate::common::solved_in;
use warpgait::check::check;
use warpgait::plan::Plan;

/// A cyclic trot of so many meters along x.
fn text(terrain: &str, way: f64, more: &str) -> String {
    format!(
        "[robot]\nname = \"anymal_towr\"\n[terrain]\n{terrain}\nextent = [-2.0, 3.0, -2.0, 2.0]\nspacing = 0.05\n[start]\nposition = [0.0, 0.0]\n\
         [gait]\nkind = \"trot\"\nduty = 0.6\nperiodic = true\n[goal]\nposition = [{way:?}, 0.0]\nspeed = 0.4\n{more}"
    )
}

fn failed(plan: &Plan) -> Vec<String> {
    let report = check(plan).expect("a sound plan");
    report.rows.iter().filter(|row| !row.passed).map(|row| row.name.clone()).collect()
}

fn solved(text: &str) -> Plan {
    let (motion, plan) = solved_in(".".as_ref(), text);
    assert!(motion.solved, "{}; {:?}", motion.status, motion.violations);
    assert_eq!(failed(&plan), Vec::<String>::new());
    plan
}

#[test]
fn a_cycle_ends_as_it_began_and_the_check_sees_when_it_does_not() {
    let plan = solved(&text("kind = \"formula\"\nexpression = \"0.1*x\"", 0.4, ""));
    let last = plan.t.len() - 1;
    assert_eq!(plan.t[last], 1.0);
    let speed = plan.base_linear_velocity[0][0];
    assert!((0.2..0.6).contains(&speed), "{speed}");
    assert!((plan.base_linear_velocity[last][0] - speed).abs() < 1e-3);
    assert!((plan.foot_position[4 * last][0] - plan.foot_position[0][0] - 0.4).abs() < 1e-3);

    type Spoil = fn(&mut Plan, usize);
    let cases: [(Spoil, &str); 6] = [
        (|plan, n| plan.base_linear_velocity[n][1] += 0.01, "cycle_motion"),
        (|plan, n| plan.base_angular_acceleration[n][2] += 0.1, "cycle_motion"),
        (|plan, n| plan.foot_position[4 * n + 1][0] += 0.002, "cycle"),
        (|plan, n| plan.foot_contact[4 * n + 1] = false, "cycle"),
        (|plan, n| plan.foot_force[4 * n + 2][2] += 10.0, "cycle_force"),
        (|plan, n| plan.base_quaternion_wxyz[n] = [0.8, 0.6, 0.0, 0.0], "cycle_turn"),
    ];
    for (spoil, law) in cases {
        let mut spoiled = plan.clone();
        spoil(&mut spoiled, last);
        let found = failed(&spoiled);
        assert!(found.iter().any(|name| name == law), "{law}: {found:?}");
    }
}

#[test]
fn a_cycle_may_turn_and_go_from_wave_to_wave() {
    let plan = solved(&text("kind = \"flat\"", 0.3, "yaw = 0.3\n"));
    let [start, end] = [0, plan.t.len() - 1].map(|n| plan.base_linear_velocity[n]);
    let turned = (end[1].atan2(end[0]) - start[1].atan2(start[0])).abs();
    assert!((turned - 0.3).abs() < 1e-3, "{turned}");
    solved(&text("kind = \"formula\"\nexpression = \"0.02*sin(2*pi*x/0.5)\"", 0.5, ""));
}

#[test]
fn a_cycle_may_begin_in_the_air() {
    let quick = text("kind = \"flat\"", 0.25, "")
        .replace("duty = 0.6", "duty = 0.4\ncycle = 0.5")
        .replace("speed = 0.4", "speed = 0.5");
    let plan = solved(&format!("time_step = 0.025\n{quick}"));
    assert!(plan.foot_contact[..4].iter().any(|stands| !stands));
    assert!(
        plan.swing_beyond.iter().flatten().filter(|beyond| **beyond > 0.0).count() >= 4,
        "{:?}",
        plan.swing_beyond
    );
    let folder = tempfile::tempdir().expect("a folder");
    let path = folder.path().join("p.plan.npz");
    plan.write(&path).expect("a file");
    let again = Plan::read(&path).expect("a plan");
    assert_eq!(again.swing_beyond, plan.swing_beyond);
    // The splines go through the samples, over the ends too.
    let exact = again.motion().expect("splines");
    for (n, t) in plan.t.iter().enumerate().step_by(7) {
        for e in 0..4 {
            let position = exact.foot(e, *t).expect("a foot").position;
            assert!(
                (0..3).all(|c| (position[c] - plan.foot_position[4 * n + e][c]).abs() < 1e-9),
                "{t} s, foot {e}"
            );
        }
    }
    let mut spoiled = plan.clone();
    spoiled.swing_beyond[0] = [0.5, 0.5];
    assert!(spoiled.motion().is_err() || failed(&spoiled).iter().any(|name| name == "spline_feet"));
}

#[test]
fn ground_that_does_not_repeat_itself_is_refused() {
    let folder = tempfile::tempdir().expect("a folder");
    let path = folder.path().join("s.toml");
    std::fs::write(&path, text("kind = \"formula\"\nexpression = \"0.02*sin(2*pi*x/0.5)\"", 0.4, ""))
        .expect("a file");
    let loaded = warpgait::scenario::load(&path, &[]).expect("a scenario");
    let refused = warpgait::pipeline::Prepared::new(&loaded, &mut |_| std::ops::ControlFlow::Continue(()));
    let message = refused.err().expect("a refusal").to_string();
    assert!(message.contains("gait.periodic: the ground at the goal is not as at the start"), "{message}");
}
