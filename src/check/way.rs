//! The way: start, goal, way-points, fixed footholds, and the posture on it.

use super::laws;
use super::patches::stance_numbers;
use super::subject::{Finding, Subject, Worst, larger};
use super::vector::{dot, rotate};
use crate::scenario::Stop;

pub(super) fn findings(s: &Subject, findings: &mut Vec<Finding>) {
    ends(s, findings);
    stops(s, findings);
    heights(s, findings);
    posture(s, findings);
    fixed_footholds(s, findings);
}

/// Distance of the base from a place at a sample, seen from above, mm.
fn distance(s: &Subject, n: usize, [x, y]: [f64; 2]) -> f64 {
    let p = s.plan.base_position[n];
    1e3 * (p[0] - x).hypot(p[1] - y)
}

/// The base's x axis as a heading at a sample, rad.
fn heading(s: &Subject, n: usize) -> f64 {
    let [x, y, _] = rotate(s.plan.base_quaternion_wxyz[n], [1.0, 0.0, 0.0]);
    y.atan2(x)
}

/// The size of an angle, between 0 and π.
fn size(angle: f64) -> f64 {
    angle.sin().atan2(angle.cos()).abs()
}

fn ends(s: &Subject, findings: &mut Vec<Finding>) {
    let (scenario, last) = (s.scenario, s.samples - 1);
    let at = |value: f64, n: usize| {
        let mut worst = Worst::default();
        worst.meet(value, n, None);
        worst
    };
    findings.push((laws::START, at(distance(s, 0, scenario.start.position), 0)));
    findings.push((laws::GOAL, at(distance(s, last, scenario.goal.position), last)));
    // The base stands along the ground: its lateral axis, not its forward axis, is normal to the heading.
    let yaw = scenario.start_yaw();
    let axis = |axis: [f64; 3]| rotate(s.plan.base_quaternion_wxyz[0], axis);
    let toward = [yaw.cos(), yaw.sin(), 0.0];
    let [forward, left] = [[1.0, 0.0, 0.0], [0.0, 1.0, 0.0]].map(|a| dot(axis(a), toward));
    // With a given tilt, the whole orientation is a law of its own.
    if scenario.start.state.as_ref().is_none_or(|state| state.tilt.is_none()) {
        findings.push((laws::START_YAW, at(left.atan2(forward).abs(), 0)));
    }
    if let Some(yaw) = scenario.goal_yaw() {
        let mut off = size(heading(s, last) - yaw);
        if let (Some(_), Some(turn)) = (scenario.goal.turns, scenario.turn()) {
            // All of the turn, which the heading at the end does not show; the base may lean a little at the start.
            let step = |n: usize| {
                let change = heading(s, n) - heading(s, n - 1);
                change.sin().atan2(change.cos())
            };
            let turned: f64 = (1..s.samples).map(step).sum();
            let whole = ((turned - turn) / std::f64::consts::TAU).round();
            off += std::f64::consts::TAU * whole.abs();
        }
        findings.push((laws::GOAL_YAW, at(off, last)));
    }
}

/// Whether the stops are passed in order: those with a time then, the others as soon as the base is near enough.
fn stops(s: &Subject, findings: &mut Vec<Finding>) {
    let stops = s.scenario.stops();
    if stops.is_empty() {
        return;
    }
    let (mut missed, mut turned) = (Worst::default(), Worst::default());
    let mut from = 0;
    for stop in &stops {
        match stop.time {
            Some(time) => {
                let n = sample(s, time);
                missed.meet(distance(s, n, stop.position), n, None);
                if let Some(yaw) = stop.yaw {
                    turned.meet(size(heading(s, n) - yaw), n, None);
                }
                from = from.max(n);
            }
            None => {
                let beyond =
                    |n: usize| distance(s, n, stop.position) - 1e3 * s.scenario.goal.waypoint_distance;
                let near = (from..s.samples).find(|&n| beyond(n) <= 0.0);
                let nearest = || (from..s.samples).min_by(|&a, &b| beyond(a).total_cmp(&beyond(b)));
                let Some(n) = near.or_else(nearest) else { continue };
                missed.meet(beyond(n), n, None);
                from = n;
            }
        }
    }
    findings.push((laws::WAYPOINT, missed));
    if stops.iter().any(|stop| stop.time.is_some() && stop.yaw.is_some()) {
        findings.push((laws::WAYPOINT_YAW, turned));
    }
}

/// The sample at a time, s.
fn sample(s: &Subject, time: f64) -> usize {
    ((time / s.step).round() as usize).min(s.samples - 1)
}

/// Limits of the torso's posture.
fn posture(s: &Subject, findings: &mut Vec<Finding>) {
    let spec = &s.scenario.posture;
    let beyond =
        |value: f64, [least, greatest]: [f64; 2]| larger(larger(least - value, value - greatest), 0.0);
    if let Some(range) = spec.height {
        let mut worst = Worst::default();
        (0..s.samples).for_each(|n| worst.meet(1e3 * beyond(s.height_over_feet(n), range), n, None));
        findings.push((laws::POSTURE_HEIGHT, worst));
    }
    if spec.roll.is_some() || spec.pitch.is_some() {
        let mut worst = Worst::default();
        for n in 0..s.samples {
            let up = [[1.0, 0.0, 0.0], [0.0, 1.0, 0.0], [0.0, 0.0, 1.0]]
                .map(|axis| rotate(s.plan.base_quaternion_wxyz[n], axis)[2]);
            let (roll, pitch) = (up[1].atan2(up[2]), -up[0].clamp(-1.0, 1.0).asin());
            for (angle, range) in [(roll, spec.roll), (pitch, spec.pitch)] {
                worst.meet(range.map_or(0.0, |range| beyond(angle, range)), n, None);
            }
        }
        findings.push((laws::POSTURE_TILT, worst));
    }
}

/// Whether the stances whose footholds are given are there.
fn fixed_footholds(s: &Subject, findings: &mut Vec<Finding>) {
    if s.scenario.foothold.is_empty() {
        return;
    }
    let mut worst = Worst::default();
    for spec in &s.scenario.foothold {
        let at = s.plan.foot_names.iter().position(|name| *name == spec.foot).and_then(|e| {
            let (number, then) = (stance_numbers(s, e), sample(s, spec.time.unwrap_or(0.0)));
            let meant = |n: usize| spec.step.map_or(n == then, |step| number[n] == step);
            (0..s.samples).find(|&n| s.in_contact(n, e) && meant(n)).map(|n| (n, e))
        });
        match at {
            Some((n, e)) => {
                let [x, y, _] = s.foot_position(n, e);
                worst.meet(1e3 * (x - spec.position[0]).hypot(y - spec.position[1]), n, Some(e));
            }
            None => worst.meet(f64::INFINITY, 0, None),
        }
    }
    findings.push((laws::FIXED_FOOTHOLD, worst));
}

/// Heights over the feet where they are given.
fn heights(s: &Subject, findings: &mut Vec<Finding>) {
    let at_stop = |stop: &Stop| Some((sample(s, stop.time?), stop.height?));
    let at_goal = s.scenario.goal.height.map(|height| (s.samples - 1, height));
    let stops = s.scenario.stops();
    let mut worst = None;
    for (n, height) in stops.iter().filter_map(at_stop).chain(at_goal) {
        let worst = worst.get_or_insert_with(Worst::default);
        worst.meet(1e3 * (s.height_over_feet(n) - height).abs(), n, None);
    }
    findings.extend(worst.map(|worst| (laws::HEIGHT, worst)));
}
