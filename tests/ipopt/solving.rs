//! Problems that are as they should be.

use std::ops::ControlFlow;
use std::thread;
use std::time::Duration;

use warpgait::ipopt::{IterationRecord, LinearSolver, Mode, NlpProblem, Options, Solution, Status, solve};

use crate::problems::{Circle, HS071_OBJECTIVE, HS071_X, Hs071, Unconstrained, Wavy, run};

const LINEAR_SOLVERS: [LinearSolver; 2] = [LinearSolver::Faer, LinearSolver::Mumps];

#[track_caller]
fn assert_is_hs071(solution: &Solution) {
    assert_eq!(solution.status, Status::Solved);
    assert!(solution.status.converged());
    for (actual, expected) in solution.x.iter().zip(HS071_X) {
        assert!((actual - expected).abs() < 1e-6, "{:?}", solution.x);
    }
    assert!((solution.objective - HS071_OBJECTIVE).abs() < 1e-6);
}

/// Everything but the times.
fn without_times(history: &[IterationRecord]) -> Vec<IterationRecord> {
    history.iter().map(|record| IterationRecord { seconds: 0.0, ..record.clone() }).collect()
}

#[test]
fn hs071_with_the_exact_hessian() {
    let lengths = LINEAR_SOLVERS.map(hs071_with);
    assert_eq!(lengths[0], lengths[1], "both linear solvers take the same iterations");
}

fn hs071_with(linear_solver: LinearSolver) -> usize {
    let solution = run(&mut Hs071::new(true), &Options::new().linear_solver(linear_solver)).unwrap();
    assert_is_hs071(&solution);
    assert_eq!(solution.linear_solver, linear_solver);
    assert!((solution.constraints[0] - 25.0).abs() < 1e-6);
    assert!((solution.constraints[1] - 40.0).abs() < 1e-6);
    // Stationarity: ∇f + Jᵀλ − z_lower + z_upper = 0.
    let (mut gradient, mut jacobian) = ([0.0; 4], [0.0; 8]);
    let mut problem = Hs071::new(true);
    problem.gradient(&solution.x, true, &mut gradient);
    problem.jacobian_values(&solution.x, false, &mut jacobian);
    for i in 0..4 {
        let pull: f64 = (0..2).map(|c| jacobian[4 * c + i] * solution.constraint_multipliers[c]).sum();
        let bounds = solution.upper_multipliers[i] - solution.lower_multipliers[i];
        assert!((gradient[i] + pull + bounds).abs() < 1e-6);
    }
    assert!(solution.lower_multipliers[0] > 1.0, "the lower bound of x₀ is active");
    solution.history.len()
}

#[test]
fn hs071_with_limited_memory() {
    let mut problem = Hs071::new(false);
    problem.on_call = Box::new(|function| assert_ne!(function, "hessian"));
    for linear_solver in LINEAR_SOLVERS {
        let solution = run(&mut problem, &Options::new().linear_solver(linear_solver)).unwrap();
        assert_is_hs071(&solution);
        assert_eq!(solution.linear_solver, linear_solver);
    }
}

/// Under each of Ipopt's treatments of fixed variables.
#[test]
fn no_constraints_and_a_fixed_variable() {
    let treatments = ["make_parameter", "make_constraint", "relax_bounds"];
    for (treatment, linear_solver) in treatments.iter().flat_map(|t| LINEAR_SOLVERS.map(|s| (t, s))) {
        let options =
            Options::new().linear_solver(linear_solver).set_str("fixed_variable_treatment", treatment);
        let mut seen = Vec::new();
        let solution = solve(&mut Unconstrained, &options, &mut |_, x| {
            seen = x.to_vec();
            ControlFlow::Continue(())
        })
        .unwrap();
        assert!(solution.status.converged(), "{treatment}: {}", solution.status);
        assert_eq!(solution.linear_solver, linear_solver);
        assert!((solution.x[0] - 3.0).abs() < 1e-7);
        assert!((solution.x[1] - 1.0).abs() < 0.01 && (solution.x[2] - 2.5).abs() < 1e-6);
        // Apart from the 1e-8 by which Ipopt relaxes bounds on its way.
        assert!(seen.iter().zip(&solution.x).all(|(a, b)| (a - b).abs() < 1e-7));
    }
}

#[test]
fn an_infeasible_problem_is_called_so() {
    for linear_solver in LINEAR_SOLVERS {
        let options = Options::new().linear_solver(linear_solver);
        let solution = run(&mut Circle { right_side: -1.0 }, &options).unwrap();
        assert_eq!(solution.status, Status::Infeasible);
        assert_eq!(solution.linear_solver, linear_solver);
        assert!(!solution.status.converged());
        assert!(solution.history.iter().any(|record| record.mode == Mode::Restoration));
        assert!((solution.history.last().unwrap().violation - 1.0).abs() < 1e-3);
    }
}

/// Ipopt's own extension of the matrix by the low-rank Hessian is none that faer knows.
#[test]
fn mumps_goes_on_where_faer_fails() {
    let extended = Options::new().set_str("limited_memory_aug_solver", "extended");
    let by_faer = run(&mut Hs071::new(false), &extended.clone().linear_solver(LinearSolver::Faer)).unwrap();
    assert_is_hs071(&by_faer);
    assert_eq!(by_faer.linear_solver, LinearSolver::Mumps);
    let iterations: Vec<usize> = by_faer.history.iter().map(|record| record.iteration).collect();
    assert_eq!(iterations, (0..iterations.len()).collect::<Vec<_>>());
    let by_mumps = run(&mut Hs071::new(false), &extended.linear_solver(LinearSolver::Mumps)).unwrap();
    assert_eq!(by_faer.x, by_mumps.x);
}

/// The point that `on_iteration` gets is Ipopt's current iterate: f there is the objective that Ipopt reports; and the
/// violation is that of g there.
#[test]
fn the_point_shown_is_the_current_iterate() {
    let mut restorations = 0;
    let mut modes = |record: &IterationRecord, x: &[f64]| {
        let mut problem = Circle { right_side: -1.0 };
        assert!((problem.objective(x, true) - record.objective).abs() < 1e-9);
        let violation = x[0] * x[0] + x[1] * x[1] + 1.0;
        assert!((violation - record.violation).abs() < 1e-12);
        restorations += usize::from(record.mode == Mode::Restoration);
        ControlFlow::Continue(())
    };
    solve(&mut Circle { right_side: -1.0 }, &Options::new(), &mut modes).unwrap();
    assert!(restorations > 0);
    let mut count = 0;
    let solution = solve(&mut Hs071::new(true), &Options::new(), &mut |record, x| {
        assert_eq!(record.iteration, count);
        count += 1;
        assert!((Hs071::new(true).objective(x, true) - record.objective).abs() < 1e-9);
        ControlFlow::Continue(())
    })
    .unwrap();
    assert_eq!(solution.history.len(), count);
    assert!(solution.history.windows(2).all(|pair| pair[0].seconds <= pair[1].seconds));
}

/// Even if Ipopt scales the constraints: 1000 times larger, their violation is 1000 times larger.
#[test]
fn the_violation_is_unscaled() {
    let solution = run(&mut Circle { right_side: 1e8 }, &Options::new()).unwrap();
    assert_eq!(solution.history[0].violation, 1e8 - 5.0);
    assert_eq!(solution.status, Status::Solved);
}

#[test]
fn the_callback_can_stop_at_its_point() {
    for stop_at in [0, 3] {
        let mut seen = Vec::new();
        let solution = solve(&mut Hs071::new(true), &Options::new(), &mut |record, x| {
            seen = x.to_vec();
            if record.iteration == stop_at { ControlFlow::Break(()) } else { ControlFlow::Continue(()) }
        })
        .unwrap();
        assert_eq!(solution.status, Status::StoppedByCallback);
        assert_eq!(solution.history.len(), stop_at + 1);
        assert_eq!(solution.x, seen);
        let mut constraints = [0.0; 2];
        Hs071::new(true).constraints(&seen, true, &mut constraints);
        assert_eq!(solution.constraints, constraints);
        assert!((solution.objective - solution.history[stop_at].objective).abs() < 1e-12);
    }
}

/// There Ipopt itself returns the point at which the restoration began.
#[test]
fn the_callback_can_stop_in_the_restoration_phase() {
    let mut seen = Vec::new();
    let mut restorations = 0;
    let mut problem = Circle { right_side: -1.0 };
    let solution = solve(&mut problem, &Options::new(), &mut |record, x| {
        seen = x.to_vec();
        restorations += usize::from(record.mode == Mode::Restoration);
        if restorations == 3 { ControlFlow::Break(()) } else { ControlFlow::Continue(()) }
    })
    .unwrap();
    assert_eq!(restorations, 3);
    assert_eq!(solution.status, Status::StoppedByCallback);
    assert_eq!(solution.x, seen);
    assert_eq!(solution.objective, seen[0] + seen[1]);
    assert_eq!(solution.constraints[0], seen[0] * seen[0] + seen[1] * seen[1]);
}

#[test]
fn the_same_solve_twice_takes_the_same_iterations() {
    let options = Options::new().set_str("mu_strategy", "adaptive");
    let first = run(&mut Hs071::new(false), &options).unwrap();
    let second = run(&mut Hs071::new(false), &options).unwrap();
    assert_eq!(first.x, second.x);
    assert_eq!(without_times(&first.history), without_times(&second.history));
}

#[test]
fn two_threads_take_turns() {
    let solve_slowly = || {
        let mut problem = Hs071::new(true);
        problem.on_call = Box::new(|_| thread::sleep(Duration::from_micros(300)));
        run(&mut problem, &Options::new()).unwrap()
    };
    let threads: Vec<_> = (0..4).map(|_| thread::spawn(solve_slowly)).collect();
    for thread in threads {
        assert_is_hs071(&thread.join().unwrap());
    }
}

#[test]
fn time_in_the_problem_is_measured() {
    let mut problem = Hs071::new(true);
    problem.on_call = Box::new(|_| thread::sleep(Duration::from_millis(1)));
    let solution = run(&mut problem, &Options::new()).unwrap();
    assert!(solution.evaluation_seconds > 1e-3 * 4.0 * (solution.history.len() - 1) as f64);
    assert!(solution.evaluation_seconds < solution.total_seconds);
}

#[test]
fn limits_are_reported() {
    let solution = run(&mut Hs071::new(true), &Options::new().set_int("max_iter", 2)).unwrap();
    assert_eq!(solution.status, Status::MaxIterations);
    assert_eq!(solution.status.to_string(), "iteration limit reached");
    assert_eq!(solution.history.len(), 3);
    let mut problem = Hs071::new(true);
    problem.on_call = Box::new(|_| {
        let start = std::time::Instant::now();
        while start.elapsed() < Duration::from_millis(5) {}
    });
    let solution = run(&mut problem, &Options::new().set_num("max_cpu_time", 0.02)).unwrap();
    assert_eq!(solution.status, Status::MaxCpuTime);
}

/// On problems with long line searches and restorations too: the point shown is the current iterate, and `new_x` is
/// never false for an x that the problem has not seen.
#[test]
fn rough_problems_see_the_right_points() {
    let (mut iterations, mut restorations, mut solved) = (0, 0, 0);
    for seed in 0..20 {
        let strategy = if seed % 2 == 0 { "adaptive" } else { "monotone" };
        let options = Options::new().set_str("mu_strategy", strategy).set_int("max_iter", 100);
        let (mut problem, mut check) = (Wavy::new(20, seed), Wavy::new(20, seed));
        let solution = solve(&mut problem, &options, &mut |record, x| {
            let objective = check.objective(x, true);
            assert!((objective - record.objective).abs() < 1e-8 * (1.0 + objective.abs()));
            iterations += 1;
            restorations += usize::from(record.mode == Mode::Restoration);
            ControlFlow::Continue(())
        })
        .unwrap();
        solved += usize::from(solution.status.converged());
        assert_eq!(problem.false_new_x, 0);
    }
    println!("{iterations} iterations, {restorations} of them restoration, {solved} of 20 solved");
    assert!(restorations > 20 && solved > 0);
}
