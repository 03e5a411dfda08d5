//! Refuses goals that are farther than the legs can carry the base within the horizon, before anything is solved.

use crate::robot::{Foot, Robot};
use crate::scenario::Scenario;
use crate::trajectory::Gait;
use crate::{Error, Result};

/// What a stance carries the base at most, as a multiple of the diagonal of the reach box, which turns and tilts with the base.
const ALLOWANCE: f64 = 1.2;
/// What a stance carries the base with ease, as a fraction of the reach box's chord along the way.
const WITH_EASE: f64 = 0.8;
/// The same for a gait that needs no more steps.
const UNHURRIED: f64 = 1.0;
/// Horizons longer than this are not proposed, s.
const LONGEST: f64 = 600.0;

/// Refuses a goal that no motion with one of these gaits can reach, and way-points too far apart for their times; the gaits are the ones
/// that may be planned with.
///
/// # Errors
/// [`Error::Key`], with a horizon that should do, if one is found.
pub fn ensure_within_range(scenario: &Scenario, robot: &Robot, gaits: &[(f64, Gait)]) -> Result<()> {
    if scenario.gait.optimize_durations {
        return Ok(());
    }
    ensure_times(scenario, robot, gaits)?;
    let distance = scenario.way_length();
    let most = carried_at_most(robot, gaits, [0.0, scenario.horizon], scenario.time_step);
    if distance <= most {
        return Ok(());
    }
    let proposal = match easy_horizon(scenario, robot, distance) {
        Some(horizon) => format!("set horizon to {horizon:.0} s or more, or bring the goal nearer"),
        None => "give the feet more steps (gait, horizon), or bring the goal nearer".into(),
    };
    let over = if scenario.stops().is_empty() { "" } else { ", along the way-points" };
    let what = format!(
        "{distance:.2} m from the start{over}; in {} s, with the steps of this gait, the legs carry the base {most:.2} m at most: {proposal}",
        scenario.horizon
    );
    Err(Error::key("goal.position", what))
}

/// How far one of the gaits carries the base between two times, s, at most; m.
fn carried_at_most(robot: &Robot, gaits: &[(f64, Gait)], times: [f64; 2], time_step: f64) -> f64 {
    let at_most = |foot: &Foot| 2.0 * ALLOWANCE * foot.reach.half_size[0].hypot(foot.reach.half_size[1]);
    let samples = times.map(|t| (t / time_step).round());
    gaits.iter().map(|(_, gait)| range(robot, gait, samples, at_most)).fold(0.0, f64::max)
}

/// Refuses way-points that are too far from the one before, or from start or goal, for their times.
fn ensure_times(scenario: &Scenario, robot: &Robot, gaits: &[(f64, Gait)]) -> Result<()> {
    let waypoints = &scenario.goal.waypoints;
    let places = std::iter::once((scenario.start.position, Some(0.0)))
        .chain(waypoints.iter().map(|w| (w.position, w.time)))
        .chain([(scenario.goal.position, Some(scenario.horizon))]);
    let name = |n: usize| match n {
        0 => "the start".to_owned(),
        n if n > waypoints.len() => "the goal".to_owned(),
        n => format!("goal.waypoints[{}]", n - 1),
    };
    let (mut before, mut length, mut last) = ((0, 0.0), 0.0, scenario.start.position);
    for (n, (place, time)) in places.enumerate() {
        length += (place[0] - last[0]).hypot(place[1] - last[1]);
        last = place;
        let Some(time) = time else { continue };
        // The whole way is judged with a proposal for its horizon.
        let (from, whole) = (before, before.0 == 0 && n > waypoints.len());
        before = (n, time);
        let way = std::mem::take(&mut length);
        let most = carried_at_most(robot, gaits, [from.1, time], scenario.time_step);
        if n == 0 || whole || way <= most {
            continue;
        }
        let what = format!(
            "{way:.2} m along the way after {}; from {} s to {time} s, with the steps of this gait, the legs carry the base {most:.2} m at most: allow more time, or bring them nearer",
            name(from.0),
            from.1
        );
        let key = if n > waypoints.len() {
            "goal.position".to_owned()
        } else {
            format!("goal.waypoints[{}].time", n - 1)
        };
        return Err(Error::key(key, what));
    }
    Ok(())
}

/// Whether the legs carry the base to the goal with steps not longer than the reach boxes.
pub fn is_unhurried(scenario: &Scenario, robot: &Robot, gait: &Gait) -> bool {
    scenario.gait.optimize_durations
        || carries(scenario, robot, gait, UNHURRIED) >= scenario.way_length() + turning(scenario, robot)
}

/// How far the feet go because the base turns, m.
fn turning(scenario: &Scenario, robot: &Robot) -> f64 {
    let from_middle = |foot: &Foot| foot.nominal[0].hypot(foot.nominal[1]);
    // A robot that follows a line turns with it; only a given turn counts.
    let turn = if scenario.stops().is_empty() { scenario.turn().unwrap_or(0.0) } else { 0.0 };
    turn.abs() * robot.feet.iter().map(from_middle).fold(0.0, f64::max)
}

/// How far a gait carries the base, m, if each stance carries it by a fraction of the reach box's chord along the way.
fn carries(scenario: &Scenario, robot: &Robot, gait: &Gait, fraction: f64) -> f64 {
    let first = scenario.stops().first().map_or(scenario.goal.position, |stop| stop.position);
    let [x, y] = [0, 1].map(|c| first[c] - scenario.start.position[c]);
    let (sin, cos) = (y.atan2(x) - scenario.start_yaw()).sin_cos();
    let chord = |half: [f64; 3]| 2.0 * (half[0] / cos.abs()).min(half[1] / sin.abs());
    range(robot, gait, [0.0, gait.intervals as f64], |foot| fraction * chord(foot.reach.half_size))
}

/// The shortest horizon, in whole seconds, in which the scenario's gait covers a distance with ease.
fn easy_horizon(scenario: &Scenario, robot: &Robot, distance: f64) -> Option<f64> {
    let mut longer = scenario.clone();
    longer.horizon = scenario.horizon.ceil();
    while longer.horizon < LONGEST {
        longer.horizon += 1.0;
        let gaits = Gait::choices(&longer, robot).ok()?;
        if gaits.iter().any(|(_, gait)| carries(&longer, robot, gait, WITH_EASE) >= distance) {
            return Some(longer.horizon);
        }
    }
    None
}

/// The longest way that the base can travel between two times, in samples, m, if a stance of a foot carries it by a given length: the time
/// is covered with stances, one after the other, such that their lengths sum to the least. Infinite if all feet are in the air at some time.
fn range(robot: &Robot, gait: &Gait, [begin, end]: [f64; 2], carried: impl Fn(&Foot) -> f64) -> f64 {
    let of_foot = |(i, foot): (usize, &Foot)| {
        let length = carried(foot);
        gait.stances(i).into_iter().map(move |stance| (stance.start, stance.end, length))
    };
    let stances: Vec<(f64, f64, f64)> = robot.feet.iter().enumerate().flat_map(of_foot).collect();
    // The least sum with which [0, t] is covered, for each end t of a stance, from the earliest on.
    let mut ends: Vec<f64> = stances.iter().map(|stance| stance.1).collect();
    ends.sort_by(f64::total_cmp);
    ends.dedup();
    let mut covered: Vec<(f64, f64)> = vec![(begin, 0.0)];
    for t in ends.into_iter().filter(|t| *t > begin) {
        let least = stances
            .iter()
            .filter(|stance| stance.1 >= t - 1e-9)
            .flat_map(|stance| {
                let before = covered.iter().filter(|(at, _)| *at >= stance.0 - 1e-9);
                before.map(|(_, sum)| sum + stance.2)
            })
            .fold(f64::INFINITY, f64::min);
        covered.push((t, least));
    }
    covered.iter().find(|(t, _)| *t >= end - 1e-9).map_or(f64::INFINITY, |(_, sum)| *sum)
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::scenario::load_text;

    fn loaded(horizon: f64, goal: f64, gait: &str) -> crate::scenario::LoadedScenario {
        let text = format!(
            "horizon = {horizon}\n[robot]\nname = \"anymal_towr\"\n[terrain]\nkind = \"flat\"\nextent = [-2.0, 40.0, -2.0, 2.0]\n\
             [start]\nposition = [0.0, 0.0]\n[goal]\nposition = [{goal}, 0.0]\n[gait]\n{gait}\n"
        );
        load_text("s.toml", &text, ".".as_ref(), &[]).expect("a scenario")
    }

    fn refusal(horizon: f64, goal: f64, gait: &str) -> Option<String> {
        let loaded = loaded(horizon, goal, gait);
        let gaits = Gait::choices(&loaded.scenario, &loaded.robot).expect("a gait");
        ensure_within_range(&loaded.scenario, &loaded.robot, &gaits).err().map(|e| e.to_string())
    }

    #[test]
    fn goals_out_of_range_are_refused_with_a_horizon_that_could_do() {
        for (horizon, goal) in [(10.0, 10.0), (2.0, 2.5)] {
            let message = refusal(horizon, goal, "").expect("a refusal");
            let proposed = message.split("set horizon to ").nth(1).and_then(|rest| rest.split(' ').next());
            let proposed: f64 = proposed.expect("a horizon").parse().expect("a number");
            assert!(
                proposed > horizon && proposed < 5.0 * horizon && refusal(proposed, goal, "").is_none(),
                "{message}"
            );
        }
        assert_eq!(refusal(10.0, 3.0, ""), None);
    }

    #[test]
    fn way_points_too_far_apart_for_their_times_are_refused() {
        let point = |x: f64, time: f64| format!("[[goal.waypoints]]\nposition = [{x}, 0.0]\ntime = {time}\n");
        let message = refusal(10.0, 2.0, &(point(0.2, 4.0) + &point(1.9, 5.0))).expect("a refusal");
        let expected =
            "goal.waypoints[1].time: 1.70 m along the way after goal.waypoints[0]; from 4 s to 5 s";
        assert!(message.starts_with(expected), "{message}");
        assert_eq!(refusal(10.0, 2.0, &(point(0.2, 4.0) + &point(0.5, 5.0))), None);
    }

    #[test]
    fn a_robot_that_stands_moves_within_its_reach_only() {
        assert!(refusal(5.0, 0.6, "kind = \"stand\"").is_some_and(|message| message.contains("more steps")));
        assert_eq!(refusal(5.0, 0.1, "kind = \"stand\""), None);
    }

    #[test]
    fn flight_has_no_such_limit() {
        let phases = "kind = \"custom\"\nphases = [[2.0, 0.3, 2.7], [2.0, 0.3, 2.7], [2.0, 0.3, 2.7], [2.0, 0.3, 2.7]]";
        assert_eq!(refusal(5.0, 3.0, phases), None);
    }
}
