//! What the legs' mass adds to the laws, updated while a solve runs.
//!
//! The terms of [`LegTerms`] are known functions of time, computed from a motion. The iterates of a solve are motions, too: from each of them
//! follow the terms with which the next points are evaluated. All that belongs to one point is evaluated with the same terms, so an iteration
//! is that of a solve with fixed terms, and its end obeys the laws with the terms that it had. By how much these differ from those of the end
//! itself is looked at afterwards.

use nalgebra::Vector3;

use super::legs;
use crate::nlp::{LegTerms, Model, State, foot_in_base};
use crate::scenario::Law;

/// By how much the torque that the legs' mass adds may still change, rms and at most, m g · 1 m.
const TOLERANCE: [f64; 2] = [0.0015 * LEVER, 0.005 * LEVER];
/// Terms are updated at every third iterate until the cost has settled. More often takes no fewer iterations, and computing them costs a
/// third of one.
const EVERY: usize = 3;
/// Terms that change by less than this fraction of the tolerance stay, so that the last iterations converge as fast as with fixed terms.
const ENOUGH: f64 = 0.5;
/// m, with which torques are compared with the weight.
pub const LEVER: f64 = 0.3;

/// By how much torques of the legs' mass differ.
#[derive(Clone, Copy, Debug)]
pub struct Change {
    /// Root mean square, m g · 1 m.
    pub rms: f64,
    /// m g · 1 m.
    pub most: f64,
}

impl Change {
    /// Between the terms of the model and others, at the state's x.
    pub fn between(model: &Model, state: &State, other: &LegTerms) -> Self {
        let samples = model.layout.intervals + 1;
        let torques = |terms: &LegTerms| -> Vec<Vector3<f64>> {
            let mut torques: Vec<Vector3<f64>> = (0..samples).map(|k| terms.torque(k)).collect();
            for inertia in &terms.inertia {
                torques[inertia.sample] += foot_in_base::inertial_torque(model, state, inertia);
            }
            torques
        };
        let (ours, theirs) = (torques(&model.leg_terms), torques(other));
        let squares = ours.iter().zip(&theirs).map(|(a, b)| (a - b).norm_squared());
        let (sum, most) =
            squares.fold((0.0, 0.0_f64), |(sum, most), square| (sum + square, most.max(square)));
        Self { rms: (sum / samples as f64).sqrt(), most: most.sqrt() }
    }

    /// Whether the terms need not be updated: less than this fraction of what may remain at the end.
    pub fn is_within(self, fraction: f64) -> bool {
        self.rms < fraction * TOLERANCE[0] && self.most < fraction * TOLERANCE[1]
    }
}

/// Updates the terms from iterate to iterate.
#[derive(Clone, Debug)]
pub struct LegUpdate {
    law: Law,
    /// Iterates so far.
    iterates: usize,
    /// For the next point.
    next: Option<LegTerms>,
}

impl LegUpdate {
    /// For a law.
    pub fn new(law: Law) -> Self {
        Self { law, iterates: 0, next: None }
    }

    /// Looks at an iterate x, of which the state is. Once the cost has settled, steps are short, and terms of the last iterate are nearly
    /// those of the next one.
    pub fn observe(&mut self, model: &Model, state: &State, x: &[f64], settled: bool) {
        self.iterates += 1;
        if !settled && !self.iterates.is_multiple_of(EVERY) {
            return;
        }
        let Some(terms) = legs::terms(model, x, self.law) else { return };
        if !Change::between(model, state, &terms).is_within(ENOUGH) {
            self.next = Some(terms);
        }
    }

    /// The terms for a new point, if they changed.
    pub fn take(&mut self) -> Option<LegTerms> {
        self.next.take()
    }
}

#[cfg(test)]
mod tests {
    use std::ops::ControlFlow;

    use super::*;
    use crate::ipopt::NlpProblem;
    use crate::pipeline::Prepared;
    use crate::planner::GaitProblem;
    use crate::scenario::load_text;

    #[test]
    fn a_point_is_evaluated_with_the_same_terms_throughout_and_the_next_one_with_those_of_its_motion() {
        let text = "horizon = 2.0\nformulation = \"direct\"\n[robot]\nname = \"anymal_c\"\n[terrain]\nkind = \"flat\"\n\
                    [start]\nposition = [0.0, 0.0]\n[goal]\nposition = [0.2, 0.0]\n[physics]\nlegs = \"massive\"\n";
        let loaded = load_text("scenario", text, ".".as_ref(), &[]).expect("a scenario");
        let prepared = Prepared::new(&loaded, &mut |_| ControlFlow::Continue(())).expect("a ground");
        let mut problem = prepared.task(&loaded, None).problem().expect("a problem");
        problem.leg_update = Some(LegUpdate::new(Law::Pcdm));
        let mut x = vec![0.0; problem.num_variables()];
        problem.initial_point(&mut x);
        x[6..].iter_mut().enumerate().for_each(|(v, x)| *x += 1e-2 * (v as f64).sin());
        let values = |problem: &mut GaitProblem, x: &[f64]| {
            let mut values = vec![f64::NAN; problem.num_constraints()];
            problem.constraints(x, true, &mut values);
            values
        };
        let before = values(&mut problem, &x);
        let multipliers = vec![0.0; problem.num_constraints()];
        let mut entries = vec![0.0; problem.hessian_structure().expect("second derivatives").0.len()];
        for _ in 0..EVERY {
            problem.hessian_values(&x, false, 1.0, &multipliers, true, &mut entries);
        }
        assert_eq!(values(&mut problem, &x), before);
        let expected = legs::terms(&problem.model, &x, Law::Pcdm).expect("massive legs");
        assert_ne!(problem.model.leg_terms, expected);
        x[9] += 1e-3;
        values(&mut problem, &x);
        assert_eq!(problem.model.leg_terms, expected);
    }
}
