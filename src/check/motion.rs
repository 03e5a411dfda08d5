//! The base: reach, clearance, and whether anything jumps.

use super::laws;
use super::legs::center_direction;
use super::subject::{Finding, Residuals, Subject, Worst, larger, rms};
use super::vector::{add, norm, rotate, rotate_back, scale, sub};

pub(super) fn findings(s: &Subject, findings: &mut Vec<Finding>, residuals: &mut Residuals) {
    reach(s, findings, residuals);
    base_clearance(s, findings, residuals);
    jumps(s, findings);
    smoothness(s, findings);
}

/// Eq. 4: distance of Rᵀ(pᵢ − p) + s from the box 𝓡ᵢ. Of a foot that moves in a plane of the base, the center does: y is the center's.
fn reach(s: &Subject, findings: &mut Vec<Finding>, residuals: &mut Residuals) {
    let mut worst = Worst::default();
    residuals.reach = vec![0.0; s.samples];
    for (n, e) in s.sample_feet() {
        let relative = sub(s.foot_position(n, e), s.plan.base_position[n]);
        let turn = s.plan.base_quaternion_wxyz[n];
        let mut body = rotate_back(turn, relative);
        if let Some(Some(radius)) = s.robot.sagittal.get(e) {
            body[1] += radius * rotate_back(turn, center_direction(s.plan, n, e))[1];
        }
        let limits = &s.robot.reach[e];
        let center = s.on_trunk(n, limits.center);
        let beyond = std::array::from_fn(|k| larger((body[k] - center[k]).abs() - limits.half_size[k], 0.0));
        let distance = 1e3 * norm(beyond);
        worst.meet(distance, n, Some(e));
        residuals.reach[n] = residuals.reach[n].max(distance);
    }
    findings.push((laws::REACH, worst));
}

/// Distance of 5 × 3 points of the torso's underside from the ground below them.
fn base_clearance(s: &Subject, findings: &mut Vec<Finding>, residuals: &mut Residuals) {
    let torso = &s.robot.torso;
    let wanted = 1e3 * s.scenario.motion.base_clearance;
    let mut shortfall = Worst::default();
    let mut least = Worst { value: f64::INFINITY, ..Default::default() };
    for n in 0..s.samples {
        let mut here = f64::INFINITY;
        for i in 0..5 {
            for j in 0..3 {
                let at = [f64::from(i) / 2.0 - 1.0, f64::from(j) - 1.0, -1.0];
                let corner = std::array::from_fn(|k| torso.center[k] + at[k] * torso.half_size[k]);
                let [x, y, z] = add(
                    s.plan.base_position[n],
                    rotate(s.plan.base_quaternion_wxyz[n], s.on_trunk(n, corner)),
                );
                here = -larger(-here, -1e3 * (z - s.ground.height(x, y)));
            }
        }
        residuals.clearance.push(here);
        shortfall.meet(wanted - here, n, None);
        if here < least.value {
            least = Worst { value: here, sample: Some(n), foot: None };
        }
    }
    findings.push((laws::BASE_CLEARANCE, shortfall));
    findings.push((laws::LEAST_CLEARANCE, least));
}

/// By how much a position changes from sample to sample beyond its velocities, and a force beyond its changes before and after.
fn jumps(s: &Subject, findings: &mut Vec<Finding>) {
    let plan = s.plan;
    let (mut base, mut foot, mut force) = (Worst::default(), Worst::default(), Worst::default());
    // Trapezoidal rule: for smooth motion the remainder is of third order in the step.
    let rest = |p: &[[f64; 3]], v: &[[f64; 3]], a: usize, b: usize| {
        1e3 * norm(sub(sub(p[b], p[a]), scale(0.5 * s.step, add(v[a], v[b]))))
    };
    for n in 1..s.samples {
        base.meet(rest(&plan.base_position, &plan.base_linear_velocity, n - 1, n), n, None);
        for e in 0..s.feet {
            let (a, b) = ((n - 1) * s.feet + e, n * s.feet + e);
            foot.meet(rest(&plan.foot_position, &plan.foot_velocity, a, b), n, Some(e));
            // A force may change quickly, but then over several samples.
            let change = |n: usize| norm(sub(s.foot_force(n, e), s.foot_force(n - 1, e)));
            let before = if n > 1 { change(n - 1) } else { 0.0 };
            let after = if n + 1 < s.samples { change(n + 1) } else { 0.0 };
            force.meet(100.0 / s.weight * (change(n) - before.max(after)), n, Some(e));
        }
    }
    findings.push((laws::BASE_JUMP, base));
    findings.push((laws::FOOT_JUMP, foot));
    findings.push((laws::FORCE_JUMP, force));
}

fn smoothness(s: &Subject, findings: &mut Vec<Finding>) {
    let accelerations: Vec<f64> = s.plan.base_linear_acceleration.iter().map(|a| norm(*a)).collect();
    findings.push((laws::BASE_ACCELERATION, Worst::overall(rms(&accelerations))));
    let mut fastest = Worst::default();
    for (n, omega) in s.plan.base_angular_velocity.iter().enumerate() {
        fastest.meet(norm(*omega), n, None);
    }
    findings.push((laws::ANGULAR_SPEED, fastest));
    let mut squares = Vec::new();
    for (n, e) in s.sample_feet().filter(|&(n, _)| n > 0) {
        squares.push(norm(sub(s.foot_force(n, e), s.foot_force(n - 1, e))) / (s.step * s.weight));
    }
    findings.push((laws::FORCE_RATE, Worst::overall(rms(&squares))));
}
