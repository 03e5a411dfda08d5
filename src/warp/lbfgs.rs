//! Preconditioned limited-memory BFGS with a backtracking line search (Nocedal and Wright, *Numerical Optimization*,
//! algorithms 7.4 and 7.5).

use pulp::NullaryFnOnce;

use super::lanes::vectorized;
use super::line_search::backtrack;
use super::objective::{Iterate, Minimized, Objective, Observer, StoppingLimits, dot};

/// Pairs (step, change of gradient) in memory. With 20, large maps take about as many iterations and a sixth more time, because all
/// pairs are read twice in each; with 6, the stepping stones take two thirds more iterations.
const MEMORY: usize = 10;
/// Pairs of a step and a change of gradient that are more nearly orthogonal than this (cosine) are rounding errors.
const LEAST_COSINE: f64 = 1e-12;
/// So many entries of all vectors are processed at a time, because they stay in the cache.
const CHUNK: usize = 512;

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
    let mut memory = Memory::new(current.x.len());
    let mut conditioned = current.gradient.clone();
    objective.precondition(&mut conditioned);
    memory.measure(&current.gradient, &conditioned);
    let mut trial = current.clone();
    let mut trial_conditioned = conditioned.clone();
    let mut direction = conditioned.clone();
    loop {
        let decrement = memory.descent(&current.gradient, &conditioned, &mut direction);
        if minimized.must_stop(current.value, decrement, &limits, observer) {
            break;
        }
        let evaluations = &mut minimized.evaluations;
        let Some(scale) = backtrack(objective, &current, &direction, decrement, &mut trial, evaluations)
        else {
            if memory.pairs == 0 {
                break;
            }
            // The preconditioned gradient may still decrease the value.
            memory.pairs = 0;
            continue;
        };
        trial_conditioned.copy_from_slice(&trial.gradient);
        objective.precondition(&mut trial_conditioned);
        let change = [[&trial.gradient[..], &current.gradient], [&trial_conditioned, &conditioned]];
        memory.remember(&direction, -scale, change);
        std::mem::swap(&mut conditioned, &mut trial_conditioned);
        std::mem::swap(&mut current, &mut trial);
        minimized.iterations += 1;
    }
    (current.x, minimized)
}

/// The last pairs of a step s and a change y of the gradient, oldest first: with the preconditioner P, an approximation H of the
/// inverse Hessian.
///
/// The two-loop recursion only needs combinations of g, P g, s and P y, and their products. All products of older vectors are
/// known, so that an iteration reads each vector twice: once for its product with the gradient, once for the direction.
struct Memory {
    /// How many.
    pairs: usize,
    /// s of each pair.
    steps: Vec<Vec<f64>>,
    /// P y of each pair.
    conditioned: Vec<Vec<f64>>,
    /// `[i][j]` = sᵢᵀ yⱼ for i ≤ j.
    step_change: [[f64; MEMORY]; MEMORY],
    /// `[i][j]` = yᵢᵀ P yⱼ, symmetric.
    change_change: [[f64; MEMORY]; MEMORY],
    /// [sᵢᵀ g, yᵢᵀ P g] with the gradient g measured last.
    by_gradient: [[f64; 2]; MEMORY],
    /// gᵀ P g.
    square: f64,
}

impl Memory {
    /// Empty, for vectors of a length.
    fn new(length: usize) -> Memory {
        let vectors = || (0..MEMORY).map(|_| vec![0.0; length]).collect();
        Memory {
            pairs: 0,
            steps: vectors(),
            conditioned: vectors(),
            step_change: [[0.0; MEMORY]; MEMORY],
            change_change: [[0.0; MEMORY]; MEMORY],
            by_gradient: [[0.0; 2]; MEMORY],
            square: 0.0,
        }
    }

    /// Computes the products with a gradient g and P g.
    fn measure(&mut self, gradient: &[f64], conditioned: &[f64]) {
        self.by_gradient = vectorized(Products { memory: self, gradient });
        self.square = dot(gradient, conditioned);
    }

    /// `direction` ← H g, for the gradient measured last; returns gᵀHg. Forgets all pairs when they do not yield a direction of
    /// descent.
    fn descent(&mut self, gradient: &[f64], conditioned: &[f64], direction: &mut [f64]) -> f64 {
        let (scale, factors) = self.factors();
        vectorized(Combination { memory: self, conditioned, scale, factors, direction });
        let decrement = dot(direction, gradient);
        if decrement > 0.0 {
            return decrement;
        }
        self.pairs = 0;
        direction.copy_from_slice(conditioned);
        self.square
    }

    /// γ and the factors [of sᵢ, of P yᵢ] in H g = γ P g + …, by the two-loop recursion from H₀ = γP, with γ = sᵀy / yᵀPy of the
    /// last pair (without it, most first steps are too long).
    fn factors(&self) -> (f64, [[f64; 2]; MEMORY]) {
        let mut factors = [[0.0; 2]; MEMORY];
        let Some(last) = self.pairs.checked_sub(1) else {
            return (1.0, factors);
        };
        let scale = self.step_change[last][last] / self.change_change[last][last];
        // q = g − Σ αⱼ yⱼ, newest first.
        let mut alpha = [0.0; MEMORY];
        for i in (0..self.pairs).rev() {
            let by_q = self.by_gradient[i][0]
                - (i + 1..self.pairs).map(|j| alpha[j] * self.step_change[i][j]).sum::<f64>();
            alpha[i] = by_q / self.step_change[i][i];
        }
        // H g = γ P q + Σ (αᵢ − βᵢ) sᵢ, oldest first.
        for i in 0..self.pairs {
            let by_change = (0..self.pairs).map(|j| alpha[j] * self.change_change[i][j]).sum::<f64>();
            let by_steps = (0..i).map(|j| factors[j][0] * self.step_change[j][i]).sum::<f64>();
            let beta = (scale * (self.by_gradient[i][1] - by_change) + by_steps) / self.step_change[i][i];
            factors[i] = [alpha[i] - beta, -scale * alpha[i]];
        }
        (scale, factors)
    }

    /// Adds the pair of the step `scale` · `direction`, unless its curvature is not positive, and measures the new gradient. `change`
    /// is the new and the old g, and the new and the old P g. Drops the oldest pair when full.
    fn remember(&mut self, direction: &[f64], scale: f64, [gradients, conditioned]: [[&[f64]; 2]; 2]) {
        if self.pairs == MEMORY {
            self.drop_oldest();
        }
        let new = self.pairs;
        let sums = vectorized(NewPair {
            step: &mut self.steps[new],
            changed: &mut self.conditioned[new],
            direction,
            scale,
            gradients,
            conditioned,
        });
        let old = self.by_gradient;
        self.measure(gradients[0], conditioned[0]);
        let [curvature, step_square, change_square, conditioned_square, by_step, by_change] = sums;
        if curvature <= LEAST_COSINE * (step_square * change_square).sqrt() {
            return;
        }
        for (i, old) in old.iter().enumerate().take(new) {
            self.step_change[i][new] = self.by_gradient[i][0] - old[0];
            self.change_change[i][new] = self.by_gradient[i][1] - old[1];
            self.change_change[new][i] = self.change_change[i][new];
        }
        self.step_change[new][new] = curvature;
        self.change_change[new][new] = conditioned_square;
        self.by_gradient[new] = [by_step, by_change];
        self.pairs += 1;
    }

    /// Makes room for a pair.
    fn drop_oldest(&mut self) {
        self.steps.rotate_left(1);
        self.conditioned.rotate_left(1);
        self.by_gradient.rotate_left(1);
        for matrix in [&mut self.step_change, &mut self.change_change] {
            matrix.rotate_left(1);
            matrix.iter_mut().for_each(|row| row.rotate_left(1));
        }
        self.pairs -= 1;
    }
}

/// [sᵢᵀ g, (P yᵢ)ᵀ g] of all pairs.
struct Products<'a> {
    memory: &'a Memory,
    gradient: &'a [f64],
}

impl NullaryFnOnce for Products<'_> {
    type Output = [[f64; 2]; MEMORY];

    #[inline(always)]
    fn call(self) -> Self::Output {
        let Products { memory, gradient } = self;
        let mut products = [[0.0; 2]; MEMORY];
        for (chunk, g) in gradient.chunks(CHUNK).enumerate() {
            let part = |v: &[f64]| dot(&v[chunk * CHUNK..][..g.len()], g);
            for (i, product) in products.iter_mut().enumerate().take(memory.pairs) {
                product[0] += part(&memory.steps[i]);
                product[1] += part(&memory.conditioned[i]);
            }
        }
        products
    }
}

/// `direction` ← `scale` P g + Σ `factors` [sᵢ, P yᵢ].
struct Combination<'a> {
    memory: &'a Memory,
    conditioned: &'a [f64],
    scale: f64,
    factors: [[f64; 2]; MEMORY],
    direction: &'a mut [f64],
}

impl NullaryFnOnce for Combination<'_> {
    type Output = ();

    #[inline(always)]
    fn call(self) {
        let Combination { memory, conditioned, scale, factors, direction } = self;
        let chunks = direction.chunks_mut(CHUNK).zip(conditioned.chunks(CHUNK));
        for (chunk, (direction, conditioned)) in chunks.enumerate() {
            for (d, c) in direction.iter_mut().zip(conditioned) {
                *d = scale * c;
            }
            let at = chunk * CHUNK..chunk * CHUNK + direction.len();
            for (i, [by_step, by_change]) in factors.iter().enumerate().take(memory.pairs) {
                let pair = memory.steps[i][at.clone()].iter().zip(&memory.conditioned[i][at.clone()]);
                for (d, (s, c)) in direction.iter_mut().zip(pair) {
                    *d += by_step * s + by_change * c;
                }
            }
        }
    }
}

/// Writes s and P y of a new pair; returns sᵀy, sᵀs, yᵀy, yᵀPy, sᵀg, yᵀPg, g the new gradient.
struct NewPair<'a> {
    step: &'a mut [f64],
    changed: &'a mut [f64],
    direction: &'a [f64],
    scale: f64,
    gradients: [&'a [f64]; 2],
    conditioned: [&'a [f64]; 2],
}

impl NullaryFnOnce for NewPair<'_> {
    type Output = [f64; 6];

    #[inline(always)]
    fn call(self) -> Self::Output {
        let mut sums = [0.0; 6];
        let mut change = [0.0; CHUNK];
        for start in (0..self.step.len()).step_by(CHUNK) {
            let at = start..(start + CHUNK).min(self.step.len());
            let (step, changed) = (&mut self.step[at.clone()], &mut self.changed[at.clone()]);
            let change = &mut change[..step.len()];
            let [g, old] = self.gradients.map(|v| &v[at.clone()]);
            let [conditioned, old_conditioned] = self.conditioned.map(|v| &v[at.clone()]);
            for (s, d) in step.iter_mut().zip(&self.direction[at.clone()]) {
                *s = self.scale * d;
            }
            for ((y, new), old) in change.iter_mut().zip(g).zip(old) {
                *y = new - old;
            }
            for ((z, new), old) in changed.iter_mut().zip(conditioned).zip(old_conditioned) {
                *z = new - old;
            }
            let products = [
                dot(step, change),
                dot(step, step),
                dot(change, change),
                dot(change, changed),
                dot(step, g),
                dot(changed, g),
            ];
            for (sum, product) in sums.iter_mut().zip(products) {
                *sum += product;
            }
        }
        sums
    }
}

#[cfg(test)]
mod tests {
    use std::ops::ControlFlow;

    use super::*;

    /// A sum of Rosenbrock functions of two variables each, infinite beyond |x| = 4.
    struct Valley;

    impl Objective for Valley {
        fn evaluate(&mut self, x: &[f64], gradient: &mut [f64]) -> f64 {
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
