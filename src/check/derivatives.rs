//! Whether the plan's velocities and accelerations are derivatives of its positions.
//!
//! Between two samples, h apart, with positions p, velocities v and accelerations a at both,
//!
//! ```text
//!   p₁ − p₀ = h (v₀ + v₁)/2 − h² (a₁ − a₀)/12,    v₁ − v₀ = h (a₀ + a₁)/2,
//! ```
//!
//! up to terms of the fifth and the third order in h. Both hold exactly where the acceleration is linear between the samples, and it
//! may have kinks at them, as that of a cubic spline with knots there. A foot's spline has knots between samples, where the second
//! relation is not applied. At lift-off and touch-down its acceleration jumps: over the time τ from lift-off to the next sample
//!
//! ```text
//!   p₁ − p₀ = 2/3 τ v₁ − τ² a₁/6,
//! ```
//!
//! which again is exact where the acceleration is linear; the same holds before touch-down, backward in time.

use super::laws;
use super::splines::swing_knots;
use super::subject::{Finding, Subject, Worst, larger, rms};
use super::vector::{add, norm, rotation_between, scale, sub};
use crate::Result;

/// Knots of a swing this near to a sample, s, are at it.
const AT_SAMPLE: f64 = 1e-9;
/// A velocity error counts as an error of acceleration over this time, s, so that one figure covers both.
const TIME: f64 = 0.1;

pub(super) fn findings(s: &Subject, findings: &mut Vec<Finding>) -> Result<()> {
    base(s, findings);
    feet(s, findings)?;
    quaternions(s, findings);
    Ok(())
}

/// Position (or the rotation so far), velocity and acceleration at two successive samples.
struct Pair {
    moved: [f64; 3],
    velocity: [[f64; 3]; 2],
    acceleration: [[f64; 3]; 2],
}

impl Pair {
    /// By how much the velocities miss the motion, per second.
    fn velocity_error(&self, h: f64) -> f64 {
        let [v, a] = [&self.velocity, &self.acceleration];
        let expected = sub(scale(0.5 * h, add(v[0], v[1])), scale(h * h / 12.0, sub(a[1], a[0])));
        norm(sub(self.moved, expected)) / h
    }

    /// The same where the foot moves only for a time τ before (`moving` 0) or after (1) a switch.
    fn switch_error(&self, time: f64, moving: usize, h: f64) -> f64 {
        let sign = if moving == 1 { -1.0 } else { 1.0 };
        let [v, a] = [self.velocity[moving], self.acceleration[moving]];
        let expected = add(scale(2.0 / 3.0 * time, v), scale(sign * time * time / 6.0, a));
        norm(sub(self.moved, expected)) / h
    }

    /// By how much the accelerations miss the change of velocity, per second.
    fn acceleration_error(&self, h: f64) -> f64 {
        let [v, a] = [&self.velocity, &self.acceleration];
        norm(sub(scale(1.0 / h, sub(v[1], v[0])), scale(0.5, add(a[0], a[1]))))
    }
}

fn base(s: &Subject, findings: &mut Vec<Finding>) {
    let (plan, h) = (s.plan, s.step);
    let both = |values: &[[f64; 3]], n: usize| [values[n], values[n + 1]];
    let (mut linear, mut angular) = (Vec::new(), Vec::new());
    let (mut linear_worst, mut angular_worst) = (Worst::default(), Worst::default());
    let gravity = norm(s.robot.gravity);
    for n in 0..s.samples - 1 {
        let pair = Pair {
            moved: sub(plan.base_position[n + 1], plan.base_position[n]),
            velocity: both(&plan.base_linear_velocity, n),
            acceleration: both(&plan.base_linear_acceleration, n),
        };
        let error = 100.0 * larger(pair.acceleration_error(h), pair.velocity_error(h) / TIME) / gravity;
        linear.push(error);
        linear_worst.meet(error, n, None);
        let q = &plan.base_quaternion_wxyz;
        let pair = Pair {
            moved: rotation_between(q[n], q[n + 1]),
            velocity: both(&plan.base_angular_velocity, n),
            acceleration: both(&plan.base_angular_acceleration, n),
        };
        let error = larger(pair.acceleration_error(h), pair.velocity_error(h) / TIME);
        angular.push(error);
        angular_worst.meet(error, n, None);
    }
    findings.push((laws::LINEAR_CONSISTENCY, Worst::overall(rms(&linear))));
    findings.push((laws::LINEAR_CONSISTENCY_MAX, linear_worst));
    findings.push((laws::ANGULAR_CONSISTENCY, Worst::overall(rms(&angular))));
    findings.push((laws::ANGULAR_CONSISTENCY_MAX, angular_worst));
}

fn feet(s: &Subject, findings: &mut Vec<Finding>) -> Result<()> {
    let (plan, h) = (s.plan, s.step);
    let free = plan.swing_shape()?.free();
    let [mut velocity, mut acceleration, mut standing] = [Worst::default(); 3];
    for e in 0..s.feet {
        let at = |values: &[[f64; 3]], n: usize| values[n * s.feet + e];
        let knots = knots_of(&plan.phases(e), free);
        for n in 0..s.samples {
            if s.in_contact(n, e) {
                let [v, a] = [&plan.foot_velocity, &plan.foot_acceleration].map(|values| norm(at(values, n)));
                standing.meet(larger(v, a * TIME), n, Some(e));
            }
            if n + 1 == s.samples {
                continue;
            }
            let both = |values: &[[f64; 3]]| [at(values, n), at(values, n + 1)];
            let pair = Pair {
                moved: sub(s.foot_position(n + 1, e), s.foot_position(n, e)),
                velocity: both(&plan.foot_velocity),
                acceleration: both(&plan.foot_acceleration),
            };
            let between = |knot: &&f64| (plan.t[n] + AT_SAMPLE..plan.t[n + 1] - AT_SAMPLE).contains(*knot);
            let knot = knots.iter().find(between);
            match [s.in_contact(n, e), s.in_contact(n + 1, e)] {
                [true, false] => {
                    let time = knot.map_or(h, |lift_off| plan.t[n + 1] - lift_off);
                    velocity.meet(pair.switch_error(time, 1, h), n, Some(e));
                }
                [false, true] => {
                    let time = knot.map_or(h, |touch_down| touch_down - plan.t[n]);
                    velocity.meet(pair.switch_error(time, 0, h), n, Some(e));
                }
                _ => {
                    velocity.meet(pair.velocity_error(h), n, Some(e));
                    if knot.is_none() {
                        acceleration.meet(pair.acceleration_error(h), n, Some(e));
                    }
                }
            }
        }
    }
    findings.push((laws::FOOT_VELOCITY, velocity));
    findings.push((laws::FOOT_ACCELERATION, acceleration));
    findings.push((laws::STANCE_MOTION, standing));
    Ok(())
}

/// Times, s, at which a foot's acceleration may jump or have a kink: the knots of its swings.
fn knots_of(phases: &[[f64; 2]], free: usize) -> Vec<f64> {
    let (all, _) = swing_knots(free);
    let swings = phases.iter().skip(1).step_by(2);
    swings
        .flat_map(|[start, end]| all[3..all.len() - 3].iter().map(move |u| start + u * (end - start)))
        .collect()
}

/// Unit length, and no flips of the sign between samples.
fn quaternions(s: &Subject, findings: &mut Vec<Finding>) {
    let q = &s.plan.base_quaternion_wxyz;
    let product = |a: [f64; 4], b: [f64; 4]| (0..4).map(|i| a[i] * b[i]).sum::<f64>();
    let mut worst = Worst::default();
    for n in 0..s.samples {
        worst.meet((product(q[n], q[n]).sqrt() - 1.0).abs(), n, None);
        if n > 0 && product(q[n - 1], q[n]) < 0.0 {
            worst.meet(2.0, n, None);
        }
    }
    findings.push((laws::QUATERNION, worst));
}
