//! `[solver]`: how the NLP is solved.

use schemars::JsonSchema;
use serde::{Deserialize, Serialize};

use crate::ipopt::LinearSolver;

/// Which Hessian Ipopt gets.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq, Serialize, Deserialize, JsonSchema)]
#[serde(rename_all = "kebab-case")]
pub enum Hessian {
    /// L-BFGS.
    #[default]
    LimitedMemory,
    /// Analytic second derivatives.
    Exact,
}

/// When to stop.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq, Serialize, Deserialize, JsonSchema)]
#[serde(rename_all = "kebab-case")]
pub enum Effort {
    /// At the first feasible point, without a cost.
    Feasible,
    /// With the cost: when feasible and no longer improving.
    #[default]
    Smooth,
    /// At the optimum.
    Optimal,
}

/// `continuation`.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Serialize, Deserialize, JsonSchema)]
#[serde(untagged)]
pub enum Continuation {
    /// `"auto"` or `"off"`.
    Mode(ContinuationMode),
    /// A number of steps.
    Steps(#[schemars(range(min = 1, max = 100))] u32),
}

/// `"auto"` or `"off"`.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Serialize, Deserialize, JsonSchema)]
#[serde(rename_all = "kebab-case")]
pub enum ContinuationMode {
    /// If the plain solve fails.
    Auto,
    /// Never.
    Off,
}

/// `[solver]`.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize, JsonSchema)]
#[serde(deny_unknown_fields, default)]
pub struct SolverSpec {
    /// Limit on the iterations, including those of a continuation.
    #[schemars(range(min = 1, max = 100000))]
    pub max_iterations: usize,
    /// Largest violation, in the units of the NLP.
    #[schemars(range(min = 1e-12, max = 0.1))]
    pub tolerance: f64,
    /// Whether to grow the terrain out of the plane if the plain solve fails.
    pub continuation: Continuation,
    /// Which Hessian; default: exact if there is a cost, limited-memory otherwise.
    pub hessian: Option<Hessian>,
    /// Number of steps that the limited-memory Hessian remembers.
    #[schemars(range(min = 1, max = 1000))]
    pub hessian_memory: usize,
    /// Which linear solver Ipopt uses.
    pub linear_solver: LinearSolver,
    /// When to stop.
    pub effort: Effort,
    /// Whether to find out which limits would have to give when no motion is found.
    pub explain: bool,
    /// Threads that evaluate the derivatives of the NLP; the linear solver uses one.
    #[schemars(range(min = 1, max = 2))]
    pub threads: usize,
}

impl Default for SolverSpec {
    fn default() -> Self {
        Self {
            max_iterations: 200,
            tolerance: 1e-4,
            continuation: Continuation::Mode(ContinuationMode::Auto),
            hessian: None,
            hessian_memory: 6,
            linear_solver: LinearSolver::Auto,
            effort: Effort::Smooth,
            explain: true,
            threads: 1,
        }
    }
}
