//! Preconditioned limited-memory BFGS with backtracking (Nocedal and Wright, Numerical Optimization, algorithm 7.4).

use std::collections::VecDeque;
use std::ops::ControlFlow;

use super::line_search::backtrack;

/// What is to be minimized. Vectors are coefficients in full; those that are fixed have gradient and direction zero.
pub(super) trait Objective {
    /// The value at x and its gradient; infinite where x is not allowed. Coefficients that depend on others are set first.
    fn evaluate(&mut self, x: &mut [f64], gradient: &mut [f64]) -> f64;
    /// `v` ← an approximation of the inverse Hessian times `v`.
    fn precondition(&mut self, v: &mut [f64]);
}

/// When to stop.
#[derive(Clone, Copy, Debug)]
pub(super) struct Limits {
    pub iterations: usize,
    /// On gᵀHg, relative to the value plus `floor`.
    pub tolerance: f64,
    /// Values much below this are as good as zero.
    pub floor: f64,
}

/// How it went.
#[derive(Clone, Copy, Debug, Default)]
pub(super) struct Outcome {
    pub converged: bool,
    pub interrupted: bool,
    pub iterations: usize,
    pub evaluations: usize,
    pub value: f64,
    /// gᵀHg at the end: twice the decrease that the quadratic model still promises.
    pub decrement: f64,
}

/// Pairs (step, change of gradient) that are remembered. With 12 the benchmark's medium pit takes 38 iterations on its finest grid and
/// the hard one 82, with 20 they take 27 and 67; more are no better.
const MEMORY: usize = 20;

struct Pair {
    step: Vec<f64>,
    change: Vec<f64>,
    /// P · change.
    conditioned: Vec<f64>,
    /// 1/(stepᵀ change).
    rho: f64,
}

/// Minimizes from x, which must be allowed. `progress` sees the iteration, the value and gᵀHg.
pub(super) fn minimize(
    objective: &mut impl Objective,
    x: &mut Vec<f64>,
    limits: Limits,
    progress: &mut dyn FnMut(usize, f64, f64) -> ControlFlow<()>,
) -> Outcome {
    let mut pairs: VecDeque<Pair> = VecDeque::new();
    let mut gradient = vec![0.0; x.len()];
    let mut value = objective.evaluate(x, &mut gradient);
    let mut outcome = Outcome { evaluations: 1, value, ..Outcome::default() };
    if !value.is_finite() {
        return outcome;
    }
    let mut conditioned = gradient.clone();
    objective.precondition(&mut conditioned);
    let mut trial = x.clone();
    let mut trial_gradient = gradient.clone();
    loop {
        let mut direction = direction(&pairs, &gradient, &conditioned);
        let mut decrement = dot(&direction, &gradient);
        if decrement <= 0.0 {
            pairs.clear();
            direction.copy_from_slice(&conditioned);
            decrement = dot(&direction, &gradient);
        }
        outcome.value = value;
        outcome.decrement = decrement;
        if progress(outcome.iterations, value, decrement).is_break() {
            outcome.interrupted = true;
            return outcome;
        }
        if decrement <= limits.tolerance * (value + limits.floor) {
            outcome.converged = true;
            return outcome;
        }
        if outcome.iterations >= limits.iterations {
            return outcome;
        }
        let accepted = backtrack(
            objective,
            x,
            value,
            &direction,
            decrement,
            &mut trial,
            &mut trial_gradient,
            &mut outcome.evaluations,
        );
        let Some(accepted) = accepted else {
            if pairs.is_empty() {
                return outcome;
            }
            pairs.clear();
            continue;
        };
        let mut pair = if pairs.len() == MEMORY { pairs.pop_front() } else { None }.unwrap_or_else(|| Pair {
            step: vec![0.0; x.len()],
            change: vec![0.0; x.len()],
            conditioned: vec![0.0; x.len()],
            rho: 0.0,
        });
        for (s, d) in pair.step.iter_mut().zip(&direction) {
            *s = -accepted.scale * d;
        }
        for ((y, new), old) in pair.change.iter_mut().zip(&trial_gradient).zip(&gradient) {
            *y = new - old;
        }
        let mut trial_conditioned = trial_gradient.clone();
        objective.precondition(&mut trial_conditioned);
        for ((y, new), old) in pair.conditioned.iter_mut().zip(&trial_conditioned).zip(&conditioned) {
            *y = new - old;
        }
        conditioned = trial_conditioned;
        let curvature = dot(&pair.step, &pair.change);
        if curvature > 1e-12 * (dot(&pair.step, &pair.step) * dot(&pair.change, &pair.change)).sqrt() {
            pair.rho = 1.0 / curvature;
            pairs.push_back(pair);
        }
        std::mem::swap(x, &mut trial);
        std::mem::swap(&mut gradient, &mut trial_gradient);
        value = accepted.value;
        outcome.iterations += 1;
    }
}

/// H g by the two-loop recursion from H₀ = γP, with γ = sᵀy / yᵀPy of the last pair (without it, most first steps are too
/// long). P g and the P y are known, so the preconditioner need not be applied here.
fn direction(pairs: &VecDeque<Pair>, gradient: &[f64], conditioned: &[f64]) -> Vec<f64> {
    let Some(last) = pairs.back() else {
        return conditioned.to_vec();
    };
    let scale = 1.0 / (last.rho * dot(&last.change, &last.conditioned));
    let mut q = gradient.to_vec();
    let mut direction = conditioned.to_vec();
    let mut factors = Vec::with_capacity(pairs.len());
    for pair in pairs.iter().rev() {
        let factor = pair.rho * dot(&pair.step, &q);
        add(&mut q, -factor, &pair.change);
        add(&mut direction, -factor, &pair.conditioned);
        factors.push(factor);
    }
    direction.iter_mut().for_each(|v| *v *= scale);
    for (pair, factor) in pairs.iter().zip(factors.iter().rev()) {
        let back = pair.rho * dot(&pair.change, &direction);
        add(&mut direction, factor - back, &pair.step);
    }
    direction
}

/// aᵀb, in eight sums so that it can be vectorized.
pub(super) fn dot(a: &[f64], b: &[f64]) -> f64 {
    let mut sums = [0.0; 8];
    let (a, a_rest) = a.as_chunks::<8>();
    let (b, b_rest) = b.as_chunks::<8>();
    for (a, b) in a.iter().zip(b) {
        for l in 0..8 {
            sums[l] += a[l] * b[l];
        }
    }
    sums.iter().sum::<f64>() + a_rest.iter().zip(b_rest).map(|(a, b)| a * b).sum::<f64>()
}

/// a += factor · b.
pub(super) fn add(a: &mut [f64], factor: f64, b: &[f64]) {
    for (a, b) in a.iter_mut().zip(b) {
        *a += factor * b;
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    /// Rosenbrock's valley in pairs, refused beyond |x| = 4.
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
        let mut x: Vec<f64> =
            (0..20).map(|i| if i % 2 == 0 { -1.2 } else { 1.0 + 0.1 * f64::from(i) }).collect();
        let limits = Limits { iterations: 500, tolerance: 1e-9, floor: 0.0 };
        let outcome = minimize(&mut Valley, &mut x, limits, &mut |_, _, _| ControlFlow::Continue(()));
        assert!(outcome.converged, "{outcome:?}");
        assert!(x.iter().all(|v| (v - 1.0).abs() < 1e-4), "{x:?}");
    }

    #[test]
    fn it_stops_when_told_to() {
        let mut x = vec![-1.2, 1.0];
        let limits = Limits { iterations: 500, tolerance: 1e-9, floor: 0.0 };
        let stop = &mut |iteration, _, _| {
            if iteration < 3 { ControlFlow::Continue(()) } else { ControlFlow::Break(()) }
        };
        let outcome = minimize(&mut Valley, &mut x, limits, stop);
        assert!(outcome.interrupted && outcome.iterations == 3);
    }
}
