//! The place of every variable of the NLP, the c of Eq. 1 and c̄ of Eq. 7, and every sampled quantity as a linear combination of them.
//!
//! | block | variables |
//! | --- | --- |
//! | base | control points (p̄, θ̄) of a uniform cubic B-spline with a knot at every sample (or, if coarser, at about every n-th); at an end at rest three coincide, else they are those of a velocity and an acceleration ([`super::base`]) |
//! | footholds | (x̄, ȳ, z̄) of each stance |
//! | swings | the inner control points of a clamped cubic B-spline; its outer ones on each side are the footholds, so that feet lift off and touch down at rest ([`SwingShape`]) |
//! | forces | f̄ at every sample of a stance (or, if coarser, at about every n-th) except at the switches, where it is zero; linear in between |
//! | switches | lift-off and touch-down of each swing in samples, if durations are optimized; see [`super::switches`] |
//!
//! The base's acceleration is (nearly) piecewise linear on the same grid as the forces, so Newton's law can hold between the samples
//! as well as at them. Coarser knots exist to measure how much that matters ([`KnotSpacing`]).
//!
//! The •₋ and •₋₋ of Eq. 14, one and two time steps back, are the nodes of samples k − 1 and k − 2.

use std::ops::Range;

use super::base::{BaseSpline, RATES};
use super::gait::Gait;
use super::instant::Instant;
use super::node::LinearNode;
use super::phase::Stance;
use super::spline::{SwingShape, swing_basis};
use super::switches::{TimedNode, force_samples};
use super::variables::{FootVariables, StanceVariables, SwingVariables};

/// Distance between knots, in samples.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct KnotSpacing {
    /// Of the base's spline; rounded so that it divides the horizon.
    pub base: usize,
    /// Of the forces; rounded so that it divides each stance.
    pub force: usize,
}

/// The phase of a foot at an instant.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Phase {
    /// It stands, in this stance. At a switch the foot counts as standing.
    Stance(usize),
    /// It moves, in this swing, or may move if its switches are variables.
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
    /// The variables of the base's spline.
    pub base_spline: BaseSpline,
    /// The base at each sample, six components.
    pub base: Vec<LinearNode>,
    /// The base halfway from each sample to the next.
    pub base_between: Vec<LinearNode>,
    /// Velocity and acceleration of the base at each sample, six components.
    pub base_rates: Vec<[LinearNode; 2]>,
    /// How swings are made of control points.
    pub swing_shape: SwingShape,
    /// The variables of each foot.
    pub feet: Vec<FootVariables>,
    /// `phase[foot][k]`.
    pub phase: Vec<Vec<Phase>>,
    /// The phase halfway from each sample to the next.
    phase_between: Vec<Vec<Phase>>,
    /// `nearest_stance[foot][k]`: the stance that a force at the sample belongs to.
    nearest_stance: Vec<Vec<usize>>,
}

impl Layout {
    /// The variables for a gait, and whether the base moves at the start and at the end.
    pub fn new(
        gait: &Gait,
        time_step: f64,
        spacing: KnotSpacing,
        swing_shape: SwingShape,
        moves: [bool; 2],
    ) -> Self {
        let base_intervals = pieces(gait.intervals, spacing.base).max(2);
        Self::with_base_intervals(gait, time_step, base_intervals, spacing.force, (swing_shape, moves))
    }

    /// The same with a given number of knot intervals of the base, at least two.
    pub fn with_base_intervals(
        gait: &Gait,
        time_step: f64,
        base_intervals: usize,
        force: usize,
        (swing_shape, moves): (SwingShape, [bool; 2]),
    ) -> Self {
        let mut base_spline = BaseSpline {
            intervals: base_intervals,
            spacing: time_step * gait.intervals as f64 / base_intervals as f64,
            start: None,
            end: None,
        };
        let mut variables = 6 * base_spline.blocks();
        let mut rates = |moves: bool| {
            variables += if moves { RATES } else { 0 };
            moves.then(|| variables - RATES)
        };
        (base_spline.start, base_spline.end) = (rates(moves[0]), rates(moves[1]));
        let mut layout = Self {
            time_step,
            intervals: gait.intervals,
            variables,
            base_spline,
            base: Vec::new(),
            base_between: Vec::new(),
            base_rates: Vec::new(),
            swing_shape,
            feet: Vec::new(),
            phase: Vec::new(),
            phase_between: Vec::new(),
            nearest_stance: Vec::new(),
        };
        layout.set_base();
        for foot in 0..gait.swings.len() {
            layout.add_foot(gait, foot, force);
        }
        layout
    }

    /// The nodes of the base.
    fn set_base(&mut self) {
        let samples = 0..=self.intervals;
        self.base = samples.clone().map(|k| self.base_node(k as f64, 0)).collect();
        self.base_between =
            (0..self.intervals).map(|k| self.base_node(Instant::Between(k).time(), 0)).collect();
        self.base_rates = samples.map(|k| [1, 2].map(|order| self.base_node(k as f64, order))).collect();
    }

    /// Appends the variables of a foot: footholds and forces by stance, then control points and switches by swing.
    fn add_foot(&mut self, gait: &Gait, foot: usize, force_spacing: usize) {
        let swings = &gait.swings[foot];
        let mut stances = Vec::with_capacity(swings.len() + 1);
        for (j, stance) in gait.stances(foot).into_iter().enumerate() {
            let before = j.checked_sub(1).map(|j| &swings[j]);
            let samples = force_samples(before, swings.get(j), self.intervals);
            stances.push(StanceVariables {
                stance,
                foothold: LinearNode::variable(self.allocate(3)),
                first_force: samples.start,
                forces: self.add_forces(stance, samples, force_spacing),
            });
        }
        let mut swing_variables = Vec::with_capacity(swings.len());
        for &swing in swings {
            swing_variables.push(SwingVariables {
                swing,
                control_points: self.allocate(3 * self.swing_shape.free()),
                switches: swing.is_free().then(|| self.allocate(2)),
            });
        }
        self.feet.push(FootVariables { stances, swings: swing_variables });
        self.phase.push(Vec::new());
        self.phase_between.push(Vec::new());
        self.nearest_stance.push(Vec::new());
        self.set_phases(foot);
    }

    /// Appends variables and returns the first.
    fn allocate(&mut self, count: usize) -> usize {
        let first = self.variables;
        self.variables += count;
        first
    }

    /// The forces at some samples of a stance.
    fn add_forces(&mut self, stance: Stance, samples: Range<usize>, spacing: usize) -> Vec<LinearNode> {
        if spacing == 1 || samples.is_empty() {
            return samples.map(|_| LinearNode::variable(self.allocate(3))).collect();
        }
        self.add_coarse_forces(stance, samples, spacing)
    }

    /// Forces interpolated between coarser nodes; those at switches are zero.
    fn add_coarse_forces(
        &mut self,
        stance: Stance,
        samples: Range<usize>,
        spacing: usize,
    ) -> Vec<LinearNode> {
        let length = stance.end - stance.start;
        let pieces = pieces(length as usize, spacing);
        let mut nodes = Vec::with_capacity(pieces + 1);
        for a in 0..=pieces {
            let at_touch_down = a == 0 && stance.start > 0.0;
            let at_lift_off = a == pieces && stance.end < self.intervals as f64;
            nodes.push((!at_touch_down && !at_lift_off).then(|| self.allocate(3)));
        }
        samples
            .map(|k| {
                let at = (k as f64 - stance.start) * pieces as f64 / length;
                let before = (at as usize).min(pieces - 1);
                let fraction = at - before as f64;
                let mut node = LinearNode::default();
                for (variable, weight) in [(nodes[before], 1.0 - fraction), (nodes[before + 1], fraction)] {
                    if let Some(variable) = variable {
                        node.push(variable, weight);
                    }
                }
                node
            })
            .filter(|node| !node.terms.is_empty())
            .collect()
    }

    /// Tabulates the phases of a foot.
    fn set_phases(&mut self, foot: usize) {
        let times = (0..=self.intervals).map(|k| k as f64);
        self.nearest_stance[foot] = times.clone().map(|time| self.stance_near(foot, time)).collect();
        self.phase[foot] = times.map(|time| self.phase_of(foot, time)).collect();
        let middles = (0..self.intervals).map(|k| Instant::Between(k).time());
        self.phase_between[foot] = middles.map(|time| self.phase_of(foot, time)).collect();
    }

    /// The same motion with a base whose spline has a knot at every 1/`factor` of a sample, and the variables that go with it: control
    /// points through given values at these knots, of which there are `factor` times the intervals and one more. None if the present knots
    /// are not among them, or the base moves at an end.
    ///
    /// A cubic spline with finer knots can equal any with coarser ones, so what is the same at the knots is the same between them. (At the
    /// two knots next to the ends, where the base is at rest, the values are those that follow from the others.)
    pub fn with_fine_base(&self, x: &[f64], factor: usize, values: &[[f64; 6]]) -> Option<(Self, Vec<f64>)> {
        let fine = self.intervals * factor;
        let spline = &self.base_spline;
        let rest = spline.start.or(spline.end).is_none();
        if !(rest && fine.is_multiple_of(spline.intervals) && values.len() == fine + 1) {
            return None;
        }
        let (before, mut layout) = (6 * spline.blocks(), self.clone());
        layout.base_spline.intervals = fine;
        layout.base_spline.spacing = self.time_step / factor as f64;
        let more = 6 * layout.base_spline.blocks() - before;
        layout.variables += more;
        layout.feet.iter_mut().for_each(|foot| foot.move_variables(more));
        layout.set_base();
        // Block b is control point b + 2: the value at knot j is that of blocks j − 2, j − 1, j with weights 1/6, 2/3, 1/6.
        let ends = [values[0], values[fine]];
        let mut points: Vec<[f64; 6]> = values[2..fine - 1].iter().map(|v| v.map(|v| 6.0 * v)).collect();
        let last = points.len() - 1;
        for d in 0..6 {
            points[0][d] -= ends[0][d];
            points[last][d] -= ends[1][d];
        }
        solve_tridiagonal(4.0, 1.0, &mut points);
        let mut fine_x: Vec<f64> = Vec::with_capacity(layout.variables);
        fine_x.extend(std::iter::once(&ends[0]).chain(&points).chain(std::iter::once(&ends[1])).flatten());
        fine_x.extend_from_slice(&x[before..]);
        Some((layout, fine_x))
    }

    /// Replaces the switches by their values at x for good: the phases, feet and forces become those of the motion x.
    pub fn freeze(&mut self, x: &[f64]) {
        for foot in 0..self.feet.len() {
            for j in 0..self.feet[foot].swings.len() {
                self.feet[foot].freeze_swing(j, x);
            }
            self.set_phases(foot);
        }
    }

    /// Whether the variables include switches.
    pub fn has_switches(&self) -> bool {
        self.feet.iter().flat_map(|f| &f.swings).any(|s| s.switches.is_some())
    }

    /// The base at time `k` in samples (any real number in range), or its first or second derivative with respect to time.
    pub fn base_node(&self, k: f64, derivative: usize) -> LinearNode {
        self.base_spline.node(k * (self.base_spline.intervals as f64 / self.intervals as f64), derivative)
    }

    /// The base at an instant, six components.
    pub fn base_at(&self, instant: Instant) -> &LinearNode {
        match instant {
            Instant::Sample(k) => &self.base[k],
            Instant::Between(k) => &self.base_between[k],
        }
    }

    /// The phase of a foot at an instant.
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

    /// A foot at time `k` in samples, or its velocity or acceleration (in the space of the variables), with switches at their nominal
    /// or frozen times.
    pub fn foot_node(&self, foot: usize, k: f64, derivative: usize) -> LinearNode {
        let variables = &self.feet[foot];
        let swing = variables.swings.iter().position(|s| s.swing.start < k && k < s.swing.end);
        match swing {
            Some(j) => {
                let s = variables.swings[j].swing;
                let duration = s.end - s.start;
                let mut node = self.swing_node(foot, j, (k - s.start) / duration, derivative);
                let scale = (duration * self.time_step).powi(-(derivative as i32));
                node.terms.iter_mut().for_each(|term| term.1 *= scale);
                node
            }
            None if derivative > 0 => LinearNode::default(),
            None => variables.stances[self.stance_near(foot, k)].foothold.clone(),
        }
    }

    /// A foot at u ∈ [0, 1] of swing `j`, or its first or second derivative with respect to u.
    pub fn swing_node(&self, foot: usize, j: usize, u: f64, derivative: usize) -> LinearNode {
        let mut node = LinearNode::default();
        let basis = swing_basis(self.swing_shape, u);
        for (variable, weight) in self.swing_variables(foot, j).into_iter().zip(&basis[derivative]) {
            node.push(variable, *weight);
        }
        node
    }

    /// The first variables of a swing's foothold, control points and next foothold.
    fn swing_variables(&self, foot: usize, j: usize) -> Vec<usize> {
        let variables = &self.feet[foot];
        let first = variables.swings[j].control_points;
        let mut points = vec![variables.stances[j].foothold.first()];
        points.extend((0..self.swing_shape.free()).map(|c| first + 3 * c));
        points.push(variables.stances[j + 1].foothold.first());
        points
    }

    /// Longest time from one lift-off of a foot to the next, s; the whole motion if it lifts off at most once.
    pub fn longest_cycle(&self, foot: usize) -> f64 {
        let swings = &self.feet[foot].swings;
        let cycles = swings.windows(2).map(|pair| pair[1].swing.start - pair[0].swing.start);
        cycles.reduce(f64::max).unwrap_or(self.intervals as f64) * self.time_step
    }

    /// A foot at an instant, as a function of its switches if these are variables.
    pub fn timed_foot(&self, foot: usize, instant: Instant) -> TimedNode {
        if let Phase::Swing(j) = self.phase_at(foot, instant)
            && let Some(lift_off) = self.feet[foot].swings[j].switches
        {
            return TimedNode::moving(instant.time(), &self.swing_variables(foot, j), lift_off);
        }
        TimedNode::given(self.foot_node(foot, instant.time(), 0))
    }

    /// The force f̄ of a foot at sample `k`, if it may carry a load there, as a function of its switches if these are variables.
    pub fn timed_force(&self, foot: usize, k: usize) -> Option<TimedNode> {
        let (j, full) = self.force(foot, k)?;
        let swings = &self.feet[foot].swings;
        // The ramp takes one sample and starts one sample away from the switch.
        let before = j.checked_sub(1).map(|j| &swings[j]).filter(|s| (k as f64) < s.swing.span()[1] + 2.0);
        let after = swings.get(j).filter(|s| (k as f64) > s.swing.span()[0] - 2.0);
        Some(match (before.and_then(|s| s.switches), after.and_then(|s| s.switches)) {
            (Some(switches), _) => TimedNode::rising(k, full.first(), switches + 1),
            (None, Some(switches)) => TimedNode::falling(k, full.first(), switches),
            (None, None) => TimedNode::given(full.clone()),
        })
    }

    /// The force of a foot at sample `k`, if there is one, and its stance. If durations are optimized, ḡ.
    pub fn force(&self, foot: usize, k: usize) -> Option<(usize, &LinearNode)> {
        let j = self.nearest_stance[foot][k];
        self.feet[foot].stances[j].force(k).map(|node| (j, node))
    }
}

/// Solves, for each component, a symmetric system with a constant diagonal and a constant entry beside it, less than half of that.
pub fn solve_tridiagonal<const D: usize>(diagonal: f64, beside: f64, values: &mut [[f64; D]]) {
    let mut pivots = vec![diagonal; values.len()];
    for i in 1..values.len() {
        let factor = beside / pivots[i - 1];
        pivots[i] -= factor * beside;
        values[i] = std::array::from_fn(|d| values[i][d] - factor * values[i - 1][d]);
    }
    for i in (0..values.len()).rev() {
        let after = if i + 1 < values.len() { values[i + 1] } else { [0.0; D] };
        values[i] = std::array::from_fn(|d| (values[i][d] - beside * after[d]) / pivots[i]);
    }
}

/// The number of pieces of about `spacing` samples in `length`.
fn pieces(length: usize, spacing: usize) -> usize {
    ((length as f64 / spacing as f64).round() as usize).clamp(1, length)
}

#[cfg(test)]
mod tests {
    use super::super::phase::Swing;
    use super::*;

    fn layout() -> Layout {
        layout_of(KnotSpacing { base: 1, force: 1 })
    }

    fn layout_of(spacing: KnotSpacing) -> Layout {
        let gait = Gait {
            intervals: 20,
            swings: vec![vec![Swing::given(4.0, 8.0)], vec![Swing::given(10.0, 15.0)], vec![], vec![]],
        };
        Layout::new(&gait, 0.05, spacing, SwingShape::Light, [false; 2])
    }

    #[test]
    fn coarse_knots_are_interpolated() {
        let spacing = KnotSpacing { base: 3, force: 2 };
        let layout = layout_of(spacing);
        // 20 samples make 7 intervals of the base; the stance of 4 samples has nodes at 0, at 2 and, fixed at zero, at 4.
        assert_eq!((layout.base_spline.intervals, layout.base_spline.blocks()), (7, 6));
        let stance = &layout.feet[0].stances[0];
        let first = stance.force(0).expect("the motion starts here").first();
        let second = stance.force(2).expect("inside").first();
        assert_eq!(stance.force(1).expect("inside").terms, [(first, 0.5), (second, 0.5)]);
        assert_eq!(stance.force(3).expect("inside").terms, [(second, 0.5)]);
        assert!(stance.force(4).is_none());
        // A spline whose control points are on a line is that line, and its derivative the slope.
        let mut x = vec![0.0; layout.variables];
        for block in 0..layout.base_spline.blocks() {
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
    fn each_variable_has_exactly_one_use() {
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
    fn forces_are_zero_at_switches_only() {
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
