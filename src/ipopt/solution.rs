//! The result of a solve.

use std::fmt;

use ipopt_sys as ffi;
use serde::Serialize;

use super::linear_solver::LinearSolver;

/// Which phase of Ipopt's algorithm an iteration belongs to.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Serialize)]
#[serde(rename_all = "kebab-case")]
pub enum Mode {
    /// Toward the optimum.
    Regular,
    /// Toward feasibility alone, after the line search failed.
    Restoration,
}

/// One iteration.
#[derive(Clone, Debug, PartialEq, Serialize)]
pub struct IterationRecord {
    /// From 0, the initial point.
    pub iteration: usize,
    /// The phase.
    pub mode: Mode,
    /// f, unscaled.
    pub objective: f64,
    /// How far g lies outside its bounds at the current iterate: max norm, unscaled. (Ipopt's own `inf_pr` is scaled
    /// and counts the slack variables.)
    pub violation: f64,
    /// Max norm of the gradient of the Lagrangian, scaled; in the restoration phase, that of its own problem.
    pub dual_infeasibility: f64,
    /// The barrier parameter μ.
    pub mu: f64,
    /// Max norm of the step, slack variables included; 0 at iteration 0.
    pub step_norm: f64,
    /// What was added to the diagonal of the Hessian; 0 for nothing.
    pub regularization: f64,
    /// Step length of the dual variables.
    pub alpha_dual: f64,
    /// Step length of the primal variables.
    pub alpha_primal: f64,
    /// Points tried in the line search.
    pub line_search_trials: usize,
    /// s since the start of the solve, wall clock.
    pub seconds: f64,
}

/// Multipliers of a problem with n variables and m constraints.
#[derive(Clone, Debug, Default, PartialEq)]
pub struct Multipliers {
    /// (m,) of the constraints.
    pub constraint: Vec<f64>,
    /// (n,) of the lower bounds of the variables, ≥ 0.
    pub lower: Vec<f64>,
    /// (n,) of the upper bounds of the variables, ≥ 0.
    pub upper: Vec<f64>,
}

impl Multipliers {
    /// All zero.
    pub fn zeros(n: usize, m: usize) -> Self {
        Self { constraint: vec![0.0; m], lower: vec![0.0; n], upper: vec![0.0; n] }
    }
}

/// The result of a solve.
#[derive(Clone, Debug, PartialEq)]
pub struct Solution {
    /// (n,) the final point; after a stop by the callback or an interruption, the one that the callback saw last, which
    /// may lie outside its bounds by Ipopt's `bound_relax_factor` (1e-8).
    pub x: Vec<f64>,
    /// f(x); NaN if Ipopt ended before it knew.
    pub objective: f64,
    /// (m,) g(x); NaN if Ipopt ended before it knew.
    pub constraints: Vec<f64>,
    /// (m,) of the constraints.
    pub constraint_multipliers: Vec<f64>,
    /// (n,) of the lower bounds of the variables.
    pub lower_multipliers: Vec<f64>,
    /// (n,) of the upper bounds of the variables.
    pub upper_multipliers: Vec<f64>,
    /// How it ended.
    pub status: Status,
    /// Faer or MUMPS, whichever was used last.
    pub linear_solver: LinearSolver,
    /// Every iteration, from the initial point on.
    pub history: Vec<IterationRecord>,
    /// s inside the problem's functions, wall clock.
    pub evaluation_seconds: f64,
    /// s in all, wall clock, without waiting for another thread's solve.
    pub total_seconds: f64,
}

/// How a solve ended.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
#[non_exhaustive]
pub enum Status {
    /// Optimal to the tolerance.
    Solved,
    /// Optimal to the acceptable tolerance only.
    Acceptable,
    /// A square problem: feasible to the tolerance.
    FeasiblePointFound,
    /// Converged to a point where the violation has a local minimum.
    Infeasible,
    /// The search direction became too small.
    StepTooSmall,
    /// The iterates diverge.
    Diverging,
    /// The limit of iterations was reached.
    MaxIterations,
    /// The limit of CPU time was reached.
    MaxCpuTime,
    /// The limit of wall-clock time was reached (Ipopt 3.14).
    MaxWallTime,
    /// The restoration phase found no better point.
    RestorationFailed,
    /// The linear solver found no step.
    StepComputationFailed,
    /// `on_iteration` asked to stop.
    StoppedByCallback,
    /// Ctrl-C, or [`super::INTERRUPT`] was raised.
    Interrupted,
    /// More equations than free variables.
    TooFewDegreesOfFreedom,
    /// Ipopt considers the problem invalid.
    InvalidProblem,
    /// Ipopt considers an option invalid, for example a linear solver that is not installed.
    InvalidOption,
    /// NaN or infinity where Ipopt could not step around it.
    InvalidNumber,
    /// Out of memory.
    OutOfMemory,
    /// An exception inside Ipopt, with its return code.
    Failed(i32),
}

/// In 3.14's header only.
const MAXIMUM_WALL_TIME_EXCEEDED: ffi::ApplicationReturnStatus = -5;

impl Status {
    /// From the return code of `IpoptSolve`. A requested stop counts as requested by the callback.
    pub(super) fn from_code(code: ffi::ApplicationReturnStatus) -> Self {
        match code {
            ffi::Solve_Succeeded => Self::Solved,
            ffi::Solved_To_Acceptable_Level => Self::Acceptable,
            ffi::Feasible_Point_Found => Self::FeasiblePointFound,
            ffi::Infeasible_Problem_Detected => Self::Infeasible,
            ffi::Search_Direction_Becomes_Too_Small => Self::StepTooSmall,
            ffi::Diverging_Iterates => Self::Diverging,
            ffi::User_Requested_Stop => Self::StoppedByCallback,
            ffi::Maximum_Iterations_Exceeded => Self::MaxIterations,
            ffi::Maximum_CpuTime_Exceeded => Self::MaxCpuTime,
            MAXIMUM_WALL_TIME_EXCEEDED => Self::MaxWallTime,
            ffi::Restoration_Failed => Self::RestorationFailed,
            ffi::Error_In_Step_Computation => Self::StepComputationFailed,
            ffi::Not_Enough_Degrees_Of_Freedom => Self::TooFewDegreesOfFreedom,
            ffi::Invalid_Problem_Definition => Self::InvalidProblem,
            ffi::Invalid_Option => Self::InvalidOption,
            ffi::Invalid_Number_Detected => Self::InvalidNumber,
            ffi::Insufficient_Memory => Self::OutOfMemory,
            other => Self::Failed(other),
        }
    }

    /// Whether Ipopt's own convergence test was met, at least to the acceptable tolerance.
    #[must_use]
    pub fn converged(self) -> bool {
        matches!(self, Self::Solved | Self::Acceptable | Self::FeasiblePointFound)
    }
}

impl fmt::Display for Status {
    fn fmt(&self, formatter: &mut fmt::Formatter<'_>) -> fmt::Result {
        formatter.write_str(match self {
            Self::Solved => "solved",
            Self::Acceptable => "solved to the acceptable tolerance",
            Self::FeasiblePointFound => "feasible point found",
            Self::Infeasible => "converged to a point that is locally infeasible",
            Self::StepTooSmall => "search direction became too small",
            Self::Diverging => "iterates diverge",
            Self::MaxIterations => "iteration limit reached",
            Self::MaxCpuTime => "CPU time limit reached",
            Self::MaxWallTime => "wall-clock time limit reached",
            Self::RestorationFailed => "restoration phase failed",
            Self::StepComputationFailed => "step computation failed",
            Self::StoppedByCallback => "stopped by the iteration callback",
            Self::Interrupted => "interrupted",
            Self::TooFewDegreesOfFreedom => "more equations than free variables",
            Self::InvalidProblem => "Ipopt holds the problem to be invalid",
            Self::InvalidOption => "Ipopt holds an option to be invalid",
            Self::InvalidNumber => "a function or derivative is NaN or infinite",
            Self::OutOfMemory => "out of memory",
            Self::Failed(code) => return write!(formatter, "Ipopt failed with return code {code}"),
        })
    }
}
