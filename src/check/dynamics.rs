//! The laws of motion (Eq. 2), and whether the plan's velocities and accelerations are derivatives of its positions.
//!
//! Each law is evaluated twice: at every sample with the plan's own accelerations, and from positions and orientations
//! alone. A second difference equals the acceleration averaged with a hat of half width h,
//! p(t−h) − 2p(t) + p(t+h) = h² ∫ hat(s) p̈(t+s) ds, so that the law holds for it with the forces averaged by the same
//! hat; Simpson's rule (1, 4, 1)/6 does this to fourth order. The larger residual counts.

use super::laws;
use super::subject::{Finding, Residuals, Subject, Worst, rms};
use super::vector::{add, cross, dot, norm, rotate, rotate_back, scale, sub};

/// Lever arm by which torques are compared with the weight, m.
const LEVER: f64 = 0.3;

pub(super) fn findings(s: &Subject, findings: &mut Vec<Finding>, residuals: &mut Residuals) {
    let forces: Vec<[f64; 3]> = (0..s.samples).map(|n| total_force(s, n)).collect();
    let torques: Vec<[f64; 3]> = (0..s.samples).map(|n| total_torque(s, n)).collect();

    residuals.newton = newton(s, &forces);
    report(findings, laws::NEWTON_RMS, laws::NEWTON_MAX, &residuals.newton);
    residuals.euler = euler(s, &torques);
    report(findings, laws::EULER_RMS, laws::EULER_MAX, &residuals.euler);
    consistency(s, findings);
    quaternions(s, findings);
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

/// Σf + m g.
fn total_force(s: &Subject, n: usize) -> [f64; 3] {
    let robot = &s.plan.meta.robot;
    (0..s.feet).fold(scale(robot.mass, robot.gravity), |sum, e| add(sum, s.foot_force(n, e)))
}

/// Σ(pᵢ − p) × fᵢ.
fn total_torque(s: &Subject, n: usize) -> [f64; 3] {
    let base = s.plan.base_position[n];
    (0..s.feet).fold([0.0; 3], |sum, e| add(sum, cross(sub(s.foot_position(n, e), base), s.foot_force(n, e))))
}

/// (1, 4, 1)/6 around sample n.
fn hat(values: &[[f64; 3]], n: usize) -> [f64; 3] {
    scale(1.0 / 6.0, add(add(values[n - 1], scale(4.0, values[n])), values[n + 1]))
}

/// ‖m p̈ − Σf − m g‖ by sample, % of m g.
fn newton(s: &Subject, forces: &[[f64; 3]]) -> Vec<f64> {
    let (mass, p) = (s.plan.meta.robot.mass, &s.plan.base_position);
    (0..s.samples)
        .map(|n| {
            let stated = norm(sub(scale(mass, s.plan.base_linear_acceleration[n]), forces[n]));
            let differenced = if n == 0 || n + 1 == s.samples {
                0.0
            } else {
                let acceleration = scale(s.step.powi(-2), add(sub(p[n - 1], scale(2.0, p[n])), p[n + 1]));
                norm(sub(scale(mass, acceleration), hat(forces, n)))
            };
            100.0 * stated.max(differenced) / s.weight
        })
        .collect()
}

/// ‖L̇ − Σ(pᵢ − p) × fᵢ‖ by sample, % of m g · 0.3 m, with L = R I Rᵀ ω.
fn euler(s: &Subject, torques: &[[f64; 3]]) -> Vec<f64> {
    let plan = s.plan;
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
            let differenced = if n == 0 || n + 1 == s.samples {
                0.0
            } else {
                norm(sub(scale(1.0 / s.step, sub(momenta[n], momenta[n - 1])), hat(torques, n)))
            };
            100.0 * stated.max(differenced) / (s.weight * LEVER)
        })
        .collect()
}

/// R I Rᵀ v.
fn inertia_times(s: &Subject, q: [f64; 4], v: [f64; 3]) -> [f64; 3] {
    let body = rotate_back(q, v);
    rotate(q, s.plan.meta.robot.inertia.map(|row| dot(row, body)))
}

/// The rotation vector (world) that turns orientation a into b.
fn rotation_between(a: [f64; 4], b: [f64; 4]) -> [f64; 3] {
    // b a⁻¹
    let (ua, ub) = ([a[1], a[2], a[3]], [b[1], b[2], b[3]]);
    let w = b[0] * a[0] + dot(ub, ua);
    let v = sub(sub(scale(a[0], ub), scale(b[0], ua)), cross(ub, ua));
    let sine = norm(v);
    // The factor angle/sin(angle/2) tends to 2.
    let factor = if sine < 1e-9 { 2.0 } else { 2.0 * sine.atan2(w.abs()) / sine };
    scale(if w < 0.0 { -factor } else { factor }, v)
}

fn half_way(a: [f64; 4], b: [f64; 4]) -> [f64; 4] {
    // −b is the same orientation; of the two, the nearer one.
    let sign = if (0..4).map(|i| a[i] * b[i]).sum::<f64>() < 0.0 { -1.0 } else { 1.0 };
    let sum: [f64; 4] = std::array::from_fn(|i| a[i] + sign * b[i]);
    let length = sum.iter().map(|v| v * v).sum::<f64>().sqrt();
    sum.map(|v| v / length)
}

/// Whether velocities and accelerations are derivatives: central differences against the Simpson mean.
fn consistency(s: &Subject, findings: &mut Vec<Finding>) {
    let plan = s.plan;
    let gravity = norm(plan.meta.robot.gravity);
    let inner = 1..s.samples - 1;
    let difference = |values: &[[f64; 3]], n: usize| scale(0.5 / s.step, sub(values[n + 1], values[n - 1]));

    let linear: Vec<f64> = inner
        .clone()
        .map(|n| {
            let acceleration =
                sub(difference(&plan.base_linear_velocity, n), hat(&plan.base_linear_acceleration, n));
            // A velocity error over a tenth of a second counts as an error of acceleration, so that one figure covers both.
            let velocity = sub(difference(&plan.base_position, n), hat(&plan.base_linear_velocity, n));
            100.0 * norm(acceleration).max(norm(velocity) / 0.1) / gravity
        })
        .collect();
    findings.push((laws::LINEAR_CONSISTENCY, Worst::overall(rms(&linear))));

    let q = &plan.base_quaternion_wxyz;
    let angular: Vec<f64> = inner
        .clone()
        .map(|n| {
            let acceleration =
                sub(difference(&plan.base_angular_velocity, n), hat(&plan.base_angular_acceleration, n));
            let turned = scale(0.5 / s.step, rotation_between(q[n - 1], q[n + 1]));
            let velocity = sub(turned, hat(&plan.base_angular_velocity, n));
            norm(acceleration).max(norm(velocity) / 0.1)
        })
        .collect();
    findings.push((laws::ANGULAR_CONSISTENCY, Worst::overall(rms(&angular))));

    let mut worst = Worst::default();
    for n in inner {
        for e in 0..s.feet {
            let at = |values: &[[f64; 3]], n: usize| values[n * s.feet + e];
            let v = &plan.foot_velocity;
            let mean = scale(1.0 / 6.0, add(add(at(v, n - 1), scale(4.0, at(v, n))), at(v, n + 1)));
            let moved = scale(0.5 / s.step, sub(s.foot_position(n + 1, e), s.foot_position(n - 1, e)));
            worst.meet(norm(sub(moved, mean)), n, Some(e));
        }
    }
    findings.push((laws::FOOT_CONSISTENCY, worst));
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
