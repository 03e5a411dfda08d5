//! Backtracking to a sufficient decrease, for the minimizers that have a gradient.

use super::lbfgs::Objective;

const SUFFICIENT_DECREASE: f64 = 1e-4;
const MAX_BACKTRACKS: usize = 30;
/// By how much a step is cut that does not decrease the value enough, and one to where it is infinite, that is, to a fold.
const CUT: [f64; 2] = [0.5, 0.3];

/// A step that was taken.
#[derive(Clone, Copy, Debug)]
pub(super) struct Accepted {
    /// The value at its end.
    pub value: f64,
    /// Its length, of the whole step.
    pub scale: f64,
}

/// Armijo's rule along x − scale · `direction`: the first of the scales 1, ½, ¼, … whose value is low enough; none where rounding
/// comes first. `value` is that at x, `decrement` is gᵀ `direction`.
///
/// The accepted point and its gradient are left in `trial` and `trial_gradient`; `evaluations` counts.
#[allow(clippy::too_many_arguments)] // where it stands, where it goes, and room for that
pub(super) fn backtrack(
    objective: &mut impl Objective,
    x: &[f64],
    value: f64,
    direction: &[f64],
    decrement: f64,
    trial: &mut [f64],
    trial_gradient: &mut [f64],
    evaluations: &mut usize,
) -> Option<Accepted> {
    let mut scale = 1.0;
    for _ in 0..MAX_BACKTRACKS {
        for ((t, x), d) in trial.iter_mut().zip(x).zip(direction) {
            *t = x - scale * d;
        }
        let next = objective.evaluate(trial, trial_gradient);
        *evaluations += 1;
        // An infinite value fails this.
        if next <= value - SUFFICIENT_DECREASE * scale * decrement {
            return Some(Accepted { value: next, scale });
        }
        scale *= CUT[usize::from(!next.is_finite())];
    }
    None
}
