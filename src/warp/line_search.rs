//! Backtracking line search (Armijo's rule).

use super::objective::{Iterate, Objective};

/// The decrease asked of a step, as a fraction of the decrease to first order.
const SUFFICIENT_DECREASE: f64 = 1e-4;
/// After so many cuts, at least 2⁻³⁰ of the step, a decrease would be lost in rounding.
const MAX_BACKTRACKS: usize = 30;
/// Factor of a step that does not decrease the value enough.
const CUT: f64 = 0.5;
/// Factor of a step to where the value is infinite, that is, where space folds.
const FOLD_CUT: f64 = 0.3;

/// Moves along x − scale · `direction` from `current` with the first of the scales 1, ½, ¼, … that decreases the value enough, and
/// returns that scale; none where there is none. `decrement` is gᵀ `direction`.
///
/// The accepted point is in `trial`; `evaluations` counts the objective's.
pub(super) fn backtrack(
    objective: &mut impl Objective,
    current: &Iterate,
    direction: &[f64],
    decrement: f64,
    trial: &mut Iterate,
    evaluations: &mut usize,
) -> Option<f64> {
    let mut scale = 1.0;
    for _ in 0..MAX_BACKTRACKS {
        for ((t, x), d) in trial.x.iter_mut().zip(&current.x).zip(direction) {
            *t = x - scale * d;
        }
        trial.value = objective.evaluate(&trial.x, &mut trial.gradient);
        *evaluations += 1;
        // False for an infinite value.
        if trial.value <= current.value - SUFFICIENT_DECREASE * scale * decrement {
            return Some(scale);
        }
        scale *= if trial.value.is_finite() { CUT } else { FOLD_CUT };
    }
    None
}
