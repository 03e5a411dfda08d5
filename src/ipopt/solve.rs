//! One solve, from the problem to the solution.

use std::panic::resume_unwind;
use std::time::Instant;

use ipopt_sys as ffi;

use super::application::{Application, Iterate};
use super::callbacks::{Session, Stop, callbacks};
use super::layout::Layout;
use super::linear_solver::go_on;
use super::lock::SolverLock;
use super::plug::{Outcome, Plugged};
use super::{
    IpoptError, LinearSolver, Multipliers, NlpProblem, OnIteration, OptionValue, Options, Solution, Status,
};

/// Ipopt's default.
const IPOPTS_MAX_ITER: i32 = 3000;

/// Solves the problem with Ipopt. Waits first if another thread is solving.
///
/// `warm_start` gives multipliers to start from (they count together with `warm_start_init_point`, which is then set; the
/// `warm_start_…_push` options say how far the point may stay at its bounds). `on_iteration` is called once an iteration.
///
/// When the linear solver faer fails, MUMPS goes on from the last iterate.
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
    let mut linear_solver = options.linear_solver.resolve(&lock)?;

    let start = Instant::now();
    let mut session = Session::new(problem, on_iteration, &layout, &x);
    let attempt = Attempt { options, layout: &layout, warm: warm_start.is_some(), lock: &lock };
    let mut ended = attempt.run(&mut session, x, multipliers, linear_solver)?;
    if session.stop.is_none() && ended.linear_solver_failed() {
        linear_solver = LinearSolver::Mumps;
        let (x, multipliers) = (session.continue_anew(), layout.initial_multipliers(None)?);
        ended = Attempt { warm: false, ..attempt }.run(&mut session, x, multipliers, linear_solver)?;
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

/// Whether Ipopt solves a problem, and with this very linear solver.
pub(super) fn probe(problem: &mut impl NlpProblem, linear_solver: LinearSolver, lock: &SolverLock) -> bool {
    let mut solved = || {
        let layout = Layout::of(problem)?;
        let x = layout.initial_point(problem)?;
        let multipliers = layout.initial_multipliers(None)?;
        let mut on_iteration = go_on;
        let mut session = Session::new(problem, &mut on_iteration, &layout, &x);
        let attempt = Attempt { options: &Options::new(), layout: &layout, warm: false, lock };
        let ended = attempt.run(&mut session, x, multipliers, linear_solver)?;
        let used = ended.plug.is_some_and(|outcome| outcome.used);
        Ok::<bool, IpoptError>(ended.code == ffi::Solve_Succeeded && used)
    };
    solved().unwrap_or(false)
}

/// One run of Ipopt: what stays the same when it is repeated with another linear solver.
#[derive(Clone, Copy)]
struct Attempt<'a> {
    options: &'a Options,
    layout: &'a Layout,
    /// Whether the multipliers count.
    warm: bool,
    lock: &'a SolverLock,
}

/// How a run ended.
struct Ended {
    code: ffi::ApplicationReturnStatus,
    iterate: Iterate,
    /// Of the linear solver, if it was plugged in.
    plug: Option<Outcome>,
}

impl Ended {
    /// Whether the run ended because of the linear solver: it failed, or Ipopt found no step while matrices counted as singular.
    fn linear_solver_failed(&self) -> bool {
        let no_step = matches!(
            Status::from_code(self.code),
            Status::StepComputationFailed | Status::RestorationFailed | Status::Failed(_)
        );
        self.plug.as_ref().is_some_and(|plug| plug.failed || (no_step && plug.singular > 0))
    }
}

impl Attempt<'_> {
    fn run<P: NlpProblem>(
        self,
        session: &mut Session<'_, P>,
        x: Vec<f64>,
        multipliers: Multipliers,
        linear_solver: LinearSolver,
    ) -> Result<Ended, IpoptError> {
        let Self { options, layout, warm, lock } = self;
        let mut application = Application::new(layout, callbacks::<P>(), lock)?;
        let plugged = match linear_solver {
            LinearSolver::Faer => Some(Plugged::new(layout, lock).ok_or(IpoptError::NoFaer)?),
            _ => None,
        };
        options.apply(&mut application, linear_solver, layout.hessian.is_some(), warm)?;
        if session.num_before > 0 {
            let limit = match options.get("max_iter") {
                Some(OptionValue::Int(limit)) => *limit,
                _ => IPOPTS_MAX_ITER,
            };
            let left = limit.saturating_sub(session.num_before as i32).max(0);
            application.set_option("max_iter", &OptionValue::Int(left));
        }
        let mut iterate = Iterate {
            constraints: vec![f64::NAN; layout.num_constraints],
            objective: f64::NAN,
            x,
            multipliers,
        };
        // SAFETY: the callbacks are those for a `Session<P>`, which is borrowed by nothing else until the call returns.
        let code = unsafe { application.solve(&mut iterate, std::ptr::from_mut(session).cast()) };
        let mut plug = plugged.map(|plugged| plugged.outcome());
        if let Some(payload) = plug.as_mut().and_then(|outcome| outcome.panic.take()) {
            session.stop = Some(Stop::Panic(payload));
        }
        Ok(Ended { code, iterate, plug })
    }
}
