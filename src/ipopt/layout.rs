//! The fixed part of a problem: sizes, bounds and sparsity, read once and checked.

use super::error::IpoptError;
use super::problem::NlpProblem;

/// Ipopt treats a bound beyond ±1e19 as no bound.
const NO_BOUND: f64 = 2e19;

/// Rows and columns of the entries of a sparse matrix, 0-based.
#[derive(Debug)]
pub struct Structure {
    pub rows: Vec<i32>,
    pub columns: Vec<i32>,
}

impl Structure {
    /// The number of entries.
    pub fn len(&self) -> usize {
        self.rows.len()
    }
}

/// Sizes, bounds and sparsity of a problem that Ipopt can solve.
#[derive(Debug)]
pub struct ProblemLayout {
    pub num_variables: usize,
    pub num_constraints: usize,
    pub variable_lower: Vec<f64>,
    pub variable_upper: Vec<f64>,
    pub constraint_lower: Vec<f64>,
    pub constraint_upper: Vec<f64>,
    pub jacobian: Structure,
    pub hessian: Option<Structure>,
}

impl ProblemLayout {
    /// Queries the problem and checks its answers.
    ///
    /// # Errors
    /// The first thing that is wrong.
    pub fn of(problem: &impl NlpProblem) -> Result<Self, IpoptError> {
        let (n, m) = (problem.num_variables(), problem.num_constraints());
        if n == 0 {
            return Err(IpoptError::NoVariables);
        }
        countable("variables", n)?;
        countable("constraints", m)?;
        let (variable_lower, variable_upper) =
            bounds("variable", n, |lower, upper| problem.variable_bounds(lower, upper))?;
        let (constraint_lower, constraint_upper) =
            bounds("constraint", m, |lower, upper| problem.constraint_bounds(lower, upper))?;
        let jacobian = jacobian(problem.jacobian_structure(), n, m)?;
        let hessian = problem.hessian_structure().map(|pair| hessian(pair, n)).transpose()?;
        Ok(Self {
            num_variables: n,
            num_constraints: m,
            variable_lower,
            variable_upper,
            constraint_lower,
            constraint_upper,
            jacobian,
            hessian,
        })
    }

    /// The initial point, (n,).
    ///
    /// # Errors
    /// When a value is not finite.
    pub fn initial_point(&self, problem: &impl NlpProblem) -> Result<Vec<f64>, IpoptError> {
        let mut x = vec![f64::NAN; self.num_variables];
        problem.initial_point(&mut x);
        finite("variable", &x)?;
        Ok(x)
    }

    /// By how much g (m,) lies outside its bounds, max norm; NaN if an entry is.
    pub fn violation(&self, constraints: &[f64]) -> f64 {
        let bounds = self.constraint_lower.iter().zip(&self.constraint_upper);
        constraints.iter().zip(bounds).fold(0.0, |worst, (value, (lower, upper))| {
            let outside = (lower - value).max(value - upper);
            if outside > worst || value.is_nan() { outside } else { worst }
        })
    }
}

fn countable(what: &'static str, count: usize) -> Result<(), IpoptError> {
    i32::try_from(count).map(|_| ()).map_err(|_| IpoptError::TooLarge { what, count })
}

fn finite(what: &'static str, values: &[f64]) -> Result<(), IpoptError> {
    match values.iter().position(|value| !value.is_finite()) {
        Some(index) => Err(IpoptError::NotFinite { what, index, value: values[index] }),
        None => Ok(()),
    }
}

fn bounds(
    what: &'static str,
    count: usize,
    ask: impl FnOnce(&mut [f64], &mut [f64]),
) -> Result<(Vec<f64>, Vec<f64>), IpoptError> {
    let (mut all_lower, mut all_upper) = (vec![f64::NAN; count], vec![f64::NAN; count]);
    ask(&mut all_lower, &mut all_upper);
    for (index, (lower, upper)) in all_lower.iter_mut().zip(&mut all_upper).enumerate() {
        let possible = *lower <= *upper && *lower < f64::INFINITY && *upper > f64::NEG_INFINITY;
        if !possible {
            return Err(IpoptError::Bounds { what, index, lower: *lower, upper: *upper });
        }
        *lower = lower.max(-NO_BOUND);
        *upper = upper.min(NO_BOUND);
    }
    Ok((all_lower, all_upper))
}

fn jacobian((rows, columns): (&[i32], &[i32]), n: usize, m: usize) -> Result<Structure, IpoptError> {
    let name = "Jacobian";
    let structure = structure(
        name,
        rows,
        columns,
        |row, column| within(row, m) && within(column, n),
        || format!("it has {m} rows and {n} columns, counted from 0"),
    )?;
    if m > 0 && rows.is_empty() {
        return Err(IpoptError::EmptyJacobian(m));
    }
    Ok(structure)
}

fn hessian((rows, columns): (&[i32], &[i32]), n: usize) -> Result<Structure, IpoptError> {
    structure(
        "Hessian",
        rows,
        columns,
        |row, column| within(row, n) && within(column, n) && row >= column,
        || format!("it is the lower triangle of {n} rows and columns, counted from 0"),
    )
}

fn within(index: i32, count: usize) -> bool {
    usize::try_from(index).is_ok_and(|index| index < count)
}

fn structure(
    matrix: &'static str,
    rows: &[i32],
    columns: &[i32],
    allowed: impl Fn(i32, i32) -> bool,
    description: impl Fn() -> String,
) -> Result<Structure, IpoptError> {
    if rows.len() != columns.len() {
        return Err(IpoptError::StructureLengths { matrix, rows: rows.len(), columns: columns.len() });
    }
    countable("matrix entries", rows.len())?;
    let wrong = rows.iter().zip(columns).position(|(&row, &column)| !allowed(row, column));
    if let Some(entry) = wrong {
        return Err(IpoptError::StructureIndex {
            matrix,
            entry,
            row: rows[entry],
            column: columns[entry],
            allowed: description(),
        });
    }
    Ok(Structure { rows: rows.to_vec(), columns: columns.to_vec() })
}
