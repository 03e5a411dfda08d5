//! The state at the first and the last sample: at rest, as the scenario gives it, or in a cyclic motion the same.

use super::cycle;
use super::laws;
use super::subject::{Finding, Subject, Worst};
use super::vector::{norm, rotation_between, sub};
use crate::scenario::StartState;

/// Accelerations count as velocities over this time, s.
const TIME: f64 = 0.1;
/// Lever arm by which rotations are compared with motions, m.
const LEVER: f64 = 0.3;

pub(super) fn findings(s: &Subject, findings: &mut Vec<Finding>) {
    if s.scenario.gait.periodic {
        cycle::findings(s, findings);
        return;
    }
    rest(s, findings);
    if let Some(state) = &s.scenario.start.state {
        given(s, state, findings);
    }
}

/// By how much velocity, and acceleration over a tenth of a second, differ from what is asked for at both ends.
fn rest(s: &Subject, findings: &mut Vec<Finding>) {
    let plan = s.plan;
    let at_rest = StartState::default();
    let start = s.scenario.start.state.as_ref().unwrap_or(&at_rest);
    let last = s.samples - 1;
    let mut goal = [0.0; 3];
    if let Some([x, y]) = s.scenario.goal.velocity {
        // Up and down it follows the ground.
        goal = [x, y, plan.base_linear_velocity[last][2]];
    }
    let mut worst = Worst::default();
    for (n, velocity, state) in [(0, start.velocity, start), (last, goal, &at_rest)] {
        for (values, asked, factor) in [
            (&plan.base_linear_velocity, velocity, 1.0),
            (&plan.base_linear_acceleration, state.acceleration, TIME),
            (&plan.base_angular_velocity, state.angular_velocity, LEVER),
            (&plan.base_angular_acceleration, state.angular_acceleration, LEVER * TIME),
        ] {
            worst.meet(factor * norm(sub(values[n], asked)), n, None);
        }
        for e in 0..s.feet {
            let [at_start, at_end] = s.scenario.in_air(e);
            let in_air = if n == 0 { at_start } else { at_end };
            // A foot that is in the air there unasked is not at rest, whatever its velocity.
            worst.meet(f64::from(u8::from(s.in_contact(n, e) == in_air)), n, Some(e));
        }
    }
    findings.push((laws::REST, worst));
}

/// Height, orientation, feet and forces at the start, as far as they are given.
fn given(s: &Subject, state: &StartState, findings: &mut Vec<Finding>) {
    let plan = s.plan;
    let [mut place, mut turn, mut force] = [Worst::default(); 3];
    if let Some(height) = state.height {
        place.meet(1e3 * (plan.base_position[0][2] - height).abs(), 0, None);
    }
    if let Some([roll, pitch]) = state.tilt {
        let asked = quaternion(roll, pitch, s.scenario.start_yaw());
        turn.meet(norm(rotation_between(plan.base_quaternion_wxyz[0], asked)), 0, None);
    }
    for (e, foot) in state.feet.iter().flatten().enumerate().take(s.feet) {
        place.meet(1e3 * norm(sub(s.foot_position(0, e), *foot)), 0, Some(e));
    }
    for (e, asked) in state.forces.iter().flatten().enumerate().take(s.feet) {
        force.meet(100.0 / s.weight * norm(sub(s.foot_force(0, e), *asked)), 0, Some(e));
    }
    if let Some(velocities) = &state.feet_velocity {
        let mut worst = Worst::default();
        for (e, asked) in velocities.iter().enumerate().take(s.feet).filter(|(e, _)| !s.in_contact(0, *e)) {
            worst.meet(norm(sub(plan.foot_velocity[e], *asked)), 0, Some(e));
        }
        findings.push((laws::START_FEET, worst));
    }
    findings.push((laws::START_STATE, place));
    findings.push((laws::START_TURN, turn));
    findings.push((laws::START_FORCE, force));
}

/// Rz(yaw) Ry(pitch) Rx(roll).
fn quaternion(roll: f64, pitch: f64, yaw: f64) -> [f64; 4] {
    let half = |angle: f64| (0.5 * angle).sin_cos();
    let ((sr, cr), (sp, cp), (sy, cy)) = (half(roll), half(pitch), half(yaw));
    [
        cr * cp * cy + sr * sp * sy,
        sr * cp * cy - cr * sp * sy,
        cr * sp * cy + sr * cp * sy,
        cr * cp * sy - sr * sp * cy,
    ]
}

#[cfg(test)]
mod tests {
    use super::super::vector::rotate;
    use super::*;

    #[test]
    fn a_quaternion_turns_as_its_angles_say() {
        let q = quaternion(0.0, 0.0, 0.3);
        let x = rotate(q, [1.0, 0.0, 0.0]);
        assert!(norm(sub(x, [0.3_f64.cos(), 0.3_f64.sin(), 0.0])) < 1e-12, "{x:?}");
        // Pitch lowers the nose, then yaw turns it.
        let x = rotate(quaternion(0.4, 0.2, 0.3), [1.0, 0.0, 0.0]);
        let expected = [0.2_f64.cos() * 0.3_f64.cos(), 0.2_f64.cos() * 0.3_f64.sin(), -0.2_f64.sin()];
        assert!(norm(sub(x, expected)) < 1e-12, "{x:?}");
    }
}
