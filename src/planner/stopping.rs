//! When a stage has done what its effort demands, and which of its iterates to keep.

use std::ops::ControlFlow;

use crate::ipopt::IterationRecord;
use crate::scenario::Effort;

/// `effort = "smooth"` stops when this many iterations have lowered a feasible objective by less than [`SMOOTH_GAIN`] of it.
const SMOOTH_WINDOW: usize = 4;
/// See [`SMOOTH_WINDOW`].
const SMOOTH_GAIN: f64 = 0.02;
/// Not while the dual infeasibility is larger than this: the steps are then short because Ipopt regularizes an indefinite Hessian.
const SMOOTH_DUAL: f64 = 1.0;

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
}

impl StoppingRule {
    /// For a problem with or without costs.
    pub fn new(effort: Effort, with_costs: bool, tolerance: f64) -> Self {
        Self { effort, with_costs, tolerance, objectives: Vec::new(), best: None, satisfied: false }
    }

    /// Records an iterate and decides whether to continue.
    pub fn observe(&mut self, record: &IterationRecord, x: &[f64]) -> ControlFlow<()> {
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
            Effort::Smooth => record.dual_infeasibility <= SMOOTH_DUAL && self.has_stalled(),
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
