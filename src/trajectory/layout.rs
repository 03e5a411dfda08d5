//! Where every variable of the NLP sits, and every sampled quantity as a linear combination of variables.
//!
//! | block | variables |
//! | --- | --- |
//! | base | control points (p̄, θ̄) of a uniform cubic B-spline with a knot at every sample (or, coarser, about every n-th); the first three coincide, and so do the last three: the motion starts and ends at rest |
//! | footholds | (x̄, ȳ, z̄) for each stance |
//! | swings | three inner control points of a clamped cubic B-spline; its outer two on each side are the footholds, so that feet leave and land with zero velocity |
//! | forces | f̄ at every sample of a stance (or, coarser, at about every n-th) but the switches, where it is zero; linear in between |
//! | switches | lift-off and touch-down of each swing in samples, where durations are optimized; see [`super::switches`] |
//!
//! The base's acceleration is (nearly) piecewise linear on the same grid as the forces, and so Newton's law can hold
//! between the samples as well as at them. Coarser knots are there to measure what that is worth ([`KnotSpacing`]).

use std::ops::Range;

use super::gait::Gait;
use super::instant::Instant;
use super::node::LinearNode;
use super::phase::{Stance, Swing};
use super::spline::{SWING_CONTROL_POINTS, SWING_INTERVALS, clamped_cubic, uniform_cubic};
use super::switches::{self, TimedNode, force_samples};

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
    /// The first sample with a force.
    pub first_force: usize,
    /// f̄ at the samples from there on, three components: all at which the foot may bear something. Where durations are
    /// optimized, ḡ.
    pub forces: Vec<LinearNode>,
}

impl StanceVariables {
    /// The samples with a free force, and its node.
    pub fn free_forces(&self) -> impl Iterator<Item = (usize, &LinearNode)> + '_ {
        self.forces.iter().enumerate().map(|(n, node)| (self.first_force + n, node))
    }

    /// The force at sample k, if it is free there.
    pub fn force(&self, k: usize) -> Option<&LinearNode> {
        self.forces.get(k.checked_sub(self.first_force)?)
    }
}

/// The variables of one swing.
#[derive(Clone, Debug)]
pub struct SwingVariables {
    /// When.
    pub swing: Swing,
    /// First of the nine variables of the inner control points.
    pub control_points: usize,
    /// The variable that is the lift-off; the next one is the touch-down. None where they are given.
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
    /// In order of time; swing j lies between stances j and j + 1.
    pub swings: Vec<SwingVariables>,
}

/// What a foot does at a sample.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Phase {
    /// Stands, in this stance. At a switch the foot counts as standing.
    Stance(usize),
    /// Moves, in this swing; or may move, where its switches are variables.
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
    /// Half way from each sample to the next.
    pub base_between: Vec<LinearNode>,
    /// Velocity and acceleration of the base at each sample, six components.
    pub base_rates: Vec<[LinearNode; 2]>,
    /// Distinct control points of the base.
    pub base_blocks: usize,
    /// By foot.
    pub feet: Vec<FootVariables>,
    /// `phase[foot][k]`.
    pub phase: Vec<Vec<Phase>>,
    /// The same half way from each sample to the next.
    phase_between: Vec<Vec<Phase>>,
    /// `nearest_stance[foot][k]`: the stance that a force at a sample belongs to.
    nearest_stance: Vec<Vec<usize>>,
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
            base_between: Vec::new(),
            base_rates: Vec::new(),
            base_blocks,
            feet: Vec::new(),
            phase: Vec::new(),
            phase_between: Vec::new(),
            nearest_stance: Vec::new(),
        };
        layout.base = (0..=intervals).map(|k| layout.base_node(k as f64, 0)).collect();
        layout.base_between = (0..intervals).map(|k| layout.base_node(k as f64 + 0.5, 0)).collect();
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
        let nominal = &gait.swings[foot];
        let stances: Vec<StanceVariables> = gait
            .stances(foot)
            .into_iter()
            .enumerate()
            .map(|(j, stance)| {
                let samples =
                    force_samples(j.checked_sub(1).map(|j| &nominal[j]), nominal.get(j), self.intervals);
                StanceVariables {
                    stance,
                    foothold: LinearNode::variable(self.take(3)),
                    first_force: samples.start,
                    forces: self.force_nodes(stance, samples, spacing),
                }
            })
            .collect();
        let swings: Vec<SwingVariables> = nominal
            .iter()
            .map(|&swing| SwingVariables {
                swing,
                control_points: self.take(3 * SWING_CONTROL_POINTS),
                switches: swing.is_free().then(|| self.take(2)),
            })
            .collect();
        self.feet.push(FootVariables { stances, swings });
        self.phase.push(Vec::new());
        self.phase_between.push(Vec::new());
        self.nearest_stance.push(Vec::new());
        self.set_phases(foot);
    }

    fn set_phases(&mut self, foot: usize) {
        let times = (0..=self.intervals).map(|k| k as f64);
        self.nearest_stance[foot] = times.clone().map(|time| self.stance_near(foot, time)).collect();
        self.phase[foot] = times.map(|time| self.phase_of(foot, time)).collect();
        let middles = (0..self.intervals).map(|k| Instant::Between(k).time());
        self.phase_between[foot] = middles.map(|time| self.phase_of(foot, time)).collect();
    }

    /// Takes the switches from x for good: from now on phases, feet and forces are those of the motion x.
    pub fn freeze(&mut self, x: &[f64]) {
        for foot in 0..self.feet.len() {
            let FootVariables { stances, swings } = &mut self.feet[foot];
            for (j, swing) in swings.iter_mut().enumerate().filter(|(_, s)| s.switches.is_some()) {
                let [start, end] = swing.times(x).map(switches::snapped);
                swing.swing = Swing::given(start, end);
                stances[j].stance.end = start;
                stances[j + 1].stance.start = end;
                swing.switches = None;
                let before = stances[j].first_force;
                for (n, node) in stances[j].forces.iter_mut().enumerate() {
                    node.terms[0].1 *= switches::activation(before + n, None, Some(start));
                }
                let after = stances[j + 1].first_force;
                for (n, node) in stances[j + 1].forces.iter_mut().enumerate() {
                    node.terms[0].1 *= switches::activation(after + n, Some(end), None);
                }
            }
            self.set_phases(foot);
        }
    }

    /// Whether there are switches among the variables.
    pub fn has_switches(&self) -> bool {
        self.feet.iter().flat_map(|f| &f.swings).any(|s| s.switches.is_some())
    }

    /// The forces at some samples of a stance: their own variables, or between those of two coarser nodes of which the ones at
    /// switches are tied to zero.
    fn force_nodes(&mut self, stance: Stance, samples: Range<usize>, spacing: usize) -> Vec<LinearNode> {
        if spacing == 1 {
            return samples.map(|_| LinearNode::variable(self.take(3))).collect();
        }
        let length = stance.end - stance.start;
        let pieces = pieces(length as usize, spacing);
        let nodes: Vec<Option<usize>> = (0..=pieces)
            .map(|a| {
                let tied =
                    (a == 0 && stance.start > 0.0) || (a == pieces && stance.end < self.intervals as f64);
                (!tied).then(|| self.take(3))
            })
            .collect();
        samples
            .map(|k| {
                let at = (k as f64 - stance.start) * pieces as f64 / length;
                let before = (at as usize).min(pieces - 1);
                let share = at - before as f64;
                let mut node = LinearNode::default();
                for (variable, weight) in [(nodes[before], 1.0 - share), (nodes[before + 1], share)] {
                    if let Some(variable) = variable {
                        node.push(variable, weight);
                    }
                }
                node
            })
            .filter(|node| !node.terms.is_empty())
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

    /// The base at an instant, six components.
    pub fn base_at(&self, instant: Instant) -> &LinearNode {
        match instant {
            Instant::Sample(k) => &self.base[k],
            Instant::Between(k) => &self.base_between[k],
        }
    }

    /// What a foot does at an instant.
    pub fn phase_at(&self, foot: usize, instant: Instant) -> Phase {
        match instant {
            Instant::Sample(k) => self.phase[foot][k],
            Instant::Between(k) => self.phase_between[foot][k],
        }
    }

    fn phase_of(&self, foot: usize, time: f64) -> Phase {
        let within = |[start, end]: [f64; 2]| start < time && time < end;
        let swing = self.feet[foot].swings.iter().position(|s| within(s.swing.span()));
        swing.map_or_else(|| Phase::Stance(self.stance_near(foot, time)), Phase::Swing)
    }

    /// The stance that is nearest to a time in samples.
    fn stance_near(&self, foot: usize, time: f64) -> usize {
        self.feet[foot].swings.iter().filter(|s| s.swing.middle() < time).count()
    }

    /// A foot at time `k` in samples: its position, velocity or acceleration (in the space of the variables), with switches
    /// at their nominal or frozen times.
    pub fn foot_node(&self, foot: usize, k: f64, derivative: usize) -> LinearNode {
        let variables = &self.feet[foot];
        let swing = variables.swings.iter().position(|s| s.swing.start < k && k < s.swing.end);
        if let Some(j) = swing {
            let s = variables.swings[j].swing;
            let duration = s.end - s.start;
            let mut node = self.swing_node(foot, j, (k - s.start) / duration, derivative);
            let scale = (duration * self.time_step).powi(-(derivative as i32));
            node.terms.iter_mut().for_each(|term| term.1 *= scale);
            return node;
        }
        if derivative > 0 {
            return LinearNode::default();
        }
        variables.stances[self.stance_near(foot, k)].foothold.clone()
    }

    /// A foot at u ∈ [0, 1] of swing `j`, or a derivative with respect to u.
    pub fn swing_node(&self, foot: usize, j: usize, u: f64, derivative: usize) -> LinearNode {
        let weights = &clamped_cubic(SWING_INTERVALS, u)[derivative];
        let variables = self.swing_variables(foot, j);
        let mut node = LinearNode::default();
        for (c, &weight) in weights.iter().enumerate() {
            node.push(variables[c.clamp(1, SWING_CONTROL_POINTS + 2) - 1], weight);
        }
        node
    }

    /// First variables of a swing's foothold, control points and next foothold.
    fn swing_variables(&self, foot: usize, j: usize) -> [usize; SWING_CONTROL_POINTS + 2] {
        let variables = &self.feet[foot];
        let first = variables.swings[j].control_points;
        std::array::from_fn(|c| match c {
            0 => variables.stances[j].foothold.first(),
            c if c <= SWING_CONTROL_POINTS => first + 3 * (c - 1),
            _ => variables.stances[j + 1].foothold.first(),
        })
    }

    /// A foot at an instant, following its switches where these are variables.
    pub fn timed_foot(&self, foot: usize, instant: Instant) -> TimedNode {
        if let Phase::Swing(j) = self.phase_at(foot, instant)
            && let Some(lift_off) = self.feet[foot].swings[j].switches
        {
            return TimedNode::moving(instant.time(), self.swing_variables(foot, j), lift_off);
        }
        TimedNode::given(self.foot_node(foot, instant.time(), 0))
    }

    /// The force f̄ of a foot at sample `k`, if it may bear something there, following its switches where these are variables.
    pub fn timed_force(&self, foot: usize, k: usize) -> Option<TimedNode> {
        let (j, full) = self.force(foot, k)?;
        let swings = &self.feet[foot].swings;
        // A ramp takes one sample, from the switch to two samples from it.
        let before = j.checked_sub(1).map(|j| &swings[j]).filter(|s| (k as f64) < s.swing.span()[1] + 2.0);
        let after = swings.get(j).filter(|s| (k as f64) > s.swing.span()[0] - 2.0);
        Some(match (before.and_then(|s| s.switches), after.and_then(|s| s.switches)) {
            (Some(switches), _) => TimedNode::rising(k, full.first(), switches + 1),
            (None, Some(switches)) => TimedNode::falling(k, full.first(), switches),
            (None, None) => TimedNode::given(full.clone()),
        })
    }

    /// The force of a foot at sample `k`, if it is free there, and its stance. Where durations are optimized, ḡ.
    pub fn force(&self, foot: usize, k: usize) -> Option<(usize, &LinearNode)> {
        let j = self.nearest_stance[foot][k];
        self.feet[foot].stances[j].force(k).map(|node| (j, node))
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
            swings: vec![vec![Swing::given(4.0, 8.0)], vec![Swing::given(10.0, 15.0)], vec![], vec![]],
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
        let first = stance.force(0).expect("the motion starts here").first();
        let second = stance.force(2).expect("inside").first();
        assert_eq!(stance.force(1).expect("inside").terms, [(first, 0.5), (second, 0.5)]);
        assert_eq!(stance.force(3).expect("inside").terms, [(second, 0.5)]);
        assert!(stance.force(4).is_none());
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
                for &(v, _) in &layout.foot_node(foot, k as f64, 0).terms {
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
        assert_eq!(layout.foot_node(1, 10.0, 0).terms, [(foot.stances[0].foothold.first(), 1.0)]);
        assert_eq!(layout.foot_node(1, 15.0, 0).terms, [(foot.stances[1].foothold.first(), 1.0)]);
    }
}
