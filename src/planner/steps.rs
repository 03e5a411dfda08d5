//! How many steps a motion takes over ground with edges, and where they are.

use super::cyclic::ensure_repeats;
use super::foothold_search::Avoided;
use super::footholds::{Assignment, assign};
use super::travel::{ensure_within_range, is_unhurried};
use crate::nlp::Model;
use crate::nlp::model::fixed_footholds;
use crate::robot::Robot;
use crate::scenario::Scenario;
use crate::terrain::{ContactGround, Patch, Surfaces};
use crate::trajectory::space::Space;
use crate::trajectory::{Gait, Spaces};
use crate::{Error, Result};

/// Cost of each touch-down for shorter cycles, m², for a robot of ANYmal's size: more steps are faster and less steady ones.
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

/// What a step costs, the gait, and `[foot][stance]` the cells of the contact surface.
type Footing = (f64, Gait, Vec<Vec<usize>>);

/// When the feet step, and where.
#[derive(Clone, Debug)]
pub struct Steps {
    /// When.
    pub gait: Gait,
    /// `[foot][stance]`: where, over ground with edges; else empty.
    pub patches: Vec<Vec<Patch>>,
    /// Over ground with edges, gaits with other numbers of steps, the better ones first.
    others: Vec<Footing>,
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
            return Ok(Self { gait: gaits[chosen].1.clone(), patches: Vec::new(), others: Vec::new() });
        };
        let (mut found, mut refused) = (Vec::new(), None);
        let more = robot.size().powi(2) * MORE_STEPS;
        for (factor, gait) in gaits {
            match footing(scenario, robot, surfaces, contact, gait, &[]) {
                Ok((cost, gait, cells)) => found.push((cost + more * (1.0 - factor), gait, cells)),
                // If none will do, what is wrong with the usual gait is reported.
                Err(error) => refused = refused.or(Some(error)),
            }
        }
        found.sort_by(|a, b| a.0.total_cmp(&b.0));
        match (found.is_empty(), refused) {
            (true, Some(error)) => Err(error),
            _ => Ok(Self::on(contact, found)),
        }
    }

    /// With the first of some footings.
    fn on(contact: &ContactGround, mut footings: Vec<Footing>) -> Self {
        let (_, gait, cells) = footings.remove(0);
        // Around each cell the largest rectangle in which the NLP may move the foothold.
        let patches = cells.iter().map(|cells| cells.iter().map(|cell| contact.patch(*cell)).collect());
        Self { gait, patches: patches.collect(), others: footings }
    }

    /// The same gait with other patches for some stances, given by foot and number; none if the search finds none.
    pub(super) fn moved(
        &self,
        scenario: &Scenario,
        robot: &Robot,
        surfaces: &Surfaces,
        stances: &[(usize, usize)],
    ) -> Option<Self> {
        let contact = surfaces.contact.as_ref()?;
        let avoid = |&(foot, stance): &(usize, usize)| {
            Some(Avoided { foot, stance, patch: *self.patches.get(foot)?.get(stance)? })
        };
        let avoided: Vec<Avoided> = stances.iter().filter_map(avoid).collect();
        let footing = footing(scenario, robot, surfaces, contact, self.gait.clone(), &avoided).ok()?;
        let moved = Self::on(contact, vec![footing]);
        (moved.patches != self.patches).then_some(moved)
    }

    /// With the n-th other gait, and the patches that it has.
    pub(super) fn with_other_gait(&self, surfaces: &Surfaces, n: usize) -> Option<Self> {
        let contact = surfaces.contact.as_ref()?;
        Some(Self::on(contact, vec![self.others.get(n)?.clone()]))
    }
}

/// Footholds for a gait.
fn footing(
    scenario: &Scenario,
    robot: &Robot,
    surfaces: &Surfaces,
    contact: &ContactGround,
    gait: Gait,
    avoided: &[Avoided],
) -> Result<Footing> {
    // In ambient space, so that all formulations get the same patches.
    let spaces = Spaces { base: Space::Direct, feet: Space::Direct };
    let model = Model::new(scenario, robot, &gait, surfaces.clone(), spaces);
    let Assignment { cells, cost } = assign(scenario, &model, contact, avoided)?;
    let count = gait.swings.iter().map(Vec::len).sum::<usize>().max(1);
    Ok((cost / count as f64, gait, cells))
}
