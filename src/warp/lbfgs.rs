//! Preconditioned limited-memory BFGS with a backtracking line search (Nocedal and Wright, *Numerical Optimization*,
//! algorithms 7.4 and 7.5).

use std::collections::VecDeque;

use super::line_search::backtrack;
use super::objective::{Iterate, Minimized, Objective, Observer, StoppingLimits, add, difference, dot};

/// Pairs (step, change of gradient) in memory. With 12, the benchmark's medium pit takes 38 iterations on its finest grid and the
/// hard one 82; with 20, they take 27 and 67; more than that is no better.
const MEMORY: usize = 20;
/// Pairs of a step and a change of gradient that are more nearly orthogonal than this (cosine) are rounding errors.
const LEAST_COSINE: f64 = 1e-12;

/// Minimizes from x and returns where it ends. Does nothing if the value at x is infinite. The observer receives gᵀHg as the
/// decrement.
pub(super) fn minimize(
    objective: &mut impl Objective,
    x: Vec<f64>,
    limits: StoppingLimits,
    observer: &mut Observer,
) -> (Vec<f64>, Minimized) {
    let mut current = Iterate::new(objective, x);
    let mut minimized = Minimized::begun(current.value);
    if !current.value.is_finite() {
        return (current.x, minimized);
    }
    let mut memory = Memory::default();
    let mut conditioned = preconditioned(objective, &current.gradient);
    let mut trial = current.clone();
    loop {
        let (direction, decrement) = memory.descent(&current.gradient, &conditioned);
        if minimized.must_stop(current.value, decrement, &limits, observer) {
            break;
        }
        let evaluations = &mut minimized.evaluations;
        let Some(scale) = backtrack(objective, &current, &direction, decrement, &mut trial, evaluations)
        else {
            if memory.pairs.is_empty() {
                break;
            }
            // The preconditioned gradient may still decrease the value.
            memory.pairs.clear();
            continue;
        };
        let trial_conditioned = preconditioned(objective, &trial.gradient);
        let step = direction.iter().map(|d| -scale * d).collect();
        let change = difference(&trial.gradient, &current.gradient);
        memory.remember(step, change, difference(&trial_conditioned, &conditioned));
        conditioned = trial_conditioned;
        std::mem::swap(&mut current, &mut trial);
        minimized.iterations += 1;
    }
    (current.x, minimized)
}

/// P g.
fn preconditioned(objective: &mut impl Objective, gradient: &[f64]) -> Vec<f64> {
    let mut conditioned = gradient.to_vec();
    objective.precondition(&mut conditioned);
    conditioned
}

/// The last pairs, oldest first: with the preconditioner P, an approximation H of the inverse Hessian.
#[derive(Default)]
struct Memory {
    pairs: VecDeque<Pair>,
}

struct Pair {
    step: Vec<f64>,
    /// Of the gradient.
    change: Vec<f64>,
    /// P · change.
    conditioned: Vec<f64>,
    /// 1/(stepᵀ change).
    rho: f64,
}

impl Memory {
    /// H g and gᵀHg from g and P g. Forgets all pairs when they do not yield a direction of descent.
    fn descent(&mut self, gradient: &[f64], conditioned: &[f64]) -> (Vec<f64>, f64) {
        let direction = self.direction(gradient, conditioned);
        let decrement = dot(&direction, gradient);
        if decrement <= 0.0 {
            self.pairs.clear();
            return (conditioned.to_vec(), dot(conditioned, gradient));
        }
        (direction, decrement)
    }

    /// H g by the two-loop recursion from H₀ = γP, with γ = sᵀy / yᵀPy of the last pair (without it, most first steps are too
    /// long). P g and all P y are known, so the preconditioner is not applied here.
    fn direction(&self, gradient: &[f64], conditioned: &[f64]) -> Vec<f64> {
        let Some(last) = self.pairs.back() else {
            return conditioned.to_vec();
        };
        let scale = 1.0 / (last.rho * dot(&last.change, &last.conditioned));
        let mut q = gradient.to_vec();
        let mut direction = conditioned.to_vec();
        let mut factors = Vec::with_capacity(self.pairs.len());
        for pair in self.pairs.iter().rev() {
            let factor = pair.rho * dot(&pair.step, &q);
            add(&mut q, -factor, &pair.change);
            add(&mut direction, -factor, &pair.conditioned);
            factors.push(factor);
        }
        direction.iter_mut().for_each(|v| *v *= scale);
        for (pair, factor) in self.pairs.iter().zip(factors.iter().rev()) {
            let back = pair.rho * dot(&pair.change, &direction);
            add(&mut direction, factor - back, &pair.step);
        }
        direction
    }

    /// Adds a pair, unless its curvature is not positive. Drops the oldest one when full.
    fn remember(&mut self, step: Vec<f64>, change: Vec<f64>, conditioned: Vec<f64>) {
        if self.pairs.len() == MEMORY {
            self.pairs.pop_front();
        }
        let curvature = dot(&step, &change);
        if curvature > LEAST_COSINE * (dot(&step, &step) * dot(&change, &change)).sqrt() {
            self.pairs.push_back(Pair { step, change, conditioned, rho: 1.0 / curvature });
        }
    }
}

#[cfg(test)]
mod tests {
    use std::ops::ControlFlow;

    use super::*;

    /// A sum of Rosenbrock functions of two variables each, infinite beyond |x| = 4.
    struct Valley;

    impl Objective for Valley {
        fn evaluate(&mut self, x: &mut [f64], gradient: &mut [f64]) -> f64 {
            if x.iter().any(|v| v.abs() > 4.0) {
                return f64::INFINITY;
            }
            let mut value = 1e-9;
            for (g, p) in gradient.chunks_exact_mut(2).zip(x.chunks_exact(2)) {
                let (a, b) = (1.0 - p[0], p[1] - p[0] * p[0]);
                value += a * a + 100.0 * b * b;
                g[0] = -2.0 * a - 400.0 * b * p[0];
                g[1] = 200.0 * b;
            }
            value
        }
        fn precondition(&mut self, v: &mut [f64]) {
            for g in v {
                *g /= 200.0;
            }
        }
    }

    #[test]
    fn it_finds_the_bottom_of_the_valley() {
        let start = (0..20).map(|i| if i % 2 == 0 { -1.2 } else { 1.0 + 0.1 * f64::from(i) }).collect();
        let limits = StoppingLimits { iterations: 500, tolerance: 1e-9, floor: 0.0 };
        let (x, minimized) = minimize(&mut Valley, start, limits, &mut |_, _, _| ControlFlow::Continue(()));
        assert!(minimized.converged, "{minimized:?}");
        assert!(x.iter().all(|v| (v - 1.0).abs() < 1e-4), "{x:?}");
    }

    #[test]
    fn it_stops_when_told_to() {
        let limits = StoppingLimits { iterations: 500, tolerance: 1e-9, floor: 0.0 };
        let stop = &mut |iteration, _, _| {
            if iteration < 3 { ControlFlow::Continue(()) } else { ControlFlow::Break(()) }
        };
        let (_, minimized) = minimize(&mut Valley, vec![-1.2, 1.0], limits, stop);
        assert!(minimized.interrupted && minimized.iterations == 3);
    }
}
