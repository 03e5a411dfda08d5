//! Where every variable of the NLP sits, and every sampled quantity as a linear combination of variables.
//!
//! | block | variables |
//! | --- | --- |
//! | base | control points (p̄, θ̄) of a uniform cubic B-spline with a knot at every sample (or, coarser, about every n-th); the first three coincide, and so do the last three: the motion starts and ends at rest |
//! | footholds | (x̄, ȳ, z̄) for each stance |
//! | swings | three inner control points of a clamped cubic B-spline; its outer two on each side are the footholds, so that feet leave and land with zero velocity |
//! | forces | f̄ at every sample of a stance (or, coarser, at about every n-th) but the switches, where it is zero; linear in between |
//!
//! The base's acceleration is (nearly) piecewise linear on the same grid as the forces, and so Newton's law can hold
//! between the samples as well as at them. Coarser knots are there to measure what that is worth ([`KnotSpacing`]).

use super::gait::{Gait, Stance, Swing};
use super::spline::{SWING_CONTROL_POINTS, SWING_INTERVALS, clamped_cubic, uniform_cubic};

/// A sampled quantity: component d is the sum of `weight * x[variable + d]` over the terms.
#[derive(Clone, Debug, Default, PartialEq)]
pub struct LinearNode {
    /// (first variable, weight).
    pub terms: Vec<(usize, f64)>,
}

impl LinearNode {
    /// A node that is a variable itself.
    pub fn variable(variable: usize) -> Self {
        Self { terms: vec![(variable, 1.0)] }
    }

    /// Its first variable; of a node that is a variable itself, that variable.
    pub fn first(&self) -> usize {
        self.terms[0].0
    }

    /// Its value at x.
    pub fn value<const D: usize>(&self, x: &[f64]) -> [f64; D] {
        let mut y = [0.0; D];
        for &(variable, weight) in &self.terms {
            for d in 0..D {
                y[d] += weight * x[variable + d];
            }
        }
        y
    }

    /// Adds a variable's share.
    pub fn push(&mut self, variable: usize, weight: f64) {
        if weight.abs() < 1e-15 {
            return;
        }
        match self.terms.iter_mut().find(|(v, _)| *v == variable) {
            Some(term) => term.1 += weight,
            None => self.terms.push((variable, weight)),
        }
    }
}

/// Distance of the knots, in samples.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct KnotSpacing {
    /// Of the base's spline; the nearest that divides the horizon is taken.
    pub base: usize,
    /// Of the forces; the nearest that divides each stance is taken.
    pub force: usize,
}

impl KnotSpacing {
    /// A knot at every sample.
    pub const FINE: Self = Self { base: 1, force: 1 };
}

/// The variables of one stance.
#[derive(Clone, Debug)]
pub struct StanceVariables {
    /// When.
    pub stance: Stance,
    /// The foothold, three components.
    pub foothold: LinearNode,
    /// f̄ at each sample from `stance.start` to `stance.end`, three components; none where it is tied to zero.
    pub forces: Vec<Option<LinearNode>>,
}

impl StanceVariables {
    /// The samples with a free force, and its node.
    pub fn free_forces(&self) -> impl Iterator<Item = (usize, &LinearNode)> + '_ {
        self.forces
            .iter()
            .enumerate()
            .filter_map(|(j, node)| node.as_ref().map(|node| (self.stance.start + j, node)))
    }
}

/// The variables of one swing.
#[derive(Clone, Debug)]
pub struct SwingVariables {
    /// When.
    pub swing: Swing,
    /// First of the nine variables of the inner control points.
    pub control_points: usize,
}

/// The variables of one foot.
#[derive(Clone, Debug)]
pub struct FootVariables {
    /// In order of time.
    pub stances: Vec<StanceVariables>,
    /// In order of time; swing j lies between stances j and j + 1.
    pub swings: Vec<SwingVariables>,
}

/// What a foot does at a sample.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Phase {
    /// Stands, in this stance. At a switch the foot counts as standing.
    Stance(usize),
    /// Moves, in this swing.
    Swing(usize),
}

/// All variables, and the samples in terms of them.
#[derive(Clone, Debug)]
pub struct Layout {
    /// Δt, s.
    pub time_step: f64,
    /// Number of intervals; there is one more sample.
    pub intervals: usize,
    /// Number of variables.
    pub variables: usize,
    /// Knot intervals of the base.
    pub base_intervals: usize,
    /// The base at each sample, six components.
    pub base: Vec<LinearNode>,
    /// Velocity and acceleration of the base at each sample, six components.
    pub base_rates: Vec<[LinearNode; 2]>,
    /// Distinct control points of the base.
    pub base_blocks: usize,
    /// By foot.
    pub feet: Vec<FootVariables>,
    /// `phase[foot][k]`.
    pub phase: Vec<Vec<Phase>>,
    /// `foot_nodes[foot][k]`, three components.
    pub foot_nodes: Vec<Vec<LinearNode>>,
}

impl Layout {
    /// Lays out the variables of a gait.
    pub fn new(gait: &Gait, time_step: f64, spacing: KnotSpacing) -> Self {
        let intervals = gait.intervals;
        Self::with_base_intervals(gait, time_step, pieces(intervals, spacing.base).max(2), spacing.force)
    }

    /// The same with a given number of knot intervals of the base, at least two.
    pub fn with_base_intervals(gait: &Gait, time_step: f64, base_intervals: usize, force: usize) -> Self {
        let intervals = gait.intervals;
        let base_blocks = base_intervals - 1;
        let mut layout = Self {
            time_step,
            intervals,
            variables: 6 * base_blocks,
            base_intervals,
            base: Vec::new(),
            base_rates: Vec::new(),
            base_blocks,
            feet: Vec::new(),
            phase: Vec::new(),
            foot_nodes: Vec::new(),
        };
        layout.base = (0..=intervals).map(|k| layout.base_node(k as f64, 0)).collect();
        layout.base_rates = (0..=intervals)
            .map(|k| [1, 2].map(|derivative| layout.base_node(k as f64, derivative)))
            .collect();
        for foot in 0..gait.swings.len() {
            layout.add_foot(gait, foot, force);
        }
        layout
    }

    fn take(&mut self, count: usize) -> usize {
        let first = self.variables;
        self.variables += count;
        first
    }

    fn add_foot(&mut self, gait: &Gait, foot: usize, spacing: usize) {
        let intervals = self.intervals;
        let stances = gait
            .stances(foot)
            .into_iter()
            .map(|stance| StanceVariables {
                stance,
                foothold: LinearNode::variable(self.take(3)),
                forces: self.force_nodes(stance, spacing),
            })
            .collect();
        let swings = gait.swings[foot]
            .iter()
            .map(|&swing| SwingVariables { swing, control_points: self.take(3 * SWING_CONTROL_POINTS) })
            .collect();
        let variables = FootVariables { stances, swings };
        let phase: Vec<Phase> = (0..=intervals)
            .map(|k| match gait.swing_at(foot, k) {
                Some(j) => Phase::Swing(j),
                None => Phase::Stance(
                    variables
                        .stances
                        .iter()
                        .rposition(|s| s.stance.start <= k)
                        .expect("the first stance starts at 0"),
                ),
            })
            .collect();
        self.feet.push(variables);
        self.phase.push(phase);
        let nodes = (0..=intervals).map(|k| self.foot_node(foot, k as f64, 0)).collect();
        self.foot_nodes.push(nodes);
    }

    /// The force at each sample of a stance: its own variables, or between those of two coarser nodes; none where it is tied
    /// to zero.
    fn force_nodes(&mut self, stance: Stance, spacing: usize) -> Vec<Option<LinearNode>> {
        let length = stance.end - stance.start;
        let pieces = pieces(length, spacing);
        let nodes: Vec<Option<usize>> = (0..=pieces)
            .map(|a| {
                let tied = (a == 0 && stance.start > 0) || (a == pieces && stance.end < self.intervals);
                (!tied).then(|| self.take(3))
            })
            .collect();
        (0..=length)
            .map(|j| {
                let at = (j * pieces) as f64 / length as f64;
                let before = (at as usize).min(pieces - 1);
                let share = at - before as f64;
                let mut node = LinearNode::default();
                for (variable, weight) in [(nodes[before], 1.0 - share), (nodes[before + 1], share)] {
                    if let Some(variable) = variable {
                        node.push(variable, weight);
                    }
                }
                (!node.terms.is_empty()).then_some(node)
            })
            .collect()
    }

    /// The variables of a control point of the base, 0 ≤ i < base_intervals + 3.
    pub fn base_block(&self, control_point: usize) -> usize {
        6 * control_point.clamp(2, self.base_intervals).saturating_sub(2)
    }

    /// Distance of the base's knots, s.
    pub fn base_knot_spacing(&self) -> f64 {
        self.time_step * self.intervals as f64 / self.base_intervals as f64
    }

    /// The base at time `k` in samples (any real number in range): its value, first or second derivative in time.
    pub fn base_node(&self, k: f64, derivative: usize) -> LinearNode {
        let k = k * (self.base_intervals as f64 / self.intervals as f64);
        let interval = (k.max(0.0) as usize).min(self.base_intervals - 1);
        let weights = uniform_cubic(k - interval as f64)[derivative];
        let scale = self.base_knot_spacing().powi(-(derivative as i32));
        let mut node = LinearNode::default();
        for (a, weight) in weights.iter().enumerate() {
            node.push(self.base_block(interval + a), weight * scale);
        }
        node.terms.retain(|(_, w)| w.abs() > 1e-14 * scale);
        node
    }

    /// A foot at time `k` in samples: its position, velocity or acceleration (in the space of the variables).
    pub fn foot_node(&self, foot: usize, k: f64, derivative: usize) -> LinearNode {
        let variables = &self.feet[foot];
        let swing =
            variables.swings.iter().position(|s| (s.swing.start as f64) < k && k < s.swing.end as f64);
        if let Some(j) = swing {
            let s = variables.swings[j].swing;
            let duration = (s.end - s.start) as f64;
            return self.swing_node(foot, j, (k - s.start as f64) / duration, derivative);
        }
        if derivative > 0 {
            return LinearNode::default();
        }
        let stance = variables.stances.iter().rev().find(|s| s.stance.start as f64 <= k + 1e-12);
        stance.expect("the first stance starts at 0").foothold.clone()
    }

    /// A foot in swing `j` at u ∈ [0, 1] of it.
    pub fn swing_node(&self, foot: usize, j: usize, u: f64, derivative: usize) -> LinearNode {
        let variables = &self.feet[foot];
        let s = &variables.swings[j];
        let duration = (s.swing.end - s.swing.start) as f64 * self.time_step;
        let weights = &clamped_cubic(SWING_INTERVALS, u)[derivative];
        let scale = duration.powi(-(derivative as i32));
        let mut node = LinearNode::default();
        for (c, weight) in weights.iter().enumerate() {
            let variable = match c {
                0 | 1 => variables.stances[j].foothold.first(),
                c if c < 2 + SWING_CONTROL_POINTS => s.control_points + 3 * (c - 2),
                _ => variables.stances[j + 1].foothold.first(),
            };
            node.push(variable, weight * scale);
        }
        node
    }

    /// The force of a foot at sample `k`, if it is free there, and its stance.
    pub fn force(&self, foot: usize, k: usize) -> Option<(usize, &LinearNode)> {
        let Phase::Stance(j) = self.phase[foot][k] else { return None };
        // At a touch-down the later stance is meant, whose force is zero there; so is that of the earlier one.
        let stance = &self.feet[foot].stances[j];
        stance.forces[k - stance.stance.start].as_ref().map(|node| (j, node))
    }
}

/// How many pieces of about `spacing` samples make up `length`.
fn pieces(length: usize, spacing: usize) -> usize {
    ((length as f64 / spacing as f64).round() as usize).clamp(1, length)
}

#[cfg(test)]
mod tests {
    use super::*;

    fn layout() -> Layout {
        layout_of(KnotSpacing::FINE)
    }

    fn layout_of(spacing: KnotSpacing) -> Layout {
        let gait = Gait {
            intervals: 20,
            swings: vec![
                vec![Swing { start: 4, end: 8 }],
                vec![Swing { start: 10, end: 15 }],
                vec![],
                vec![],
            ],
        };
        Layout::new(&gait, 0.05, spacing)
    }

    #[test]
    fn coarse_knots_are_interpolated() {
        let spacing = KnotSpacing { base: 3, force: 2 };
        let layout = layout_of(spacing);
        // 20 samples in 7 intervals of the base; the stance of 4 samples has nodes at 0, 2 and, tied to zero, 4.
        assert_eq!((layout.base_intervals, layout.base_blocks), (7, 6));
        let stance = &layout.feet[0].stances[0];
        let first = stance.forces[0].as_ref().expect("the motion starts here").first();
        let second = stance.forces[2].as_ref().expect("inside").first();
        assert_eq!(stance.forces[1].as_ref().expect("inside").terms, [(first, 0.5), (second, 0.5)]);
        assert_eq!(stance.forces[3].as_ref().expect("inside").terms, [(second, 0.5)]);
        assert!(stance.forces[4].is_none());
        // A spline whose control points lie on a line is that line; its derivative is the slope.
        let mut x = vec![0.0; layout.variables];
        for block in 0..layout.base_blocks {
            x[6 * block] = block as f64;
        }
        let velocity = layout.base_node(10.0, 1).value::<6>(&x)[0];
        assert!((velocity - 7.0 / 1.0).abs() < 1e-12, "{velocity}");
    }

    #[test]
    fn the_base_starts_and_ends_at_rest() {
        let layout = layout();
        for k in [0.0, 20.0] {
            assert_eq!(layout.base_node(k, 0).terms.len(), 1);
            for derivative in [1, 2] {
                let node = layout.base_node(k, derivative);
                let sum: f64 = node.terms.iter().map(|t| t.1.abs()).sum();
                assert!(sum < 1e-9, "derivative {derivative} at {k}: {node:?}");
            }
        }
        assert_eq!(layout.base[10].terms.len(), 3);
    }

    #[test]
    fn each_variable_is_used_and_none_twice() {
        let layout = layout();
        let mut used = vec![0; layout.variables];
        for node in &layout.base {
            for &(v, _) in &node.terms {
                for d in 0..6 {
                    used[v + d] |= 1;
                }
            }
        }
        for foot in 0..4 {
            for k in 0..=20 {
                for &(v, _) in &layout.foot_nodes[foot][k].terms {
                    for d in 0..3 {
                        used[v + d] |= 2;
                    }
                }
                if let Some((_, node)) = layout.force(foot, k) {
                    for d in 0..3 {
                        used[node.first() + d] |= 4;
                    }
                }
            }
        }
        assert!(used.iter().all(|u| [1, 2, 4].contains(u)), "{used:?}");
    }

    #[test]
    fn forces_are_tied_to_zero_at_switches_only() {
        let layout = layout();
        assert!(layout.force(0, 0).is_some() && layout.force(0, 20).is_some());
        for k in [4, 5, 6, 7, 8] {
            assert!(layout.force(0, k).is_none(), "sample {k}");
        }
        assert!(layout.force(0, 3).is_some() && layout.force(0, 9).is_some());
    }

    #[test]
    fn a_swing_joins_its_footholds() {
        let layout = layout();
        let foot = &layout.feet[1];
        assert_eq!(layout.swing_node(1, 0, 0.0, 0).terms, [(foot.stances[0].foothold.first(), 1.0)]);
        assert_eq!(layout.swing_node(1, 0, 1.0, 0).terms, [(foot.stances[1].foothold.first(), 1.0)]);
        assert_eq!(layout.foot_nodes[1][10].terms, [(foot.stances[0].foothold.first(), 1.0)]);
        assert_eq!(layout.foot_nodes[1][15].terms, [(foot.stances[1].foothold.first(), 1.0)]);
    }
}
