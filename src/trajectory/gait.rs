//! Which foot stands when. Nominal switches are on samples, so that the piecewise linear forces and the base's acceleration have
//! their kinks at the same times. With `gait.optimize_durations` each switch may move within some room; see [`super::switches`].

use super::phase::{Stance, Swing};
use super::switches;
use crate::robot::Robot;
use crate::scenario::{GaitKind, Scenario};
use crate::{Error, Result};

/// Least time of standing at the start and at the end, s, in which the base accelerates and stops.
const STAND: f64 = 0.3;
/// Duration of a cycle, s, if neither the scenario nor the robot specifies one.
const CYCLE: f64 = 1.0;
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
        Self::new(scenario, &foot_names, robot.gait_cycle.unwrap_or(CYCLE))
    }

    /// The gait of a scenario for feet with these names. `cycle` is the duration of a cycle, s, if the scenario does not specify it.
    fn new(scenario: &Scenario, foot_names: &[String], cycle: f64) -> Result<Self> {
        let step = scenario.time_step;
        let intervals = (scenario.horizon / step).round() as usize;
        let gait = &scenario.gait;
        let feet = foot_names.len();
        let mut swings = match gait.kind {
            GaitKind::Stand => vec![Vec::new(); feet],
            GaitKind::Custom => custom(gait.phases.as_deref(), feet, step, intervals)?,
            kind => {
                let (offsets, duty) = pattern(kind, foot_names)?;
                let duty = gait.duty.unwrap_or(duty);
                cyclic(&offsets, duty, gait.cycle.unwrap_or(cycle), scenario.horizon, step)?
            }
        };
        if gait.optimize_durations {
            for (swings, name) in swings.iter_mut().zip(foot_names) {
                switches::make_room(swings, intervals, step, gait.duration_bounds)
                    .map_err(|what| Error::input(format!("gait.optimize_durations: foot {name}: {what}")))?;
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

/// The lift-off of each foot, as a fraction of the cycle, and the default duty factor.
fn pattern(kind: GaitKind, names: &[String]) -> Result<(Vec<f64>, f64)> {
    let (table, duty): ([f64; 4], f64) = match kind {
        // One foot at a time: LH, LF, RH, RF.
        GaitKind::Walk => ([0.25, 0.75, 0.0, 0.5], 0.75),
        GaitKind::Trot => ([0.0, 0.5, 0.5, 0.0], 0.6),
        GaitKind::Pace => ([0.0, 0.5, 0.0, 0.5], 0.6),
        GaitKind::Bound => ([0.0, 0.0, 0.5, 0.5], 0.6),
        GaitKind::Stand | GaitKind::Custom => unreachable!("handled by the caller"),
    };
    let order = ["LF", "RF", "LH", "RH"];
    let offsets = names
        .iter()
        .map(|name| {
            order.iter().position(|o| o == name).map(|i| table[i]).ok_or_else(|| {
                Error::input(format!(
                    "gait.kind: the built-in gaits are for feet named LF, RF, LH, RH, but the robot has a foot \"{name}\"; use kind = \"custom\" with phases"
                ))
            })
        })
        .collect::<Result<_>>()?;
    Ok((offsets, duty))
}

/// As many whole cycles as fit into the horizon with standing at both ends. The remaining time is divided between the ends.
fn cyclic(offsets: &[f64], duty: f64, cycle: f64, horizon: f64, step: f64) -> Result<Vec<Vec<Swing>>> {
    let swing = ((1.0 - duty) * cycle / step).round();
    if swing < SHORTEST_PHASE {
        return Err(Error::input(format!(
            "gait: a swing of {:.3} s (cycle {cycle} s, duty {duty}) is shorter than two time steps of {step} s; lengthen the cycle, lower the duty or the time_step",
            (1.0 - duty) * cycle
        )));
    }
    let last = offsets.iter().fold(0.0, |a: f64, &b| a.max(b)) + (1.0 - duty);
    // n cycles take n − 1 + last times the duration of one; the summand of 1e-9 absorbs rounding.
    let cycles = ((horizon - 2.0 * STAND) / cycle - last + 1.0 + 1e-9).floor();
    if cycles < 1.0 {
        return Err(Error::input(format!(
            "gait: no cycle of {cycle} s fits into the horizon of {horizon} s with {STAND} s of standing at both ends; lengthen the horizon or shorten gait.cycle"
        )));
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

/// The gait of tables of phase durations, s, one for each foot.
fn custom(phases: Option<&[Vec<f64>]>, feet: usize, step: f64, intervals: usize) -> Result<Vec<Vec<Swing>>> {
    let phases = phases.ok_or_else(|| {
        Error::input("gait.phases: kind = \"custom\" needs a table of phase durations for each foot, stance first, in s")
    })?;
    if phases.len() != feet {
        return Err(Error::input(format!(
            "gait.phases: there are {} tables, but the robot has {feet} feet",
            phases.len()
        )));
    }
    let swings = |(foot, durations): (usize, &Vec<f64>)| {
        custom_swings(durations, step, intervals)
            .map_err(|what| Error::input(format!("gait.phases[{foot}]{what}")))
    };
    phases.iter().enumerate().map(swings).collect()
}

/// The swings of a foot from the durations of its stances and swings in turn, s, stance first and last.
///
/// # Errors
/// The part of the message after `gait.phases[foot]`.
fn custom_swings(durations: &[f64], step: f64, intervals: usize) -> std::result::Result<Vec<Swing>, String> {
    if durations.len().is_multiple_of(2) {
        return Err(format!(
            ": {} durations; the number must be odd because a foot stands at the start and at the end",
            durations.len()
        ));
    }
    let mut switches = vec![0.0];
    let mut time = 0.0;
    for duration in durations {
        time += duration;
        switches.push((time / step).round());
    }
    if switches[durations.len()] != intervals as f64 {
        let horizon = intervals as f64 * step;
        return Err(format!(": the durations sum to {time} s, but the horizon is {horizon} s"));
    }
    for (j, pair) in switches.windows(2).enumerate() {
        if pair[1] < pair[0] + SHORTEST_PHASE {
            return Err(format!("[{j}]: {} s is shorter than two time steps of {step} s", durations[j]));
        }
    }
    Ok((1..durations.len()).step_by(2).map(|j| Swing::given(switches[j], switches[j + 1])).collect())
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
        assert!(gait.swings.iter().all(|s| s.len() == 9 && s.iter().all(|s| s.end - s.start == 5.0)));
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
    fn a_custom_table_must_fill_the_horizon() {
        let ok = "[gait]\nkind = \"custom\"\nphases = [[5.0, 0.5, 4.5], [10.0], [10.0], [10.0]]";
        let gait = Gait::new(&scenario(ok), &names(), 1.0).expect("a gait");
        assert_eq!(gait.swings[0], [Swing::given(100.0, 110.0)]);
        assert_eq!(gait.stances(0), [Stance { start: 0.0, end: 100.0 }, Stance { start: 110.0, end: 200.0 }]);
        let short = ok.replace("4.5", "4.0");
        assert!(Gait::new(&scenario(&short), &names(), 1.0).unwrap_err().to_string().contains("horizon"));
    }
}
