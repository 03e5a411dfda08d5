//! A solve that says why, when no motion is found: which limits would have to give, and with which value of one key of the scenario a motion is
//! found, if there is one. Each value is tried by a solve.

use std::time::Duration;

use super::elastic::{self, Explanation, Shortfall};
use super::guess::guess;
use super::legs;
use super::motion::Motion;
use super::problem::{Choice, GaitProblem};
use super::solve::{Host, Progress, attempt};
use super::stage::Stage;
use super::steps::Steps;
use super::task::Task;
use crate::Result;
use crate::ipopt::INTERRUPT;
use crate::scenario::{Effort, Scenario};

/// Looking for a reason takes twice as long as the solve at most, or this long if that is more, s.
const LEAST_SECONDS: u64 = 30;
/// What is added to what lacks, as a fraction of it.
const TO_SPARE: f64 = 0.1;
/// Longer horizons that are tried, as multiples of the scenario's.
const LONGER: [f64; 2] = [1.25, 1.6];
/// Limits that more time may keep.
const HURRIED: [&str; 6] = ["reach", "joint speed", "joint torque", "friction", "normal force", "goal"];
/// A scenario with another horizon lasts this long at most, s.
const LONGEST: f64 = 600.0;

/// Another value of a key of the scenario.
struct Remedy {
    key: &'static str,
    /// The value, and that of the scenario, as text.
    to: String,
    from: String,
    scenario: Scenario,
}

/// Says why no motion was found, if that is so and `solver.explain` is on: [`Motion::explanation`].
///
/// # Errors
/// Those of [`attempt`].
pub(super) fn explain(task: &Task, host: &mut dyn Host, motion: &mut Motion) -> Result<()> {
    if !task.scenario.solver.explain || motion.solved || motion.interrupted {
        return Ok(());
    }
    let Some(mut explanation) = shortfalls(task, host, motion) else { return Ok(()) };
    for Remedy { key, to, from, mut scenario } in remedies(task.scenario, &explanation.shortfalls) {
        if motion.interrupted || explanation.remedy.is_some() {
            break;
        }
        scenario.solver.effort = Effort::Feasible;
        // Another horizon has other steps, and may be refused.
        let other_steps = if key == "horizon" {
            match Steps::of(&scenario, task.robot, task.surfaces) {
                Ok(steps) => Some(steps),
                Err(_) => continue,
            }
        } else {
            None
        };
        let steps = other_steps.as_ref().unwrap_or(task.steps);
        let other = attempt(&Task { scenario: &scenario, steps, ..*task }, host)?;
        motion.interrupted |= other.interrupted;
        explanation.remedy = other.solved.then(|| [key.to_owned(), to, from]);
    }
    motion.explanation = Some(explanation);
    Ok(())
}

/// Which limits would have to give.
fn shortfalls(task: &Task, host: &mut dyn Host, motion: &mut Motion) -> Option<Explanation> {
    // The whole problem with second derivatives, whatever was solved last, from the guess: a solve that failed can end anywhere.
    let Task { scenario, .. } = task;
    let mut model = task.model().ok()?;
    let x = guess(scenario, &model, None).ok()?;
    model.leg_terms = legs::terms(&model, &x, scenario.physics.law).unwrap_or_default();
    let choice = Choice { with_costs: true, exact_hessian: true };
    let mut problem = GaitProblem::new(scenario, model, x.clone(), choice);
    let spent = Duration::try_from_secs_f64(motion.seconds.total).unwrap_or_default();
    let limit = (2 * spent).max(Duration::from_secs(LEAST_SECONDS));
    let (before, mut stopped) = (motion.iterations, false);
    let explanation = elastic::explain(&mut problem, &x, &scenario.solver, limit, &mut |record| {
        let iteration = before + record.iteration;
        let flow = host.on_iteration(&Progress { stage: Stage::Why, iteration, record, iterate: None });
        stopped = flow.is_break();
        flow
    });
    motion.interrupted |= stopped || INTERRUPT.is_raised();
    explanation
}

/// What is worth a try: if all that gives belongs to one key, a value of that with a little to spare; else more time, where that may do.
fn remedies(scenario: &Scenario, shortfalls: &[Shortfall]) -> Vec<Remedy> {
    let Some(first) = shortfalls.first() else { return Vec::new() };
    let of_one_key = shortfalls.iter().all(|shortfall| shortfall.block == first.block);
    let own = of_one_key.then(|| own_remedy(scenario, &first.block, shortfalls)).flatten();
    let hurried = shortfalls.iter().any(|shortfall| HURRIED.contains(&shortfall.block.as_str()));
    own.into_iter().chain(hurried.then(|| longer(scenario)).into_iter().flatten()).collect()
}

/// Another value of the key that a block of limits belongs to.
fn own_remedy(scenario: &Scenario, block: &str, shortfalls: &[Shortfall]) -> Option<Remedy> {
    let most = shortfalls.iter().map(|shortfall| shortfall.amount).fold(0.0, f64::max);
    let (meters, by) = (1e-3 * (1.0 + TO_SPARE) * most, 1e-2 * (1.0 + TO_SPARE) * most);
    let less = |value: f64| (((value - meters) * 1e3).floor() / 1e3).max(0.0);
    let more = |value: f64, by: f64| ((value + by) * 1e3).ceil() / 1e3;
    let mut changed = scenario.clone();
    let (motion, posture) = (&mut changed.motion, &mut changed.posture);
    let widened =
        |[least, greatest]: [f64; 2]| [(((least - meters) * 1e3).floor() / 1e3), more(greatest, meters)];
    let (key, to, from) = match (block, [posture.height, posture.roll, posture.pitch]) {
        ("swing clearance", _) => {
            let from = std::mem::replace(&mut motion.swing_clearance, less(scenario.motion.swing_clearance));
            ("motion.swing_clearance", motion.swing_clearance.to_string(), from.to_string())
        }
        ("base clearance", _) => {
            let from = std::mem::replace(&mut motion.base_clearance, less(scenario.motion.base_clearance));
            ("motion.base_clearance", motion.base_clearance.to_string(), from.to_string())
        }
        ("normal force", _) => {
            let from = std::mem::replace(&mut motion.force_limit, more(scenario.motion.force_limit, by));
            ("motion.force_limit", motion.force_limit.to_string(), from.to_string())
        }
        ("way-points", _) => {
            let distance = &mut changed.goal.waypoint_distance;
            // The rows are those of a square inside of the circle.
            let from = std::mem::replace(distance, more(scenario.goal.waypoint_distance, 1.5 * meters));
            ("goal.waypoint_distance", distance.to_string(), from.to_string())
        }
        ("foothold slope", _) => {
            let from = scenario.contact.max_slope?;
            let to = more(from, by);
            changed.contact.max_slope = Some(to);
            ("contact.max_slope", to.to_string(), from.to_string())
        }
        ("posture", [Some(range), None, None]) => {
            posture.height = Some(widened(range));
            ("posture.height", format!("{:?}", widened(range)), format!("{range:?}"))
        }
        ("posture", [None, Some(range), None]) => {
            posture.roll = Some(widened(range));
            ("posture.roll", format!("{:?}", widened(range)), format!("{range:?}"))
        }
        ("posture", [None, None, Some(range)]) => {
            posture.pitch = Some(widened(range));
            ("posture.pitch", format!("{:?}", widened(range)), format!("{range:?}"))
        }
        _ => return None,
    };
    Some(Remedy { key, to, from, scenario: changed })
}

/// The scenario with more time, where nothing in it has a time of its own.
fn longer(scenario: &Scenario) -> Vec<Remedy> {
    let gait = &scenario.gait;
    let timed = scenario.goal.waypoints.iter().any(|stop| stop.time.is_some())
        || scenario.foothold.iter().any(|spec| spec.time.is_some());
    if timed
        || gait.phases.is_some()
        || gait.sequence.is_some()
        || gait.periodic
        || !scenario.force.is_empty()
    {
        return Vec::new();
    }
    let remedy = |factor: f64| {
        let horizon = scenario.time_step * (factor * scenario.horizon / scenario.time_step).ceil();
        let to = (1e3 * horizon).round() / 1e3;
        let from = scenario.horizon.to_string();
        Remedy {
            key: "horizon",
            to: to.to_string(),
            from,
            scenario: Scenario { horizon: to, ..scenario.clone() },
        }
    };
    LONGER.map(remedy).into_iter().filter(|remedy| remedy.scenario.horizon <= LONGEST).collect()
}
