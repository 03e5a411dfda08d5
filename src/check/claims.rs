//! What the plan says of itself, against the scenario that it carries: robot, limits, timing, solver.
//!
//! Where robot or friction differ, the plan is judged by what the scenario asks for.

use std::path::Path;

use super::laws;
use super::subject::{Finding, Subject, Worst, larger};
use crate::plan::{MetaRobot, Plan};
use crate::robot::{Box3, Robot};
use crate::scenario::{Formulation, Scenario};
use crate::{Error, Result};

/// Acceleration of gravity of every plan, m/s².
const GRAVITY: [f64; 3] = [0.0, 0.0, -9.81];
/// Relative difference of numbers that are the same up to rounding.
const ROUNDING: f64 = 1e-9;
/// How far the violation in the history may be from that of the result, as a fraction of the tolerance.
const RELAXED: f64 = 0.01;

/// The robot that the scenario asks for: a shipped one, or, as a robot file is not part of a plan, that of the plan with the scenario's
/// friction.
///
/// # Errors
/// For the name of a robot that does not ship with the program.
pub(super) fn asked_robot(plan: &Plan, scenario: &Scenario) -> Result<MetaRobot> {
    let stated = &plan.meta.robot;
    let friction = scenario.contact.friction;
    if scenario.robot.file.is_some() {
        return Ok(MetaRobot { friction, gravity: GRAVITY, ..stated.clone() });
    }
    let robot = Robot::load(&scenario.robot, Path::new("."))
        .and_then(|robot| match &scenario.payload {
            Some(payload) => robot.with_payload(payload.mass, payload.position),
            None => Ok(robot),
        })
        .map_err(|e| Error::input(format!("meta.scenario: {e}")))?;
    Ok(MetaRobot {
        name: robot.name.clone(),
        mass: robot.mass,
        inertia: robot.inertia,
        friction,
        gravity: GRAVITY,
        reach: robot.feet.iter().map(|foot| foot.reach).collect(),
        torso: robot.torso,
        foot_radius: robot.foot_radius(),
        // Plans of version 0.1.0 and before know massless legs only.
        legs: if stated.nominal.is_empty() && plan.legs.is_none() {
            Vec::new()
        } else {
            MetaRobot::legs_of(&robot, scenario)
        },
        sagittal: robot.sagittal_radii(),
        nominal: robot.feet.iter().map(|foot| foot.nominal).collect(),
    })
}

pub(super) fn findings(s: &Subject, findings: &mut Vec<Finding>, remarks: &mut Vec<String>) {
    let before = remarks.len();
    robot(s, remarks);
    limits(s, remarks);
    parts(s, remarks);
    findings.push((laws::CLAIMS, Worst::overall((remarks.len() - before) as f64)));
    let solved = s.plan.meta.solver.success;
    findings.push((laws::SOLVED, Worst::overall(f64::from(u8::from(!solved)))));
    findings.push((laws::MAGNITUDE, Worst::overall(magnitude(s.plan))));
    findings.push((laws::HISTORY, Worst::overall(history(s))));
    horizon(s, findings);
}

/// The largest number in the plan but for the history. Numbers near the largest that there are would turn into infinities and into what
/// is not a number.
fn magnitude(plan: &Plan) -> f64 {
    let base = [
        &plan.base_position,
        &plan.base_linear_velocity,
        &plan.base_linear_acceleration,
        &plan.base_angular_velocity,
        &plan.base_angular_acceleration,
    ];
    let feet = [
        &plan.foot_position,
        &plan.foot_velocity,
        &plan.foot_acceleration,
        &plan.foot_force,
        &plan.foot_normal,
    ];
    let legs = plan.legs.iter().flat_map(|legs| [&legs.shift, &legs.angular_momentum]);
    let warped = plan.warped.iter().flat_map(|w| [&w.foot_position, &w.foot_force]);
    let warped_base = plan.warped.iter().flat_map(|w| &w.base).flat_map(|b| [&b.position, &b.euler]);
    let map = plan.map.iter().map(|map| &map.control_points);
    let joints = plan.legs.iter().flat_map(|legs| &legs.joints).flat_map(|j| [&j.position, &j.torque]);
    let points = base.into_iter().chain(feet).chain(legs).chain(warped).chain(warped_base).chain(map);
    let splines = plan.splines.iter().map(|(.., values)| values);
    let numbers = plan.phase_durations.iter().chain(splines).chain(joints);
    let ground = [Some(&plan.ground.height), plan.ground.raw.as_ref()];
    points
        .flatten()
        .flatten()
        .chain(plan.patches.iter().flatten().flatten().flatten())
        .chain(numbers.chain(ground.into_iter().flatten()).flatten())
        .chain(&plan.ground.origin)
        .chain(&plan.ground.spacing)
        .fold(0.0, |largest, number| larger(largest, number.abs()))
}

/// Whether numbers are the same up to rounding.
fn same(a: &[f64], b: &[f64]) -> bool {
    a.len() == b.len() && a.iter().zip(b).all(|(a, b)| (a - b).abs() <= ROUNDING * (1.0 + b.abs()))
}

/// Adds a remark where the plan states something else than the scenario asks for.
fn compare(remarks: &mut Vec<String>, key: &str, stated: &[f64], asked: &[f64]) {
    if !same(stated, asked) {
        let words = |values: &[f64]| match values {
            [value] => format!("{value:?}"),
            _ => format!("{values:?}"),
        };
        remarks.push(format!(
            "{key} is {} where the scenario asks for {}, by which the plan is judged",
            words(stated),
            words(asked)
        ));
    }
}

fn robot(s: &Subject, remarks: &mut Vec<String>) {
    let (stated, asked) = (&s.plan.meta.robot, &s.robot);
    if stated.name != asked.name {
        remarks
            .push(format!("meta.robot.name is \"{}\", that of the scenario \"{}\"", stated.name, asked.name));
    }
    let numbers = |b: &Box3| [b.center, b.half_size].concat();
    for (key, a, b) in [
        ("mass", vec![stated.mass], vec![asked.mass]),
        ("inertia", stated.inertia.concat(), asked.inertia.concat()),
        ("friction", vec![stated.friction], vec![asked.friction]),
        ("gravity", stated.gravity.to_vec(), asked.gravity.to_vec()),
        ("torso", numbers(&stated.torso), numbers(&asked.torso)),
    ] {
        compare(remarks, &format!("meta.robot.{key}"), &a, &b);
    }
    for (e, (a, b)) in stated.reach.iter().zip(&asked.reach).enumerate() {
        compare(remarks, &format!("meta.robot.reach[{e}]"), &numbers(a), &numbers(b));
    }
    if stated.legs != asked.legs {
        let stated = if stated.legs.is_empty() { "is missing" } else { "has other links" };
        remarks.push(format!(
            "meta.robot.legs {stated}; by those that the scenario asks for the plan is judged"
        ));
    }
    if !stated.nominal.is_empty() {
        compare(remarks, "meta.robot.nominal", &stated.nominal.concat(), &asked.nominal.concat());
    }
    if s.plan.legs.is_some() != s.body.is_some() {
        let verb = if s.plan.legs.is_some() { "has" } else { "lacks" };
        remarks.push(format!(
            "a plan that {verb} center_of_mass_shift, for legs of which the scenario asks the opposite"
        ));
    }
    // Plans of version 0.1.0 and before state no radius.
    if s.plan.meta.limits.is_some() {
        compare(remarks, "meta.robot.foot_radius", &[stated.foot_radius], &[asked.foot_radius]);
    }
}

fn limits(s: &Subject, remarks: &mut Vec<String>) {
    let Some(stated) = &s.plan.meta.limits else { return };
    let (motion, contact) = (&s.scenario.motion, &s.scenario.contact);
    for (key, stated, asked) in [
        ("force_limit", stated.force_limit, motion.force_limit),
        ("pull_limit", stated.pull_limit, motion.pull_limit),
        ("swing_clearance", stated.swing_clearance, motion.swing_clearance),
        ("base_clearance", stated.base_clearance, motion.base_clearance),
        ("friction", stated.friction, contact.friction),
        ("friction_margin", stated.friction_margin, contact.friction_margin),
    ] {
        compare(remarks, &format!("meta.limits.{key}"), &[stated], &[asked]);
    }
}

/// Feet, formulation, and the verdicts of earlier checks.
fn parts(s: &Subject, remarks: &mut Vec<String>) {
    let (plan, scenario) = (s.plan, s.scenario);
    let (stated, rate) = (plan.meta.sample_rate_hz, 1.0 / s.step);
    if !same(&[stated], &[rate]) {
        remarks.push(format!("meta.sample_rate_hz is {stated:?}, that of `t` {rate:?}"));
    }
    if let Ok(robot) = Robot::load(&scenario.robot, Path::new("."))
        && scenario.robot.file.is_none()
        && robot.foot_names() != plan.foot_names
    {
        let (stated, asked) = (plan.foot_names.join(", "), robot.foot_names().join(", "));
        remarks.push(format!("foot_names are {stated}, those of the robot {asked}"));
    }
    for (name, adhesive) in plan.foot_names.iter().zip(&plan.foot_adhesive) {
        if scenario.robot.adhesive_feet.contains(name) != *adhesive {
            let stated = if *adhesive { "adhesive" } else { "not adhesive" };
            remarks.push(format!("foot_adhesive: {name} is {stated}, unlike in robot.adhesive_feet"));
        }
    }
    let formulation = scenario.formulation();
    if plan.meta.formulation != formulation {
        let stated = plan.meta.formulation;
        remarks.push(format!("meta.formulation is {stated}, that of the scenario {formulation}"));
    }
    let warped = |needed: bool, has: bool, what: &str| {
        (needed != has).then(|| {
            let verb = if has { "has" } else { "lacks" };
            format!("a {formulation} plan that {verb} {what}")
        })
    };
    let feet = formulation != Formulation::Direct;
    let base = formulation == Formulation::Warped;
    remarks.extend(warped(feet, plan.map.is_some(), "a map (map_control_points)"));
    remarks.extend(warped(feet, plan.warped.is_some(), "warped_foot_position"));
    remarks.extend(warped(
        base,
        plan.warped.as_ref().is_some_and(|w| w.base.is_some()),
        "warped_base_position",
    ));
}

/// 0 if a row of the history has the violation of the result, its times increase up to the total, and it is as it was written; else
/// more than that. Ipopt sums the violation in another order, and measures from bounds that it relaxes a little.
fn history(s: &Subject) -> f64 {
    let (plan, solver) = (s.plan, &s.plan.meta.solver);
    let allowed = RELAXED * s.scenario.solver.tolerance;
    let off = |violation: &f64| {
        let difference = (violation - solver.max_violation).abs();
        (difference - allowed).max(0.0) / (1e-12 + solver.max_violation.abs())
    };
    let nearest = plan.history_constraint_violation.iter().map(off);
    let nearest = nearest.reduce(|a, b| -larger(-a, -b)).unwrap_or(1.0);
    let times = &plan.history_seconds;
    let increase = times.windows(2).all(|pair| pair[1] > pair[0]) && times.first().is_some_and(|t| *t >= 0.0);
    let total = solver.seconds.total - solver.seconds.map;
    let within = times.last().is_some_and(|t| *t <= total * (1.0 + ROUNDING));
    let unchanged = solver.history_sha256.as_ref().is_none_or(|digest| *digest == plan.history_sha256());
    larger(nearest, if increase && within && unchanged { 0.0 } else { 1.0 })
}

/// The plan's duration, and that of every foot's phases, against the scenario's.
fn horizon(s: &Subject, findings: &mut Vec<Finding>) {
    // As the planner has it: a whole number of time steps.
    let step = s.scenario.time_step;
    let horizon = (s.scenario.horizon / step).round() * step;
    let mut worst = Worst::default();
    worst.meet((s.plan.t[s.samples - 1] - horizon).abs(), s.samples - 1, None);
    for (e, durations) in s.plan.phase_durations.iter().enumerate() {
        worst.meet((durations.iter().sum::<f64>() - horizon).abs(), s.samples - 1, Some(e));
    }
    findings.push((laws::HORIZON, worst));
}
