//! What a nonlinear program has to provide.

use std::ops::ControlFlow;

use super::solution::{IterationRecord, Multipliers};

/// A nonlinear program: its size, bounds, start, and functions with derivatives.
///
/// Every `out` must be filled completely. It arrives filled with NaN, and an entry that stays NaN ends the solve with
/// [`super::Status::InvalidNumber`] or a rejected step. `new_x` is true if no evaluation has seen this `x` yet; while it is false,
/// what was computed for the last `x` may be used again.
pub trait NlpProblem {
    /// n, at least 1.
    fn num_variables(&self) -> usize;

    /// m, may be 0.
    fn num_constraints(&self) -> usize;

    /// Bounds of the variables, each (n,); `±f64::INFINITY` for none, equal ones fix a variable.
    fn variable_bounds(&self, lower: &mut [f64], upper: &mut [f64]);

    /// Bounds of the constraints, each (m,); `±f64::INFINITY` for none, equal ones make an equation.
    fn constraint_bounds(&self, lower: &mut [f64], upper: &mut [f64]);

    /// Where to start, (n,), finite. Ipopt pushes it inside the bounds.
    fn initial_point(&self, x: &mut [f64]);

    /// Multipliers to start from, which the option `warm_start_init_point` makes use of; as many as variables and constraints.
    fn initial_multipliers(&self) -> Option<Multipliers> {
        None
    }

    /// f(x).
    fn objective(&mut self, x: &[f64], new_x: bool) -> f64;

    /// ∇f(x), (n,).
    fn gradient(&mut self, x: &[f64], new_x: bool, out: &mut [f64]);

    /// g(x), (m,).
    fn constraints(&mut self, x: &[f64], new_x: bool, out: &mut [f64]);

    /// Rows and columns of the entries of ∂g/∂x that can differ from zero, 0-based. Read once. Entries that occur
    /// twice are added up.
    fn jacobian_structure(&self) -> (&[i32], &[i32]);

    /// The entries of ∂g/∂x at x, in the order of [`NlpProblem::jacobian_structure`].
    fn jacobian_values(&mut self, x: &[f64], new_x: bool, out: &mut [f64]);

    /// Rows and columns of the lower triangle (row ≥ column) of the Hessian of the Lagrangian, 0-based. Read once.
    /// `None`: there is no Hessian, Ipopt approximates it from gradients (limited memory).
    fn hessian_structure(&self) -> Option<(&[i32], &[i32])> {
        None
    }

    /// The entries of `objective_factor` ∇²f(x) + Σᵢ `multipliers[i]` ∇²gᵢ(x), in the order of
    /// [`NlpProblem::hessian_structure`]. Never called when that is `None`.
    fn hessian_values(
        &mut self,
        x: &[f64],
        new_x: bool,
        objective_factor: f64,
        multipliers: &[f64],
        new_multipliers: bool,
        out: &mut [f64],
    ) {
        let _ = (x, new_x, objective_factor, multipliers, new_multipliers, out);
        unreachable!("a problem with a Hessian structure computes the Hessian's values");
    }
}

/// Called at every iteration, with the iteration and the point x that its constraint violation belongs to
/// (the last one at which the constraints were evaluated). `Break` stops the solve there.
pub type OnIteration<'a> = dyn FnMut(&IterationRecord, &[f64]) -> ControlFlow<()> + 'a;
