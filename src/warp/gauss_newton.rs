//! Gauss–Newton with a line search that stays where space is not folded.
//!
//! The linear systems are solved by conjugate gradients with the tensor-product preconditioner. A sparse factorization is no
//! match for that: tri-cubic splines couple each coefficient with 343 others in each of three components, and the factor fills.

use std::ops::ControlFlow;

use super::barrier::{Barrier, Curvature};
use super::lbfgs::{Limits, Objective, Outcome, add, dot};
use super::line_search::backtrack;
use super::problem::Problem;

/// Where it settles it does so within two dozen, and each is dear.
const MAX_ITERATIONS: usize = 60;
/// Conjugate gradients by iteration, at most. (With 20 it takes three times as many iterations on the hard hill.)
const MAX_INNER: usize = 40;
/// A step that had to be cut, for it folds space somewhere, asks for damping in the next, of the points that are about to fold
/// (`Barrier::curvature`). Least and greatest, and by how much it changes. (With an even damping, K, steps stayed cut to a 16th:
/// one point on the way to its fold keeps back all.)
const DAMPING: [f64; 2] = [0.01, 10.0];
const DAMPING_FACTOR: f64 = 4.0;

/// Minimizes from u, which must not be folded. `progress` sees the iteration, the energy and gᵀd, d the step.
pub(super) fn gauss_newton(
    problem: &mut Problem<'_, Barrier>,
    u: &mut Vec<f64>,
    limits: Limits,
    progress: &mut dyn FnMut(usize, f64, f64) -> ControlFlow<()>,
) -> Outcome {
    let mut gradient = vec![0.0; u.len()];
    let mut value = problem.evaluate(u, &mut gradient);
    let mut outcome = Outcome { evaluations: 1, value, ..Outcome::default() };
    if !value.is_finite() {
        return outcome;
    }
    let mut trial = u.clone();
    let mut trial_gradient = gradient.clone();
    let mut damping = 0.0;
    loop {
        let mut step = newton_step(problem, u, &gradient, damping);
        let mut decrement = dot(&step, &gradient);
        let tolerance = limits.tolerance * (value.abs() + limits.floor);
        if decrement <= tolerance && damping > 0.0 {
            // Short steps are no sign of a minimum where damping made them short.
            damping = 0.0;
            step = newton_step(problem, u, &gradient, damping);
            decrement = dot(&step, &gradient);
        }
        (outcome.value, outcome.decrement) = (value, decrement);
        if progress(outcome.iterations, value, decrement).is_break() {
            outcome.interrupted = true;
            return outcome;
        }
        if decrement <= tolerance {
            outcome.converged = true;
            return outcome;
        }
        if outcome.iterations >= limits.iterations.min(MAX_ITERATIONS) {
            return outcome;
        }
        let accepted = backtrack(
            problem,
            u,
            value,
            &step,
            decrement,
            &mut trial,
            &mut trial_gradient,
            &mut outcome.evaluations,
        );
        let Some(accepted) = accepted else { return outcome };
        damping = match accepted.scale < 1.0 {
            true => (DAMPING_FACTOR * damping).clamp(DAMPING[0], DAMPING[1]),
            false if damping > DAMPING[0] => damping / DAMPING_FACTOR,
            false => 0.0,
        };
        std::mem::swap(u, &mut trial);
        std::mem::swap(&mut gradient, &mut trial_gradient);
        value = accepted.value;
        outcome.iterations += 1;
    }
}

/// (H + damping D)⁻¹ g, to a residual that falls with the gradient, by preconditioned conjugate gradients.
fn newton_step(problem: &mut Problem<'_, Barrier>, u: &[f64], gradient: &[f64], damping: f64) -> Vec<f64> {
    let linearized = problem.linearized(u, |density, jacobian| density.curvature(jacobian, damping));
    let mut step = vec![0.0; gradient.len()];
    let mut rest = gradient.to_vec();
    let mut conditioned = rest.clone();
    problem.precondition(&mut conditioned);
    let mut direction = conditioned.clone();
    let mut product = vec![0.0; gradient.len()];
    let first = dot(&rest, &conditioned);
    let mut square = first;
    for _ in 0..MAX_INNER {
        problem.curved(&linearized, Curvature::times, &mut direction, &mut product);
        let curvature = dot(&direction, &product);
        if curvature <= 0.0 {
            break;
        }
        let length = square / curvature;
        add(&mut step, length, &direction);
        add(&mut rest, -length, &product);
        conditioned.copy_from_slice(&rest);
        problem.precondition(&mut conditioned);
        let next = dot(&rest, &conditioned);
        if next <= FORCING * FORCING * first {
            break;
        }
        let ratio = next / square;
        square = next;
        for (d, c) in direction.iter_mut().zip(&conditioned) {
            *d = c + ratio * *d;
        }
    }
    step
}

/// The residual of a linear system, in the preconditioner's norm, relative to the gradient.
const FORCING: f64 = 0.1;
