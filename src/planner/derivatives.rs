//! Analytic derivatives against central differences, block by block: in the tests, and for users as `--check-derivatives`.

use serde::Serialize;

use super::problem::GaitProblem;
use crate::ipopt::NlpProblem;

/// The largest disagreement within one block.
#[derive(Clone, Debug, Serialize)]
pub struct DerivativeError {
    /// Name of the block, or of a cost, or `hessian`.
    pub block: String,
    /// Largest |analytic − difference| / max(1, |difference|).
    pub largest: f64,
    /// Row within the block, and variable.
    pub place: String,
    /// Entries that differences find but the pattern lacks.
    pub missing: usize,
}

/// Step of the central differences.
const STEP: f64 = 1e-5;
/// Finer one, where the first cannot tell.
const FINER_STEP: f64 = 1e-6;
/// Coarser one for second derivatives, where rounding hides what the others could tell.
const COARSER_STEP: f64 = 1e-4;
/// A derivative that disagrees by more than this is compared with other differences too, a second one also with one-sided ones:
/// more than the step's own error, less than any test allows.
const SUSPICIOUS: f64 = 1e-7;
/// A difference larger than this, where the pattern has no entry, is a missing entry.
const NOISE: f64 = 1e-6;

/// Compares all first derivatives at x, and the second ones if the problem has them, in the directions of `variables`.
pub fn check(problem: &mut GaitProblem, x: &[f64], variables: &[usize]) -> Vec<DerivativeError> {
    check_with(problem, x, variables, |_| {}, |_| {})
}

/// The same, with the values of the Jacobian and of the Hessian changed first, to test that the comparison notices.
pub fn check_with(
    problem: &mut GaitProblem,
    x: &[f64],
    variables: &[usize],
    tamper: impl FnOnce(&mut [f64]),
    tamper_hessian: impl FnOnce(&mut [f64]),
) -> Vec<DerivativeError> {
    let (rows, columns) = {
        let (r, c) = problem.jacobian_structure();
        (r.to_vec(), c.to_vec())
    };
    let m = problem.num_constraints();
    // Poisoned, so that an entry that is not written is noticed.
    let mut values = vec![f64::NAN; rows.len()];
    problem.jacobian_values(x, true, &mut values);
    tamper(&mut values);
    let n = problem.num_variables();
    let mut gradient = vec![f64::NAN; n];
    problem.gradient(x, true, &mut gradient);

    let names: Vec<(String, usize)> =
        problem.blocks().map(|(b, first)| (b.name().to_string(), first)).collect();
    let block_of = |row: usize| names.iter().rposition(|(_, first)| *first <= row).unwrap_or(0);
    let mut errors: Vec<DerivativeError> = names
        .iter()
        .map(|(name, _)| name.clone())
        .chain(["cost".into()])
        .map(|block| DerivativeError { block, largest: 0.0, place: String::new(), missing: 0 })
        .collect();

    let mut moved = x.to_vec();
    let (mut plus, mut minus) = (vec![f64::NAN; m], vec![f64::NAN; m]);
    let cost = names.len();
    for &v in variables {
        let mut column = vec![None; m];
        for (slot, (&r, &c)) in rows.iter().zip(&columns).enumerate() {
            if c as usize == v {
                column[r as usize] = Some(values[slot]);
            }
        }
        let name = problem.variable_name(v);
        let mut nearest = vec![f64::INFINITY; m];
        let mut slope = f64::INFINITY;
        for step in [STEP, FINER_STEP] {
            moved[v] = x[v] + step;
            problem.constraints(&moved, true, &mut plus);
            let up = problem.objective(&moved, false);
            moved[v] = x[v] - step;
            problem.constraints(&moved, true, &mut minus);
            let down = problem.objective(&moved, false);
            if slope.is_infinite() {
                slope = (up - down) / (2.0 * step);
            }
            if !approach(&column, &mut nearest, |row| (plus[row] - minus[row]) / (2.0 * step)) {
                break;
            }
        }
        moved[v] = x[v];
        for row in 0..m {
            let b = block_of(row);
            match column[row] {
                Some(value) => {
                    note(&mut errors[b], value, nearest[row], || format!("row {}, {name}", row - names[b].1))
                }
                None if nearest[row].abs() > NOISE => errors[b].missing += 1,
                None => {}
            }
        }
        note(&mut errors[cost], gradient[v], slope, || name.clone());
    }
    if problem.hessian_structure().is_some() {
        errors.push(check_hessian(problem, x, variables, tamper_hessian));
    }
    errors
}

/// The Hessian of the Lagrangian with fixed arbitrary multipliers against differences of its gradient.
///
/// Third derivatives of the ground and of the map are in it, and they jump by J at knots: if one is at a distance d < step, the central
/// difference is off by J/2 (1 − d/step), and a smaller step only makes that rarer. The one-sided difference away from the knot
/// is not affected. So where the central one disagrees, both one-sided ones and one of fourth order are taken as well, and the nearest
/// counts; a wrong derivative disagrees with all of them.
fn check_hessian(
    problem: &mut GaitProblem,
    x: &[f64],
    variables: &[usize],
    tamper: impl FnOnce(&mut [f64]),
) -> DerivativeError {
    let mut error =
        DerivativeError { block: "hessian".into(), largest: 0.0, place: String::new(), missing: 0 };
    let Some((rows, columns)) = problem.hessian_structure().map(|(r, c)| (r.to_vec(), c.to_vec())) else {
        return error;
    };
    let (n, m) = (problem.num_variables(), problem.num_constraints());
    let multipliers: Vec<f64> = (0..m).map(|r| (1.0 + r as f64 * 0.7).sin()).collect();
    let factor = 0.8;
    let mut values = vec![f64::NAN; rows.len()];
    problem.hessian_values(x, true, factor, &multipliers, true, &mut values);
    tamper(&mut values);
    let (jacobian_rows, jacobian_columns) = {
        let (r, c) = problem.jacobian_structure();
        (r.to_vec(), c.to_vec())
    };
    let mut jacobian = vec![f64::NAN; jacobian_rows.len()];
    let mut lagrangian = |problem: &mut GaitProblem, x: &[f64]| -> Vec<f64> {
        let mut gradient = vec![f64::NAN; n];
        problem.gradient(x, true, &mut gradient);
        gradient.iter_mut().for_each(|g| *g *= factor);
        problem.jacobian_values(x, false, &mut jacobian);
        for (slot, (&r, &c)) in jacobian_rows.iter().zip(&jacobian_columns).enumerate() {
            gradient[c as usize] += multipliers[r as usize] * jacobian[slot];
        }
        gradient
    };
    let mut moved = x.to_vec();
    for &v in variables {
        let mut column = vec![None; n];
        for (slot, (&r, &c)) in rows.iter().zip(&columns).enumerate() {
            if c as usize == v {
                column[r as usize] = Some(values[slot]);
            } else if r as usize == v {
                column[c as usize] = Some(values[slot]);
            }
        }
        let mut at = |offset: f64| {
            moved[v] = x[v] + offset;
            lagrangian(problem, &moved)
        };
        let mut nearest = vec![f64::INFINITY; n];
        for step in [STEP, FINER_STEP, COARSER_STEP] {
            let [minus, plus] = [-step, step].map(&mut at);
            let central = |u: usize| (plus[u] - minus[u]) / (2.0 * step);
            if !approach(&column, &mut nearest, central) {
                break;
            }
            let (here, beyond) = (at(0.0), [-2.0 * step, 2.0 * step].map(&mut at));
            let before = |u: usize| (3.0 * here[u] - 4.0 * minus[u] + beyond[0][u]) / (2.0 * step);
            let after = |u: usize| (4.0 * plus[u] - beyond[1][u] - 3.0 * here[u]) / (2.0 * step);
            let finer =
                |u: usize| (8.0 * (plus[u] - minus[u]) - (beyond[1][u] - beyond[0][u])) / (12.0 * step);
            approach(&column, &mut nearest, finer);
            approach(&column, &mut nearest, before);
            if !approach(&column, &mut nearest, after) {
                break;
            }
        }
        moved[v] = x[v];
        for u in 0..n {
            match column[u] {
                Some(value) => note(&mut error, value, nearest[u], || {
                    format!("{} × {}", problem.variable_name(u), problem.variable_name(v))
                }),
                None if nearest[u].abs() > NOISE * 10.0 => error.missing += 1,
                None => {}
            }
        }
    }
    error
}

/// Takes each of the differences that is nearer to its value than the one before; the first where there is no value. Whether some
/// still disagree.
fn approach(values: &[Option<f64>], nearest: &mut [f64], difference: impl Fn(usize) -> f64) -> bool {
    let mut suspicious = false;
    for (u, (value, nearest)) in values.iter().zip(nearest).enumerate() {
        let difference = difference(u);
        match *value {
            Some(value) => {
                if disagreement(value, difference) < disagreement(value, *nearest) {
                    *nearest = difference;
                }
                suspicious |= disagreement(value, *nearest) > SUSPICIOUS;
            }
            None if nearest.is_infinite() => *nearest = difference,
            None => {}
        }
    }
    suspicious
}

fn note(error: &mut DerivativeError, value: f64, difference: f64, place: impl FnOnce() -> String) {
    let size = disagreement(value, difference);
    if size > error.largest {
        error.largest = size;
        error.place = place();
    }
}

/// |value − difference| / max(1, |difference|); infinite where either is not a number.
fn disagreement(value: f64, difference: f64) -> f64 {
    let size = (value - difference).abs() / difference.abs().max(1.0);
    if size.is_nan() { f64::INFINITY } else { size }
}
