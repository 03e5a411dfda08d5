//! One solve, from the problem to the solution.

use std::panic::resume_unwind;
use std::time::Instant;

use super::application::{Application, Iterate};
use super::callbacks::{Session, Stop, callbacks};
use super::layout::Layout;
use super::lock::SolverLock;
use super::{IpoptError, Multipliers, NlpProblem, OnIteration, Options, Solution, Status};

/// Solves the problem with Ipopt. Waits first if another thread is solving.
///
/// `warm_start` gives multipliers to start from (they count together with `warm_start_init_point`, which is then set; the
/// `warm_start_…_push` options say how far the point may stay at its bounds). `on_iteration` is called once an iteration.
///
/// # Errors
/// When the problem, its initial point, the multipliers or the options are wrong; then nothing was solved.
///
/// # Panics
/// When the problem or `on_iteration` panics: with the same payload, after Ipopt has ended in good order.
pub fn solve<P: NlpProblem>(
    problem: &mut P,
    options: &Options,
    warm_start: Option<&Multipliers>,
    on_iteration: &mut OnIteration<'_>,
) -> Result<Solution, IpoptError> {
    let layout = Layout::of(problem)?;
    let x = layout.initial_point(problem)?;
    let multipliers = layout.initial_multipliers(warm_start)?;
    let lock = SolverLock::acquire()?;
    let mut application = Application::new(&layout, callbacks::<P>(), &lock)?;
    options.apply(&mut application, layout.hessian.is_some(), warm_start.is_some())?;

    let start = Instant::now();
    let mut session = Session::new(problem, on_iteration, &layout, &x);
    let mut iterate =
        Iterate { constraints: vec![f64::NAN; layout.num_constraints], objective: f64::NAN, x, multipliers };
    // SAFETY: the callbacks are those for a `Session<P>`, which is borrowed by nothing else until the call returns.
    let code = unsafe { application.solve(&mut iterate, (&raw mut session).cast()) };
    let total_seconds = start.elapsed().as_secs_f64();

    let status = match session.stop.take() {
        None => Status::from_code(code),
        Some(Stop::Callback) => Status::StoppedByCallback,
        Some(Stop::Interrupt) => Status::Interrupted,
        Some(Stop::Panic(payload)) => {
            drop(application);
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
        history,
        evaluation_seconds: evaluation_time.as_secs_f64(),
        total_seconds,
    })
}
