//! Nonlinear programs and the interior-point solver Ipopt that solves them.
//!
//! ```text
//! minimise    f(x)                  x: (n,)
//! subject to  g_lower ≤ g(x) ≤ g_upper    g: (m,)
//!             x_lower ≤   x  ≤ x_upper
//! ```
//!
//! A problem is a type that implements [`NlpProblem`]; [`solve`] returns a [`Solution`]. A solve that does not converge
//! is no error: its [`Status`] says so. An [`IpoptError`] is a mistake that is found before the solve.
//!
//! - Silent: nothing is written to the standard output, no file `ipopt.opt` is read.
//! - One solve at a time: Ipopt's linear solver MUMPS is not re-entrant, so a second thread waits for the first.
//! - A panic in the problem stops the solve and goes on in the caller once Ipopt has cleaned up.
//! - Ctrl-C, once [`install_ctrl_c`] was called, stops the solve at the next iteration; see [`INTERRUPT`].
//!
//! - The systems of equations of each iteration are solved by crate `kkt` in the place of Ipopt's linear solver, or by MUMPS; see
//!   [`LinearSolver`].
//!
//! This module is the only place in the crate with `unsafe` code: in `application`, `callbacks`, `memory`, `plug` and one call in `solve`.

use std::ops::ControlFlow;

mod application;
mod callbacks;
mod error;
mod interrupt;
mod layout;
mod linear_solver;
mod lock;
mod memory;
mod options;
mod plug;
mod solution;
mod solve;

pub use error::IpoptError;
pub use interrupt::{INTERRUPT, InterruptFlag, install_ctrl_c};
pub use linear_solver::LinearSolver;
pub use memory::keep_freed_memory;
pub use options::{OptionValue, Options};
pub use solution::{IterationRecord, Mode, Multipliers, Solution, Status};
pub use solve::solve;

/// A nonlinear program: its size, bounds, start, and functions with derivatives.
///
/// Every `out` must be filled completely: it arrives filled with NaN, and an entry left so ends the solve with
/// [`Status::InvalidNumber`] or a rejected step. `new_x` says that no evaluation has seen this `x` yet; while it is
/// false, what was computed for the last `x` may be used again.
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

    /// f(x).
    fn objective(&mut self, x: &[f64], new_x: bool) -> f64;

    /// ∇f(x), (n,).
    fn gradient(&mut self, x: &[f64], new_x: bool, out: &mut [f64]);

    /// g(x), (m,).
    fn constraints(&mut self, x: &[f64], new_x: bool, out: &mut [f64]);

    /// Rows and columns of the entries of ∂g/∂x that can differ from zero, 0-based. Read once. Entries that occur
    /// twice are added.
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

/// What is called once an iteration, with the iteration and the point x that its constraint violation belongs to
/// (the last one at which the constraints were evaluated). `Break` stops the solve there.
pub type OnIteration<'a> = dyn FnMut(&IterationRecord, &[f64]) -> ControlFlow<()> + 'a;
