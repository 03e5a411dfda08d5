//! Algorithm 1: the target of every point by itself (local), then all coefficients at once (global), in turn.

use std::ops::ControlFlow;

use super::density::Density;
use super::lbfgs::{Limits, Outcome};
use super::problem::Problem;

/// Where it settles it does so within a few dozen rounds; over folded places it wanders without end.
const MAX_ROUNDS: usize = 150;

/// Alternates from u. `progress` sees the iteration, the energy and the square of the last step in the energy's norm.
///
/// The ground under the bottom is frozen in each round, and nothing of its slope reaches the points of the map: the energy
/// need not fall, and where it settles is no minimum.
pub(super) fn alternate<D: Density>(
    problem: &mut Problem<D>,
    u: &mut [f64],
    limits: Limits,
    progress: &mut dyn FnMut(usize, f64, f64) -> ControlFlow<()>,
) -> Outcome {
    let mut scratch = [vec![0.0; u.len()], vec![0.0; u.len()]];
    let mut outcome = Outcome::default();
    loop {
        let (value, decrement) = problem.alternate(u, &mut scratch);
        (outcome.value, outcome.decrement) = (value, decrement);
        outcome.evaluations += 1;
        if progress(outcome.iterations, value, decrement).is_break() {
            outcome.interrupted = true;
            break;
        }
        if decrement <= limits.tolerance * (value + limits.floor) {
            outcome.converged = true;
            break;
        }
        if outcome.iterations >= limits.iterations.min(MAX_ROUNDS) || !value.is_finite() {
            break;
        }
        outcome.iterations += 1;
    }
    // The bottom is on the ground of the round before.
    problem.seat(u);
    outcome
}
