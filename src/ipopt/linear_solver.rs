//! The linear solvers that Ipopt can use.

use std::fmt;

use schemars::JsonSchema;
use serde::{Deserialize, Serialize};

/// The linear solver inside Ipopt.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq, Serialize, Deserialize, JsonSchema)]
#[serde(rename_all = "kebab-case")]
pub enum LinearSolver {
    /// Faer where Ipopt can take it, else MUMPS.
    #[default]
    Auto,
    /// Condensed and factored in Rust, by the crate `kkt`. If that fails, the solve continues with MUMPS.
    Faer,
    /// Ipopt's own.
    Mumps,
}

impl fmt::Display for LinearSolver {
    fn fmt(&self, formatter: &mut fmt::Formatter<'_>) -> fmt::Result {
        formatter.write_str(match self {
            Self::Auto => "auto",
            Self::Faer => "faer",
            Self::Mumps => "mumps",
        })
    }
}
