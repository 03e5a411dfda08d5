//! Gauss–Newton with a line search that keeps space from folding: the paper's second solver of Eq. 6, for μ > 0 (Section IV-B).
//!
//! The linear systems are solved by conjugate gradients with the tensor-product preconditioner. A sparse factorization is slower:
//! tri-cubic splines couple each coefficient with 343 others in each of three components, and the factor fills in.

use super::barrier::{Barrier, BarrierCurvature};
use super::line_search::backtrack;
use super::objective::{Iterate, Minimized, Objective, Observer, StoppingLimits, add, dot};
use super::problem::WarpProblem;

/// Where it converges it takes less than two dozen iterations, and each is expensive.
const MAX_ITERATIONS: usize = 60;
/// Conjugate-gradient iterations per Gauss–Newton iteration, at most. (With 20, the hard hill takes three times as many of the latter.)
const MAX_INNER: usize = 40;
/// Residual of a linear system relative to the gradient, in the norm of the preconditioner, at which it counts as solved.
const FORCING: f64 = 0.1;
/// A step that had to be cut because it folds space somewhere makes the next one damped, at the points that are about to fold
/// (`Barrier::curvature`): the least and the greatest damping. (With a uniform damping by the stiffness matrix, steps stayed at a
/// sixteenth: one point close to folding holds back all others.)
const DAMPING: [f64; 2] = [0.01, 10.0];
/// By how much the damping grows after a step that was cut, and shrinks after one that was not.
const DAMPING_FACTOR: f64 = 4.0;

/// Minimizes from v and returns where it ends. Does nothing if space is folded at v. The observer receives gᵀd, d the step, as the
/// decrement.
pub(super) fn gauss_newton(
    problem: &mut WarpProblem<'_, Barrier>,
    v: Vec<f64>,
    limits: StoppingLimits,
    observer: &mut Observer,
) -> (Vec<f64>, Minimized) {
    let limits = limits.at_most(MAX_ITERATIONS);
    let mut current = Iterate::new(problem, v);
    let mut minimized = Minimized::begun(current.value);
    if !current.value.is_finite() {
        return (current.x, minimized);
    }
    let mut trial = current.clone();
    let mut damping = 0.0;
    loop {
        let (mut step, mut decrement) = newton_step(problem, &current, damping);
        if damping > 0.0 && limits.are_met(current.value, decrement) {
            // A short step does not indicate a minimum if damping made it short.
            damping = 0.0;
            (step, decrement) = newton_step(problem, &current, damping);
        }
        if minimized.must_stop(current.value, decrement, &limits, observer) {
            break;
        }
        let evaluations = &mut minimized.evaluations;
        let Some(scale) = backtrack(problem, &current, &step, decrement, &mut trial, evaluations) else {
            break;
        };
        damping = next_damping(damping, scale < 1.0);
        std::mem::swap(&mut current, &mut trial);
        minimized.iterations += 1;
    }
    (current.x, minimized)
}

/// More after a step that was cut; less, and in the end none, after full steps.
fn next_damping(damping: f64, cut: bool) -> f64 {
    let [least, greatest] = DAMPING;
    if cut {
        (DAMPING_FACTOR * damping).clamp(least, greatest)
    } else if damping > least {
        damping / DAMPING_FACTOR
    } else {
        0.0
    }
}

/// The step d = (H + damping D)⁻¹ g by preconditioned conjugate gradients, and gᵀd.
fn newton_step(problem: &mut WarpProblem<'_, Barrier>, current: &Iterate, damping: f64) -> (Vec<f64>, f64) {
    let gradient = &current.gradient;
    let linearized = problem.linearized(&current.x, |density, jacobian| density.curvature(jacobian, damping));
    let mut step = vec![0.0; gradient.len()];
    let mut residual = gradient.clone();
    let mut conditioned = residual.clone();
    problem.precondition(&mut conditioned);
    let mut direction = conditioned.clone();
    let mut product = vec![0.0; gradient.len()];
    let first = dot(&residual, &conditioned);
    let mut square = first;
    for _ in 0..MAX_INNER {
        problem.gauss_newton_product(&linearized, BarrierCurvature::times, &direction, &mut product);
        let curvature = dot(&direction, &product);
        if curvature <= 0.0 {
            break;
        }
        let length = square / curvature;
        add(&mut step, length, &direction);
        add(&mut residual, -length, &product);
        conditioned.copy_from_slice(&residual);
        problem.precondition(&mut conditioned);
        let next = dot(&residual, &conditioned);
        if next <= FORCING * FORCING * first {
            break;
        }
        let ratio = next / square;
        square = next;
        for (d, c) in direction.iter_mut().zip(&conditioned) {
            *d = c + ratio * *d;
        }
    }
    let decrement = dot(&step, gradient);
    (step, decrement)
}
