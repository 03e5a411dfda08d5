//! The check: a good plan passes every law; a plan that breaks one law fails that one and no other.

use crate::common::{GRAVITY, MASS, ask, lifting, on_slope, standing};
use warpgait::check::{CheckLimits, check, check_with};
use warpgait::plan::Plan;

const WEIGHT: f64 = MASS * GRAVITY;

/// The laws that fail. Splines are left out: whoever changes a sample differs from them, too.
fn failed(plan: &Plan) -> Vec<String> {
    let report = check(plan).unwrap();
    let failed = || report.rows.iter().filter(|row| !row.passed);
    assert_eq!(report.passed, failed().next().is_none());
    failed().map(|row| row.name.clone()).filter(|name| !name.starts_with("spline_")).collect()
}

/// Multiplies all forces.
fn scale_forces(plan: &mut Plan, factor: f64) {
    let nodes = plan.splines.iter_mut().filter(|(name, ..)| name.ends_with("_force_nodes"));
    let nodes = nodes.flat_map(|(.., values)| values);
    for force in plan.foot_force.iter_mut().flatten().chain(nodes) {
        *force *= factor;
    }
}

/// Breaks a copy of a good plan and tells which laws fail.
fn broken(mut plan: Plan, breaking: impl FnOnce(&mut Plan)) -> Vec<String> {
    assert_eq!(failed(&plan), [""; 0], "the plan is not good to begin with");
    breaking(&mut plan);
    failed(&plan)
}

#[test]
fn good_plans_pass_everything() {
    for plan in [standing(), lifting(0.08), on_slope(0.2)] {
        assert_eq!(failed(&plan), [""; 0]);
    }
    let report = check(&lifting(0.08)).unwrap();
    let least = report.figures.iter().find(|row| row.name == "swing_apex_least").unwrap();
    assert!(
        (least.value - 80.0).abs() < 0.1 && least.foot.as_deref() == Some("LF") && least.time == Some(0.5)
    );
    assert_eq!(report.residuals.newton.len(), 201);
}

#[test]
fn laws_of_motion() {
    // Forces that bear 2 % less than the weight: over the limit in the mean, not at its worst.
    assert_eq!(broken(standing(), |p| scale_forces(p, 0.98)), ["newton_rms"]);
    assert_eq!(broken(standing(), |p| scale_forces(p, 0.95)), ["newton_rms", "newton_max"]);
    // One bad sample.
    assert_eq!(
        broken(standing(), |p| p.foot_force[4 * 100][2] += 0.04 * WEIGHT),
        ["newton_max", "euler_max"]
    );
    // Weight on the front feet, the center of mass between all four.
    let front_heavy = |p: &mut Plan| {
        for (i, force) in p.foot_force.iter_mut().enumerate() {
            force[2] += if i % 4 < 2 { 0.02 } else { -0.02 } * WEIGHT;
        }
    };
    assert_eq!(broken(standing(), front_heavy), ["euler_rms", "euler_max"]);
}

#[test]
fn a_turning_body_needs_torque() {
    // A constant spin about the body's z axis needs none, one about a skew axis does.
    let spin = |axis: [f64; 3]| {
        let mut plan = standing();
        for n in 0..plan.t.len() {
            let half = 0.5 * 0.15 * plan.t[n];
            plan.base_quaternion_wxyz[n] =
                [half.cos(), axis[0] * half.sin(), axis[1] * half.sin(), axis[2] * half.sin()];
            plan.base_angular_velocity[n] = axis.map(|a| 0.15 * a);
        }
        failed(&plan)
    };
    assert_eq!(spin([0.0, 0.0, 1.0]), ["rest"]);
    let skew = std::f64::consts::FRAC_1_SQRT_2;
    let report_at = |rate: f64| {
        let mut plan = standing();
        for n in 0..plan.t.len() {
            let half = 0.5 * rate * plan.t[n];
            plan.base_quaternion_wxyz[n] = [half.cos(), skew * half.sin(), 0.0, skew * half.sin()];
            plan.base_angular_velocity[n] = [skew * rate, 0.0, skew * rate];
        }
        let report = check(&plan).unwrap();
        report.rows.iter().find(|row| row.name == "euler_rms").unwrap().value
    };
    // ‖ω × Iω‖ = rate² · ½ (I_zz − I_xx), constant along the motion.
    let expected = 100.0 * 0.5 * (2.018 - 0.946) / (WEIGHT * 0.3);
    assert!((report_at(1.0) / expected - 1.0).abs() < 1e-3, "{} {expected}", report_at(1.0));
}

#[test]
fn derivatives_must_be_derivatives() {
    let within = |values: &mut Vec<[f64; 3]>, value| values[1..200].fill(value);
    assert_eq!(
        broken(standing(), |p| within(&mut p.base_linear_velocity, [0.0, 0.05, 0.0])),
        ["linear_consistency", "linear_consistency_max"]
    );
    assert_eq!(
        broken(standing(), |p| within(&mut p.base_linear_acceleration, [0.0, 0.0, 0.2])),
        ["newton_rms", "linear_consistency", "linear_consistency_max"]
    );
    assert_eq!(
        broken(standing(), |p| within(&mut p.base_angular_velocity, [0.0, 0.0, 0.05])),
        ["angular_consistency", "angular_consistency_max"]
    );
    assert_eq!(
        broken(lifting(0.08), |p| p.foot_velocity.iter_mut().flatten().for_each(|v| *v *= 1.02)),
        ["foot_velocity"]
    );
    assert_eq!(
        broken(lifting(0.08), |p| p.foot_acceleration.iter_mut().flatten().for_each(|a| *a *= 1.5)),
        ["foot_acceleration"]
    );
    assert_eq!(broken(standing(), |p| p.base_linear_velocity[200][1] = 1e-5), ["rest"]);
    assert_eq!(
        broken(standing(), |p| p.foot_velocity[4 * 100] = [0.18, 0.0, 0.0]),
        ["foot_velocity", "foot_acceleration", "stance_motion"]
    );
    assert_eq!(
        broken(standing(), |p| p.base_quaternion_wxyz[100..].fill([-1.0, 0.0, 0.0, 0.0])),
        ["quaternion"]
    );
}

#[test]
fn feet_and_ground() {
    let sunk = |p: &mut Plan| p.foot_position.iter_mut().for_each(|x| x[2] -= 0.002);
    assert_eq!(broken(standing(), sunk), ["stance_gap"]);
    let drifting =
        |p: &mut Plan| (0..201).for_each(|n| p.foot_position[4 * n + 1][0] += 0.0005 * n as f64 / 200.0);
    assert_eq!(broken(standing(), drifting), ["stance_slip"]);
    assert_eq!(
        broken(lifting(0.08), |p| p.foot_position[4 * 51][2] = -0.00015),
        ["foot_velocity", "swing_penetration"]
    );
    assert_eq!(failed(&lifting(0.05)), ["swing_apex_shortfall"]);
    let tilt = 0.0175_f64;
    assert_eq!(
        broken(standing(), |p| p.foot_normal[7] = [tilt, 0.0, (1.0 - tilt * tilt).sqrt()]),
        ["normal"]
    );
    assert_eq!(broken(on_slope(0.05), |p| ask(p, "contact", "max_slope = 0.02")), ["foothold_slope"]);
    let narrow = |p: &mut Plan| {
        p.ground.columns = 47;
        p.ground.height = vec![0.0; 47 * p.ground.rows];
    };
    assert_eq!(broken(standing(), narrow), ["terrain", "inside"]);
}

#[test]
fn forces() {
    let squeeze = |share: f64| {
        move |p: &mut Plan| {
            for n in 0..201 {
                p.foot_force[4 * n][1] += share * WEIGHT;
                p.foot_force[4 * n + 1][1] -= share * WEIGHT;
            }
        }
    };
    // The cone holds 0.8 · 0.75 · 0.25 m g.
    assert_eq!(broken(standing(), squeeze(0.149)), [""; 0]);
    assert_eq!(broken(standing(), squeeze(0.16)), ["friction"]);
    // On a slope beyond the friction angle, vertical forces leave the cone of the true normal.
    assert!(failed(&on_slope(0.8)).contains(&"friction".to_owned()));

    let diagonal = |share: f64| {
        move |p: &mut Plan| {
            for (i, force) in p.foot_force.iter_mut().enumerate() {
                force[2] = if matches!(i % 4, 0 | 3) { share } else { 0.5 - share } * WEIGHT;
            }
        }
    };
    assert_eq!(broken(standing(), diagonal(-0.002)), ["pull"]);
    let sucking = |p: &mut Plan| {
        p.foot_adhesive.fill(true);
        let (name, feet) = ("name = \"anymal_towr\"", "adhesive_feet = [\"LF\", \"RF\", \"LH\", \"RH\"]");
        p.meta.scenario = p.meta.scenario.replace(name, &format!("{name}\n{feet}"));
        diagonal(-0.1)(p);
    };
    assert_eq!(broken(standing(), sucking), [""; 0]);
    let sucking_too_much = |p: &mut Plan| {
        sucking(p);
        ask(p, "motion", "pull_limit = 0.05");
    };
    // Beyond the limit, nothing presses the foot onto the ground any more.
    assert_eq!(broken(standing(), sucking_too_much), ["shear", "pull_limit"]);
    assert_eq!(broken(standing(), |p| ask(p, "motion", "force_limit = 0.2")), ["force_limit"]);
    assert_eq!(broken(lifting(0.08), |p| p.foot_force[4 * 100] = [0.0, 0.0, 1e-4 * WEIGHT]), ["swing_force"]);
    let step = |p: &mut Plan| {
        for (i, force) in p.foot_force.iter_mut().enumerate().skip(4 * 100) {
            force[2] = if matches!(i % 4, 0 | 3) { 0.0 } else { 0.5 } * WEIGHT;
        }
    };
    assert_eq!(broken(standing(), step), ["force_jump"]);
}

#[test]
fn the_body() {
    let raise = |p: &mut Plan| p.base_position.iter_mut().for_each(|x| x[2] += 0.105);
    assert_eq!(broken(standing(), raise), ["reach"]);
    assert_eq!(
        broken(standing(), |p| ask(p, "motion", "base_clearance = 0.33")),
        ["base_clearance_shortfall"]
    );
    // A bump under the middle of the belly, where no corner is.
    let bump = |p: &mut Plan| p.ground.height[20 * 81 + 40] = 0.25;
    assert_eq!(broken(standing(), bump), ["terrain", "base_clearance_shortfall"]);
    let elsewhere = |key: &str| {
        let key = key.to_owned();
        move |p: &mut Plan| {
            let at = format!("[{key}]\nposition = [0.0, 0.0]");
            assert!(p.meta.scenario.contains(&at));
            p.meta.scenario = p.meta.scenario.replace(&at, &format!("[{key}]\nposition = [0.0, 0.005]"));
        }
    };
    assert_eq!(broken(standing(), elsewhere("start")), ["start", "start_yaw"]);
    assert_eq!(broken(standing(), elsewhere("goal")), ["start_yaw", "goal"]);
    let turned = |p: &mut Plan| p.meta.scenario = p.meta.scenario.replace("[start]", "[start]\nyaw = 0.1");
    assert_eq!(broken(standing(), turned), ["start_yaw"]);
    let longer = |p: &mut Plan| p.meta.scenario = p.meta.scenario.replace("horizon = 1.0", "horizon = 1.2");
    assert_eq!(broken(standing(), longer), ["horizon"]);
    let turn = |p: &mut Plan| p.meta.scenario = p.meta.scenario.replace("[goal]", "[goal]\nyaw = 0.1");
    assert_eq!(broken(standing(), turn), ["goal_yaw"]);
}

#[test]
fn jumps() {
    // A jump of the body breaks Newton's law as well, and its velocity.
    let hop = |p: &mut Plan| p.base_position[100..].iter_mut().for_each(|x| x[2] += 0.001);
    assert_eq!(
        broken(standing(), hop),
        ["newton_rms", "newton_max", "linear_consistency", "linear_consistency_max", "base_jump"]
    );
    let skip = |p: &mut Plan| (100..201).for_each(|n| p.foot_position[4 * n][1] += 0.0006);
    assert_eq!(broken(standing(), skip), ["foot_velocity", "stance_slip", "foot_jump"]);
}

#[test]
fn values_that_are_not_numbers_are_refused() {
    let mut plan = standing();
    plan.base_linear_acceleration[17][0] = f64::NAN;
    assert!(check(&plan).unwrap_err().to_string().contains("base_linear_acceleration"));
    let mut plan = standing();
    plan.foot_force.pop();
    assert!(check(&plan).unwrap_err().to_string().contains("foot_force"));
}

#[test]
fn limits_can_be_changed() {
    let folder = tempfile::tempdir().unwrap();
    let path = folder.path().join("limits.toml");
    let read = |text: &str| {
        std::fs::write(&path, text).unwrap();
        CheckLimits::default().read(&path)
    };
    let mut heavy = standing();
    scale_forces(&mut heavy, 0.98);
    assert!(check_with(&heavy, &read("newton_rms = 5").unwrap()).unwrap().passed);
    // A figure becomes a law when it gets a limit.
    let report = check_with(&standing(), &read("base_clearance_least = 100.0").unwrap()).unwrap();
    assert!(report.rows.iter().any(|row| row.name == "base_clearance_least" && !row.passed));
    let message = read("newton_rsm = 5").unwrap_err().to_string();
    assert!(message.contains("did you mean `newton_rms`?"), "{message}");
    assert!(read("newton_rms = nan").is_err() && read("newton_rms = \"a\"").is_err() && read("= 3").is_err());
    let strict = check_with(&standing(), &CheckLimits::new(true)).unwrap();
    assert!(
        strict.passed && strict.rows.iter().any(|row| row.name == "angular_speed_max" && row.limit == 1.0)
    );
}

#[test]
fn a_scenario_that_cannot_be_read_is_an_error() {
    let mut plan = standing();
    plan.meta.scenario = "nonsense".into();
    assert!(check(&plan).unwrap_err().to_string().contains("meta.scenario"));
    let mut plan = standing();
    plan.t[100] += 0.001;
    assert!(check(&plan).unwrap_err().to_string().contains("`t`"));
}
