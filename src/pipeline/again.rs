//! A motion is planned and judged. What fails is planned again, a few times: where limits are missed between the samples, these limits are tightened
//! by what was missed; over patches, other patches or other numbers of steps are tried.

use super::event::{Event, Step};
use crate::Result;
use crate::check::{CheckReport, check};
use crate::nlp::Tighter;
use crate::plan::sampled::Provenance;
use crate::plan::{CheckRow, Plan};
use crate::planner::{self, Host, Motion, Task, Trouble};
use crate::scenario::GivenMotion;

/// Limits are tightened this often, at most.
const MOST_TIGHTENED: usize = 2;
/// Limits are tightened by this multiple of what is missed, …
const TIGHTENED: f64 = 1.5;
/// … unless that is more than this, m, …
const MOST_LENGTH: f64 = 0.02;
/// … or this fraction of a limit.
const MOST_FRACTION: f64 = 0.15;
/// Iterations for a motion with flight whose legs have mass, at most: those that are found take 10 to 36.
const MOST_IN_FLIGHT: usize = 60;

/// A host of solves that passes on what happens.
pub(super) trait Teller: Host {
    /// Reports what asks for no answer: a request to stop takes effect at the next iteration.
    fn say(&mut self, event: &Event);
}

/// A motion, sampled and checked.
pub(super) struct Judged {
    pub motion: Motion,
    pub plan: Plan,
    pub check: CheckReport,
}

impl Judged {
    fn new(motion: Motion, provenance: &Provenance, host: &mut dyn Teller) -> Result<Self> {
        host.say(&Event::Step(Step::Plan));
        let mut plan = Plan::from_motion(&motion, provenance);
        let check = check(&plan)?;
        plan.meta.checks.clone_from(&check.rows);
        Ok(Self { motion, plan, check })
    }

    /// Whether nothing is left to try.
    fn is_done(&self) -> bool {
        self.motion.interrupted || (self.motion.solved && self.check.passed)
    }

    /// The feet and times at which something is wrong.
    fn troubles(&self, tolerance: f64) -> Vec<Trouble> {
        let names = &self.motion.model.foot_names;
        let violated = self.motion.violations.iter().filter(|block| block.largest > tolerance);
        let violated = violated.map(|block| (block.foot.as_ref(), Some(block.time)));
        let missed = self.check.rows.iter().filter(|row| !row.passed && self.motion.solved);
        let missed = missed.map(|row| (row.foot.as_ref(), row.time));
        let trouble = |(foot, time): (Option<&String>, Option<f64>)| {
            Some(Trouble { foot: names.iter().position(|name| Some(name) == foot)?, time: time? })
        };
        missed.chain(violated).filter_map(trouble).collect()
    }

    /// As a motion to go on from.
    fn given(&self) -> GivenMotion {
        let plan = &self.plan;
        let feet = plan.foot_names.len();
        let by_foot = |all: &[[f64; 3]]| -> Vec<Vec<[f64; 3]>> {
            (0..feet).map(|e| all.iter().skip(e).step_by(feet).copied().collect()).collect()
        };
        GivenMotion::from_samples(
            plan.t.clone(),
            plan.base_position.clone(),
            plan.base_quaternion_wxyz.clone(),
            by_foot(&plan.foot_position),
            by_foot(&plan.foot_force),
        )
    }
}

/// By how much the limits that a solved motion misses between its samples have to be tighter; none if it misses others, or too much.
fn lacking(rows: &[CheckRow]) -> Option<Tighter> {
    let mut lacking = Tighter::default();
    for row in rows.iter().filter(|row| !row.passed) {
        let (limit, by, most) = match row.name.as_str() {
            "reach" => (&mut lacking.reach, 1e-3 * row.value, MOST_LENGTH),
            "base_clearance_shortfall" => (&mut lacking.base_clearance, 1e-3 * row.value, MOST_LENGTH),
            "swing_apex_shortfall" => (&mut lacking.swing_clearance, 1e-3 * row.value, MOST_LENGTH),
            "joint_speed_limit" => (&mut lacking.joint_speed, 1e-2 * row.value - 1.0, MOST_FRACTION),
            "joint_torque_limit" => (&mut lacking.joint_torque, 1e-2 * row.value - 1.0, MOST_FRACTION),
            _ => return None,
        };
        if by.is_nan() || by > most {
            return None;
        }
        *limit = TIGHTENED * by;
    }
    Some(lacking)
}

/// Plans a motion, and again what fails. If nothing will do, the first result stays.
///
/// # Errors
/// Those of [`planner::attempt`] and [`check`].
pub(super) fn plan_motion(task: &Task, host: &mut dyn Teller, provenance: &Provenance) -> Result<Judged> {
    let mut first = Judged::new(planner::attempt(task, host)?, provenance, host)?;
    if first.is_done() {
        return Ok(first);
    }
    let mut tried = Vec::new();
    let last = match try_again(task, &first, host, provenance, &mut tried)? {
        Some(last) if last.is_done() && !last.motion.interrupted => return Ok(last),
        last => last,
    };
    if let Some(last) = last {
        first.motion.interrupted = last.motion.interrupted;
        first.motion.seconds.total = last.motion.seconds.total;
        first.motion.status = format!("{}; no better with {}", first.motion.status, tried.join("; with "));
    }
    planner::explain(task, host, &mut first.motion)?;
    Judged::new(first.motion, provenance, host)
}

/// Plans a motion with flight. In flight nothing holds the trunk against the swinging legs, and what their mass adds may not settle. So this
/// tries massive legs first, and massless ones if no motion is found.
///
/// # Errors
/// Those of [`plan_motion`].
pub(super) fn plan_flight(
    (massive, provenance): (&Task, &Provenance),
    (massless, lighter): (&Task, &Provenance),
    host: &mut dyn Teller,
) -> Result<Judged> {
    let mut scenario = massive.scenario.clone();
    scenario.solver.max_iterations = scenario.solver.max_iterations.min(MOST_IN_FLIGHT);
    let task = Task { scenario: &scenario, ..*massive };
    let first = Judged::new(planner::attempt(&task, host)?, provenance, host)?;
    if first.is_done() {
        return Ok(first);
    }
    let mut spent = first.motion.seconds.total;
    if first.motion.solved
        && let Some(last) = try_again(&task, &first, host, provenance, &mut Vec::new())?
    {
        if last.is_done() {
            return Ok(last);
        }
        spent = last.motion.seconds.total;
    }
    host.say(&Event::Note(
        "no motion is found whose legs have mass; planning with massless legs (physics.legs sets it)",
    ));
    host.say(&Event::Step(Step::Solve));
    let mut judged = plan_motion(massless, host, lighter)?;
    for seconds in [&mut judged.motion.seconds, &mut judged.plan.meta.solver.seconds] {
        seconds.total += spent;
    }
    Ok(judged)
}

/// Tries what may do in turn, until something does; the last that was tried, if there is anything to try.
fn try_again(
    task: &Task,
    first: &Judged,
    host: &mut dyn Teller,
    provenance: &Provenance,
    tried: &mut Vec<String>,
) -> Result<Option<Judged>> {
    let mut last: Option<Judged> = None;
    let what = if first.motion.solved { "a law is missed between the samples" } else { "no motion is found" };
    let mut attempt = |task: &Task, words: String, last: &Option<Judged>| -> Result<Judged> {
        host.say(&Event::Note(&format!("{what}; trying {words}")));
        host.say(&Event::Step(Step::Solve));
        let before = last.as_ref().unwrap_or(first);
        let mut again = planner::attempt_again(task, host, &before.motion)?;
        if again.solved {
            again.status = format!("{}; with {words}", again.status);
        }
        tried.push(words);
        Judged::new(again, provenance, host)
    };

    let mut tighter = Tighter::default();
    for _ in 0..MOST_TIGHTENED {
        let at = last.as_ref().unwrap_or(first);
        let Some(more) = lacking(&at.check.rows).filter(|_| at.motion.solved) else { break };
        tighter = tighter.and(&more);
        let from = at.given();
        let task = Task { tighter, guess: Some(&from), ..*task };
        let again = attempt(&task, tighter.words(), &last)?;
        let is_done = again.is_done();
        last = Some(again);
        if is_done {
            return Ok(last);
        }
    }

    let troubles = first.troubles(task.scenario.solver.tolerance);
    for other in planner::reassignments(task, &first.motion, &troubles) {
        let from = (other.goes_on && first.motion.solved).then(|| first.given());
        let again =
            attempt(&Task { steps: &other.steps, guess: from.as_ref(), ..*task }, other.words, &last)?;
        let is_done = again.is_done();
        last = Some(again);
        if is_done {
            break;
        }
    }
    Ok(last)
}

#[cfg(test)]
mod tests {
    use super::*;

    fn row(name: &str, value: f64, passed: bool) -> CheckRow {
        let (name, unit) = (name.to_owned(), "mm".to_owned());
        CheckRow { name, value, unit, limit: 1.0, passed, time: None, foot: None }
    }

    #[test]
    fn limits_are_tightened_by_more_than_they_are_missed_unless_others_are_missed_too() {
        let held = row("swing_penetration", 0.0, true);
        let reach = lacking(&[held.clone(), row("reach", 4.0, false)]).expect("less reach");
        assert_eq!(reach, Tighter { reach: TIGHTENED * 4e-3, ..Tighter::default() });
        let speed = lacking(&[row("joint_speed_limit", 104.0, false)]).expect("less speed");
        assert!((speed.joint_speed - TIGHTENED * 0.04).abs() < 1e-12);
        for other in [row("euler_max", 4.0, false), row("reach", 40.0, false), row("reach", f64::NAN, false)]
        {
            assert_eq!(lacking(&[row("reach", 4.0, false), other.clone()]), None, "{other:?}");
        }
    }
}
