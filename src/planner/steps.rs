//! How many steps a motion takes over ground with edges, and where they are.

use super::footholds::{Assignment, assign};
use super::travel::ensure_within_range;
use crate::Result;
use crate::nlp::Model;
use crate::robot::Robot;
use crate::scenario::Scenario;
use crate::terrain::{Patch, Surfaces};
use crate::trajectory::space::Space;
use crate::trajectory::{Gait, Spaces};

/// Lengths of a cycle that are tried besides the usual one, as fractions of it.
const SHORTER_CYCLES: [f64; 4] = [0.9, 0.8, 0.7, 0.6];
/// Cost of each touch-down for shorter cycles, m²: more steps are faster and less steady ones.
const MORE_STEPS: f64 = 0.1;

/// When the feet step, and where.
#[derive(Clone, Debug)]
pub struct Steps {
    /// When.
    pub gait: Gait,
    /// `[foot][stance]`: where, over ground with edges; else empty.
    pub patches: Vec<Vec<Patch>>,
}

impl Steps {
    /// The steps of a scenario. Over ground with edges, a gait without a given cycle gets more steps where that makes the footholds
    /// better, such as on a staircase with short treads.
    ///
    /// # Errors
    /// Those of the gait; for a goal out of range; and, if no number of steps will do, what is wrong with the usual number: which foot
    /// finds nothing to stand on, where and when.
    pub fn of(scenario: &Scenario, robot: &Robot, surfaces: &Surfaces) -> Result<Self> {
        let usual = Gait::of(scenario, robot)?;
        let shorter: Vec<(f64, Gait)> = match surfaces.have_edges() {
            true => SHORTER_CYCLES
                .iter()
                .map_while(|&factor| Some((factor, Gait::with_more_steps(scenario, robot, factor)?.ok()?)))
                .collect(),
            false => Vec::new(),
        };
        let possible: Vec<&Gait> =
            std::iter::once(&usual).chain(shorter.iter().map(|(_, gait)| gait)).collect();
        ensure_within_range(scenario, robot, &possible)?;
        let Some(contact) = &surfaces.contact else { return Ok(Self { gait: usual, patches: Vec::new() }) };
        // In ambient space, so that all formulations get the same patches.
        let spaces = Spaces { base: Space::Direct, feet: Space::Direct };
        // The cost of a step, the gait, and the cells.
        let with = |gait: Gait| -> Result<(f64, Gait, Vec<Vec<usize>>)> {
            let model = Model::new(scenario, robot, &gait, surfaces.clone(), spaces.clone());
            let Assignment { cells, cost } = assign(scenario, &model, contact)?;
            let count = gait.swings.iter().map(Vec::len).sum::<usize>().max(1);
            Ok((cost / count as f64, gait, cells))
        };
        let mut best = with(usual);
        for (factor, gait) in shorter {
            if let Ok((cost, gait, cells)) = with(gait) {
                let cost = cost + MORE_STEPS * (1.0 - factor);
                if best.as_ref().map_or(true, |(least, ..)| cost < *least) {
                    best = Ok((cost, gait, cells));
                }
            }
        }
        let (_, gait, cells) = best?;
        // Around each cell the largest rectangle in which the NLP may move the foothold.
        let patches = cells.iter().map(|cells| cells.iter().map(|cell| contact.patch(*cell)).collect());
        Ok(Self { gait, patches: patches.collect() })
    }
}
