//! Mistakes that are found before a solve.

use super::option_value::OptionValue;

/// A mistake in the problem, the options or the use of the solver, found before the solve.
#[derive(Clone, Debug, PartialEq, thiserror::Error)]
#[non_exhaustive]
pub enum IpoptError {
    /// No variables.
    #[error("the problem has no variables")]
    NoVariables,
    /// More variables, constraints or entries than Ipopt's 32-bit indices can count.
    #[error("the problem has {count} {what}, more than Ipopt can count")]
    TooLarge {
        /// Of what.
        what: &'static str,
        /// How many.
        count: usize,
    },
    /// The lists of rows and columns of a sparsity structure differ in length.
    #[error("the {matrix} has {rows} row indices but {columns} column indices")]
    StructureLengths {
        /// Which matrix.
        matrix: &'static str,
        /// Length of the list of rows.
        rows: usize,
        /// Length of the list of columns.
        columns: usize,
    },
    /// An entry lies outside the matrix, or above the diagonal of the Hessian.
    #[error("entry {entry} of the {matrix} is at row {row}, column {column}, but {allowed}")]
    StructureIndex {
        /// Which matrix.
        matrix: &'static str,
        /// Position in the lists.
        entry: usize,
        /// Its row.
        row: i32,
        /// Its column.
        column: i32,
        /// What would be right.
        allowed: String,
    },
    /// There are constraints, but the Jacobian has no entries.
    #[error("the problem has {0} constraints, but none depends on a variable: the Jacobian is empty")]
    EmptyJacobian(usize),
    /// A bound is NaN, or the lower one is above the upper one, or infinite on the wrong side.
    #[error("{what} {index} has the bounds [{lower}, {upper}], between which there is no number")]
    Bounds {
        /// "variable" or "constraint".
        what: &'static str,
        /// Which one.
        index: usize,
        /// The lower bound.
        lower: f64,
        /// The upper bound.
        upper: f64,
    },
    /// A value of the initial point is not finite.
    #[error("the initial {what} {index} is {value}, not a finite number")]
    NotFinite {
        /// Of what.
        what: &'static str,
        /// Which one.
        index: usize,
        /// Its value.
        value: f64,
    },
    /// Ipopt has no such option, or it does not take such a value.
    #[error(
        "Ipopt does not accept the option {name} = {value:?}: check its name, whether it takes an integer, \
         a number or a word, and the range (https://coin-or.github.io/Ipopt/OPTIONS.html)"
    )]
    OptionRejected {
        /// The option.
        name: String,
        /// The value.
        value: OptionValue,
    },
    /// An option that the solver interface sets itself.
    #[error("the Ipopt option {0} cannot be set: warpgait sets it itself")]
    OptionReserved(String),
    /// `hessian_approximation = exact` without a Hessian.
    #[error("hessian_approximation = exact, but the problem has no Hessian")]
    NoHessian,
    /// `linear_solver = "faer"` with an Ipopt that cannot use it.
    #[error(
        "linear_solver = \"faer\", but this Ipopt cannot use it: it has no function that sets MA57's routines \
         (Ipopt 3.11 to 3.14 built with the linear solver loader have one); use \"auto\" or \"mumps\""
    )]
    NoFaer,
    /// A solve was started from within the callbacks of another one.
    #[error("a solve was started from inside another solve; Ipopt can run only one at a time")]
    Nested,
    /// Ipopt did not take a problem that passed every check.
    #[error("Ipopt refused to set the problem up")]
    Refused,
    /// The handler for Ctrl-C could not be installed.
    #[error("the handler for Ctrl-C could not be installed: {0}")]
    CtrlC(String),
}

impl From<IpoptError> for crate::Error {
    /// Options come from the user; everything else is a mistake in the program.
    fn from(error: IpoptError) -> Self {
        match error {
            IpoptError::OptionRejected { .. } | IpoptError::OptionReserved(_) | IpoptError::NoFaer => {
                Self::Input(error.to_string())
            }
            _ => Self::Internal(error.to_string()),
        }
    }
}
