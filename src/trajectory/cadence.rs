//! How quickly the feet of a gait step: the length of its cycle and its duty factor, and the swings that follow.

use super::phase::{SHORTEST_PHASE, Swing};
use crate::robot::Robot;
use crate::scenario::{Footholds, GaitKind, Scenario, SectionSpec};
use crate::{Error, Result};

/// Duration of a cycle, s, if neither the scenario nor the robot specifies one, for a robot of ANYmal's size.
const CYCLE: f64 = 1.0;
/// Length of the cycle of a walk over smooth ground, in the robot's own: swings last 0.21 of that, instead of 0.25 over patches.
const SMOOTH_WALK_CYCLE: f64 = 1.25;
/// Fraction of the time that a foot of a walk over smooth ground is in the air, of that in which one foot is at any time.
const SMOOTH_WALK_SWING: f64 = 2.0 / 3.0;
/// The cycles of walks and waves, in which the feet take turns, are for this many feet.
const TURNS: f64 = 4.0;
/// Lengths of the cycles with flight, in units of the time √(h/g) that a robot of the standing height h takes to fall by half of it.
const FLYING_TROT_CYCLE: f64 = 2.1;
const HOP_CYCLE: f64 = 2.2;
/// Froude numbers v²/(g h) up to which trot, tripod, pace and bound have their usual cadence, and from which on they have that of a flying
/// trot.
const SPEEDS: [f64; 2] = [0.05, 0.5];
/// Time at both ends in which the base hardly moves, s, for a robot of ANYmal's size.
const ENDS: f64 = 1.0;
/// m/s².
const GRAVITY: f64 = 9.81;

/// The time in which a section's steps are, s.
#[derive(Clone, Copy, Debug)]
pub(super) struct Window {
    pub from: f64,
    pub to: f64,
    /// Least time of standing at both ends.
    pub stand: [f64; 2],
}

/// How quickly the feet step.
#[derive(Clone, Copy, Debug, PartialEq)]
pub(super) struct Cadence {
    /// Time from one lift-off of a foot to its next, s.
    pub cycle: f64,
    /// Fraction of it that the foot stands.
    pub duty: f64,
}

/// How far the mean speed is from an ordinary one to one for which the feet must leave the ground, 0 to 1; in proportion to the speed.
fn quickness(scenario: &Scenario, robot: &Robot) -> f64 {
    let ends = if scenario.gait.periodic { 0.0 } else { ENDS * robot.time_scale() };
    let speed = scenario.way_length() / (scenario.horizon - ends).max(scenario.time_step);
    let [ordinary, flying] = SPEEDS.map(|froude| (froude * GRAVITY * robot.standing_height()).sqrt());
    ((speed - ordinary) / (flying - ordinary)).clamp(0.0, 1.0)
}

impl Cadence {
    /// That of a section of a scenario's gait; where it does not say, a usual one for the gait and the robot.
    pub fn of(section: &SectionSpec, scenario: &Scenario, robot: &Robot) -> Self {
        let usual = Self::usual(section.kind, scenario, robot);
        Self { cycle: section.cycle.unwrap_or(usual.cycle), duty: section.duty.unwrap_or(usual.duty) }
    }

    /// Whether the scenario leaves it to the program.
    pub fn is_open(section: &SectionSpec) -> bool {
        section.kind.is_cyclic() && !section.kind.flies() && section.cycle.is_none() && section.duty.is_none()
    }

    fn usual(kind: GaitKind, scenario: &Scenario, robot: &Robot) -> Self {
        let feet = robot.feet.len() as f64;
        let cycle = robot.gait_cycle.unwrap_or(CYCLE * robot.time_scale());
        let turns = feet / TURNS * cycle;
        let falling = (robot.standing_height() / GRAVITY).sqrt();
        // A multiple of two time steps, so that all flights last as long.
        let even = |cycle: f64| {
            let steps = 2.0 * scenario.time_step;
            (cycle / steps).round().max(1.0) * steps
        };
        match kind {
            // All feet stand between the swings for a twelfth of the cycle of four feet: the base then accelerates a third as much. Over
            // patches, where the steps follow the ground, it would not, and swings would be quicker (docs/results.md).
            GaitKind::Walk if scenario.footholds() == Footholds::Anywhere => {
                Self { cycle: SMOOTH_WALK_CYCLE * turns, duty: 1.0 - SMOOTH_WALK_SWING / feet }
            }
            GaitKind::Walk | GaitKind::Wave => Self { cycle: turns, duty: 1.0 - 1.0 / feet },
            GaitKind::FlyingTrot => Self { cycle: even(FLYING_TROT_CYCLE * falling), duty: 0.4 },
            // One foot bears more while it stands.
            GaitKind::Hop | GaitKind::Pronk if robot.feet.len() == 1 => {
                Self { cycle: even(HOP_CYCLE * falling), duty: 0.65 }
            }
            GaitKind::Hop | GaitKind::Pronk => Self { cycle: even(HOP_CYCLE * falling), duty: 0.55 },
            GaitKind::Trot | GaitKind::Tripod | GaitKind::Pace | GaitKind::Bound => {
                let quick = Self { cycle: FLYING_TROT_CYCLE * falling, duty: 0.4 };
                Self { cycle, duty: 0.6 }.toward(quick, quickness(scenario, robot))
            }
            GaitKind::Stand | GaitKind::Custom => Self { cycle, duty: 0.6 },
        }
    }

    /// A fraction of the way to another cadence.
    fn toward(self, other: Self, fraction: f64) -> Self {
        let between = |a: f64, b: f64| a + fraction * (b - a);
        Self { cycle: between(self.cycle, other.cycle), duty: between(self.duty, other.duty) }
    }

    /// With cycles of a fraction of the length, and swings that last as long.
    pub fn with_cycle(&self, fraction: f64) -> Self {
        Self { cycle: fraction * self.cycle, duty: 1.0 - (1.0 - self.duty) / fraction }
    }

    /// The duration of a swing, in time steps.
    ///
    /// # Errors
    /// [`Error::Key`] with the section's `cycle` where phases are too short for the time step.
    pub fn swing(&self, step: f64) -> Result<f64> {
        let &Self { cycle, duty } = self;
        let swing = ((1.0 - duty) * cycle / step).round();
        if swing < SHORTEST_PHASE {
            let what = format!(
                "a swing of {:.3} s (cycle {cycle} s, duty {duty}) is shorter than two time steps of {step} s; lengthen the cycle, or lower the duty or the time_step",
                (1.0 - duty) * cycle
            );
            return Err(Error::key("cycle", what));
        }
        if (duty * cycle / step).round() < SHORTEST_PHASE {
            let what = format!(
                "a stance of {:.3} s (cycle {cycle} s, duty {duty}) is shorter than two time steps of {step} s; lengthen the cycle, raise the duty or lower the time_step",
                duty * cycle
            );
            return Err(Error::key("cycle", what));
        }
        Ok(swing)
    }

    /// As many whole cycles as fit into a window with standing at both ends. The remaining time is divided between the ends.
    ///
    /// # Errors
    /// [`Error::Key`] with the key `horizon` where no cycle fits, with the section's `cycle` where phases are too short for the time step.
    pub fn swings(&self, lift_offs: &[f64], window: &Window, step: f64) -> Result<Vec<Vec<Swing>>> {
        let (swing, &Self { cycle, duty }) = (self.swing(step)?, self);
        let last = lift_offs.iter().fold(0.0, |a: f64, &b| a.max(b)) + (1.0 - duty);
        // n cycles take n − 1 + last times the duration of one; the summand of 1e-9 absorbs rounding.
        let (duration, [before, after]) = (window.to - window.from, window.stand);
        let cycles = ((duration - (before + after)) / cycle - last + 1.0 + 1e-9).floor();
        if cycles < 1.0 {
            let what = format!(
                "given {duration} s, into which not one cycle of {cycle} s fits with {before} s and {after} s of standing before and after; lengthen it or shorten the cycle"
            );
            return Err(Error::key("horizon", what));
        }
        let begin = window.from + (duration - (cycles - 1.0 + last) * cycle + (before - after)) / 2.0;
        let of_foot = |lift_off: &f64| {
            (0..cycles as usize)
                .map(|j| {
                    let start = ((begin + (j as f64 + lift_off) * cycle) / step).round();
                    Swing::given(start, start + swing)
                })
                .collect()
        };
        Ok(lift_offs.iter().map(of_foot).collect())
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::scenario::load_text;

    fn trot(goal: f64) -> Cadence {
        let text = format!(
            "horizon = 5.0\n[terrain]\nkind = \"flat\"\nextent = [-1.0, 20.0, -1.0, 1.0]\n[start]\nposition = [0.0, 0.0]\n\
             [goal]\nposition = [{goal:?}, 0.0]\n[gait]\nkind = \"trot\"\n"
        );
        let loaded = load_text("s.toml", &text, ".".as_ref(), &[]).expect("a scenario");
        Cadence::of(&loaded.scenario.gait.sections()[0], &loaded.scenario, &loaded.robot)
    }

    #[test]
    fn a_trot_is_quicker_and_flies_at_high_speed_only() {
        let [slow, fast, fastest] = [1.0, 4.0, 8.0].map(trot);
        assert_eq!(slow, Cadence { cycle: 1.2, duty: 0.6 });
        assert!(fast.cycle < slow.cycle && fast.duty < slow.duty && fast.duty > fastest.duty);
        assert!((fastest.duty - 0.4).abs() < 1e-12 && fastest.cycle < 0.5, "{fastest:?}");
    }
}
