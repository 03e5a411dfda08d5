//! Algorithm 1, the paper's first solver of Eq. 6, for μ = 0: alternately the target of each point by itself (local) and all
//! coefficients at once (global).

use super::density::Density;
use super::objective::{Minimized, Observer, StoppingLimits};
use super::problem::WarpProblem;

/// Where it converges it takes a few dozen rounds; where the map is folded it never does.
const MAX_ROUNDS: usize = 150;

/// Alternates from v and returns where it ends. The observer receives the square of the last step, in the norm of the energy, as the decrement.
///
/// Each round freezes the ground under the bottom face, and with it the ground's slope. So the energy may rise, and the limit is not
/// a minimum of Eq. 6.
pub(super) fn alternate<D: Density>(
    problem: &mut WarpProblem<'_, D>,
    v: Vec<f64>,
    limits: StoppingLimits,
    observer: &mut Observer,
) -> (Vec<f64>, Minimized) {
    let limits = limits.at_most(MAX_ROUNDS);
    let mut u = problem.on_ground(v);
    let mut minimized = Minimized::default();
    loop {
        let (value, decrement) = problem.alternate(&mut u);
        minimized.evaluations += 1;
        if minimized.must_stop(value, decrement, &limits, observer) || !value.is_finite() {
            break;
        }
        minimized.iterations += 1;
    }
    // The bottom face is still on the ground of the last round's start; the unknowns are relative to it.
    (problem.unknowns(u), minimized)
}
