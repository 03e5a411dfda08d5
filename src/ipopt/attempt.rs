//! One run of Ipopt.

use ipopt_sys as ffi;

use super::application::{Application, Iterate};
use super::callbacks::{Session, Stop, callbacks};
use super::error::IpoptError;
use super::layout::ProblemLayout;
use super::linear_solver::LinearSolver;
use super::lock::SolverLock;
use super::option_value::OptionValue;
use super::options::Options;
use super::plug::{Analysis, Outcome, Plugged};
use super::problem::NlpProblem;
use super::solution::{Multipliers, Status};

/// Ipopt's default of `max_iter`.
const DEFAULT_MAX_ITER: i32 = 3000;

/// One run of Ipopt: what stays the same when it is repeated with another linear solver.
#[derive(Clone, Copy)]
pub(super) struct Attempt<'a> {
    pub options: &'a Options,
    pub layout: &'a ProblemLayout,
    /// Of the matrices that faer factors.
    pub analysis: Analysis,
    pub lock: &'a SolverLock,
}

/// How a run ended.
pub(super) struct Ended {
    pub code: ffi::ApplicationReturnStatus,
    pub iterate: Iterate,
    /// Of the linear solver, if it was plugged in.
    pub plug: Option<Outcome>,
}

impl Ended {
    /// Whether the run ended because of the linear solver: it failed, or Ipopt found no step while matrices counted as singular.
    pub fn linear_solver_failed(&self) -> bool {
        let no_step = matches!(
            Status::from_code(self.code),
            Status::StepComputationFailed | Status::RestorationFailed | Status::Failed(_)
        );
        self.plug.as_ref().is_some_and(|plug| plug.failed || (no_step && plug.singular > 0))
    }
}

impl Attempt<'_> {
    pub fn run<P: NlpProblem>(
        self,
        session: &mut Session<'_, P>,
        x: Vec<f64>,
        linear_solver: LinearSolver,
    ) -> Result<Ended, IpoptError> {
        let Self { options, layout, analysis, lock } = self;
        let mut application = Application::new(layout, callbacks::<P>(), lock)?;
        let plugged = match linear_solver {
            LinearSolver::Faer => Some(Plugged::new(layout, analysis, lock).ok_or(IpoptError::NoFaer)?),
            _ => None,
        };
        options.apply(&mut application, linear_solver, layout.hessian.is_some())?;
        if session.num_before > 0 {
            let limit = match options.get("max_iter") {
                Some(OptionValue::Int(limit)) => *limit,
                _ => DEFAULT_MAX_ITER,
            };
            let left = limit.saturating_sub(session.num_before as i32).max(0);
            application.set_option("max_iter", &OptionValue::Int(left));
        }
        let mut iterate = Iterate {
            constraints: vec![f64::NAN; layout.num_constraints],
            objective: f64::NAN,
            x,
            multipliers: session
                .initial_multipliers()
                .unwrap_or_else(|| Multipliers::zeros(layout.num_variables, layout.num_constraints)),
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
