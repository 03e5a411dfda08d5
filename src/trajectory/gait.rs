//! Which foot stands when. Nominal switches are on samples, so that the piecewise linear forces and the base's acceleration have
//! their kinks at the same times. With `gait.optimize_durations` each switch may move within some room; see [`super::switches`].

use super::phase::{Stance, Swing};
use super::switches;
use crate::robot::Robot;
use crate::scenario::{Footholds, GaitKind, Scenario};
use crate::{Error, Result};

/// Least time of standing at the start and at the end, s, in which the base accelerates and stops.
const STAND: f64 = 0.3;
/// Duration of a cycle, s, if neither the scenario nor the robot specifies one.
const CYCLE: f64 = 1.0;
/// Lengths of a cycle that are tried besides the usual one, as fractions of it.
const SHORTER_CYCLES: [f64; 4] = [0.9, 0.8, 0.7, 0.6];
/// Length of the cycle of a walk over smooth ground, in the robot's own: swings last 0.21 of that, instead of 0.25 over patches.
const SMOOTH_WALK_CYCLE: f64 = 1.25;
/// Below this duty factor, all feet of a trot, pace or bound are in the air at times. (A little less, because of rounding.)
const LEAST_DUTY: f64 = 0.4999;
/// Shortest phase of a given gait, in time steps: with fewer, no sample is inside it.
const SHORTEST_PHASE: f64 = 2.0;

/// The swings of each foot.
#[derive(Clone, Debug, PartialEq)]
pub struct Gait {
    /// Number of time steps.
    pub intervals: usize,
    /// `swings[foot]`, in order of time.
    pub swings: Vec<Vec<Swing>>,
}

impl Gait {
    /// The gait of a scenario for its robot.
    ///
    /// # Errors
    /// If the gait does not fit the robot, the horizon or the time step, or its durations cannot be optimized.
    pub fn of(scenario: &Scenario, robot: &Robot) -> Result<Self> {
        let foot_names: Vec<String> = robot.feet.iter().map(|f| f.name.clone()).collect();
        Self::new(scenario, &foot_names, default_cycle(scenario, robot))
    }

    /// The gaits that a scenario allows, each with the length of its cycle as a fraction of the usual one: the usual one first, then
    /// those with more steps.
    ///
    /// # Errors
    /// Those of the usual one.
    pub fn choices(scenario: &Scenario, robot: &Robot) -> Result<Vec<(f64, Self)>> {
        let mut gaits = vec![(1.0, Self::of(scenario, robot)?)];
        let shorter = SHORTER_CYCLES.iter();
        gaits.extend(
            shorter
                .map_while(|&factor| Some((factor, Self::with_more_steps(scenario, robot, factor)?.ok()?))),
        );
        Ok(gaits)
    }

    /// The same with shorter cycles: more steps, with swings that last as long. None if the gait has no cycle, if
    /// the scenario gives its length or the duty factor, or if feet would stand for less than half of it: a trot would begin to jump.
    fn with_more_steps(scenario: &Scenario, robot: &Robot, factor: f64) -> Option<Result<Self>> {
        let gait = &scenario.gait;
        let cyclic = !matches!(gait.kind, GaitKind::Stand | GaitKind::Custom);
        if !cyclic || gait.cycle.is_some() || gait.duty.is_some() {
            return None;
        }
        let duty = 1.0 - (1.0 - default_duty(scenario)) / factor;
        if duty < LEAST_DUTY {
            return None;
        }
        let mut quicker = scenario.clone();
        quicker.gait.cycle = Some(factor * default_cycle(scenario, robot));
        quicker.gait.duty = Some(duty);
        Some(Self::of(&quicker, robot))
    }

    /// The gait of a scenario for feet named LF, RF, LH, RH (the built-in patterns) or in the robot's order (custom); `cycle` is the
    /// length of a cycle, s, where the scenario names none.
    ///
    /// # Errors
    /// [`Error::Key`] for a gait that the feet, the horizon or the time step do not allow.
    fn new(scenario: &Scenario, foot_names: &[String], cycle: f64) -> Result<Self> {
        let step = scenario.time_step;
        let intervals = (scenario.horizon / step).round() as usize;
        let gait = &scenario.gait;
        let feet = foot_names.len();
        let mut swings = match gait.kind {
            GaitKind::Stand => vec![Vec::new(); feet],
            GaitKind::Custom => custom(gait.phases.as_deref(), feet, step, intervals)?,
            kind => {
                let offsets = pattern(kind, foot_names)?;
                let duty = gait.duty.unwrap_or(default_duty(scenario));
                cyclic(&offsets, duty, gait.cycle.unwrap_or(cycle), scenario.horizon, step)?
            }
        };
        if gait.optimize_durations {
            for (swings, name) in swings.iter_mut().zip(foot_names) {
                switches::make_room(swings, intervals, step, gait.duration_bounds)
                    .map_err(|what| Error::key("gait.optimize_durations", format!("foot {name}: {what}")))?;
            }
        }
        Ok(Self { intervals, swings })
    }

    /// The stances of a foot in order of time, one more than its swings.
    pub fn stances(&self, foot: usize) -> Vec<Stance> {
        let swings = &self.swings[foot];
        (0..=swings.len())
            .map(|j| Stance {
                start: if j == 0 { 0.0 } else { swings[j - 1].end },
                end: if j == swings.len() { self.intervals as f64 } else { swings[j].start },
            })
            .collect()
    }
}

/// The lift-off of each foot, as a fraction of the cycle.
fn pattern(kind: GaitKind, names: &[String]) -> Result<Vec<f64>> {
    let table: [f64; 4] = match kind {
        // One foot at a time: LH, LF, RH, RF.
        GaitKind::Walk => [0.25, 0.75, 0.0, 0.5],
        GaitKind::Trot => [0.0, 0.5, 0.5, 0.0],
        GaitKind::Pace => [0.0, 0.5, 0.0, 0.5],
        GaitKind::Bound => [0.0, 0.0, 0.5, 0.5],
        GaitKind::Stand | GaitKind::Custom => unreachable!("handled by the caller"),
    };
    let order = ["LF", "RF", "LH", "RH"];
    names
        .iter()
        .map(|name| {
            order.iter().position(|o| o == name).map(|i| table[i]).ok_or_else(|| {
                let what = format!(
                    "the built-in gaits are for feet named LF, RF, LH, RH, but the robot has a foot \"{name}\"; use kind = \"custom\" with phases"
                );
                Error::key("gait.kind", what)
            })
        })
        .collect()
}

/// Whether a gait is a walk over smooth ground, in which all feet stand between the swings for a twelfth of the cycle: the base then
/// accelerates a third as much. Over patches, where the steps follow the ground, it would not, and swings would be quicker
/// (docs/results.md).
fn is_smooth_walk(scenario: &Scenario) -> bool {
    scenario.gait.kind == GaitKind::Walk && scenario.footholds() == Footholds::Anywhere
}

/// The fraction of a cycle that a foot stands.
fn default_duty(scenario: &Scenario) -> f64 {
    match scenario.gait.kind {
        GaitKind::Walk if is_smooth_walk(scenario) => 5.0 / 6.0,
        GaitKind::Walk => 0.75,
        _ => 0.6,
    }
}

/// The length of a cycle, s.
fn default_cycle(scenario: &Scenario, robot: &Robot) -> f64 {
    let cycle = robot.gait_cycle.unwrap_or(CYCLE);
    if is_smooth_walk(scenario) { SMOOTH_WALK_CYCLE * cycle } else { cycle }
}

/// As many whole cycles as fit into the horizon with standing at both ends. The remaining time is divided between the ends.
fn cyclic(offsets: &[f64], duty: f64, cycle: f64, horizon: f64, step: f64) -> Result<Vec<Vec<Swing>>> {
    let swing = ((1.0 - duty) * cycle / step).round();
    if swing < SHORTEST_PHASE {
        let what = format!(
            "a swing of {:.3} s (cycle {cycle} s, duty {duty}) is shorter than two time steps of {step} s; lengthen the cycle, or lower the duty or the time_step",
            (1.0 - duty) * cycle
        );
        return Err(Error::key("gait.cycle", what));
    }
    let last = offsets.iter().fold(0.0, |a: f64, &b| a.max(b)) + (1.0 - duty);
    // n cycles take n − 1 + last times the duration of one; the summand of 1e-9 absorbs rounding.
    let cycles = ((horizon - 2.0 * STAND) / cycle - last + 1.0 + 1e-9).floor();
    if cycles < 1.0 {
        let what = format!(
            "given {horizon} s, into which not one cycle of {cycle} s fits with {STAND} s of standing at both ends; lengthen it or shorten gait.cycle"
        );
        return Err(Error::key("horizon", what));
    }
    let begin = (horizon - (cycles - 1.0 + last) * cycle) / 2.0;
    Ok(offsets
        .iter()
        .map(|offset| {
            (0..cycles as usize)
                .map(|j| {
                    let start = ((begin + (j as f64 + offset) * cycle) / step).round();
                    Swing::given(start, start + swing)
                })
                .collect()
        })
        .collect())
}

/// Phase tables: alternating stance and swing durations per foot, stance first and last; they fill the horizon.
fn custom(phases: Option<&[Vec<f64>]>, feet: usize, step: f64, intervals: usize) -> Result<Vec<Vec<Swing>>> {
    let Some(phases) = phases.filter(|phases| phases.len() == feet) else {
        // Loading a scenario refuses this with file and line.
        return Err(Error::key("gait.phases", "kind = \"custom\" needs a row for each foot"));
    };
    let row = |(foot, durations): (usize, &Vec<f64>)| {
        let key = format!("gait.phases[{foot}]");
        if durations.len().is_multiple_of(2) {
            let what = format!(
                "given {} durations, allowed: an odd number, because a foot stands at the start and at the end",
                durations.len()
            );
            return Err(Error::key(key, what));
        }
        let mut edges = vec![0.0];
        let mut time = 0.0;
        for d in durations {
            time += d;
            edges.push((time / step).round());
        }
        edges[durations.len()] = intervals as f64;
        for (j, pair) in edges.windows(2).enumerate() {
            if pair[1] < pair[0] + SHORTEST_PHASE {
                let what =
                    format!("given {} s, which is shorter than two time steps of {step} s", durations[j]);
                return Err(Error::key(format!("{key}[{j}]"), what));
            }
        }
        Ok((1..durations.len()).step_by(2).map(|j| Swing::given(edges[j], edges[j + 1])).collect())
    };
    phases.iter().enumerate().map(row).collect()
}

#[cfg(test)]
mod tests {
    use super::*;

    fn names() -> Vec<String> {
        ["LF", "RF", "LH", "RH"].map(String::from).to_vec()
    }

    fn scenario(text: &str) -> Scenario {
        toml::from_str(&format!(
            "schema = 1\n{text}\n[terrain]\nkind = \"flat\"\n[start]\nposition = [0, 0]\n[goal]\nposition = [1, 0]\n"
        ))
        .expect("a scenario")
    }

    #[test]
    fn a_walk_swings_one_foot_at_a_time_and_stands_at_both_ends() {
        let gait = Gait::new(&scenario(""), &names(), 1.0).expect("a gait");
        assert_eq!(gait.intervals, 200);
        for k in 0..=200 {
            let swings = |swings: &[Swing]| swings.iter().any(|s| s.start < k as f64 && (k as f64) < s.end);
            let up = gait.swings.iter().filter(|foot| swings(foot)).count();
            assert!(up <= 1, "sample {k}: {up} feet in the air");
            if !(6..=194).contains(&k) {
                assert_eq!(up, 0);
            }
        }
        assert!(gait.swings.iter().all(|s| s.len() == 9 && s.iter().all(|s| s.end - s.start == 3.0)));
    }

    #[test]
    fn a_trot_moves_diagonal_pairs_together() {
        let gait = Gait::new(&scenario("[gait]\nkind = \"trot\"\ncycle = 0.8\nduty = 0.5"), &names(), 1.0)
            .expect("a gait");
        assert_eq!(gait.swings[0], gait.swings[3]);
        assert_eq!(gait.swings[1], gait.swings[2]);
        assert_ne!(gait.swings[0], gait.swings[1]);
    }

    #[test]
    fn shorter_cycles_do_not_make_a_trot_jump() {
        let robot = Robot::load(&crate::robot::RobotSpec::default(), ".".as_ref()).expect("a robot");
        let exists = |kind: &str, factor: f64| {
            let scenario = scenario(&format!("[gait]\nkind = \"{kind}\""));
            Gait::with_more_steps(&scenario, &robot, factor).is_some_and(|gait| gait.is_ok())
        };
        assert!(exists("trot", 0.8) && !exists("trot", 0.7));
        assert!(exists("walk", 0.6) && !exists("stand", 0.9));
    }

    #[test]
    fn a_custom_table_sets_the_switches() {
        let ok = "[gait]\nkind = \"custom\"\nphases = [[5.0, 0.5, 4.5], [10.0], [10.0], [10.0]]";
        let gait = Gait::new(&scenario(ok), &names(), 1.0).expect("a gait");
        assert_eq!(gait.swings[0], [Swing::given(100.0, 110.0)]);
        assert_eq!(gait.stances(0), [Stance { start: 0.0, end: 100.0 }, Stance { start: 110.0, end: 200.0 }]);
        for (from, to, key) in [
            ("5.0, 0.5, 4.5", "5.0, 5.0", "gait.phases[0]: given 2 durations"),
            ("5.0, 0.5, 4.5", "5.0, 0.05, 4.95", "gait.phases[0][1]: given 0.05 s"),
            (", [10.0]]", "]", "gait.phases: "),
        ] {
            let message = Gait::new(&scenario(&ok.replace(from, to)), &names(), 1.0).unwrap_err().to_string();
            assert!(message.starts_with(key), "{message}");
        }
    }
}
