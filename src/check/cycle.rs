//! The end of a cyclic motion against its start: the same, but for the shift from start to goal and the turn to the goal's yaw.

use super::laws;
use super::subject::{Finding, Subject, Worst};
use super::vector::{add, norm, rotate, sub};

/// Accelerations count as velocities over this time, s.
const TIME: f64 = 0.1;
/// Lever arm by which rotations are compared with motions, m.
const LEVER: f64 = 0.3;

pub(super) fn findings(s: &Subject, findings: &mut Vec<Finding>) {
    let (plan, scenario, last) = (s.plan, s.scenario, s.samples - 1);
    let turn = scenario.turn().unwrap_or(0.0);
    let about_vertical = [(0.5 * turn).cos(), 0.0, 0.0, (0.5 * turn).sin()];
    let turned = |v: [f64; 3]| rotate(about_vertical, v);
    let on_ground = |[x, y]: [f64; 2]| [x, y, s.ground.height(x, y)];
    let (from, to) = (on_ground(scenario.start.position), on_ground(scenario.goal.position));
    let moved = |p: [f64; 3]| add(to, turned(sub(p, from)));

    let [mut place, mut tilt, mut motion, mut force] = [Worst::default(); 4];
    place.meet(1e3 * norm(sub(plan.base_position[last], moved(plan.base_position[0]))), last, None);
    for axis in [[1.0, 0.0, 0.0], [0.0, 1.0, 0.0], [0.0, 0.0, 1.0]] {
        let [start, end] = [0, last].map(|n| rotate(plan.base_quaternion_wxyz[n], axis));
        tilt.meet(norm(sub(end, turned(start))), last, None);
    }
    for (values, factor) in [
        (&plan.base_linear_velocity, 1.0),
        (&plan.base_linear_acceleration, TIME),
        (&plan.base_angular_velocity, LEVER),
        (&plan.base_angular_acceleration, LEVER * TIME),
    ] {
        motion.meet(factor * norm(sub(values[last], turned(values[0]))), last, None);
    }
    for e in 0..s.feet {
        let [start, end] = [0, last].map(|n| s.foot_position(n, e));
        place.meet(1e3 * norm(sub(end, moved(start))), last, Some(e));
        let [start, end] = [e, last * s.feet + e].map(|at| plan.foot_velocity[at]);
        motion.meet(norm(sub(end, turned(start))), last, Some(e));
        let [start, end] = [0, last].map(|n| s.foot_force(n, e));
        force.meet(100.0 / s.weight * norm(sub(end, turned(start))), last, Some(e));
        if s.in_contact(0, e) != s.in_contact(last, e) {
            place.meet(f64::INFINITY, last, Some(e));
        }
    }
    findings.push((laws::CYCLE, place));
    findings.push((laws::CYCLE_TURN, tilt));
    findings.push((laws::CYCLE_MOTION, motion));
    findings.push((laws::CYCLE_FORCE, force));
}
