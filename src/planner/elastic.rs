//! Why no motion was found: which limits would have to give.
//!
//! The problem is solved once more with its limits made elastic. The laws of motion and the ground stay as they are; each other row may exceed
//! its bounds by a slack,
//!
//! ```text
//!   min Σ s_g + ε f(x)   s.t.   lower − c s_g ≤ g(x) ≤ upper + c s_g,   s_g ≥ 0,
//! ```
//!
//! one slack for the rows of a block, a foot and a quarter of a second, with c what counts as a lot for that kind of row. Sums of slacks have
//! minima at which most of them are zero, so that few limits are named. What is found is no motion, and never replaces one.

use std::collections::BTreeMap;
use std::ops::ControlFlow;
use std::time::{Duration, Instant};

use serde::{Deserialize, Serialize};

use super::options;
use super::problem::GaitProblem;
use super::stopping::StoppingRule;
use crate::ipopt::{self, IterationRecord, NlpProblem};
use crate::scenario::{Effort, Hessian, SolverSpec};

/// Rows of a block and a foot that act within this time share a slack, s.
const WINDOW: f64 = 0.25;
/// ε.
const COST: f64 = 0.03;
/// Iterations, at most.
const ITERATIONS: usize = 100;
/// Limits that are named in sentences, at most.
const MOST_WORDS: usize = 5;
/// Limits that give less than this fraction of c are not named.
const LEAST: f64 = 0.03;

/// A limit that would have to give.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
pub struct Shortfall {
    /// Name of the block of constraints.
    pub block: String,
    /// The foot, if the limit is one of a foot.
    pub foot: Option<String>,
    /// From when to when, s.
    pub time: [f64; 2],
    /// Where, x and y: the foot, or the base, m.
    pub place: [f64; 2],
    /// By how much.
    pub amount: f64,
    /// Of the amount.
    pub unit: String,
    /// In words.
    pub words: String,
}

/// Why no motion was found.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
pub struct Explanation {
    /// The limits that would have to give, the worst first.
    pub shortfalls: Vec<Shortfall>,
    /// Whether the search for the fewest came to its end in time.
    pub fewest: bool,
    /// A key with which a motion is found, its value, and the value in the scenario, as text.
    pub remedy: Option<[String; 3]>,
}

impl Explanation {
    /// In a few sentences.
    pub fn sentences(&self) -> String {
        let mut words: Vec<String> = self.shortfalls.iter().map(|s| s.words.clone()).collect();
        if words.len() > MOST_WORDS {
            let more = words.split_off(MOST_WORDS).len();
            words.push(format!("and {more} more"));
        }
        if !self.fewest {
            words.push("fewer may do, the search ended early".into());
        }
        let remedy = self.remedy.as_ref().map_or(String::new(), |[key, to, from]| {
            format!("; with {key} = {to} instead of {from} a motion is found")
        });
        format!("{}{remedy}", words.join("; "))
    }
}

/// How the rows of a block give: what counts as a lot, as a length of ANYmal or not, the factor and unit of amounts, and the words around
/// an amount, with FOOT in place of the foot.
struct Kind {
    block: &'static str,
    scale: f64,
    is_length: bool,
    factor: f64,
    unit: &'static str,
    words: [&'static str; 2],
}

macro_rules! kinds {
    ($($block:literal, $scale:literal, $is_length:literal, $factor:literal, $unit:literal, $before:literal, $after:literal;)*) => {
        &[$(Kind { block: $block, scale: $scale, is_length: $is_length, factor: $factor, unit: $unit, words: [$before, $after] }),*]
    };
}

/// The blocks that can give; all others are laws. What the user can change gives more easily than what the robot is.
const KINDS: &[Kind] = kinds! {
    "reach", 0.03, true, 1e3, "mm", "FOOT's reach box is ", " too small";
    "friction", 0.1, false, 1e2, "% of the weight", "FOOT lacks friction for ", "";
    "friction (Eq. 9)", 0.1, false, 1e2, "% of the weight", "FOOT lacks friction for ", "";
    "normal force", 0.4, false, 1e2, "% of the weight", "FOOT's normal force is ", " beyond its limits";
    "swing clearance", 0.1, true, 1e3, "mm", "FOOT swings ", " too low";
    "base clearance", 0.1, true, 1e3, "mm", "the torso is ", " too close to the ground";
    "goal", 0.2, true, 1e3, "mm", "the base ends ", " from the goal";
    "way-points", 0.2, true, 1e3, "mm", "the base passes a way-point ", " too far away";
    "foothold patch", 0.05, true, 1e3, "mm", "FOOT's foothold is ", " outside its patch";
    "foothold slope", 0.2, false, 1e2, "%", "FOOT's foothold is ", " too steep";
    "fixed footholds", 0.1, true, 1e3, "mm", "FOOT's foothold is ", " from the given place";
    "keep out", 0.05, true, 1e3, "mm", "FOOT stands ", " too deep in what is kept free";
    "posture", 0.1, true, 1e3, "mm or mrad", "the torso is ", " beyond [posture]";
    "joint speed", 0.2, false, 1e2, "% of its limit", "a joint of FOOT is ", " too slow";
    "joint torque", 0.2, false, 1e2, "% of its limit", "a joint of FOOT is ", " too weak";
    "knee clearance", 0.03, true, 1e3, "mm", "FOOT's knee or shank is ", " too close to the ground";
};

fn kind(block: &str) -> Option<&'static Kind> {
    KINDS.iter().find(|kind| kind.block == block)
}

impl Kind {
    fn scale(&self, size: f64) -> f64 {
        if self.is_length { size * self.scale } else { self.scale }
    }
}

/// A row of the elastic problem.
#[derive(Clone, Copy, Debug)]
struct Row {
    /// Of the problem itself.
    row: usize,
    /// Lower and upper bound.
    range: [f64; 2],
    /// The slack, and what one unit of it adds to the row.
    slack: Option<(usize, f64)>,
}

/// A problem whose limits give.
struct Elastic<'a> {
    problem: &'a mut GaitProblem,
    /// Rows that are bounded on both sides appear twice.
    rows: Vec<Row>,
    slacks: usize,
    initial: Vec<f64>,
    jacobian: (Vec<i32>, Vec<i32>),
    /// Where each entry of the Jacobian comes from: that of the problem, or the coefficient of a slack.
    sources: Vec<Source>,
    values: Vec<f64>,
    entries: Vec<f64>,
    /// By row of the problem.
    multipliers: Vec<f64>,
}

#[derive(Clone, Copy, Debug)]
enum Source {
    Entry(usize),
    Slack(f64),
}

impl<'a> Elastic<'a> {
    /// From a point x of the problem.
    fn new(problem: &'a mut GaitProblem, x: &[f64]) -> Self {
        let (n, m) = (problem.num_variables(), problem.num_constraints());
        let (mut lower, mut upper) = (vec![0.0; m], vec![0.0; m]);
        problem.constraint_bounds(&mut lower, &mut upper);
        let mut values = vec![0.0; m];
        problem.constraints(x, true, &mut values);
        let (size, step) = (problem.model.size, problem.model.layout.time_step);
        let (mut rows, mut groups, mut largest) = (Vec::new(), BTreeMap::new(), Vec::<f64>::new());
        for (b, (block, first)) in problem.blocks().enumerate() {
            let scale = kind(block.name()).map(|kind| kind.scale(size));
            for r in 0..block.rows() {
                let (row, range) = (first + r, [lower[first + r], upper[first + r]]);
                let Some(scale) = scale else {
                    rows.push(Row { row, range, slack: None });
                    continue;
                };
                let place = block.place(r);
                let window = (place.sample * step / WINDOW) as usize;
                let next = largest.len();
                let group = *groups.entry((b, place.foot, window)).or_insert(next);
                if group == next {
                    largest.push(0.0);
                }
                let excess = (range[0] - values[row]).max(values[row] - range[1]).max(0.0) / scale;
                largest[group] = largest[group].max(excess);
                if range[0].is_finite() {
                    rows.push(Row { row, range: [range[0], f64::INFINITY], slack: Some((group, scale)) });
                }
                if range[1].is_finite() {
                    rows.push(Row {
                        row,
                        range: [f64::NEG_INFINITY, range[1]],
                        slack: Some((group, -scale)),
                    });
                }
            }
        }
        let slacks = largest.len();
        let mut initial = x.to_vec();
        initial.extend(largest.iter().map(|slack| slack + 0.01));
        let mut of_row = vec![Vec::new(); m];
        for (e, row) in rows.iter().enumerate() {
            of_row[row.row].push(e);
        }
        let (mut jacobian, mut sources) = ((Vec::new(), Vec::new()), Vec::new());
        let (entry_rows, entry_columns) = problem.jacobian_structure();
        for (entry, (&row, &column)) in entry_rows.iter().zip(entry_columns).enumerate() {
            for &e in &of_row[row as usize] {
                jacobian.0.push(e as i32);
                jacobian.1.push(column);
                sources.push(Source::Entry(entry));
            }
        }
        for (e, row) in rows.iter().enumerate() {
            if let Some((group, coefficient)) = row.slack {
                jacobian.0.push(e as i32);
                jacobian.1.push((n + group) as i32);
                sources.push(Source::Slack(coefficient));
            }
        }
        let entries = vec![0.0; entry_rows.len()];
        let multipliers = vec![0.0; m];
        Self { problem, rows, slacks, initial, jacobian, sources, values, entries, multipliers }
    }

    fn own(&self) -> usize {
        self.problem.num_variables()
    }
}

impl NlpProblem for Elastic<'_> {
    fn num_variables(&self) -> usize {
        self.own() + self.slacks
    }

    fn num_constraints(&self) -> usize {
        self.rows.len()
    }

    fn variable_bounds(&self, lower: &mut [f64], upper: &mut [f64]) {
        let n = self.own();
        self.problem.variable_bounds(&mut lower[..n], &mut upper[..n]);
        lower[n..].fill(0.0);
        upper[n..].fill(f64::INFINITY);
    }

    fn constraint_bounds(&self, lower: &mut [f64], upper: &mut [f64]) {
        for (r, row) in self.rows.iter().enumerate() {
            [lower[r], upper[r]] = row.range;
        }
    }

    fn initial_point(&self, x: &mut [f64]) {
        x.copy_from_slice(&self.initial);
    }

    fn objective(&mut self, x: &[f64], new_x: bool) -> f64 {
        let n = self.own();
        COST * self.problem.objective(&x[..n], new_x) + x[n..].iter().sum::<f64>()
    }

    fn gradient(&mut self, x: &[f64], new_x: bool, out: &mut [f64]) {
        let n = self.own();
        self.problem.gradient(&x[..n], new_x, &mut out[..n]);
        out[..n].iter_mut().for_each(|value| *value *= COST);
        out[n..].fill(1.0);
    }

    fn constraints(&mut self, x: &[f64], new_x: bool, out: &mut [f64]) {
        let n = self.own();
        self.problem.constraints(&x[..n], new_x, &mut self.values);
        for (value, row) in out.iter_mut().zip(&self.rows) {
            *value = self.values[row.row] + row.slack.map_or(0.0, |(group, c)| c * x[n + group]);
        }
    }

    fn jacobian_structure(&self) -> (&[i32], &[i32]) {
        (&self.jacobian.0, &self.jacobian.1)
    }

    fn jacobian_values(&mut self, x: &[f64], new_x: bool, out: &mut [f64]) {
        let n = self.own();
        self.problem.jacobian_values(&x[..n], new_x, &mut self.entries);
        for (value, source) in out.iter_mut().zip(&self.sources) {
            *value = match source {
                Source::Entry(entry) => self.entries[*entry],
                Source::Slack(coefficient) => *coefficient,
            };
        }
    }

    fn hessian_structure(&self) -> Option<(&[i32], &[i32])> {
        self.problem.hessian_structure()
    }

    fn hessian_values(
        &mut self,
        x: &[f64],
        new_x: bool,
        objective_factor: f64,
        multipliers: &[f64],
        new_multipliers: bool,
        out: &mut [f64],
    ) {
        let n = self.own();
        let own = &mut self.multipliers;
        own.fill(0.0);
        for (multiplier, row) in multipliers.iter().zip(&self.rows) {
            own[row.row] += multiplier;
        }
        self.problem.hessian_values(&x[..n], new_x, COST * objective_factor, own, new_multipliers, out);
    }
}

/// The limits that would have to give for there to be a motion; from x. None if none was found within the time, or it was interrupted.
pub(super) fn explain(
    problem: &mut GaitProblem,
    x: &[f64],
    solver: &SolverSpec,
    limit: Duration,
    on_iteration: &mut dyn FnMut(&IterationRecord) -> ControlFlow<()>,
) -> Option<Explanation> {
    problem.hessian_structure()?;
    let n = problem.num_variables();
    let mut elastic = Elastic::new(problem, x);
    let options = options::of(solver, Hessian::Exact, false, ITERATIONS);
    let mut rule = StoppingRule::new(Effort::Smooth, true, solver.tolerance);
    let start = Instant::now();
    let mut stopped = false;
    let solution = ipopt::solve(&mut elastic, &options, &mut |record, x| {
        if start.elapsed() > limit {
            return ControlFlow::Break(());
        }
        if on_iteration(record).is_break() {
            stopped = true;
            return ControlFlow::Break(());
        }
        rule.observe(record, x)
    })
    .ok()?;
    if stopped || solution.status == ipopt::Status::Interrupted {
        return None;
    }
    // The best point at which the laws hold, if there was one.
    let fewest = rule.is_satisfied() || solution.status == ipopt::Status::Solved;
    let best = rule.best(Vec::new(), f64::INFINITY, false);
    let shortfalls = exceeded(problem, best.get(..n)?);
    (!shortfalls.is_empty()).then_some(Explanation { shortfalls, fewest, remedy: None })
}

/// What exceeds its limits at x, runs of a block and a foot together; the worst first.
fn exceeded(problem: &mut GaitProblem, x: &[f64]) -> Vec<Shortfall> {
    let m = problem.num_constraints();
    let (mut lower, mut upper, mut values) = (vec![0.0; m], vec![0.0; m], vec![0.0; m]);
    problem.constraint_bounds(&mut lower, &mut upper);
    problem.constraints(x, true, &mut values);
    let (size, step) = (problem.model.size, problem.model.layout.time_step);
    let mut runs: Vec<(f64, Shortfall)> = Vec::new();
    for (block, first) in problem.blocks() {
        let Some(kind) = kind(block.name()) else { continue };
        let mut found: Vec<(Option<usize>, f64, f64)> = Vec::new();
        for r in 0..block.rows() {
            let excess = (lower[first + r] - values[first + r]).max(values[first + r] - upper[first + r]);
            if excess > LEAST * kind.scale(size) {
                let place = block.place(r);
                found.push((place.foot, place.sample * step, excess));
            }
        }
        found.sort_by(|a, b| (a.0).cmp(&b.0).then(a.1.total_cmp(&b.1)));
        for group in found.chunk_by(|a, b| a.0 == b.0 && b.1 - a.1 <= WINDOW) {
            let (foot, at, excess) =
                group.iter().fold(group[0], |worst, row| if row.2 > worst.2 { *row } else { worst });
            let time = [group[0].1, group[group.len() - 1].1];
            let k = ((at / step).round() as usize).min(problem.model.layout.intervals);
            let p = match foot {
                Some(i) => problem.state.foot(&problem.model, i, k).point.position,
                None => problem.state.base[k].position(),
            };
            let foot = foot.map(|i| problem.model.foot_names[i].clone());
            let amount = kind.factor * excess;
            let [before, after] =
                kind.words.map(|words| words.replace("FOOT", foot.as_deref().unwrap_or("a foot")));
            let digits = if amount < 10.0 { 1 } else { 0 };
            let when = if time[1] - time[0] < step {
                format!("at {:.2} s", time[0])
            } else {
                format!("from {:.2} to {:.2} s", time[0], time[1])
            };
            let words = format!("{before}{amount:.digits$} {}{after} {when}", kind.unit);
            let shortfall = Shortfall {
                block: kind.block.into(),
                foot,
                time,
                place: [p.x, p.y],
                amount,
                unit: kind.unit.into(),
                words,
            };
            runs.push((excess / kind.scale(size), shortfall));
        }
    }
    runs.sort_by(|a, b| b.0.total_cmp(&a.0));
    runs.into_iter().map(|(_, shortfall)| shortfall).collect()
}
