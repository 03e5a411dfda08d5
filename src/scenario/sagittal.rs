//! Refuses ways that a robot cannot go whose feet move in planes of its base, as those of legs of two joints do.
//!
//! While such feet stand where they are, the base can move ahead, up and down, pitch and, with legs of different lengths, roll, but neither turn
//! nor leave its line by more than it rolls. So the way is a straight line, ahead or back, with one heading.

use super::format::Scenario;
use super::wrapped;
use crate::Result;
use crate::input::Document;
use crate::robot::{Foot, Robot};

/// How far a place may be beside the line, m, and a heading off, rad.
const BESIDE: f64 = 1e-3;
const TURNED: f64 = 1e-3;
/// How fast the base may move to the side at the end, m/s.
const ASIDE: f64 = 1e-3;

impl Robot {
    /// By foot, its radius, m, if it moves in a plane of the base; empty where none does.
    pub fn sagittal_radii(&self) -> Vec<Option<f64>> {
        let radius =
            |foot: &Foot| foot.leg.as_ref().filter(|leg| leg.is_sagittal()).map(|leg| leg.foot_radius);
        if self.is_sagittal() { self.feet.iter().map(radius).collect() } else { Vec::new() }
    }
}

/// Refuses a goal, a way-point, a heading or a velocity off the straight line.
pub(super) fn check(document: &Document, scenario: &Scenario, robot: &Robot) -> Result<()> {
    if !robot.is_sagittal() {
        return Ok(());
    }
    let goal = &scenario.goal;
    let refuse = |key: &str, what: String| {
        let why = format!(
            "{what}; legs of two joints take robot {} straight ahead or back, without turns",
            robot.name
        );
        Err(document.error(key, why))
    };
    if goal.circle.is_some() {
        return refuse("goal.circle", "given".into());
    }
    if let Some(turns) = goal.turns.filter(|turns| *turns != 0) {
        return refuse("goal.turns", format!("given {turns}"));
    }
    let heading = scenario.start_yaw();
    let ([x, y], (sin, cos)) = (scenario.start.position, heading.sin_cos());
    let beside = |[u, v]: [f64; 2]| cos * (v - y) - sin * (u - x);
    let off = |yaw: f64| wrapped(yaw - heading).abs() > TURNED;
    let waypoints = goal.waypoints.iter().enumerate().map(|(n, waypoint)| {
        let passed = if waypoint.time.is_some() { BESIDE } else { goal.waypoint_distance };
        (format!("goal.waypoints[{n}]"), waypoint.position, waypoint.yaw, passed)
    });
    for (key, place, yaw, most) in waypoints.chain([("goal".into(), goal.position, goal.yaw, BESIDE)]) {
        let aside = beside(place);
        if aside.abs() > most {
            let what = format!(
                "given [{}, {}], {:.3} m beside the line through start.position with the heading at the start, {heading:.4} rad",
                place[0],
                place[1],
                aside.abs()
            );
            return refuse(&format!("{key}.position"), what);
        }
        if let Some(yaw) = yaw.filter(|yaw| off(*yaw)) {
            return refuse(
                &format!("{key}.yaw"),
                format!("given {yaw}, the heading at the start is {heading:.4} rad"),
            );
        }
    }
    if let Some([u, v]) = goal.velocity.filter(|[u, v]| (cos * v - sin * u).abs() > ASIDE) {
        let what = format!(
            "given [{u}, {v}], of which {:.3} m/s is to the side of the heading at the start, {heading:.4} rad",
            (cos * v - sin * u).abs()
        );
        return refuse("goal.velocity", what);
    }
    Ok(())
}

#[cfg(test)]
mod tests {
    use std::path::Path;

    use crate::scenario::load_text;

    #[test]
    fn ways_that_legs_of_two_joints_cannot_go_are_refused() {
        let of = |robot: &str, ends: &str| {
            let text = format!("[terrain]\nkind = \"flat\"\n[robot]\nname = \"{robot}\"\n{ends}");
            load_text("s.toml", &text, Path::new("."), &[]).map_err(|e| e.to_string())
        };
        let way = |start: &str, goal: &str| {
            format!("[start]\nposition = [0.0, 0.0]\n{start}\n[goal]\nposition = [0.3, 0.3]\n{goal}\n")
        };
        let stop = |rest: &str| format!("[[goal.waypoints]]\n{rest}");
        for (start, goal, expected) in [
            ("yaw = 0.0", "", "s.toml:9: goal.position: given [0.3, 0.3], 0.300 m beside the line"),
            ("", "yaw = 0.0", "s.toml:10: goal.yaw: given 0, the heading at the start is 0.7854 rad"),
            ("", "turns = 1", "s.toml:10: goal.turns: given 1"),
            (
                "",
                "velocity = [0.2, 0.0]",
                "s.toml:10: goal.velocity: given [0.2, 0], of which 0.141 m/s is to the side",
            ),
            ("", "circle = { center = [0.0, 0.3] }", "s.toml:10: goal.circle: given"),
            ("", &stop("position = [0.1, 0.3]"), "goal.position: given [0.3, 0.3], 0.190 m beside the line"),
            (
                "yaw = 0.7853981634",
                &stop("position = [0.1, 0.3]"),
                "goal.waypoints[0].position: given [0.1, 0.3]",
            ),
            (
                "yaw = 0.7853981634",
                &stop("position = [0.15, 0.15]\nyaw = 1.0"),
                "goal.waypoints[0].yaw: given 1,",
            ),
        ] {
            let message = of("solo8", &way(start, goal)).expect_err(expected);
            assert!(message.contains(expected) && message.contains("straight ahead or back"), "{message}");
            assert!(!message.contains('\n'), "{message}");
            assert!(of("solo12", &way(start, goal)).is_ok(), "{goal}");
        }
        for (start, goal) in [
            ("", ""),
            ("yaw = -2.35619449", ""), // backward
            ("", "yaw = 0.7853981634"),
            ("", "velocity = [0.2, 0.2]"),
            ("yaw = 0.7853981634", "[[goal.waypoints]]\nposition = [0.12, 0.16]"),
        ] {
            of("solo8", &way(start, goal)).expect(goal);
        }
    }
}
