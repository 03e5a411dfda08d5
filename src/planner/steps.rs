//! How many steps a motion takes over ground with edges, and where they are.

use super::cyclic::ensure_repeats;
use super::footholds::{Assignment, assign};
use super::travel::{ensure_within_range, is_unhurried};
use crate::nlp::Model;
use crate::nlp::model::fixed_footholds;
use crate::robot::Robot;
use crate::scenario::Scenario;
use crate::terrain::{Patch, Surfaces};
use crate::trajectory::space::Space;
use crate::trajectory::{Gait, Spaces};
use crate::{Error, Result};

/// Cost of each touch-down for shorter cycles, m²: more steps are faster and less steady ones.
const MORE_STEPS: f64 = 0.1;

/// Those of some gaits that have the steps whose footholds are given.
fn with_fixed(scenario: &Scenario, robot: &Robot, gaits: Vec<(f64, Gait)>) -> Result<Vec<(f64, Gait)>> {
    let usual = gaits[0].1.clone();
    let has = |gait: &Gait| fixed_footholds(scenario, robot, gait).iter().all(Option::is_some);
    let gaits: Vec<(f64, Gait)> = gaits.into_iter().filter(|(_, gait)| has(gait)).collect();
    if !gaits.is_empty() {
        return Ok(gaits);
    }
    let missing = fixed_footholds(scenario, robot, &usual).iter().position(Option::is_none).unwrap_or(0);
    let spec = &scenario.foothold[missing];
    let foot = robot.feet.iter().position(|foot| foot.name == spec.foot).unwrap_or(0);
    Err(match (spec.step, spec.time) {
        (Some(step), _) => {
            let steps = usual.swings[foot].len();
            let what = format!("given {step}; in this gait, {} takes {steps} steps", spec.foot);
            Error::key(format!("foothold[{missing}].step"), what)
        }
        (None, time) => {
            let what = format!(
                "given {} s, when {} is in the air in this gait; give a time at which it stands, or a step",
                time.unwrap_or(0.0),
                spec.foot
            );
            Error::key(format!("foothold[{missing}].time"), what)
        }
    })
}

/// What it costs, the gait, and `[foot][stance]` the cells of the contact surface.
type Footing = (f64, Gait, Vec<Vec<usize>>);

/// When the feet step, and where.
#[derive(Clone, Debug)]
pub struct Steps {
    /// When.
    pub gait: Gait,
    /// `[foot][stance]`: where, over ground with edges; else empty.
    pub patches: Vec<Vec<Patch>>,
}

impl Steps {
    /// The steps of a scenario. A gait without a given cycle gets more steps where the goal is too far for fewer, and over ground with
    /// edges where that makes the footholds better, such as on a staircase with short treads.
    ///
    /// # Errors
    /// Those of the gait; for a goal out of range; and, if no number of steps will do, what is wrong with the usual number: which foot
    /// finds nothing to stand on, where and when.
    pub fn of(scenario: &Scenario, robot: &Robot, surfaces: &Surfaces) -> Result<Self> {
        ensure_repeats(scenario, robot, surfaces)?;
        let gaits = Gait::choices(scenario, robot)?;
        ensure_within_range(scenario, robot, &gaits)?;
        let gaits = with_fixed(scenario, robot, gaits)?;
        let Some(contact) = &surfaces.contact else {
            let unhurried = gaits.iter().position(|(_, gait)| is_unhurried(scenario, robot, gait));
            let chosen = unhurried.unwrap_or(gaits.len() - 1);
            return Ok(Self { gait: gaits[chosen].1.clone(), patches: Vec::new() });
        };
        // In ambient space, so that all formulations get the same patches.
        let spaces = Spaces { base: Space::Direct, feet: Space::Direct };
        // The cost of a step, the gait, and the cells.
        let with = |gait: Gait| -> Result<Footing> {
            let model = Model::new(scenario, robot, &gait, surfaces.clone(), spaces.clone());
            let Assignment { cells, cost } = assign(scenario, &model, contact)?;
            let count = gait.swings.iter().map(Vec::len).sum::<usize>().max(1);
            Ok((cost / count as f64, gait, cells))
        };
        // That of the usual gait first: if none will do, its error is reported.
        let mut tried = gaits.into_iter().map(|(factor, gait)| {
            with(gait).map(|(cost, gait, cells)| (cost + MORE_STEPS * (1.0 - factor), gait, cells))
        });
        let usual = tried.next().expect("at least the usual gait");
        let better = |best: Result<Footing>, next: Result<Footing>| match (&best, &next) {
            (_, Err(_)) => best,
            (Ok((least, ..)), Ok((cost, ..))) if cost >= least => best,
            _ => next,
        };
        let (_, gait, cells) = tried.fold(usual, better)?;
        // Around each cell the largest rectangle in which the NLP may move the foothold.
        let patches = cells.iter().map(|cells| cells.iter().map(|cell| contact.patch(*cell)).collect());
        Ok(Self { gait, patches: patches.collect() })
    }
}
