//! Optimized phase durations: lift-off and touch-down as variables, and the nodes that depend on them.
//!
//! The switches a (lift-off) and b (touch-down) of each swing are variables, in samples, so the phases of a foot sum to the horizon by
//! construction. Each switch may move within some room around its nominal time. The room is small enough for a sample to depend on
//! one swing only, and for its force to depend on one switch only, so that the sparsity pattern is fixed and local.
//!
//! ```text
//!   foot at sample k:   p̄_k = Σ_m c̄_m B_m(u),  u = clamp((k − a)/(b − a), 0, 1),   with c̄ the foothold, the control points and
//!                       the next foothold: the foot stands on a foothold at u = 0 and at u = 1
//!   force at sample k:  f̄_k = σ ḡ_k,  σ = ramp(k − 1 − b) after touch-down, ramp(a − k − 1) before lift-off
//! ```
//!
//! Forces are linear between samples, so a force at k acts from k − 1 to k + 1. The activation σ is zero unless all of that time is
//! within the stance. Therefore a foot never carries a load while it moves, and forces stay linear between samples, so that Newton's
//! law holds there as it does with given durations. ḡ obeys the friction cone and the limits of the normal force for any σ, and so
//! f̄ does, too.

use std::ops::Range;

use super::node::LinearNode;
use super::phase::Swing;
use super::spline::SwingBasis;

/// Greatest distance of a switch from its nominal time, s, for a robot of ANYmal's size.
pub(super) const FARTHEST: f64 = 0.15;
/// Shortest swing, in time steps: with fewer, the samples do not capture its path.
pub const SHORTEST_SWING: f64 = 3.0;
/// Samples of a stance that neither of its switches may enter: the width of two ramps.
const CORE: f64 = 4.0;
/// Samples of the first or last stance that its only switch may not enter: the robot is at rest there.
const END_CORE: f64 = 2.0;
/// How far inside the nominal swing the guess has lift-off and touch-down, in samples, room permitting. The swing is then shorter by a
/// time step or more, and the foot carries a load at one sample more. Because σ is flat at zero, the optimizer cannot see the benefit
/// of a force that the guess leaves out, but it easily drops a superfluous one. Rippled, medium: the cost falls from 28.9 to 20.6
/// from this guess, and not at all from half a sample inside on both sides.
const GUESS_SHIFT: [f64; 2] = [1.25, 0.25];
/// Greatest fraction of its room that the guess shifts a switch by, so that it starts inside its bounds.
const GUESS_FRACTION: f64 = 0.9;
/// Least room of a switch, in samples: less would change no force or path noticeably.
const LEAST_ROOM: f64 = 0.5;
/// Switches this close to a sample, in samples, count as being on it.
const ON_SAMPLE: f64 = 1e-6;
/// Tolerance for durations given in decimal, s.
const ROUNDING: f64 = 1e-9;

/// The sample at a time, if there is one up to rounding; otherwise the time itself.
pub fn snapped(time: f64) -> f64 {
    if (time - time.round()).abs() < ON_SAMPLE { time.round() } else { time }
}

/// Gives the switches of one foot room to move, at most `farthest`, s. `bounds` on the duration of a phase in s.
///
/// # Errors
/// The reason, in words, if the phases and the bounds leave no room.
pub(super) fn make_room(
    swings: &mut [Swing],
    intervals: usize,
    step: f64,
    bounds: [f64; 2],
    farthest: f64,
) -> Result<(), String> {
    let durations = phase_durations(swings, intervals);
    check_horizon(durations.len(), intervals as f64 * step, bounds)?;
    for n in 0..durations.len() {
        check_duration(n, &durations, step, bounds)?;
    }
    for (j, swing) in swings.iter_mut().enumerate() {
        swing.room = room(j, &durations, step, farthest)?;
    }
    Ok(())
}

/// The nominal durations of the phases, stance first, in samples.
fn phase_durations(swings: &[Swing], intervals: usize) -> Vec<f64> {
    let mut switches = vec![0.0];
    switches.extend(swings.iter().flat_map(|s| [s.start, s.end]));
    switches.push(intervals as f64);
    switches.windows(2).map(|pair| pair[1] - pair[0]).collect()
}

fn check_horizon(phases: usize, horizon: f64, [least, _]: [f64; 2]) -> Result<(), String> {
    if phases as f64 * least > horizon {
        return Err(format!(
            "{phases} phases of at least {least} s (gait.duration_bounds) do not fit into the horizon of {horizon} s; lower the bound, or lengthen the horizon or gait.cycle"
        ));
    }
    Ok(())
}

/// Whether the nominal duration of phase n obeys its bounds.
fn check_duration(n: usize, durations: &[f64], step: f64, [least, most]: [f64; 2]) -> Result<(), String> {
    let duration = durations[n] * step;
    let swings = n % 2 == 1;
    // The first and the last stance include standing before and after the walk.
    let at_end = n == 0 || n + 1 == durations.len();
    if duration < least - ROUNDING || (duration > most + ROUNDING && !at_end) {
        let name = if swings { "swing" } else { "stance" };
        return Err(format!(
            "the {name} of {duration:.3} s that the gait starts from is not within gait.duration_bounds = [{least}, {most}] s; widen them, or change gait.cycle or gait.duty"
        ));
    }
    let shortest = SHORTEST_SWING * step;
    if swings && (duration < shortest - ROUNDING || most < shortest) {
        return Err(format!(
            "a swing takes at least three time steps, {shortest:.3} s, but that of the gait takes {duration:.3} s and gait.duration_bounds allow up to {most} s; lower the time_step, or lengthen the swing"
        ));
    }
    Ok(())
}

/// The room of the switches of swing j, in samples: as much as its neighbors in time leave.
fn room(j: usize, durations: &[f64], step: f64, farthest: f64) -> Result<[f64; 2], String> {
    let [before, own, after] = [2 * j, 2 * j + 1, 2 * j + 2].map(|n| durations[n]);
    let left = if j == 0 { before - END_CORE } else { 0.5 * (before - CORE) };
    let right = if 2 * j + 3 == durations.len() { after - END_CORE } else { 0.5 * (after - CORE) };
    // At least one sample of the swing itself remains.
    let most = (0.5 * (own - 1.0)).min(farthest / step);
    let room = [left.min(most), right.min(most)];
    if room.iter().any(|&room| room < LEAST_ROOM) {
        return Err(format!(
            "between a stance of {:.3} s, a swing of {:.3} s and a stance of {:.3} s no switch has room to move with a time_step of {step} s; lower the time_step",
            before * step,
            own * step,
            after * step
        ));
    }
    Ok(room)
}

/// The guess of lift-off and touch-down, in samples.
pub fn guessed(swing: &Swing) -> [f64; 2] {
    let shift = |n: usize| GUESS_SHIFT[n].min(GUESS_FRACTION * swing.room[n]);
    [swing.start + shift(0), swing.end - shift(1)]
}

/// A function that rises from 0 at s ≤ 0 to 1 at s ≥ 1 with two continuous derivatives (smootherstep), and these derivatives.
pub fn ramp(s: f64) -> [f64; 3] {
    let s = s.clamp(0.0, 1.0);
    [
        s * s * s * (10.0 - 15.0 * s + 6.0 * s * s),
        30.0 * s * s * (1.0 - s) * (1.0 - s),
        60.0 * s * (1.0 - s) * (1.0 - 2.0 * s),
    ]
}

/// The activation σ of a force at sample k in a stance from `touch_down` to `lift_off`, in samples; none where the motion starts or ends.
pub fn activation(k: usize, touch_down: Option<f64>, lift_off: Option<f64>) -> f64 {
    let k = k as f64;
    touch_down.map_or(1.0, |b| ramp(k - 1.0 - b)[0]) * lift_off.map_or(1.0, |a| ramp(a - k - 1.0)[0])
}

/// The dependence of a node on switches.
#[derive(Clone, Copy, Debug, PartialEq)]
enum Timing {
    /// Not at all.
    Given,
    /// A foot in a swing or close to one, at this time in samples.
    Moving(f64),
    /// A force after touch-down: the argument of the ramp is this minus the switch.
    Rising(f64),
    /// A force before lift-off: the argument of the ramp is the switch minus this.
    Falling(f64),
}

/// A node whose weights may depend on one or two switches, at the current x. The variables of its terms and times do not change.
#[derive(Clone, Debug)]
pub struct TimedNode {
    /// Value and differential at the current x.
    pub node: LinearNode,
    /// `mixed[term][time]`: the derivative of the term's weight with respect to the switch.
    pub mixed: Vec<[f64; 2]>,
    /// Second derivatives of the value with respect to the switches a and b: aa, ab, bb.
    pub second: [[f64; 3]; 3],
    timing: Timing,
}

impl TimedNode {
    /// A node that does not depend on switches.
    pub fn given(node: LinearNode) -> Self {
        Self { node, mixed: Vec::new(), second: [[0.0; 3]; 3], timing: Timing::Given }
    }

    /// A foot at time k in samples. `variables` are those of a swing's foothold, control points and next foothold; `lift_off` is the
    /// variable of the lift-off, followed by that of the touch-down.
    pub fn moving(k: f64, variables: &[usize], lift_off: usize) -> Self {
        Self {
            node: LinearNode {
                terms: variables.iter().map(|v| (*v, 0.0)).collect(),
                times: vec![(lift_off, [0.0; 3]), (lift_off + 1, [0.0; 3])],
            },
            mixed: vec![[0.0; 2]; variables.len()],
            second: [[0.0; 3]; 3],
            timing: Timing::Moving(k),
        }
    }

    /// The force at sample k after the touch-down in variable `touch_down`, with ḡ in variable `full`.
    pub fn rising(k: usize, full: usize, touch_down: usize) -> Self {
        Self::ramped(full, touch_down, Timing::Rising(k as f64 - 1.0))
    }

    /// The force at sample k before the lift-off in variable `lift_off`, with ḡ in variable `full`.
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

    /// Whether the node depends on switches.
    pub fn is_timed(&self) -> bool {
        self.timing != Timing::Given
    }

    /// The activation σ of a force.
    pub fn activation(&self) -> f64 {
        if self.is_timed() { self.node.terms[0].1 } else { 1.0 }
    }

    /// Updates the weights and their derivatives to x.
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
        // ∂u/∂(a, b) and ∂²u/∂(aa, ab, bb); zero where the foot stands.
        let moves = f64::from(u8::from(u > 0.0 && u < 1.0));
        let first = [(u - 1.0) / duration, -u / duration].map(|v| v * moves);
        let scale = moves / (duration * duration);
        let second = [2.0 * (u - 1.0) * scale, (1.0 - 2.0 * u) * scale, 2.0 * u * scale];
        let mut slope = [0.0; 3];
        let mut bend = [0.0; 3];
        for ((term, mixed), weights) in self.node.terms.iter_mut().zip(&mut self.mixed).zip(basis.at(u)) {
            term.1 = weights[0];
            *mixed = first.map(|by| weights[1] * by);
            for d in 0..3 {
                slope[d] += weights[1] * x[term.0 + d];
                bend[d] += weights[2] * x[term.0 + d];
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
        let [activation, slope, bend] = ramp(s);
        let full = self.node.terms[0].0;
        self.node.terms[0].1 = activation;
        self.mixed[0] = [sign * slope, 0.0];
        for d in 0..3 {
            self.node.times[0].1[d] = sign * slope * x[full + d];
            self.second[0][d] = bend * x[full + d];
        }
    }
}

/// The samples of a stance between two swings at which the foot may carry a load: a force acts from the sample before to the sample
/// after, all of which must be within the stance.
pub(super) fn force_samples(before: Option<&Swing>, after: Option<&Swing>, intervals: usize) -> Range<usize> {
    let first = before.map_or(0.0, |s| {
        // A switch at the very end of its room leaves no force at this sample.
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
    fn a_force_acts_only_within_its_stance() {
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
    fn switches_do_not_interfere() {
        let mut swings = walk();
        make_room(&mut swings, 80, 0.05, [0.1, 1.0], FARTHEST).expect("room");
        assert_eq!(swings[0].room, [2.0, 2.0]);
        let mut fine: Vec<Swing> = walk().iter().map(|s| Swing::given(2.0 * s.start, 2.0 * s.end)).collect();
        make_room(&mut fine, 160, 0.025, [0.1, 1.0], FARTHEST).expect("room");
        assert_eq!(fine[0].room, [4.5, 4.5]);
    }

    #[test]
    fn gaits_without_room_are_rejected() {
        let refused = |swings: &[Swing], bounds| {
            make_room(&mut swings.to_vec(), 80, 0.05, bounds, FARTHEST).expect_err("a refusal")
        };
        assert!(refused(&walk(), [0.9, 1.0]).contains("5 phases of at least 0.9 s"));
        assert!(refused(&walk(), [0.3, 1.0]).contains("the swing of 0.250 s"));
        assert!(refused(&walk(), [0.1, 0.5]).contains("the stance of 0.750 s"));
        let tight = [Swing::given(20.0, 25.0), Swing::given(29.0, 34.0)];
        assert!(refused(&tight, [0.1, 1.0]).contains("no switch has room"));
        assert!(refused(&[Swing::given(20.0, 22.0)], [0.1, 1.0]).contains("at least three time steps"));
    }
}
