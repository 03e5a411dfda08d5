//! Refuses ways from start to goal that contradict themselves, and finds the horizon that a speed needs.

use std::f64::consts::TAU;

use super::format::Scenario;
use crate::Result;
use crate::input::Document;
use crate::robot::Robot;

/// Time for standing at both ends, and for speeding up and slowing down, s, for a robot of ANYmal's size.
const ENDS: f64 = 1.5;
/// By how much a given horizon may differ from that of the speed, s.
const SAME: f64 = 0.5;
/// Part of a turn that the ends of a circle may be off.
const OFF: f64 = 0.02;
/// A place nearer than this to the center of a circle is not on one, m.
const LEAST_RADIUS: f64 = 0.05;

/// Refuses headings that look like degrees, and way-points and circles that contradict themselves.
pub(super) fn check(document: &Document, scenario: &Scenario) -> Result<()> {
    headings(document, scenario)?;
    times(document, scenario)?;
    circle(document, scenario)
}

fn headings(document: &Document, scenario: &Scenario) -> Result<()> {
    let goal = &scenario.goal;
    let waypoints = goal.waypoints.iter().enumerate();
    let waypoints = waypoints.map(|(n, w)| (format!("goal.waypoints[{n}].yaw"), w.yaw));
    let ends = [("start.yaw".to_owned(), scenario.start.yaw), ("goal.yaw".to_owned(), goal.yaw)];
    for (key, yaw) in ends.into_iter().chain(waypoints) {
        if let Some(yaw) = yaw.filter(|yaw| yaw.abs() > TAU) {
            let what = format!("given {yaw}, allowed: -2π to 2π rad; {yaw}° are {:.4} rad", yaw.to_radians());
            return Err(document.error(&key, what));
        }
    }
    Ok(())
}

/// Times of way-points are within the motion, at samples, and in order.
fn times(document: &Document, scenario: &Scenario) -> Result<()> {
    let (horizon, step) = (scenario.horizon, scenario.time_step);
    let mut before: Option<(usize, f64)> = None;
    for (n, waypoint) in scenario.goal.waypoints.iter().enumerate() {
        let key = format!("goal.waypoints[{n}].time");
        let Some(time) = waypoint.time else {
            if waypoint.height.is_some() {
                let what = "only allowed with a time; give the way-point one, or remove it";
                return Err(document.error(&format!("goal.waypoints[{n}].height"), what));
            }
            continue;
        };
        if !(time > 0.0 && time < horizon) {
            let what = format!(
                "given {time} s, allowed: between 0 and the horizon of {horizon} s ({})",
                document.place("horizon")
            );
            return Err(document.error(&key, what));
        }
        let at = step * (time / step).round();
        if (time - at).abs() > 1e-6 {
            let what = format!(
                "given {time} s, allowed: a multiple of the time step of {step} s ({}), such as {}",
                document.place("time_step"),
                (1e9 * at).round() / 1e9
            );
            return Err(document.error(&key, what));
        }
        if let Some((m, earlier)) = before.filter(|(_, earlier)| *earlier >= time) {
            let what = format!(
                "given {time} s, not after {earlier} s ({}); way-points are passed in order",
                document.place(&format!("goal.waypoints[{m}].time"))
            );
            return Err(document.error(&key, what));
        }
        before = Some((n, time));
    }
    Ok(())
}

fn circle(document: &Document, scenario: &Scenario) -> Result<()> {
    let Some(circle) = &scenario.goal.circle else { return Ok(()) };
    if !scenario.goal.waypoints.is_empty() {
        let what = format!("given together with {}; give one of them", document.place("goal.waypoints"));
        return Err(document.error("goal.circle", what));
    }
    for (key, [x, y]) in
        [("start.position", scenario.start.position), ("goal.position", scenario.goal.position)]
    {
        let [u, v] = circle.center;
        if (x - u).hypot(y - v) < LEAST_RADIUS {
            let what = format!(
                "given [{u}, {v}], where the way cannot go around {} ([{x}, {y}])",
                document.place(key)
            );
            return Err(document.error("goal.circle.center", what));
        }
    }
    if let Some(turns) = circle.turns {
        let ends = circle.angle(scenario.start.position, scenario.goal.position) / TAU;
        if (turns - ends).abs() > OFF || ends.abs() < OFF {
            let what = format!(
                "given {turns}, which does not lead from {} to {}; {ends:.3} does, and so do whole turns more or less",
                document.place("start.position"),
                document.place("goal.position")
            );
            return Err(document.error("goal.circle.turns", what));
        }
    }
    Ok(())
}

/// Refuses a speed beside a horizon that is not the one that follows from it.
pub(super) fn check_speed(document: &Document, scenario: &Scenario, robot: &Robot) -> Result<()> {
    match (horizon(scenario, robot), scenario.goal.speed) {
        (Some(horizon), Some(speed))
            if document.has("horizon") && (scenario.horizon - horizon).abs() > SAME =>
        {
            let what = format!(
                "given {speed} m/s, with which the motion takes {horizon} s, but {} is {} s; remove one of them",
                document.place("horizon"),
                scenario.horizon
            );
            Err(document.error("goal.speed", what))
        }
        _ => Ok(()),
    }
}

/// The horizon that follows from the speed, where one is given, s: a multiple of the time step.
pub(super) fn horizon(scenario: &Scenario, robot: &Robot) -> Option<f64> {
    let speed = scenario.goal.speed?;
    let from_middle = robot.feet.iter().map(|foot| foot.nominal[0].hypot(foot.nominal[1]));
    let way = scenario.way_length();
    // A cycle that turns on its way is as long as one that does not.
    let turns = scenario.stops().is_empty() && !(scenario.gait.periodic && way > 0.0);
    let turn = if turns { scenario.turn().unwrap_or(0.0) } else { 0.0 };
    let length = way + turn.abs() * from_middle.fold(0.0, f64::max);
    let step = scenario.time_step;
    let steps = if scenario.gait.periodic {
        (length / speed / step).round()
    } else {
        ((length / speed + ENDS * robot.time_scale()) / step).ceil()
    };
    let seconds = step * steps;
    Some((1e9 * seconds).round() / 1e9)
}

#[cfg(test)]
mod tests {
    use crate::scenario::{load_text, parse};

    const TERRAIN: &str = "[terrain]\nkind = \"flat\"\n[start]\nposition = [0.0, 0.0]\n";

    fn refusal(goal: &str) -> String {
        parse("s.toml", &format!("{TERRAIN}{goal}")).expect_err(goal).to_string()
    }

    #[test]
    fn contradictions_are_refused_with_both_lines() {
        let goal = "[goal]\nposition = [1.0, 0.0]\n";
        let point = |rest: &str| format!("[[goal.waypoints]]\nposition = [0.5, 0.0]\n{rest}\n");
        for (rest, expected) in [
            (
                point("time = 11.0"),
                "s.toml:9: goal.waypoints[0].time: given 11 s, allowed: between 0 and the horizon of 10 s (horizon, by default)",
            ),
            (
                point("time = 1.01"),
                "s.toml:9: goal.waypoints[0].time: given 1.01 s, allowed: a multiple of the time step of 0.05 s (time_step, by default), such as 1",
            ),
            (
                point("time = 3.0") + &point("time = 2.0"),
                "s.toml:12: goal.waypoints[1].time: given 2 s, not after 3 s (goal.waypoints[0].time, line 9)",
            ),
            (point("height = 0.4"), "s.toml:9: goal.waypoints[0].height: only allowed with a time"),
            (point("yaw = 90.0"), "s.toml:9: goal.waypoints[0].yaw: given 90, allowed: -2π to 2π rad"),
            (
                "circle = { center = [0.5, 0.0], turns = 0.7 }\n".into(),
                "s.toml:7: goal.circle.turns: given 0.7, which does not lead from start.position, line 4 to goal.position, line 6; 0.500 does",
            ),
            (
                "circle = { center = [0.0, 0.0] }\n".into(),
                "s.toml:7: goal.circle.center: given [0, 0], where the way cannot go around start.position, line 4",
            ),
            (
                "circle = { center = [0.5, 1.0] }\n".to_owned() + &point(""),
                "s.toml:7: goal.circle: given together with goal.waypoints, line 8",
            ),
            ("circle = { center = [3.0, 0.0] }\n".into(), "s.toml:7: goal.circle: it leads over"),
        ] {
            let message = refusal(&format!("{goal}{rest}"));
            assert!(message.starts_with(expected), "{message}\nis not\n{expected}");
        }
        let outside = refusal(&format!("{goal}[[goal.waypoints]]\nposition = [9.0, 0.0]\n"));
        assert!(outside.starts_with("s.toml:8: goal.waypoints[0].position: given [9, 0], outside the terrain (terrain.extent, by default)"), "{outside}");
    }

    #[test]
    fn a_speed_sets_the_horizon_and_contradicts_another() {
        let text = format!("{TERRAIN}[goal]\nposition = [1.0, 0.0]\nspeed = 0.2\n");
        let load = |text: &str| load_text("s.toml", text, ".".as_ref(), &[]);
        let loaded = load(&text).unwrap();
        assert_eq!(loaded.scenario.horizon, 6.5);
        // The scenario in a plan has both, and they agree.
        assert_eq!(load(&loaded.effective_text).unwrap().scenario, loaded.scenario);
        let message = load(&format!("horizon = 20.0\n{text}")).unwrap_err().to_string();
        let expected = "s.toml:8: goal.speed: given 0.2 m/s, with which the motion takes 6.5 s, but horizon, line 1 is 20 s";
        assert!(message.starts_with(expected), "{message}");
    }
}
