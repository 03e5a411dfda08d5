//! Which foot stands when. Nominal switches are on samples, so that the piecewise linear forces and the base's acceleration have
//! their kinks at the same times. With `gait.optimize_durations` each switch may move within some room; see [`super::switches`].

use super::cadence::{Cadence, Window};
use super::cyclic;
use super::footfall::lift_offs;
use super::phase::{SHORTEST_PHASE, Stance, Swing};
use super::switches;
use crate::robot::Robot;
use crate::scenario::{GaitKind, Scenario, SectionSpec, section_key};
use crate::{Error, Result};

/// Least time of standing at the start and at the end, s, in which the base accelerates and stops, for a robot of ANYmal's size.
const STAND: f64 = 0.3;
/// The same on each side of the change from one gait to another.
const CHANGE: f64 = 0.1;
/// Tolerance for durations given in decimal, s.
const ROUNDING: f64 = 1e-9;
/// Lengths of a cycle that are tried besides the usual one, as fractions of it.
const SHORTER_CYCLES: [f64; 4] = [0.9, 0.8, 0.7, 0.6];
/// Below this duty factor, all feet of a trot, pace or bound are in the air at times. (A little less, because of rounding.)
const LEAST_DUTY: f64 = 0.4999;

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
    /// [`Error::Key`] for a gait that the feet, the horizon or the time step do not allow, or whose durations cannot be optimized.
    pub fn of(scenario: &Scenario, robot: &Robot) -> Result<Self> {
        Self::with_cycles(scenario, robot, 1.0)
    }

    /// The gaits that a scenario allows, each with the length of its cycle as a fraction of the usual one: the usual one first, then
    /// those with more steps.
    ///
    /// # Errors
    /// Those of the usual one.
    pub fn choices(scenario: &Scenario, robot: &Robot) -> Result<Vec<(f64, Self)>> {
        let mut gaits = vec![(1.0, Self::of(scenario, robot)?)];
        let possible = |factor: &&f64| has_shorter_cycles(scenario, robot, **factor);
        let shorter = SHORTER_CYCLES.iter().take_while(possible);
        gaits.extend(
            shorter.map_while(|&factor| Some((factor, Self::with_cycles(scenario, robot, factor).ok()?))),
        );
        Ok(gaits)
    }

    /// With cycles of a fraction of the usual length where the scenario leaves it open: more steps, with swings that last as long.
    fn with_cycles(scenario: &Scenario, robot: &Robot, fraction: f64) -> Result<Self> {
        let step = scenario.time_step;
        let intervals = (scenario.horizon / step).round() as usize;
        let gait = &scenario.gait;
        let feet = robot.feet.len();
        let mut swings = match gait.kind {
            GaitKind::Custom => custom(scenario, feet, step, intervals)?,
            _ if gait.periodic => periodic(scenario, robot, fraction)?,
            _ => sequence(scenario, robot, fraction)?,
        };
        if gait.optimize_durations {
            let farthest = switches::FARTHEST * robot.time_scale();
            for (swings, foot) in swings.iter_mut().zip(&robot.feet) {
                switches::make_room(swings, intervals, step, gait.duration_bounds, farthest).map_err(
                    |what| Error::key("gait.optimize_durations", format!("foot {}: {what}", foot.name)),
                )?;
            }
        }
        Ok(Self { intervals, swings })
    }

    /// The stances of a foot in order of time, one more than its swings. Beside a swing over the start or the end, that beyond it has no
    /// duration.
    pub fn stances(&self, foot: usize) -> Vec<Stance> {
        let swings = &self.swings[foot];
        (0..=swings.len())
            .map(|j| Stance {
                start: j.checked_sub(1).map_or_else(
                    || swings.first().map_or(0.0, |s| s.start.min(0.0)),
                    |before| swings[before].end,
                ),
                end: swings.get(j).map_or_else(
                    || swings.last().map_or(0.0, |s| s.end).max(self.intervals as f64),
                    |after| after.start,
                ),
            })
            .collect()
    }
}

/// Whether cycles of a fraction of the usual length are another gait: one whose cycles and duty factors the scenario leaves open, and in
/// which feet still stand for half of it: else a trot would begin to jump.
fn has_shorter_cycles(scenario: &Scenario, robot: &Robot, fraction: f64) -> bool {
    let sections = scenario.gait.sections();
    let mut open = sections.iter().filter(|section| Cadence::is_open(section)).peekable();
    let stands =
        |section: &SectionSpec| Cadence::of(section, scenario, robot).with_cycle(fraction).duty >= LEAST_DUTY;
    open.peek().is_some() && open.all(stands)
}

/// The swings of each foot of a cyclic motion.
fn periodic(scenario: &Scenario, robot: &Robot, fraction: f64) -> Result<Vec<Vec<Swing>>> {
    let gait = &scenario.gait;
    let section = &gait.sections()[0];
    let keyed = |e: Error| match e {
        Error::Key { key, what } => Error::key(section_key(gait, 0, &key), what),
        other => other,
    };
    let mut cadence = Cadence::of(section, scenario, robot);
    if Cadence::is_open(section) {
        cadence = cadence.with_cycle(fraction);
    }
    // Whole cycles.
    let cycle = scenario.horizon / scenario.cycles(section, cadence.cycle);
    let (step, cadence) = (scenario.time_step, Cadence { cycle, ..cadence });
    let lift_offs = lift_offs(section.kind, robot).map_err(keyed)?;
    let intervals = (scenario.horizon / step).round() as usize;
    cyclic::swings(&cadence, &lift_offs, intervals, step).map_err(keyed)
}

/// The swings of each foot, section by section.
fn sequence(scenario: &Scenario, robot: &Robot, fraction: f64) -> Result<Vec<Vec<Swing>>> {
    let gait = &scenario.gait;
    let sections = gait.sections();
    let ends = gait.section_ends(scenario.horizon);
    let change = CHANGE * robot.time_scale();
    // Feet in the air at the start land first.
    let mut swings: Vec<Vec<Swing>> = (0..robot.feet.len())
        .map(|foot| Ok(begun(scenario, foot)?.into_iter().collect()))
        .collect::<Result<_>>()?;
    let landed = swings.iter().flatten().map(|s| s.end * scenario.time_step + change).fold(0.0, f64::max);
    for (n, section) in sections.iter().enumerate().filter(|(_, section)| section.kind.is_cyclic()) {
        let keyed = |e: Error| match e {
            Error::Key { key, what } if key != "horizon" => Error::key(section_key(gait, n, &key), what),
            Error::Key { what, .. } if gait.sequence.is_some() => {
                Error::key(section_key(gait, n, "duration"), what)
            }
            other => other,
        };
        let mut cadence = Cadence::of(section, scenario, robot);
        if Cadence::is_open(section) {
            cadence = cadence.with_cycle(fraction);
        }
        let alone = |neighbor: Option<&SectionSpec>| neighbor.is_none_or(|s| !s.kind.is_cyclic());
        // At ends at rest, beside a section that stands, and where the robot goes on moving.
        let stand = |(neighbor, moves): (Option<&SectionSpec>, bool)| match neighbor {
            None if !moves => STAND * robot.time_scale(),
            Some(_) if alone(neighbor) => 0.0,
            _ => change,
        };
        let mut window = Window {
            from: if n == 0 { 0.0 } else { ends[n - 1] },
            to: ends[n],
            stand: [
                (n.checked_sub(1).map(|n| &sections[n]), scenario.start.moves()),
                (sections.get(n + 1), scenario.goal.velocity.is_some()),
            ]
            .map(stand),
        };
        if n == 0 {
            window.stand[0] = window.stand[0].max(landed);
        }
        let lift_offs = lift_offs(section.kind, robot).map_err(keyed)?;
        let more = cadence.swings(&lift_offs, &window, scenario.time_step).map_err(keyed)?;
        for (swings, more) in swings.iter_mut().zip(more) {
            let stance = swings
                .last()
                .zip(more.first())
                .map(|(before, after): (&Swing, &Swing)| after.start - before.end);
            if stance.is_some_and(|stance| stance < SHORTEST_PHASE) {
                let what = "leaves a foot less than two time steps of standing before this section; lengthen the section before it";
                return Err(Error::key(section_key(gait, n, "kind"), what));
            }
            swings.extend(more);
        }
    }
    Ok(swings)
}

/// The swing that a foot is in at the start, if the state there has it in the air.
fn begun(scenario: &Scenario, foot: usize) -> Result<Option<Swing>> {
    let step = scenario.time_step;
    let Some([since, left]) = scenario.start.swing(foot) else { return Ok(None) };
    // Rounding must not move a touch-down off the samples of plans, which are ten in a time step.
    let samples = switches::snapped(10.0 * left / step);
    let given = |why: String| {
        Err(Error::key(format!("start.state.swings[{foot}]"), format!("given [{since}, {left}], {why}")))
    };
    if samples < 1.0 {
        return given(format!(
            "but a plan has no sample before the foot lands; allowed: it lands after at least {} s, a tenth of the time_step of {step} s",
            shown(0.1 * step)
        ));
    }
    if since + left < SHORTEST_PHASE * step - ROUNDING {
        return given(format!("a swing of {} s, which {}", shown(since + left), too_short(step)));
    }
    Ok(Some(Swing::given(-since / step, samples / 10.0)))
}

/// What is wrong with a phase that is shorter than the shortest.
fn too_short(step: f64) -> String {
    format!(
        "has no sample of the laws within it; allowed: at least {} s, two time steps of {step} s (time_step)",
        shown(SHORTEST_PHASE * step)
    )
}

/// A duration without rounding errors, s.
fn shown(duration: f64) -> f64 {
    (1e9 * duration).round() / 1e9
}

/// Phase tables: alternating stance and swing durations per foot, stance first and last; they fill the horizon. A first or last stance
/// without duration is none: that swing goes as far beyond the end as it is within, unless the state at the start says otherwise.
fn custom(scenario: &Scenario, feet: usize, step: f64, intervals: usize) -> Result<Vec<Vec<Swing>>> {
    let phases = scenario.gait.phases.as_deref();
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
        let in_air = scenario.in_air(foot);
        for (j, pair) in edges.windows(2).enumerate() {
            let none = (j == 0 && in_air[0]) || (j + 1 == durations.len() && in_air[1]);
            if pair[1] < pair[0] + SHORTEST_PHASE && !none {
                let what = format!("given {} s, which {}", durations[j], too_short(step));
                return Err(Error::key(format!("{key}[{j}]"), what));
            }
        }
        let mut swings: Vec<Swing> =
            (1..durations.len()).step_by(2).map(|j| Swing::given(edges[j], edges[j + 1])).collect();
        if let Some(first) = swings.first_mut().filter(|_| in_air[0]) {
            *first = begun(scenario, foot)?.unwrap_or(Swing::given(-first.end, first.end));
        }
        if let Some(last) = swings.last_mut().filter(|_| in_air[1]) {
            last.end += intervals as f64 - last.start;
        }
        Ok(swings)
    };
    phases.iter().enumerate().map(row).collect()
}

#[cfg(test)]
mod tests {
    use super::*;

    fn robot(name: &str) -> Robot {
        let spec = crate::robot::RobotSpec { name: name.into(), ..Default::default() };
        Robot::load(&spec, ".".as_ref()).expect("a robot")
    }

    fn of(scenario: &Scenario) -> Result<Gait> {
        Gait::of(scenario, &robot("anymal_towr"))
    }

    fn scenario(text: &str) -> Scenario {
        toml::from_str(&format!(
            "schema = 1\n{text}\n[terrain]\nkind = \"flat\"\n[start]\nposition = [0, 0]\n[goal]\nposition = [1, 0]\n"
        ))
        .expect("a scenario")
    }

    #[test]
    fn a_walk_swings_one_foot_at_a_time_and_stands_at_both_ends() {
        let gait = of(&scenario("[gait]\ncycle = 1.0")).expect("a gait");
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
        let gait = of(&scenario("[gait]\nkind = \"trot\"\ncycle = 0.8\nduty = 0.5")).expect("a gait");
        assert_eq!(gait.swings[0], gait.swings[3]);
        assert_eq!(gait.swings[1], gait.swings[2]);
        assert_ne!(gait.swings[0], gait.swings[1]);
    }

    #[test]
    fn gaits_follow_one_another_with_standing_in_between() {
        let text = "[[gait.sequence]]\nkind = \"stand\"\nduration = 1.0\n[[gait.sequence]]\nkind = \"walk\"\n\
                    [[gait.sequence]]\nkind = \"trot\"\n[[gait.sequence]]\nkind = \"stand\"\nduration = 1.5\n";
        let gait = of(&scenario(text)).expect("a gait");
        let up = |k: usize| {
            let swings = |swings: &[Swing]| swings.iter().any(|s| s.start < k as f64 && (k as f64) < s.end);
            gait.swings.iter().filter(|foot| swings(foot)).count()
        };
        // Walk from 1 s to 4.75 s, trot to 8.5 s.
        assert!((0..=20).all(|k| up(k) == 0) && (170..=200).all(|k| up(k) == 0));
        assert!((21..95).all(|k| up(k) <= 1) && (21..95).any(|k| up(k) == 1));
        assert!((94..=96).all(|k| up(k) == 0));
        assert!((96..170).all(|k| [0, 2].contains(&up(k))) && (96..170).any(|k| up(k) == 2));
    }

    #[test]
    fn sections_that_are_too_short_are_refused_by_name() {
        let text = |duration: f64| {
            format!(
                "[[gait.sequence]]\nkind = \"trot\"\n[[gait.sequence]]\nkind = \"walk\"\nduration = {duration}\n"
            )
        };
        let message = of(&scenario(&text(0.5))).unwrap_err().to_string();
        assert!(
            message.starts_with("gait.sequence[1].duration: given 0.5 s, into which not one"),
            "{message}"
        );
        assert!(of(&scenario(&text(3.0))).is_ok());
    }

    #[test]
    fn shorter_cycles_do_not_make_a_trot_jump() {
        let robot = robot("anymal_b");
        let exists = |kind: &str, factor: f64| {
            let scenario = scenario(&format!("[gait]\nkind = \"{kind}\""));
            has_shorter_cycles(&scenario, &robot, factor)
        };
        assert!(exists("trot", 0.8) && !exists("trot", 0.7));
        assert!(exists("walk", 0.6) && !exists("stand", 0.9));
    }

    #[test]
    fn a_custom_table_sets_the_switches() {
        let ok = "[gait]\nkind = \"custom\"\nphases = [[5.0, 0.5, 4.5], [10.0], [10.0], [10.0]]";
        let gait = of(&scenario(ok)).expect("a gait");
        assert_eq!(gait.swings[0], [Swing::given(100.0, 110.0)]);
        assert_eq!(gait.stances(0), [Stance { start: 0.0, end: 100.0 }, Stance { start: 110.0, end: 200.0 }]);
        for (from, to, key) in [
            ("5.0, 0.5, 4.5", "5.0, 5.0", "gait.phases[0]: given 2 durations"),
            ("5.0, 0.5, 4.5", "5.0, 0.05, 4.95", "gait.phases[0][1]: given 0.05 s"),
            (", [10.0]]", "]", "gait.phases: "),
        ] {
            let message = of(&scenario(&ok.replace(from, to))).unwrap_err().to_string();
            assert!(message.starts_with(key), "{message}");
        }
    }
}
