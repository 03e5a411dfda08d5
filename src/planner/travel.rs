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

/// Refuses a goal that no motion with one of these gaits can reach; they are the ones that may be planned with.
///
/// # Errors
/// [`Error::Key`], with a horizon that should do, if one is found.
pub fn ensure_within_range(scenario: &Scenario, robot: &Robot, gaits: &[(f64, Gait)]) -> Result<()> {
    if scenario.gait.optimize_durations {
        return Ok(());
    }
    let [x, y] = way(scenario);
    let distance = x.hypot(y);
    let at_most = |foot: &Foot| 2.0 * ALLOWANCE * foot.reach.half_size[0].hypot(foot.reach.half_size[1]);
    let most = gaits.iter().map(|(_, gait)| range(robot, gait, at_most)).fold(0.0, f64::max);
    if distance <= most {
        return Ok(());
    }
    let proposal = match easy_horizon(scenario, robot, distance) {
        Some(horizon) => format!("set horizon to {horizon:.0} s or more, or bring the goal nearer"),
        None => "give the feet more steps (gait, horizon), or bring the goal nearer".into(),
    };
    let what = format!(
        "{distance:.2} m from the start; in {} s, with the steps of this gait, the legs carry the base {most:.2} m at most: {proposal}",
        scenario.horizon
    );
    Err(Error::key("goal.position", what))
}

/// Whether the legs carry the base to the goal with steps not longer than the reach boxes.
pub fn is_unhurried(scenario: &Scenario, robot: &Robot, gait: &Gait) -> bool {
    let [x, y] = way(scenario);
    scenario.gait.optimize_durations || carries(scenario, robot, gait, UNHURRIED) >= x.hypot(y)
}

/// How far a gait carries the base, m, if each stance carries it by a fraction of the reach box's chord along the way.
fn carries(scenario: &Scenario, robot: &Robot, gait: &Gait, fraction: f64) -> f64 {
    let [x, y] = way(scenario);
    let (sin, cos) = (y.atan2(x) - scenario.start_yaw()).sin_cos();
    let chord = |half: [f64; 3]| 2.0 * (half[0] / cos.abs()).min(half[1] / sin.abs());
    range(robot, gait, |foot| fraction * chord(foot.reach.half_size))
}

/// From the start to the goal, m.
fn way(scenario: &Scenario) -> [f64; 2] {
    [0, 1].map(|c| scenario.goal.position[c] - scenario.start.position[c])
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

/// The longest way that the base can travel, m, if a stance of a foot carries it by a given length: the horizon is covered with
/// stances, one after the other, such that their lengths sum to the least. Infinite if all feet are in the air at some time.
fn range(robot: &Robot, gait: &Gait, carried: impl Fn(&Foot) -> f64) -> f64 {
    let end = gait.intervals as f64;
    let of_foot = |(i, foot): (usize, &Foot)| {
        let length = carried(foot);
        gait.stances(i).into_iter().map(move |stance| (stance.start, stance.end, length))
    };
    let stances: Vec<(f64, f64, f64)> = robot.feet.iter().enumerate().flat_map(of_foot).collect();
    // The least sum with which [0, t] is covered, for each end t of a stance, from the earliest on.
    let mut ends: Vec<f64> = stances.iter().map(|stance| stance.1).collect();
    ends.sort_by(f64::total_cmp);
    ends.dedup();
    let mut covered: Vec<(f64, f64)> = vec![(0.0, 0.0)];
    for t in ends {
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
