//! Which constraint is violated most, where and when.

use serde::Serialize;

use super::problem::GaitProblem;
use crate::ipopt::NlpProblem;

/// The largest violation within one named block.
#[derive(Clone, Debug, PartialEq, Serialize)]
pub struct BlockViolation {
    /// Name of the block.
    pub block: String,
    /// Number of rows.
    pub rows: usize,
    /// Largest violation, units of the NLP.
    pub largest: f64,
    /// Name of the foot, where there is one.
    pub foot: Option<String>,
    /// When, s.
    pub time: f64,
    /// Where: the base's x and y there, m.
    pub place: [f64; 2],
}

/// Whether every constraint and bound holds to the tolerance.
pub fn is_feasible(problem: &mut GaitProblem, x: &[f64], tolerance: f64) -> bool {
    table(problem, x).iter().all(|block| block.largest <= tolerance)
}

/// One row for each block, in the order of the problem, and one for the bounds of the variables.
pub fn table(problem: &mut GaitProblem, x: &[f64]) -> Vec<BlockViolation> {
    let rows = problem.num_constraints();
    let (mut lower, mut upper, mut g) = (vec![0.0; rows], vec![0.0; rows], vec![0.0; rows]);
    problem.constraint_bounds(&mut lower, &mut upper);
    problem.constraints(x, true, &mut g);
    let excess = |value: f64, lower: f64, upper: f64| (lower - value).max(value - upper).max(0.0);
    let mut table: Vec<BlockViolation> = problem
        .blocks()
        .map(|(block, first)| {
            // NaN counts as infinite.
            let size = |r: usize| {
                let v = excess(g[first + r], lower[first + r], upper[first + r]);
                if g[first + r].is_nan() { f64::INFINITY } else { v }
            };
            let worst = (0..block.rows()).max_by(|&a, &b| size(a).total_cmp(&size(b)));
            let place = worst.map(|r| block.place(r)).unwrap_or_default();
            let k = (place.sample.round() as usize).min(problem.model.layout.intervals);
            let p = problem.state.base[k].position();
            BlockViolation {
                block: block.name().to_string(),
                rows: block.rows(),
                largest: worst.map_or(0.0, size),
                foot: place.foot.map(|i| problem.model.foot_names[i].clone()),
                time: place.sample * problem.model.layout.time_step,
                place: [p.x, p.y],
            }
        })
        .collect();
    let n = problem.num_variables();
    let (mut lower, mut upper) = (vec![0.0; n], vec![0.0; n]);
    problem.variable_bounds(&mut lower, &mut upper);
    let largest = (0..n).map(|v| excess(x[v], lower[v], upper[v])).fold(0.0, f64::max);
    table.push(BlockViolation {
        block: "bounds of variables".into(),
        rows: n,
        largest,
        foot: None,
        time: 0.0,
        place: [0.0; 2],
    });
    table
}
