//! Which linear solvers the installed Ipopt can use.

use std::ops::ControlFlow;
use std::sync::OnceLock;

use ipopt_sys as ffi;

use super::attempt::Attempt;
use super::callbacks::Session;
use super::error::IpoptError;
use super::layout::ProblemLayout;
use super::linear_solver::LinearSolver;
use super::lock::SolverLock;
use super::options::Options;
use super::plug::by_kkt;
use super::problem::NlpProblem;
use super::solution::IterationRecord;

impl LinearSolver {
    /// Whether the Ipopt that this process runs with can take this linear solver.
    ///
    /// # Errors
    /// [`IpoptError::NoFaer`], or [`IpoptError::Nested`] from inside a solve.
    pub fn check(self) -> Result<(), IpoptError> {
        match self {
            Self::Faer => self.resolve(&SolverLock::acquire()?).map(|_| ()),
            Self::Auto | Self::Mumps => Ok(()),
        }
    }

    /// Faer or MUMPS.
    pub(super) fn resolve(self, lock: &SolverLock) -> Result<Self, IpoptError> {
        static FAER_WORKS: OnceLock<bool> = OnceLock::new();
        let faer_works = || *FAER_WORKS.get_or_init(|| probe(&mut Parabola, Self::Faer, lock));
        match self {
            Self::Mumps => Ok(Self::Mumps),
            Self::Faer | Self::Auto if faer_works() => Ok(Self::Faer),
            Self::Faer => Err(IpoptError::NoFaer),
            Self::Auto => Ok(Self::Mumps),
        }
    }
}

/// Whether Ipopt solves a problem, and with this very linear solver.
fn probe(problem: &mut impl NlpProblem, linear_solver: LinearSolver, lock: &SolverLock) -> bool {
    let mut solved = || {
        let layout = ProblemLayout::of(problem)?;
        let x = layout.initial_point(problem)?;
        let mut on_iteration = |_: &IterationRecord, _: &[f64]| ControlFlow::Continue(());
        let mut session = Session::new(problem, &mut on_iteration, &layout, &x);
        let attempt = Attempt { options: &Options::new(), layout: &layout, analysis: by_kkt, lock };
        let ended = attempt.run(&mut session, x, linear_solver)?;
        let used = ended.plug.is_some_and(|outcome| outcome.used);
        Ok::<bool, IpoptError>(ended.code == ffi::Solve_Succeeded && used)
    };
    solved().unwrap_or(false)
}

/// Minimize (x − 1)²: shows whether Ipopt calls a linear solver that was plugged in.
struct Parabola;

impl NlpProblem for Parabola {
    fn num_variables(&self) -> usize {
        1
    }
    fn num_constraints(&self) -> usize {
        0
    }
    fn variable_bounds(&self, lower: &mut [f64], upper: &mut [f64]) {
        lower.fill(f64::NEG_INFINITY);
        upper.fill(f64::INFINITY);
    }
    fn constraint_bounds(&self, _lower: &mut [f64], _upper: &mut [f64]) {}
    fn initial_point(&self, x: &mut [f64]) {
        x.fill(0.0);
    }
    fn objective(&mut self, x: &[f64], _new_x: bool) -> f64 {
        (x[0] - 1.0).powi(2)
    }
    fn gradient(&mut self, x: &[f64], _new_x: bool, out: &mut [f64]) {
        out.fill(2.0 * (x[0] - 1.0));
    }
    fn constraints(&mut self, _x: &[f64], _new_x: bool, _out: &mut [f64]) {}
    fn jacobian_structure(&self) -> (&[i32], &[i32]) {
        (&[], &[])
    }
    fn jacobian_values(&mut self, _x: &[f64], _new_x: bool, _out: &mut [f64]) {}
    fn hessian_structure(&self) -> Option<(&[i32], &[i32])> {
        Some((&[0], &[0]))
    }
    fn hessian_values(&mut self, _: &[f64], _: bool, factor: f64, _: &[f64], _: bool, out: &mut [f64]) {
        out.fill(2.0 * factor);
    }
}
