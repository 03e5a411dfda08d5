//! The laws of motion (Eq. 2).
//!
//! Each law is evaluated twice: at every sample with the plan's own accelerations, and from positions and orientations
//! alone. A second difference equals the acceleration averaged with a hat of half width h,
//! p(t−h) − 2p(t) + p(t+h) = h² ∫ hat(s) p̈(t+s) ds, so that the law holds for it with the forces averaged by the same
//! hat; Simpson's rule (1, 4, 1)/6 does this to fourth order. The larger residual counts.

use super::laws;
use super::subject::{Finding, Residuals, Subject, Worst, larger, rms};
use super::vector::{add, cross, dot, norm, rotate, rotate_back, rotation_between, scale, sub};

/// Lever arm by which torques are compared with the weight, m.
const LEVER: f64 = 0.3;

pub(super) fn findings(s: &Subject, findings: &mut Vec<Finding>, residuals: &mut Residuals) {
    let forces: Vec<[f64; 3]> = (0..s.samples).map(|n| total_force(s, n)).collect();
    let torques: Vec<[f64; 3]> = (0..s.samples).map(|n| total_torque(s, n)).collect();

    residuals.newton = newton(s, &forces);
    report(findings, laws::NEWTON_RMS, laws::NEWTON_MAX, &residuals.newton);
    residuals.euler = euler(s, &torques);
    report(findings, laws::EULER_RMS, laws::EULER_MAX, &residuals.euler);
    legs(s, findings);
}

fn report(
    findings: &mut Vec<Finding>,
    mean: &'static laws::CheckedLaw,
    most: &'static laws::CheckedLaw,
    values: &[f64],
) {
    let mut worst = Worst::default();
    for (n, value) in values.iter().enumerate() {
        worst.meet(*value, n, None);
    }
    findings.push((mean, Worst::overall(rms(values))));
    findings.push((most, worst));
}

/// Σf + m g, the scenario's forces included.
fn total_force(s: &Subject, n: usize) -> [f64; 3] {
    let robot = &s.robot;
    let feet = (0..s.feet).fold(scale(robot.mass, robot.gravity), |sum, e| add(sum, s.foot_force(n, e)));
    applied(s, n).fold(feet, |sum, (_, force)| add(sum, force))
}

/// Σ(pᵢ − p) × fᵢ.
fn total_torque(s: &Subject, n: usize) -> [f64; 3] {
    let base = s.plan.base_position[n];
    let feet = (0..s.feet)
        .fold([0.0; 3], |sum, e| add(sum, cross(sub(s.foot_position(n, e), base), s.foot_force(n, e))));
    applied(s, n).fold(feet, |sum, (arm, force)| add(sum, cross(arm, force)))
}

/// Where the scenario's forces on the trunk act at a sample, from the center of mass, m, and what they are, N; world frame.
fn applied(s: &Subject, n: usize) -> impl Iterator<Item = ([f64; 3], [f64; 3])> {
    s.scenario.force.iter().map(move |force| {
        let arm = rotate(s.plan.base_quaternion_wxyz[n], s.on_trunk(n, force.point));
        (arm, scale(force.fraction(s.plan.t[n], s.scenario.time_step), force.vector))
    })
}

/// (1, 4, 1)/6 around sample n.
fn hat(values: &[[f64; 3]], n: usize) -> [f64; 3] {
    scale(1.0 / 6.0, add(add(values[n - 1], scale(4.0, values[n])), values[n + 1]))
}

/// ‖m p̈ − Σf − m g‖ by sample, % of m g.
fn newton(s: &Subject, forces: &[[f64; 3]]) -> Vec<f64> {
    let (mass, p) = (s.robot.mass, &s.plan.base_position);
    (0..s.samples)
        .map(|n| {
            let stated = norm(sub(scale(mass, s.plan.base_linear_acceleration[n]), forces[n]));
            let differenced = if n == 0 || n + 1 == s.samples {
                0.0
            } else {
                let acceleration = scale(s.step.powi(-2), add(sub(p[n - 1], scale(2.0, p[n])), p[n + 1]));
                norm(sub(scale(mass, acceleration), hat(forces, n)))
            };
            100.0 * larger(stated, differenced) / s.weight
        })
        .collect()
}

/// ‖L̇ − Σ(pᵢ − p) × fᵢ‖ by sample, % of m g · 0.3 m, with L = R I Rᵀ ω, or that of trunk and legs where these have mass.
fn euler(s: &Subject, torques: &[[f64; 3]]) -> Vec<f64> {
    let plan = s.plan;
    let differenced = |momenta: &[[f64; 3]], n: usize| {
        if n == 0 || n + 1 == s.samples {
            return 0.0;
        }
        norm(sub(scale(1.0 / s.step, sub(momenta[n], momenta[n - 1])), hat(torques, n)))
    };
    let percent = 100.0 / (s.weight * LEVER);
    if let Some(body) = &s.body {
        // The robot stands still at both ends, where only the torques have to vanish.
        let at_rest = |n: usize| if n == 0 || n + 1 == s.samples { norm(torques[n]) } else { 0.0 };
        let all = (0..s.samples).map(|n| percent * larger(differenced(&body.momentum, n), at_rest(n)));
        return all.collect();
    }
    // From orientations alone: the mean angular velocity between two samples, and the inertia halfway.
    let momenta: Vec<[f64; 3]> = plan
        .base_quaternion_wxyz
        .windows(2)
        .map(|q| {
            let turned = rotation_between(q[0], q[1]);
            let half_way = half_way(q[0], q[1]);
            inertia_times(s, half_way, scale(1.0 / s.step, turned))
        })
        .collect();
    (0..s.samples)
        .map(|n| {
            let (q, omega) = (plan.base_quaternion_wxyz[n], plan.base_angular_velocity[n]);
            let change = add(
                inertia_times(s, q, plan.base_angular_acceleration[n]),
                cross(omega, inertia_times(s, q, omega)),
            );
            let stated = norm(sub(change, torques[n]));
            percent * larger(stated, differenced(&momenta, n))
        })
        .collect()
}

/// What the plan states of its legs' mass against the postures.
fn legs(s: &Subject, findings: &mut Vec<Finding>) {
    let (Some(body), Some(stated)) = (&s.body, &s.plan.legs) else { return };
    let (mut shift, mut momentum) = (Worst::default(), Worst::default());
    for n in 0..s.samples {
        shift.meet(1e3 * norm(sub(stated.shift[n], body.shift[n])), n, None);
        // At both ends the robot is at rest.
        let halves = [n.checked_sub(1), Some(n)].map(|n| n.and_then(|n| body.momentum.get(n).copied()));
        let expected = match halves {
            [Some(a), Some(b)] => scale(0.5, add(a, b)),
            _ => [0.0; 3],
        };
        let off = norm(sub(stated.angular_momentum[n], expected));
        momentum.meet(100.0 * off / (s.weight * LEVER), n, None);
    }
    findings.push((laws::SHIFT, shift));
    findings.push((laws::MOMENTUM, momentum));
}

/// R I Rᵀ v.
fn inertia_times(s: &Subject, q: [f64; 4], v: [f64; 3]) -> [f64; 3] {
    let body = rotate_back(q, v);
    rotate(q, s.robot.inertia.map(|row| dot(row, body)))
}

fn half_way(a: [f64; 4], b: [f64; 4]) -> [f64; 4] {
    // −b is the same orientation; of the two, the nearer one.
    let sign = if (0..4).map(|i| a[i] * b[i]).sum::<f64>() < 0.0 { -1.0 } else { 1.0 };
    let sum: [f64; 4] = std::array::from_fn(|i| a[i] + sign * b[i]);
    let length = sum.iter().map(|v| v * v).sum::<f64>().sqrt();
    sum.map(|v| v / length)
}
