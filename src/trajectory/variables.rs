//! The variables of a foot, by stance and swing.

use super::node::LinearNode;
use super::phase::{Stance, Swing};
use super::switches;

/// The variables of one stance.
#[derive(Clone, Debug)]
pub struct StanceVariables {
    /// When the foot stands.
    pub stance: Stance,
    /// The foothold, three components.
    pub foothold: LinearNode,
    /// The first sample with a force.
    pub first_force: usize,
    /// f̄, three components, at the samples from there on: all at which the foot may carry a load. If durations are optimized, ḡ.
    pub forces: Vec<LinearNode>,
}

impl StanceVariables {
    /// The samples with a force, and its node.
    pub fn free_forces(&self) -> impl Iterator<Item = (usize, &LinearNode)> + '_ {
        self.forces.iter().enumerate().map(|(n, node)| (self.first_force + n, node))
    }

    /// The force at sample k, if there is one.
    pub fn force(&self, k: usize) -> Option<&LinearNode> {
        self.forces.get(k.checked_sub(self.first_force)?)
    }

    /// Scales each force by a function of its sample.
    fn scale_forces(&mut self, factor: impl Fn(usize) -> f64) {
        for (n, node) in self.forces.iter_mut().enumerate() {
            node.terms[0].1 *= factor(self.first_force + n);
        }
    }
}

/// The variables of one swing.
#[derive(Clone, Debug)]
pub struct SwingVariables {
    /// When the foot moves.
    pub swing: Swing,
    /// The first variable of the free control points.
    pub control_points: usize,
    /// The variable of the lift-off, followed by that of the touch-down; none if they are given.
    pub switches: Option<usize>,
}

impl SwingVariables {
    /// Lift-off and touch-down at x, in samples.
    pub fn times(&self, x: &[f64]) -> [f64; 2] {
        self.switches.map_or([self.swing.start, self.swing.end], |v| [x[v], x[v + 1]])
    }
}

/// The variables of one foot.
#[derive(Clone, Debug)]
pub struct FootVariables {
    /// In order of time.
    pub stances: Vec<StanceVariables>,
    /// In order of time; swing j is between stances j and j + 1.
    pub swings: Vec<SwingVariables>,
}

impl FootVariables {
    /// Whether its first swing has begun before the start.
    pub fn starts_in_air(&self) -> bool {
        self.swings.first().is_some_and(|swing| swing.swing.start < 0.0)
    }

    /// Moves all its variables by so many places.
    pub(super) fn move_variables(&mut self, by: usize) {
        for stance in &mut self.stances {
            for node in std::iter::once(&mut stance.foothold).chain(&mut stance.forces) {
                node.terms.iter_mut().for_each(|term| term.0 += by);
            }
        }
        for swing in &mut self.swings {
            swing.control_points += by;
            swing.switches = swing.switches.map(|switch| switch + by);
        }
    }

    /// Replaces the switches of swing `j`, if they are variables, by their values at x, and scales the forces next to it accordingly.
    pub(super) fn freeze_swing(&mut self, j: usize, x: &[f64]) {
        let swing = &mut self.swings[j];
        if swing.switches.is_none() {
            return;
        }
        let [start, end] = swing.times(x).map(switches::snapped);
        swing.swing = Swing::given(start, end);
        swing.switches = None;
        let [before, after] = [j, j + 1];
        self.stances[before].stance.end = start;
        self.stances[before].scale_forces(|k| switches::activation(k, None, Some(start)));
        self.stances[after].stance.start = end;
        self.stances[after].scale_forces(|k| switches::activation(k, Some(end), None));
    }
}
