//! When no motion is found: would one be, if the plan used more of the friction?

use super::motion::Motion;
use super::solve::{Host, attempt};
use super::task::Task;
use crate::Result;
use crate::scenario::{Effort, Scenario};

/// Adds to the status of a motion that was not found with which smaller `contact.friction_margin` one is found, if there is one.
///
/// Solves once more with no margin and, if that succeeds, with half of the margin; feasible points suffice.
///
/// # Errors
/// Those of [`attempt`].
pub(super) fn advise(task: &Task, host: &mut dyn Host, motion: &mut Motion) -> Result<()> {
    let margin = task.scenario.contact.friction_margin;
    if motion.solved || motion.interrupted || margin == 0.0 {
        return Ok(());
    }
    let mut with_margin = |margin: f64| -> Result<Motion> {
        let mut scenario: Scenario = task.scenario.clone();
        scenario.contact.friction_margin = margin;
        scenario.solver.effort = Effort::Feasible;
        attempt(&Task { scenario: &scenario, ..*task }, host)
    };
    let without = with_margin(0.0)?;
    motion.interrupted = without.interrupted;
    if without.solved {
        let half = with_margin(0.5 * margin)?;
        motion.interrupted |= half.interrupted;
        let enough = if half.solved { 0.5 * margin } else { 0.0 };
        motion.status = format!(
            "{}; with contact.friction_margin = {enough} instead of {margin} the constraints can be met (the laws were not checked)",
            motion.status
        );
    }
    Ok(())
}
