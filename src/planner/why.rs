//! A solve that says why, when no motion is found: which limits would have to give, and whether one key of the scenario would do.

use super::elastic::remedy;
use super::motion::Motion;
use super::solve::{Host, Task, attempt};
use crate::Result;
use crate::scenario::{Effort, Scenario};

/// Plans a motion; if none is found and `solver.explain` is on, [`Motion::explanation`] says why.
///
/// # Errors
/// Those of [`attempt`].
pub(super) fn attempt_or_explain(task: &Task, host: &mut dyn Host) -> Result<Motion> {
    let mut motion = attempt(task, host)?;
    let Some(mut explanation) = motion.explanation.take() else { return Ok(motion) };
    if let Some((key, to, from)) = remedy(task.scenario, &explanation.shortfalls) {
        let mut scenario: Scenario = task.scenario.clone();
        match key {
            "motion.swing_clearance" => scenario.motion.swing_clearance = to,
            "motion.base_clearance" => scenario.motion.base_clearance = to,
            _ => scenario.motion.force_limit = to,
        }
        scenario.solver.effort = Effort::Feasible;
        scenario.solver.explain = false;
        let other = attempt(&Task { scenario: &scenario, ..*task }, host)?;
        motion.interrupted |= other.interrupted;
        explanation.remedy = other.solved.then(|| [key.to_owned(), to.to_string(), from.to_string()]);
    }
    motion.explanation = Some(explanation);
    Ok(motion)
}
