//! The options given to Ipopt.

use crate::ipopt::Options;
use crate::scenario::{Hessian, SolverSpec};

/// Ipopt's `sigma_min` for solves with the exact Hessian from the guess in F. Solves out of the medium pit take 37 iterations in
/// the median with Ipopt's own 10⁻⁶ and 23 with this one; with 0.1 some take as many as before, with 0.5 other terrains take
/// more. From a feasible point, with limited memory, or in the direct formulation (24 to 29 out of the pit) it costs iterations.
const LEAST_CENTERING: f64 = 0.3;

/// Adaptive μ (monotone takes ten times the iterations); if MUMPS is used, with the AMD ordering (1.6 times faster than its default).
///
/// With `centered`, an iteration lowers μ to [`LEAST_CENTERING`] of the average complementarity at most. Where the Hessian is
/// indefinite (the pit's edge in F), Ipopt's oracle drives μ to 10⁻⁶ and below while the dual infeasibility is near 1; the
/// iterates then hug the bounds, and steps are cut to a fifth for dozens of iterations.
pub(super) fn of(solver: &SolverSpec, hessian: Hessian, centered: bool, max_iterations: usize) -> Options {
    let options =
        if centered { Options::new().set_num("sigma_min", LEAST_CENTERING) } else { Options::new() };
    options
        .linear_solver(solver.linear_solver)
        .set_int("max_iter", max_iterations as i32)
        .set_str(
            "hessian_approximation",
            match hessian {
                Hessian::Exact => "exact",
                Hessian::LimitedMemory => "limited-memory",
            },
        )
        .set_int("limited_memory_max_history", solver.hessian_memory as i32)
        .set_str("mu_strategy", "adaptive")
        .set_int("mumps_pivot_order", 0)
        .set_num("tol", solver.tolerance)
        .set_num("constr_viol_tol", solver.tolerance)
        .set_num("dual_inf_tol", 1e-2)
        .set_num("compl_inf_tol", 1e-3)
        .set_int("acceptable_iter", 0)
}

/// How near to a bound a warm start may be, relative to its scale.
const WARM_PUSH: f64 = 1e-9;

/// The same from the solution of nearly the same problem, with its multipliers and barrier parameter μ.
pub(super) fn warm(options: Options, mu: f64) -> Options {
    let pushes = [
        "warm_start_bound_push",
        "warm_start_bound_frac",
        "warm_start_slack_bound_push",
        "warm_start_slack_bound_frac",
        "warm_start_mult_bound_push",
    ];
    let options = options.set_str("warm_start_init_point", "yes").set_num("mu_init", mu);
    pushes.into_iter().fold(options, |options, name| options.set_num(name, WARM_PUSH))
}
