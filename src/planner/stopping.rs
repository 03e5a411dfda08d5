//! When a stage has done what its effort demands, and which of its iterates to keep.

use std::cell::Cell;
use std::ops::ControlFlow;
use std::rc::Rc;

use crate::ipopt::{IterationRecord, NlpProblem};
use crate::scenario::Effort;

/// `effort = "smooth"` stops when this many iterations have lowered a feasible objective by less than [`SMOOTH_GAIN`] of it.
const SMOOTH_WINDOW: usize = 4;
/// See [`SMOOTH_WINDOW`].
const SMOOTH_GAIN: f64 = 0.02;
/// Not while the dual infeasibility is larger than this: the steps are then short because Ipopt regularizes an indefinite Hessian.
const SMOOTH_DUAL: f64 = 1.0;
/// The cost has settled when the sum of the products of slacks and multipliers is below this fraction of it. On the central path of a
/// convex problem, that is by how much it exceeds the minimum; in solves of gaits it is twice as much.
const SETTLED_GAP: f64 = 0.02;
/// The products are what μ says after a step of at least this length.
const FULL_STEP: f64 = 0.9;
/// The largest violation with which an objective means something.
const NEARLY_FEASIBLE: f64 = 1e-2;

/// Watches the iterations of one stage.
pub(super) struct StoppingRule {
    effort: Effort,
    with_costs: bool,
    /// On the largest violation.
    tolerance: f64,
    /// Objectives of the feasible iterates, in order.
    objectives: Vec<f64>,
    best: Option<(f64, Vec<f64>)>,
    satisfied: bool,
    settling: Option<Settling>,
}

/// Notices that the cost has settled: that hardly more than feasibility is left to gain.
struct Settling {
    /// Products of slacks and multipliers, whose mean is μ.
    pairs: f64,
    /// At the last iterate.
    objective: f64,
    settled: Rc<Cell<bool>>,
}

impl Settling {
    fn observe(&mut self, record: &IterationRecord) {
        let cost = record.objective.abs();
        let change = (self.objective - record.objective).abs();
        self.objective = record.objective;
        if record.violation <= NEARLY_FEASIBLE
            && record.dual_infeasibility <= SMOOTH_DUAL
            && record.alpha_primal.min(record.alpha_dual) >= FULL_STEP
            && change < SMOOTH_GAIN * cost
            && self.pairs * record.mu < SETTLED_GAP * cost
        {
            self.settled.set(true);
        }
    }
}

/// The number of bounds on free variables and on rows that are no equations.
fn bounds(problem: &impl NlpProblem) -> usize {
    let (variables, rows) = (problem.num_variables(), problem.num_constraints());
    let (mut lower, mut upper) = (vec![0.0; variables + rows], vec![0.0; variables + rows]);
    problem.variable_bounds(&mut lower[..variables], &mut upper[..variables]);
    problem.constraint_bounds(&mut lower[variables..], &mut upper[variables..]);
    let free = lower.iter().zip(&upper).filter(|(lower, upper)| lower < upper);
    free.map(|(lower, upper)| usize::from(lower.is_finite()) + usize::from(upper.is_finite())).sum()
}

impl StoppingRule {
    /// For a problem with or without costs.
    pub fn new(effort: Effort, with_costs: bool, tolerance: f64) -> Self {
        Self {
            effort,
            with_costs,
            tolerance,
            objectives: Vec::new(),
            best: None,
            satisfied: false,
            settling: None,
        }
    }

    /// Tells the problem, through `settled`, when its cost has settled, and then stops at the next feasible iterate.
    #[must_use]
    pub fn telling(self, problem: &impl NlpProblem, settled: Rc<Cell<bool>>) -> Self {
        let settling = Settling { pairs: bounds(problem) as f64, objective: f64::INFINITY, settled };
        let wanted = self.with_costs && self.effort == Effort::Smooth;
        Self { settling: wanted.then_some(settling), ..self }
    }

    /// Records an iterate and decides whether to continue.
    pub fn observe(&mut self, record: &IterationRecord, x: &[f64]) -> ControlFlow<()> {
        let had_settled = self.settling.as_ref().is_some_and(|settling| settling.settled.get());
        if let Some(settling) = &mut self.settling {
            settling.observe(record);
        }
        if record.violation > self.tolerance {
            return ControlFlow::Continue(());
        }
        if self.best.as_ref().is_none_or(|(objective, _)| record.objective < *objective) {
            self.best = Some((record.objective, x.to_vec()));
        }
        self.objectives.push(record.objective);
        self.satisfied = match self.effort {
            _ if !self.with_costs => true,
            Effort::Feasible => true,
            Effort::Smooth => record.dual_infeasibility <= SMOOTH_DUAL && (had_settled || self.has_stalled()),
            Effort::Optimal => false,
        };
        if self.satisfied { ControlFlow::Break(()) } else { ControlFlow::Continue(()) }
    }

    /// Whether the last few feasible iterates have hardly lowered the objective.
    fn has_stalled(&self) -> bool {
        let gain = |window: &[f64]| window[0] - window[SMOOTH_WINDOW - 1];
        let last = self.objectives.windows(SMOOTH_WINDOW).last();
        last.is_some_and(|window| gain(window) < SMOOTH_GAIN * window[0].abs())
    }

    /// Whether this rule ended the stage.
    pub fn is_satisfied(&self) -> bool {
        self.satisfied
    }

    /// The better of the best feasible iterate and Ipopt's last point, which may be worse than one that it has passed.
    pub fn best(self, last: Vec<f64>, last_objective: f64, last_feasible: bool) -> Vec<f64> {
        match self.best {
            Some((objective, x)) if !last_feasible || objective < last_objective => x,
            _ => last,
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::ipopt::Mode;

    fn record(objective: f64, violation: f64) -> IterationRecord {
        IterationRecord {
            iteration: 0,
            mode: Mode::Regular,
            objective,
            violation,
            dual_infeasibility: 0.0,
            mu: 0.0,
            step_norm: 0.0,
            regularization: 0.0,
            alpha_dual: 0.0,
            alpha_primal: 0.0,
            line_search_trials: 0,
            seconds: 0.0,
        }
    }

    #[test]
    fn smooth_stops_where_the_objective_stalls() {
        let mut rule = StoppingRule::new(Effort::Smooth, true, 1e-4);
        for (objective, violation) in
            [(1.0, 1.0), (90.0, 0.0), (50.0, 0.0), (20.0, 0.0), (19.9, 0.0), (19.8, 0.0)]
        {
            assert!(rule.observe(&record(objective, violation), &[objective]).is_continue(), "{objective}");
        }
        assert!(rule.observe(&record(19.85, 0.0), &[19.85]).is_break());
        assert!(rule.is_satisfied());
        assert_eq!(rule.best(vec![19.85], 19.85, true), [19.8]);
    }

    /// One variable with one bound.
    struct OneBound;

    impl NlpProblem for OneBound {
        fn num_variables(&self) -> usize {
            1
        }
        fn num_constraints(&self) -> usize {
            0
        }
        fn variable_bounds(&self, lower: &mut [f64], upper: &mut [f64]) {
            (lower[0], upper[0]) = (0.0, f64::INFINITY);
        }
        fn constraint_bounds(&self, _lower: &mut [f64], _upper: &mut [f64]) {}
        fn initial_point(&self, x: &mut [f64]) {
            x[0] = 1.0;
        }
        fn objective(&mut self, x: &[f64], _new_x: bool) -> f64 {
            x[0]
        }
        fn gradient(&mut self, _x: &[f64], _new_x: bool, out: &mut [f64]) {
            out[0] = 1.0;
        }
        fn constraints(&mut self, _x: &[f64], _new_x: bool, _out: &mut [f64]) {}
        fn jacobian_structure(&self) -> (&[i32], &[i32]) {
            (&[], &[])
        }
        fn jacobian_values(&mut self, _x: &[f64], _new_x: bool, _out: &mut [f64]) {}
    }

    #[test]
    fn a_settled_cost_is_told_and_the_next_feasible_iterate_is_the_last() {
        let full = |objective: f64, violation: f64, mu: f64| IterationRecord {
            mu,
            alpha_primal: 1.0,
            alpha_dual: 1.0,
            ..record(objective, violation)
        };
        let settled = Rc::new(Cell::new(false));
        let mut rule = StoppingRule::new(Effort::Smooth, true, 1e-4).telling(&OneBound, settled.clone());
        let far =
            [full(20.0, 1e-3, 1e-3), full(10.0, 1e-3, 1e-3), full(9.9, 0.1, 1e-3), full(9.9, 1e-3, 0.5)];
        let short = IterationRecord { alpha_dual: 0.5, ..full(9.9, 1e-3, 1e-3) };
        for row in far.iter().chain([&short]) {
            assert!(rule.observe(row, &[0.0]).is_continue());
            assert!(!settled.get(), "{row:?}");
        }
        assert!(rule.observe(&full(9.9, 1e-5, 1e-3), &[0.0]).is_continue());
        assert!(settled.get());
        assert!(rule.observe(&full(9.9, 1e-3, 1e-3), &[0.0]).is_continue());
        assert!(rule.observe(&full(9.9, 1e-5, 1e-3), &[0.0]).is_break());
    }

    #[test]
    fn feasible_stops_at_the_first_feasible_iterate_and_optimal_never() {
        for (effort, stops) in [(Effort::Feasible, true), (Effort::Optimal, false)] {
            let mut rule = StoppingRule::new(effort, true, 1e-4);
            assert!(rule.observe(&record(1.0, 1e-3), &[0.0]).is_continue());
            assert_eq!(rule.observe(&record(2.0, 1e-5), &[1.0]).is_break(), stops);
            assert_eq!(rule.best(vec![7.0], 0.0, false), [1.0]);
        }
    }
}
