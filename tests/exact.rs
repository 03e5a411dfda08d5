//! The exact motion of a plan goes through its samples, between them it is what its derivatives say, and splines that do
//! not fit together are refused.

use std::path::Path;

use crate::common;
use warpgait::pipeline;
use warpgait::plan::Plan;
use warpgait::scenario::load_text;

/// A short trot over ripples after a few iterations: not solved, but a motion with everything in it.
const SCENARIO: &str = r#"
schema = 1
horizon = 2.0
[terrain]
kind = "rippled"
extent = [-1.5, 2.0, -1.0, 1.0]
[map]
cells = [16, 12, 8]
[start]
position = [0.0, 0.0]
[goal]
position = [0.3, 0.0]
[gait]
kind = "trot"
[solver]
max_iterations = 4
continuation = "off"
"#;

fn plan(formulation: &str) -> Plan {
    let set = [format!("formulation={formulation}")];
    let loaded = load_text("scenario", SCENARIO, Path::new("."), &set).unwrap();
    let outcome = pipeline::run(&loaded, false, &mut |_| std::ops::ControlFlow::Continue(())).unwrap();
    outcome.expect("nobody stopped it").plan
}

fn near(what: &str, t: f64, a: impl AsRef<[f64]>, b: impl AsRef<[f64]>, tolerance: f64) {
    let scale = 1.0 + b.as_ref().iter().fold(0.0, |m: f64, v| m.max(v.abs()));
    for (a, b) in a.as_ref().iter().zip(b.as_ref()) {
        assert!((a - b).abs() <= tolerance * scale, "{what} at {t} s: {a} and {b}");
    }
}

#[test]
fn the_exact_motion_goes_through_the_samples() {
    let folder = tempfile::tempdir().unwrap();
    for formulation in ["direct", "warped", "hybrid"] {
        let path = folder.path().join("a.plan.npz");
        plan(formulation).write(&path).unwrap();
        let plan = Plan::read(&path).unwrap();
        assert_eq!(plan.map.is_some(), formulation != "direct");
        let motion = plan.motion().unwrap();
        assert!((motion.duration() - 2.0).abs() < 1e-12 && motion.feet() == 4);
        assert!(plan.foot_contact.contains(&false));
        for (n, &t) in plan.t.iter().enumerate() {
            let base = motion.base(t).unwrap();
            near("position", t, base.position, plan.base_position[n], 1e-9);
            let quaternion = base.quaternion_wxyz(plan.base_quaternion_wxyz[n]);
            near("quaternion", t, quaternion, plan.base_quaternion_wxyz[n], 1e-9);
            near("velocity", t, base.velocity, plan.base_linear_velocity[n], 1e-9);
            near("acceleration", t, base.acceleration, plan.base_linear_acceleration[n], 1e-9);
            near("angular velocity", t, base.angular_velocity, plan.base_angular_velocity[n], 1e-9);
            let acceleration = plan.base_angular_acceleration[n];
            near("angular acceleration", t, base.angular_acceleration, acceleration, 1e-9);
            for e in 0..4 {
                let (foot, at) = (motion.foot(e, t).unwrap(), 4 * n + e);
                assert_eq!(foot.contact, plan.foot_contact[at], "contact of foot {e} at {t} s");
                near("foot position", t, foot.position, plan.foot_position[at], 1e-9);
                near("foot velocity", t, foot.velocity, plan.foot_velocity[at], 1e-9);
                near("foot acceleration", t, foot.acceleration, plan.foot_acceleration[at], 1e-9);
                near("foot force", t, foot.force, plan.foot_force[at], 1e-9);
            }
        }
        // Between the samples, at times of no grid: the velocity is the difference of positions.
        let step = 1e-5;
        for t in [0.1234, 0.777, 1.0403] {
            let [before, after] = [t - step, t + step].map(|t| motion.base(t).unwrap());
            let slope = (after.position - before.position) / (2.0 * step);
            near("slope", t, slope, motion.base(t).unwrap().velocity, 1e-6);
            for e in 0..4 {
                let [before, after] = [t - step, t + step].map(|t| motion.foot(e, t).unwrap());
                let slope = (after.position - before.position) / (2.0 * step);
                near("foot slope", t, slope, motion.foot(e, t).unwrap().velocity, 1e-5);
            }
        }
        for t in [-0.01, 2.01, f64::NAN, f64::INFINITY] {
            assert!(motion.base(t).unwrap_err().to_string().contains("from 0 to 2"), "{t}");
        }
        assert!(motion.foot(4, 0.0).unwrap_err().to_string().contains("4 feet"));
    }
}

#[test]
fn splines_that_do_not_fit_together_are_refused() {
    fn splines<'a>(plan: &'a mut Plan, name: &str) -> &'a mut (String, Vec<usize>, Vec<f64>) {
        plan.splines.iter_mut().find(|(member, ..)| member == name).unwrap()
    }
    let good = plan("direct");
    type Spoil = fn(&mut Plan);
    let cases: [(Spoil, &str); 11] = [
        (|plan| plan.splines.retain(|(name, ..)| name != "LF_footholds"), "spline/LF_footholds: is missing"),
        (
            |plan| {
                let shape = &mut splines(plan, "base_control_points").1;
                *shape = vec![2 * shape[0], 3];
            },
            "expected (knot intervals + 3, 6)",
        ),
        (|plan| splines(plan, "base_knots").2[7] += 0.01, "not uniform"),
        (|plan| splines(plan, "base_knots").2.fill(f64::NAN), "not uniform"),
        (|plan| splines(plan, "force_knots").2.reverse(), "not uniform from 0 s"),
        (|plan| splines(plan, "RH_force_nodes").1[0] -= 1, "123 values for the shape [40, 3]"),
        (|plan| splines(plan, "RH_force_nodes").1 = vec![123, 1], "the phases require [41, 3]"),
        (|plan| splines(plan, "RH_force_nodes").2.fill(1.0), "where the foot moves"),
        (|plan| plan.phase_durations[1].truncate(2), "phase_durations of RF: 2 phases"),
        (|plan| plan.phase_durations[1][0] += 0.02, "phase_durations of RF: a switch"),
        (|plan| plan.phase_durations.truncate(3), "phase_durations: needs one row"),
    ];
    for (spoil, words) in cases {
        let mut bad = good.clone();
        spoil(&mut bad);
        let message = bad.motion().expect_err(words).to_string();
        assert!(message.contains(words), "`{words}` is not in: {message}");
    }
    let mut bare = common::standing();
    bare.splines.clear();
    assert!(bare.motion().unwrap_err().to_string().contains("is missing"));
}
