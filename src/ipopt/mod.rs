//! Nonlinear programs and the interior-point solver Ipopt that solves them.
//!
//! ```text
//! minimize    f(x)                  x: (n,)
//! subject to  g_lower ≤ g(x) ≤ g_upper    g: (m,)
//!             x_lower ≤   x  ≤ x_upper
//! ```
//!
//! A problem is a type that implements [`NlpProblem`]; [`solve`] returns a [`Solution`]. A solve that does not converge is not an
//! error; see its [`Status`]. An [`IpoptError`] is a mistake that is found before the solve.
//!
//! - Silent: nothing is written to the standard output, no file `ipopt.opt` is read.
//! - One solve at a time: Ipopt's linear solver MUMPS is not re-entrant, so a second thread waits for the first.
//! - A panic in the problem stops the solve and resumes in the caller once Ipopt has cleaned up.
//! - Ctrl-C, once [`install_ctrl_c`] was called, stops the solve at the next iteration; see [`INTERRUPT`].
//! - The systems of equations of each iteration are solved by the crate `kkt`, plugged in as Ipopt's linear solver, or by MUMPS; see
//!   [`LinearSolver`].
//!
//! This module is the only place in the crate with `unsafe` code: in `application`, `callbacks`, `memory`, `plug` and one call in `attempt`.

mod application;
mod attempt;
mod availability;
mod callbacks;
mod error;
#[cfg(test)]
mod faults;
mod interrupt;
mod layout;
mod linear_solver;
mod lock;
mod memory;
mod option_value;
mod options;
mod plug;
mod problem;
mod solution;
mod solve;

pub use error::IpoptError;
pub use interrupt::{INTERRUPT, InGoodOrder, InterruptFlag, install_ctrl_c};
pub use linear_solver::LinearSolver;
pub use memory::keep_freed_memory;
pub use option_value::OptionValue;
pub use options::Options;
pub use problem::{NlpProblem, OnIteration};
pub use solution::{IterationRecord, Mode, Multipliers, Solution, Status};
pub use solve::solve;
