//! What the minimizers of the map have in common: the objective, when to stop, how it went, and sums over vectors.

use std::ops::ControlFlow;

/// A function to minimize. Vectors hold all coefficients; the fixed ones have zero gradient and direction.
pub(super) trait Objective {
    /// The value at x and its gradient; infinite where x is not allowed.
    fn evaluate(&mut self, x: &[f64], gradient: &mut [f64]) -> f64;
    /// `v` ← an approximation of the inverse Hessian times `v`.
    fn precondition(&mut self, v: &mut [f64]);
}

/// Called before each iteration with its number, the value and the decrement; may stop the minimizer.
pub(super) type Observer<'a> = dyn FnMut(usize, f64, f64) -> ControlFlow<()> + 'a;

/// A point with its value and gradient.
#[derive(Clone, Debug)]
pub(super) struct Iterate {
    pub x: Vec<f64>,
    pub value: f64,
    pub gradient: Vec<f64>,
}

impl Iterate {
    /// Evaluates the objective at x.
    pub fn new(objective: &mut impl Objective, x: Vec<f64>) -> Iterate {
        let mut gradient = vec![0.0; x.len()];
        let value = objective.evaluate(&x, &mut gradient);
        Iterate { x, value, gradient }
    }
}

/// When to stop.
#[derive(Clone, Copy, Debug)]
pub(super) struct StoppingLimits {
    pub iterations: usize,
    /// On the relative decrement.
    pub tolerance: f64,
    /// Values much below this are rounding errors.
    pub floor: f64,
}

impl StoppingLimits {
    /// The same with at most so many iterations.
    pub fn at_most(self, iterations: usize) -> StoppingLimits {
        StoppingLimits { iterations: self.iterations.min(iterations), ..self }
    }

    /// Whether the decrement is small enough for a minimum of this value.
    pub fn are_met(&self, value: f64, decrement: f64) -> bool {
        decrement <= self.tolerance * self.scale(value)
    }

    /// The decrement relative to the value.
    pub fn relative(&self, value: f64, decrement: f64) -> f64 {
        decrement / self.scale(value)
    }

    fn scale(&self, value: f64) -> f64 {
        value.abs() + self.floor
    }
}

/// How a minimization ended.
#[derive(Clone, Copy, Debug, Default)]
pub(super) struct Minimized {
    pub converged: bool,
    pub interrupted: bool,
    pub iterations: usize,
    pub evaluations: usize,
    pub value: f64,
    /// gᵀd at the end, with d the step that would be taken next: twice the decrease that the quadratic model predicts.
    pub decrement: f64,
}

impl Minimized {
    /// A minimization that has evaluated its first point.
    pub fn begun(value: f64) -> Minimized {
        Minimized { evaluations: 1, value, ..Minimized::default() }
    }

    /// Records and reports the current point; `true` once the minimizer is interrupted, has converged or is out of iterations.
    pub fn must_stop(
        &mut self,
        value: f64,
        decrement: f64,
        limits: &StoppingLimits,
        observer: &mut Observer,
    ) -> bool {
        (self.value, self.decrement) = (value, decrement);
        self.interrupted = observer(self.iterations, value, decrement).is_break();
        self.converged = !self.interrupted && limits.are_met(value, decrement);
        self.interrupted || self.converged || self.iterations >= limits.iterations
    }
}

/// aᵀb, as eight partial sums so that the compiler vectorizes it.
#[inline(always)]
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

/// a − b.
pub(super) fn difference(a: &[f64], b: &[f64]) -> Vec<f64> {
    a.iter().zip(b).map(|(a, b)| a - b).collect()
}
