//! Mistakes in the problem, the options and the use.

use std::cell::RefCell;
use std::ops::ControlFlow;
use std::panic::{AssertUnwindSafe, catch_unwind};

use warpgait::ipopt::{IpoptError, NlpProblem, Options, Status, solve};

use crate::problems::{Hs071, run};

/// A panic in any function, at its first call or a later one, reaches the caller as it was, soon, and the next solve
/// is as good as ever.
#[test]
fn a_panic_in_the_problem_reaches_the_caller() {
    let expected = run(&mut Hs071::new(true), &Options::new()).unwrap();
    for function in ["objective", "gradient", "constraints", "jacobian", "hessian"] {
        for at_call in [1, 4] {
            let mut problem = Hs071::new(true);
            let (mut calls, mut total_after) = (0, 0);
            problem.on_call = Box::new(move |name| {
                if calls == at_call {
                    total_after += 1;
                    assert_eq!(total_after, 0, "the problem was called after its panic");
                }
                calls += usize::from(name == function);
                if calls == at_call {
                    std::panic::panic_any(format!("{function} fails"));
                }
            });
            let result = catch_unwind(AssertUnwindSafe(|| run(&mut problem, &Options::new())));
            let payload = result.expect_err("the panic goes on");
            assert_eq!(payload.downcast_ref(), Some(&format!("{function} fails")));
        }
    }
    let afterwards = run(&mut Hs071::new(true), &Options::new()).unwrap();
    assert_eq!(afterwards.x, expected.x);
}

#[test]
fn a_panic_in_the_iteration_callback_reaches_the_caller() {
    let result = catch_unwind(AssertUnwindSafe(|| {
        solve(&mut Hs071::new(true), &Options::new(), &mut |record, _| {
            assert!(record.iteration < 2, "enough");
            ControlFlow::Continue(())
        })
    }));
    let payload = result.expect_err("the panic goes on");
    assert!(payload.downcast_ref::<&str>().is_some_and(|text| text.contains("enough")));
}

#[test]
fn a_solve_inside_a_solve_is_refused() {
    let inner = RefCell::new(None);
    let outer = solve(&mut Hs071::new(true), &Options::new(), &mut |_, _| {
        *inner.borrow_mut() = Some(run(&mut Hs071::new(true), &Options::new()));
        ControlFlow::Continue(())
    });
    assert_eq!(outer.unwrap().status, Status::Solved);
    assert_eq!(inner.take(), Some(Err(IpoptError::Nested)));
}

#[test]
fn wrong_structures_are_refused() {
    let refusal = |rows| run(&mut Hs071::with_jacobian_rows(rows), &Options::new()).unwrap_err();
    assert_eq!(refusal(vec![0; 7]), IpoptError::StructureLengths { matrix: "Jacobian", rows: 7, columns: 8 });
    for row in [2, -1, i32::MAX] {
        let error = refusal(vec![0, 0, row, 0, 1, 1, 1, 1]);
        assert!(
            matches!(error, IpoptError::StructureIndex { matrix: "Jacobian", entry: 2, column: 2, .. }),
            "{error}"
        );
    }
}

/// A problem of one variable and at most one constraint, all of whose facts can be wrong.
#[derive(Clone)]
struct Small {
    variables: usize,
    bounds: [f64; 2],
    constraint_bounds: [f64; 2],
    start: f64,
    jacobian: Vec<i32>,
    hessian: Option<(Vec<i32>, Vec<i32>)>,
    derivative: f64,
}

const FINE: Small = Small {
    variables: 1,
    bounds: [-10.0, 10.0],
    constraint_bounds: [1.0, f64::INFINITY],
    start: 3.0,
    jacobian: Vec::new(),
    hessian: None,
    derivative: 1.0,
};

fn fine() -> Small {
    Small { jacobian: vec![0], ..FINE }
}

/// Minimise x² with x within bounds.
impl NlpProblem for Small {
    fn num_variables(&self) -> usize {
        self.variables
    }
    fn num_constraints(&self) -> usize {
        1
    }
    fn variable_bounds(&self, lower: &mut [f64], upper: &mut [f64]) {
        lower.fill(self.bounds[0]);
        upper.fill(self.bounds[1]);
    }
    fn constraint_bounds(&self, lower: &mut [f64], upper: &mut [f64]) {
        lower.fill(self.constraint_bounds[0]);
        upper.fill(self.constraint_bounds[1]);
    }
    fn initial_point(&self, x: &mut [f64]) {
        x.fill(self.start);
    }
    fn objective(&mut self, x: &[f64], _new_x: bool) -> f64 {
        x[0] * x[0]
    }
    fn gradient(&mut self, x: &[f64], _new_x: bool, out: &mut [f64]) {
        out[0] = 2.0 * x[0];
    }
    fn constraints(&mut self, x: &[f64], _new_x: bool, out: &mut [f64]) {
        out[0] = x[0];
    }
    fn jacobian_structure(&self) -> (&[i32], &[i32]) {
        (&self.jacobian, &self.jacobian)
    }
    fn jacobian_values(&mut self, _x: &[f64], _new_x: bool, out: &mut [f64]) {
        out.fill(self.derivative);
    }
    fn hessian_structure(&self) -> Option<(&[i32], &[i32])> {
        self.hessian.as_ref().map(|(rows, columns)| (&rows[..], &columns[..]))
    }
    fn hessian_values(&mut self, _: &[f64], _: bool, factor: f64, _: &[f64], _: bool, out: &mut [f64]) {
        out.fill(2.0 * factor);
    }
}

#[test]
fn mistakes_are_found_before_the_solve() {
    let error = |mut problem: Small| run(&mut problem, &Options::new()).unwrap_err().to_string();
    assert_eq!(run(&mut fine(), &Options::new()).unwrap().status, Status::Solved);
    assert_eq!(error(Small { variables: 0, ..fine() }), "the problem has no variables");
    assert!(error(Small { start: f64::NAN, ..fine() }).contains("initial variable 0 is NaN"));
    assert!(error(Small { start: f64::INFINITY, ..fine() }).contains("not a finite number"));
    for bounds in [[2.0, 1.0], [f64::NAN, 1.0], [0.0, f64::NAN], [f64::INFINITY; 2], [f64::NEG_INFINITY; 2]] {
        assert!(error(Small { bounds, ..fine() }).starts_with("variable 0 has the bounds"));
        let problem = Small { constraint_bounds: bounds, ..fine() };
        assert!(error(problem).starts_with("constraint 0 has the bounds"));
    }
    assert!(error(Small { jacobian: vec![], ..fine() }).contains("Jacobian is empty"));
    let upper_triangle = Small { hessian: Some((vec![0], vec![1])), ..fine() };
    assert!(error(upper_triangle).contains("entry 0 of the Hessian is at row 0, column 1"));
    let uneven = Small { hessian: Some((vec![0], vec![])), ..fine() };
    assert!(error(uneven).contains("the Hessian has 1 row indices but 0 column indices"));
}

/// Also one in the Jacobian, which Ipopt by default does not look at.
#[test]
fn nan_in_a_derivative_is_reported() {
    let problem = &mut Small { derivative: f64::NAN, ..fine() };
    assert_eq!(run(problem, &Options::new()).unwrap().status, Status::InvalidNumber);
}

#[test]
fn wrong_options_are_refused() {
    let attempt = |options: Options| run(&mut fine(), &options).map(|solution| solution.status);
    let accepted = Options::new()
        .set_int("max_iter", 50)
        .set_num("tol", 1e-6)
        .set_str("mu_strategy", "adaptive")
        .set_int("mumps_pivot_order", 6);
    assert_eq!(attempt(accepted), Ok(Status::Solved));
    for refused in [
        Options::new().set_int("no_such_option", 1),
        Options::new().set_int("%s%n%d", 1),
        Options::new().set_int("tol\0", 1),
        Options::new().set_int("", 1),
        Options::new().set_int("tol", 1),
        Options::new().set_num("max_iter", 1.0),
        Options::new().set_str("max_iter", "1"),
        Options::new().set_int("max_iter", -1),
        Options::new().set_num("tol", -1.0),
        Options::new().set_num("tol", f64::NAN),
        Options::new().set_str("mu_strategy", "bold"),
        Options::new().set_str("mu_strategy", "adapt\0ive"),
    ] {
        let error = attempt(refused.clone()).unwrap_err();
        assert!(matches!(error, IpoptError::OptionRejected { .. }), "{refused:?}: {error}");
        assert!(matches!(warpgait::Error::from(error), warpgait::Error::Input(_)));
    }
    let reserved = Options::new().set_str("option_file_name", "ipopt.opt");
    assert_eq!(attempt(reserved), Err(IpoptError::OptionReserved("option_file_name".into())));
    let linear_solver = Options::new().set_str("linear_solver", "ma27");
    assert_eq!(attempt(linear_solver), Err(IpoptError::OptionReserved("linear_solver".into())));
    let exact = Options::new().set_str("hessian_approximation", "exact");
    assert_eq!(attempt(exact), Err(IpoptError::NoHessian));
}

#[test]
fn of_two_settings_the_later_one_counts() {
    let options = Options::new().set_int("max_iter", 0).set_int("max_iter", 100);
    assert_eq!(run(&mut fine(), &options).unwrap().status, Status::Solved);
}
