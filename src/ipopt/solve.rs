//! One solve, from the problem to the solution.

use std::panic::resume_unwind;
use std::time::Instant;

use super::application::Iterate;
use super::attempt::{Attempt, Ended};
use super::callbacks::{Session, Stop};
use super::error::IpoptError;
use super::interrupt::InGoodOrder;
use super::layout::ProblemLayout;
use super::linear_solver::LinearSolver;
use super::lock::SolverLock;
use super::options::Options;
use super::plug::{Analysis, by_kkt};
use super::problem::{NlpProblem, OnIteration};
use super::solution::{Solution, Status};

/// Solves the problem with Ipopt. Waits first if another thread is solving.
///
/// `on_iteration` is called at every iteration. When faer fails, the solve continues with MUMPS from the last iterate.
///
/// # Errors
/// When the problem, its initial point or the options are wrong; then nothing was solved.
///
/// # Panics
/// When the problem or `on_iteration` panics: with the same payload, after Ipopt has cleaned up.
pub fn solve<P: NlpProblem>(
    problem: &mut P,
    options: &Options,
    on_iteration: &mut OnIteration<'_>,
) -> Result<Solution, IpoptError> {
    solve_by(by_kkt, problem, options, on_iteration)
}

/// [`solve`], with what faer factors made by `analysis`.
pub(super) fn solve_by<P: NlpProblem>(
    analysis: Analysis,
    problem: &mut P,
    options: &Options,
    on_iteration: &mut OnIteration<'_>,
) -> Result<Solution, IpoptError> {
    let layout = ProblemLayout::of(problem)?;
    let x = layout.initial_point(problem)?;
    let lock = SolverLock::acquire()?;
    let _in_good_order = InGoodOrder::begin();
    let mut linear_solver = options.linear_solver.resolve(&lock)?;

    let start = Instant::now();
    let mut session = Session::new(problem, on_iteration, &layout, &x);
    let attempt = Attempt { options, layout: &layout, analysis, lock: &lock };
    let mut ended = attempt.run(&mut session, x, linear_solver)?;
    if session.stop.is_none() && ended.linear_solver_failed() {
        linear_solver = LinearSolver::Mumps;
        let x = session.continue_anew();
        ended = attempt.run(&mut session, x, linear_solver)?;
    }
    let total_seconds = start.elapsed().as_secs_f64();

    let Ended { code, mut iterate, .. } = ended;
    let status = match session.stop.take() {
        None => Status::from_code(code),
        Some(Stop::Callback) => Status::StoppedByCallback,
        Some(Stop::Interrupt) => Status::Interrupted,
        Some(Stop::Panic(payload)) => {
            drop(lock);
            resume_unwind(payload);
        }
    };
    let Session { history, last_x, last_constraints, evaluation_time, .. } = session;
    if matches!(status, Status::StoppedByCallback | Status::Interrupted) {
        // Stopped in the restoration phase, Ipopt returns the point at which that phase began. The caller stopped
        // because of the point that it saw.
        if iterate.x != last_x {
            iterate.objective = problem.objective(&last_x, true);
        }
        iterate.x = last_x;
        iterate.constraints = last_constraints;
    }
    let Iterate { x, constraints, objective, multipliers } = iterate;
    Ok(Solution {
        x,
        objective,
        constraints,
        constraint_multipliers: multipliers.constraint,
        lower_multipliers: multipliers.lower,
        upper_multipliers: multipliers.upper,
        status,
        linear_solver,
        history,
        evaluation_seconds: evaluation_time.as_secs_f64(),
        total_seconds,
    })
}
