//! Optimized phase durations: lift-off and touch-down as variables, and what depends on them.
//!
//! The switches a (lift-off) and b (touch-down) of each swing are variables, in samples; so the phases of a foot sum to the
//! horizon by construction. Each may move within a room around its nominal time, small enough that a sample depends on one
//! swing only, and its force on one switch only: the sparsity pattern stays fixed and local.
//!
//! ```text
//!   foot at sample k:   p̄_k = Σ_m c̄_m B_m(u),  u = clamp((k − a)/(b − a), 0, 1);   B_m collapsed onto
//!                       foothold, three control points, next foothold: it stands on these at u = 0 and u = 1
//!   force at sample k:  f̄_k = σ ḡ_k,  σ = ramp(k − 1 − b) after touch-down, ramp(a − k − 1) before lift-off
//! ```
//!
//! A force at k acts from k − 1 to k + 1, for it is linear between samples. σ is zero unless all of that lies within the
//! stance, so that a foot never bears anything while it moves, and forces stay linear between samples: Newton's law holds
//! there as it does with given durations. ḡ obeys the cone and the limits of the normal force, whatever σ is, and then so
//! does f̄.

use std::ops::Range;

use super::node::LinearNode;
use super::phase::Swing;
use super::spline::SwingBasis;

/// No switch moves further than this from its nominal time, s.
const FARTHEST: f64 = 0.15;
/// A swing takes at least so many time steps, whatever its bounds: its path is to be seen at the samples.
pub const SHORTEST_SWING: f64 = 3.0;
/// Samples of a stance that both of its switches leave alone: so wide are two ramps.
const CORE: f64 = 4.0;
/// Samples of the first or last stance that its only switch leaves alone: the robot rests there on its own force.
const END_CORE: f64 = 2.0;
/// The guess has lift-off and touch-down so many samples inside the nominal swing, within their rooms. The swing is then a
/// time step shorter and each foot bears something at one sample more. A force that the guess leaves out cannot tell what it
/// would be worth, for σ is flat where it is zero; one too many is given up easily. Rippled, medium: the cost falls from
/// 28.9 to 20.6 from here, and not at all from half a sample inside on both sides.
const GUESS_SHIFT: [f64; 2] = [1.25, 0.25];
/// Least room of a switch that is worth having, in samples.
const LEAST_ROOM: f64 = 0.5;
/// Switches nearer to a sample than this, in samples, are taken to lie on it.
const ON_SAMPLE: f64 = 1e-6;

/// The sample that a time lies on, up to rounding; otherwise the time itself.
pub fn snapped(time: f64) -> f64 {
    if (time - time.round()).abs() < ON_SAMPLE { time.round() } else { time }
}

/// Gives the switches of one foot room to move, or says why they have none. `bounds` in s.
pub(super) fn make_room(
    swings: &mut [Swing],
    intervals: usize,
    step: f64,
    bounds: [f64; 2],
) -> Result<(), String> {
    let phases = 2 * swings.len() + 1;
    let horizon = intervals as f64 * step;
    if phases as f64 * bounds[0] > horizon {
        return Err(format!(
            "{phases} phases of at least {} s (gait.duration_bounds) do not fit into the horizon of {horizon} s; lower the bound, lengthen the horizon or gait.cycle",
            bounds[0]
        ));
    }
    let edges: Vec<f64> = std::iter::once(0.0)
        .chain(swings.iter().flat_map(|s| [s.start, s.end]))
        .chain([intervals as f64])
        .collect();
    for (n, pair) in edges.windows(2).enumerate() {
        let duration = (pair[1] - pair[0]) * step;
        // The first and the last stance include standing before and after the walk.
        let most = if n == 0 || n + 1 == phases { f64::INFINITY } else { bounds[1] };
        let name = if n % 2 == 0 { "stance" } else { "swing" };
        if duration < bounds[0] - 1e-9 || duration > most + 1e-9 {
            return Err(format!(
                "the {name} of {duration:.3} s that the gait begins with is not within gait.duration_bounds = [{}, {}] s; widen them, or change gait.cycle or gait.duty",
                bounds[0], bounds[1]
            ));
        }
        let shortest = SHORTEST_SWING * step;
        if n % 2 == 1 && (duration < shortest - 1e-9 || bounds[1] < shortest) {
            return Err(format!(
                "a swing takes at least three time steps, {shortest:.3} s, but the gait begins with {duration:.3} s and gait.duration_bounds allow up to {} s; lower the time_step, or lengthen the swing",
                bounds[1]
            ));
        }
    }
    let count = swings.len();
    for (j, swing) in swings.iter_mut().enumerate() {
        // The stances before and after, and what they leave to this switch.
        let [before, own, after] = [2 * j, 2 * j + 1, 2 * j + 2].map(|n| edges[n + 1] - edges[n]);
        let left = if j == 0 { before - END_CORE } else { 0.5 * (before - CORE) };
        let right = if j + 1 == count { after - END_CORE } else { 0.5 * (after - CORE) };
        let most = (0.5 * (own - 1.0)).min(FARTHEST / step);
        swing.room = [left.min(most), right.min(most)];
        if swing.room.iter().any(|&room| room < LEAST_ROOM) {
            return Err(format!(
                "between a stance of {:.3} s, a swing of {:.3} s and a stance of {:.3} s no switch has room to move, with a time_step of {step} s; lower the time_step",
                before * step,
                own * step,
                after * step
            ));
        }
    }
    Ok(())
}

/// Lift-off and touch-down to start from, in samples.
pub fn guessed(swing: &Swing) -> [f64; 2] {
    let shift = |n: usize| GUESS_SHIFT[n].min(0.9 * swing.room[n]);
    [swing.start + shift(0), swing.end - shift(1)]
}

/// Rises from 0 at s ≤ 0 to 1 at s ≥ 1 with two continuous derivatives: its value and these.
pub fn ramp(s: f64) -> [f64; 3] {
    let s = s.clamp(0.0, 1.0);
    [
        s * s * s * (10.0 - 15.0 * s + 6.0 * s * s),
        30.0 * s * s * (1.0 - s) * (1.0 - s),
        60.0 * s * (1.0 - s) * (1.0 - 2.0 * s),
    ]
}

/// σ of a force at sample k in a stance from `touch_down` to `lift_off`, both in samples; none at the ends of the motion.
pub fn activation(k: usize, touch_down: Option<f64>, lift_off: Option<f64>) -> f64 {
    let k = k as f64;
    touch_down.map_or(1.0, |b| ramp(k - 1.0 - b)[0]) * lift_off.map_or(1.0, |a| ramp(a - k - 1.0)[0])
}

/// How a node depends on switches.
#[derive(Clone, Copy, Debug, PartialEq)]
enum Timing {
    /// Not at all.
    Given,
    /// A foot in or near a swing, at this time in samples.
    Moving(f64),
    /// A force after touch-down: the ramp's argument is this minus the switch.
    Rising(f64),
    /// A force before lift-off: the ramp's argument is the switch minus this.
    Falling(f64),
}

/// A node whose weights may depend on one or two switches, at the present x. Its terms and times stay the same variables.
#[derive(Clone, Debug)]
pub struct TimedNode {
    /// Value and differential at the present x.
    pub node: LinearNode,
    /// `mixed[term][time]`: the derivative of the term's weight with respect to the switch.
    pub mixed: Vec<[f64; 2]>,
    /// Second derivatives of the value with respect to the switches: first twice, both, second twice.
    pub second: [[f64; 3]; 3],
    timing: Timing,
}

impl TimedNode {
    /// A node that does not depend on switches.
    pub fn given(node: LinearNode) -> Self {
        Self { node, mixed: Vec::new(), second: [[0.0; 3]; 3], timing: Timing::Given }
    }

    /// A foot at time k, in samples, of a swing from foothold to foothold by way of control points, with switches at `lift_off` and
    /// the variable after it.
    pub fn moving(k: f64, variables: [usize; 5], lift_off: usize) -> Self {
        Self {
            node: LinearNode {
                terms: variables.map(|v| (v, 0.0)).to_vec(),
                times: vec![(lift_off, [0.0; 3]), (lift_off + 1, [0.0; 3])],
            },
            mixed: vec![[0.0; 2]; variables.len()],
            second: [[0.0; 3]; 3],
            timing: Timing::Moving(k),
        }
    }

    /// The force at sample k after the touch-down that is variable `touch_down`, full force in variable `full`.
    pub fn rising(k: usize, full: usize, touch_down: usize) -> Self {
        Self::ramped(full, touch_down, Timing::Rising(k as f64 - 1.0))
    }

    /// The force at sample k before the lift-off that is variable `lift_off`, full force in variable `full`.
    pub fn falling(k: usize, full: usize, lift_off: usize) -> Self {
        Self::ramped(full, lift_off, Timing::Falling(k as f64 + 1.0))
    }

    fn ramped(full: usize, switch: usize, timing: Timing) -> Self {
        Self {
            node: LinearNode { terms: vec![(full, 0.0)], times: vec![(switch, [0.0; 3])] },
            mixed: vec![[0.0; 2]],
            second: [[0.0; 3]; 3],
            timing,
        }
    }

    /// Whether it depends on switches.
    pub fn is_timed(&self) -> bool {
        self.timing != Timing::Given
    }

    /// σ of a force.
    pub fn activation(&self) -> f64 {
        if self.is_timed() { self.node.terms[0].1 } else { 1.0 }
    }

    /// Brings the weights and their derivatives to x.
    pub fn update(&mut self, basis: &SwingBasis, x: &[f64]) {
        match self.timing {
            Timing::Given => {}
            Timing::Moving(k) => self.update_moving(k, basis, x),
            Timing::Rising(k) => self.update_ramped(k - x[self.node.times[0].0], -1.0, x),
            Timing::Falling(k) => self.update_ramped(x[self.node.times[0].0] - k, 1.0, x),
        }
    }

    fn update_moving(&mut self, k: f64, basis: &SwingBasis, x: &[f64]) {
        let [a, b] = [0, 1].map(|t| x[self.node.times[t].0]);
        let duration = b - a;
        let u = (k - a) / duration;
        let weights = basis.at(u);
        // ∂u/∂(a, b) and ∂²u/∂(aa, ab, bb); nothing where the foot stands.
        let moves = f64::from(u8::from(u > 0.0 && u < 1.0));
        let first = [(u - 1.0) / duration, -u / duration].map(|v| v * moves);
        let scale = moves / (duration * duration);
        let second = [2.0 * (u - 1.0) * scale, (1.0 - 2.0 * u) * scale, 2.0 * u * scale];
        let mut slope = [0.0; 3];
        let mut bend = [0.0; 3];
        for (m, term) in self.node.terms.iter_mut().enumerate() {
            term.1 = weights[0][m];
            self.mixed[m] = first.map(|by| weights[1][m] * by);
            for d in 0..3 {
                slope[d] += weights[1][m] * x[term.0 + d];
                bend[d] += weights[2][m] * x[term.0 + d];
            }
        }
        let square = [first[0] * first[0], first[0] * first[1], first[1] * first[1]];
        for d in 0..3 {
            for t in 0..2 {
                self.node.times[t].1[d] = slope[d] * first[t];
            }
            for s in 0..3 {
                self.second[s][d] = bend[d] * square[s] + slope[d] * second[s];
            }
        }
    }

    fn update_ramped(&mut self, s: f64, sign: f64, x: &[f64]) {
        let [share, slope, bend] = ramp(s);
        let full = self.node.terms[0].0;
        self.node.terms[0].1 = share;
        self.mixed[0] = [sign * slope, 0.0];
        for d in 0..3 {
            self.node.times[0].1[d] = sign * slope * x[full + d];
            self.second[0][d] = bend * x[full + d];
        }
    }
}

/// The samples of a stance between two swings at which the foot may bear something: a force acts from the sample before to the
/// sample after, all of which must lie within the stance.
pub(super) fn force_samples(before: Option<&Swing>, after: Option<&Swing>, intervals: usize) -> Range<usize> {
    let first = before.map_or(0.0, |s| {
        // At the very end of its room a switch leaves no force there.
        let earliest = s.end - s.room[1] + 1.0;
        if s.is_free() { earliest.floor() + 1.0 } else { earliest.ceil() }
    });
    let last = after.map_or(intervals as f64, |s| {
        let latest = s.start + s.room[0] - 1.0;
        if s.is_free() { latest.ceil() - 1.0 } else { latest.floor() }
    });
    let first = first as usize;
    first..((last + 1.0).max(0.0) as usize).max(first)
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_ramp_is_smooth_and_flat_at_both_ends() {
        assert_eq!(ramp(-1.0), [0.0; 3]);
        assert_eq!(ramp(2.0), [1.0, 0.0, 0.0]);
        let e = 1e-6;
        for i in 0..40 {
            let s = f64::from(i) / 40.0 + 0.01;
            let [p, m, at] = [ramp(s + e), ramp(s - e), ramp(s)];
            for d in 0..2 {
                assert!(((p[d] - m[d]) / (2.0 * e) - at[d + 1]).abs() < 1e-8, "{s}");
            }
        }
    }

    #[test]
    fn a_force_acts_within_its_stance_alone() {
        // It acts from k − 1 to k + 1.
        for (k, expected) in [(5, 0.0), (6, 0.0), (7, 1.0), (11, 1.0), (12, 0.0), (13, 0.0)] {
            assert_eq!(activation(k, Some(5.0), Some(13.0)), expected, "sample {k}");
        }
        assert!((activation(7, Some(5.5), None) - 0.5).abs() < 1e-15);
        assert_eq!(activation(0, None, None), 1.0);
    }

    fn walk() -> Vec<Swing> {
        vec![Swing::given(20.0, 25.0), Swing::given(40.0, 45.0)]
    }

    #[test]
    fn switches_keep_out_of_each_others_way() {
        let mut swings = walk();
        make_room(&mut swings, 80, 0.05, [0.1, 1.0]).expect("room");
        assert_eq!(swings[0].room, [2.0, 2.0]);
        let mut fine: Vec<Swing> = walk().iter().map(|s| Swing::given(2.0 * s.start, 2.0 * s.end)).collect();
        make_room(&mut fine, 160, 0.025, [0.1, 1.0]).expect("room");
        assert_eq!(fine[0].room, [4.5, 4.5]);
    }

    #[test]
    fn what_has_no_room_is_refused_in_words() {
        let refused = |swings: &[Swing], bounds| {
            make_room(&mut swings.to_vec(), 80, 0.05, bounds).expect_err("a refusal")
        };
        assert!(refused(&walk(), [0.9, 1.0]).contains("5 phases of at least 0.9 s"));
        assert!(refused(&walk(), [0.3, 1.0]).contains("the swing of 0.250 s"));
        assert!(refused(&walk(), [0.1, 0.5]).contains("the stance of 0.750 s"));
        let tight = [Swing::given(20.0, 25.0), Swing::given(29.0, 34.0)];
        assert!(refused(&tight, [0.1, 1.0]).contains("no switch has room"));
        assert!(refused(&[Swing::given(20.0, 22.0)], [0.1, 1.0]).contains("at least three time steps"));
    }
}
