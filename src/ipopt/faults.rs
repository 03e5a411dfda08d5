//! Tests of the plug with matrices that fail.

use std::cell::RefCell;
use std::ops::ControlFlow;
use std::panic::{AssertUnwindSafe, catch_unwind};

use kkt::{Factored, Layout};

use super::error::IpoptError;
use super::linear_solver::LinearSolver;
use super::options::Options;
use super::plug::{Analysis, Matrix, by_kkt};
use super::problem::NlpProblem;
use super::solution::{Solution, Status};
use super::solve::{solve, solve_by};

/// What goes wrong.
#[derive(Clone, Copy, Debug, PartialEq)]
enum Fault {
    /// A panic in this function.
    Panic(&'static str),
    /// The solution comes with this residual.
    Residual(f64),
    /// The solution is zero and called exact.
    Zero,
    /// Every matrix counts as singular.
    Singular,
    /// Every matrix has so many negative eigenvalues.
    Negative(usize),
}

/// When it goes wrong, and what has happened so far.
struct Script {
    fault: Fault,
    /// How many calls of that function are right before.
    good_calls: usize,
    /// Calls of any function.
    calls: usize,
    calls_after_panic: usize,
    panicked: bool,
}

thread_local! {
    static SCRIPT: RefCell<Option<Script>> = const { RefCell::new(None) };
}

/// Counts a call of `function`, panics if it shall, and returns the fault if it is time for it.
fn fault(function: &'static str) -> Option<Fault> {
    let fault = SCRIPT.with_borrow_mut(|script| {
        let script = script.as_mut().expect("a script");
        script.calls += 1;
        script.calls_after_panic += usize::from(script.panicked);
        let concerned = match script.fault {
            Fault::Panic(name) => function == name,
            Fault::Residual(_) | Fault::Zero => function == "solve",
            Fault::Singular | Fault::Negative(_) => function == "factor",
        };
        if !concerned {
            return None;
        }
        if script.good_calls > 0 {
            script.good_calls -= 1;
            return None;
        }
        script.panicked = matches!(script.fault, Fault::Panic(_));
        Some(script.fault)
    });
    if let Some(Fault::Panic(name)) = fault {
        std::panic::panic_any(format!("{name} fails"));
    }
    fault
}

struct Faulty(Box<dyn Matrix>);

impl Matrix for Faulty {
    fn factor(&mut self, values: &[f64]) -> Factored {
        let right = self.0.factor(values);
        match fault("factor") {
            Some(Fault::Singular) => Factored::Singular,
            Some(Fault::Negative(negative)) => Factored::Regular { negative },
            _ => right,
        }
    }

    fn solve(&mut self, x: &mut [f64]) -> f64 {
        let right = self.0.solve(x);
        match fault("solve") {
            Some(Fault::Residual(residual)) => residual,
            Some(Fault::Zero) => {
                x.fill(0.0);
                0.0
            }
            _ => right,
        }
    }
}

fn faulty(layout: Layout, rows: &[u32], columns: &[u32]) -> Option<Box<dyn Matrix>> {
    fault("analysis");
    Some(Box::new(Faulty(by_kkt(layout, rows, columns)?)))
}

/// Minimize (x₀ − 2)⁴ + (x₀ − 2 x₁)² subject to x₀² = x₁ and x₁ ≤ 2 x₀. The optimum has x₀ = 0.9456 (Newton's method on the
/// derivative of the objective along the parabola).
struct Valley;

const OPTIMUM: [f64; 2] = [0.945_582_993, 0.894_127_197];

impl NlpProblem for Valley {
    fn num_variables(&self) -> usize {
        2
    }
    fn num_constraints(&self) -> usize {
        2
    }
    fn variable_bounds(&self, lower: &mut [f64], upper: &mut [f64]) {
        lower.fill(f64::NEG_INFINITY);
        upper.fill(f64::INFINITY);
    }
    fn constraint_bounds(&self, lower: &mut [f64], upper: &mut [f64]) {
        lower.copy_from_slice(&[0.0, f64::NEG_INFINITY]);
        upper.copy_from_slice(&[0.0, 0.0]);
    }
    fn initial_point(&self, x: &mut [f64]) {
        x.copy_from_slice(&[2.0, 1.0]);
    }
    fn objective(&mut self, x: &[f64], _new_x: bool) -> f64 {
        (x[0] - 2.0).powi(4) + (x[0] - 2.0 * x[1]).powi(2)
    }
    fn gradient(&mut self, x: &[f64], _new_x: bool, out: &mut [f64]) {
        let difference = x[0] - 2.0 * x[1];
        out.copy_from_slice(&[4.0 * (x[0] - 2.0).powi(3) + 2.0 * difference, -4.0 * difference]);
    }
    fn constraints(&mut self, x: &[f64], _new_x: bool, out: &mut [f64]) {
        out.copy_from_slice(&[x[0] * x[0] - x[1], x[1] - 2.0 * x[0]]);
    }
    fn jacobian_structure(&self) -> (&[i32], &[i32]) {
        (&[0, 0, 1, 1], &[0, 1, 0, 1])
    }
    fn jacobian_values(&mut self, x: &[f64], _new_x: bool, out: &mut [f64]) {
        out.copy_from_slice(&[2.0 * x[0], -1.0, -2.0, 1.0]);
    }
    fn hessian_structure(&self) -> Option<(&[i32], &[i32])> {
        Some((&[0, 1, 1], &[0, 0, 1]))
    }
    fn hessian_values(&mut self, x: &[f64], _: bool, factor: f64, y: &[f64], _: bool, out: &mut [f64]) {
        let first = factor * (12.0 * (x[0] - 2.0).powi(2) + 2.0) + 2.0 * y[0];
        out.copy_from_slice(&[first, -4.0 * factor, 8.0 * factor]);
    }
}

const MAX_ITER: i32 = 50;

/// Solves with the fault after so many good calls; also returns the calls of all functions of the matrices.
fn solve_with(fault: Fault, good_calls: usize) -> (std::thread::Result<Solution>, Script) {
    let script = Script { fault, good_calls, calls: 0, calls_after_panic: 0, panicked: false };
    SCRIPT.set(Some(script));
    let solution = catch_unwind(AssertUnwindSafe(|| solve_valley(faulty).unwrap()));
    (solution, SCRIPT.take().expect("a script"))
}

fn solve_valley(analysis: Analysis) -> Result<Solution, IpoptError> {
    let options = Options::new().linear_solver(LinearSolver::Faer).set_int("max_iter", MAX_ITER);
    solve_by(analysis, &mut Valley, &options, &mut |_, _| ControlFlow::Continue(()))
}

#[track_caller]
fn assert_is_optimum(solution: &Solution, linear_solver: LinearSolver) {
    assert_eq!(solution.status, Status::Solved);
    assert_eq!(solution.linear_solver, linear_solver);
    for (actual, expected) in solution.x.iter().zip(OPTIMUM) {
        assert!((actual - expected).abs() < 1e-6, "{:?}", solution.x);
    }
    let iterations: Vec<usize> = solution.history.iter().map(|record| record.iteration).collect();
    assert_eq!(iterations, (0..iterations.len()).collect::<Vec<_>>(), "each iteration once");
}

#[test]
fn without_faults_faer_solves() {
    assert_is_optimum(&solve_valley(by_kkt).unwrap(), LinearSolver::Faer);
}

/// At the first call and at a later one, with the same payload; and the next solve is as good as ever.
#[test]
fn a_panic_in_the_linear_solver_reaches_the_caller() {
    for (function, good_calls) in [("analysis", 0), ("factor", 0), ("factor", 4), ("solve", 0), ("solve", 4)]
    {
        let (result, script) = solve_with(Fault::Panic(function), good_calls);
        let payload = result.expect_err("the panic goes on");
        assert_eq!(payload.downcast_ref(), Some(&format!("{function} fails")));
        assert_eq!(script.calls_after_panic, 0, "the linear solver was called after its panic in {function}");
        assert_is_optimum(&solve_valley(by_kkt).unwrap(), LinearSolver::Faer);
    }
}

/// Ipopt itself would accept 1e-6.
#[test]
fn a_large_residual_makes_mumps_go_on() {
    for residual in [1e-6, 1.0, f64::INFINITY, f64::NAN] {
        for good_calls in [0, 4] {
            let (result, script) = solve_with(Fault::Residual(residual), good_calls);
            assert_is_optimum(&result.unwrap(), LinearSolver::Mumps);
            let before = script.calls;
            assert!(before < 20, "{before} calls, of which only the last one may have failed");
        }
    }
    let (result, _) = solve_with(Fault::Residual(1e-9), 0);
    assert_is_optimum(&result.unwrap(), LinearSolver::Faer);
}

/// Ipopt perturbs the matrix again and again, up to a limit; then MUMPS goes on.
#[test]
fn matrices_that_stay_singular_end_in_mumps() {
    for good_calls in [0, 4] {
        let (result, script) = solve_with(Fault::Singular, good_calls);
        assert_is_optimum(&result.unwrap(), LinearSolver::Mumps);
        assert!(script.calls < 200, "{} calls", script.calls);
    }
}

/// Neither a wrong inertia nor a wrong solution can make Ipopt loop, or call a point solved that is not.
#[test]
fn lies_of_the_linear_solver_end_the_solve() {
    for fault in [Fault::Negative(0), Fault::Negative(4), Fault::Zero] {
        for good_calls in [0, 4] {
            let (result, script) = solve_with(fault, good_calls);
            let solution = result.unwrap();
            assert!(script.calls < 10 * MAX_ITER as usize, "{fault:?}: {} calls", script.calls);
            if solution.status.converged() {
                assert_is_optimum(&solution, solution.linear_solver);
            }
        }
    }
    assert_is_optimum(
        &solve(&mut Valley, &Options::new(), &mut |_, _| ControlFlow::Continue(())).unwrap(),
        LinearSolver::Faer,
    );
}
