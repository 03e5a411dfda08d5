//! The joints of legs that have mass: angles, speeds and torques.
//!
//! The torque of a motor is what accelerates the links below its joint and bears their weight, less what the ground's force does there:
//!
//! ```text
//!   τ_j = a_j · ( Σ_l (c_l − o_j) × m_l (c̈_l − g) + d/dt (R_l I_l R_lᵀ ω_l)  −  (p_i − o_j) × f_i )
//! ```
//!
//! a_j is the joint's axis and o_j a point of it; accelerations are differences over the steps before and after a sample, and f_i is
//! averaged over the same steps. At the first and the last sample, links count as not accelerated.

use super::laws;
use super::legs::{BodyMotion, spin};
use super::subject::{Finding, Subject, Worst};
use super::vector::{add, apply, cross, dot, product, scale, sub};

pub(super) fn findings(s: &Subject, findings: &mut Vec<Finding>) {
    let Some(body) = &s.body else { return };
    let stated = s.plan.legs.as_ref().and_then(|legs| legs.joints.as_ref());
    let (mut position, mut torque) = (Worst::default(), Worst::default());
    let (mut range, mut speed, mut greatest) = (Worst::default(), Worst::default(), Worst::default());
    for (n, e) in s.sample_feet() {
        let at = n * s.feet + e;
        let (angles, torques) = (&body.angles[at], motor_torques(s, body, n, e));
        let joints = &s.robot.legs[e].joints;
        for (joint, j) in joints.iter().zip(angles.len() - joints.len()..) {
            let [least, most] = joint.range;
            let beyond = (least - angles[j]).max(angles[j] - most).max(0.0);
            range.meet(if angles[j].is_nan() { f64::NAN } else { 1e3 * beyond }, n, Some(e));
            if n > 0 {
                let moved = (angles[j] - body.angles[at - s.feet][j]).abs() / s.step;
                speed.meet(100.0 * moved / joint.speed_limit, n, Some(e));
            }
            greatest.meet(100.0 * torques[j].abs() / joint.torque_limit, n, Some(e));
            if let Some(stated) = stated {
                let place = (at + 1) * stated.joints - angles.len() + j;
                position.meet(1e3 * (stated.position[place] - angles[j]).abs(), n, Some(e));
                let off = (stated.torque[place] - torques[j]).abs();
                torque.meet(100.0 * off / joint.torque_limit, n, Some(e));
            }
        }
    }
    if stated.is_some() {
        findings.extend([(laws::JOINT_POSITION, position), (laws::JOINT_TORQUE, torque)]);
    }
    findings.extend([
        (laws::JOINT_RANGE, range),
        (laws::JOINT_SPEED_LIMIT, speed),
        (laws::JOINT_TORQUE_LIMIT, greatest),
    ]);
}

/// N m.
fn motor_torques(s: &Subject, body: &BodyMotion, n: usize, e: usize) -> Vec<f64> {
    let last = s.samples - 1;
    let place = |n: usize, point: [f64; 3]| {
        add(s.plan.base_position[n], apply(&body.turns[n], sub(point, body.shift[n])))
    };
    let [before, after] = [n.saturating_sub(1), (n + 1).min(last)];
    let force = scale(
        1.0 / 6.0,
        add(add(s.foot_force(before, e), scale(4.0, s.foot_force(n, e))), s.foot_force(after, e)),
    );
    // Of each link: where it is, the force on it, and the rate of its spin.
    let joints = body.angles[n * s.feet + e].len();
    let load = |l: usize| {
        let link = &body.links[n][l];
        let here = place(n, link.center);
        let (mut acceleration, mut rate) = (scale(-1.0, s.robot.gravity), [0.0; 3]);
        if 0 < n && n < last {
            let [a, b] = [before, after].map(|n| place(n, body.links[n][l].center));
            let bent = add(sub(a, scale(2.0, here)), b);
            acceleration = add(acceleration, scale(s.step.powi(-2), bent));
            let [earlier, now, later] =
                [before, n, after].map(|n| product(&body.turns[n], &body.links[n][l].turn));
            let spins = [(&earlier, &now), (&now, &later)].map(|(a, b)| spin(&link.inertia, a, b, s.step));
            rate = scale(1.0 / s.step, sub(spins[1], spins[0]));
        }
        (here, scale(link.mass, acceleration), rate)
    };
    let loads: Vec<_> = (0..joints).map(|j| load(body.first_link[e] + j)).collect();
    let torque = |j: usize| {
        let (point, axis) = body.axes[n][body.first_link[e] - 1 + j];
        let origin = place(n, point);
        let borne = loads[j..].iter().fold([0.0; 3], |sum, (place, force, rate)| {
            add(add(sum, cross(sub(*place, origin), *force)), *rate)
        });
        let by_ground = cross(sub(s.foot_position(n, e), origin), force);
        dot(apply(&body.turns[n], axis), sub(borne, by_ground))
    };
    (0..joints).map(torque).collect()
}
