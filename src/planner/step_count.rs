//! How many steps a motion takes over ground with edges.

use super::footholds::assign;
use crate::Result;
use crate::nlp::Model;
use crate::robot::Robot;
use crate::scenario::Scenario;
use crate::terrain::Surfaces;
use crate::trajectory::space::Space;
use crate::trajectory::{Gait, Spaces};

/// Lengths of a cycle that are tried besides the usual one, as fractions of it.
const SHORTER_CYCLES: [f64; 3] = [0.9, 0.8, 0.7];
/// Cost of each touch-down for shorter cycles, m²: more steps are faster and less steady ones.
const MORE_STEPS: f64 = 0.1;

/// The gait of a scenario. Over ground with edges, a gait without a given cycle gets more steps where that makes the footholds better,
/// such as on a staircase with short treads.
///
/// # Errors
/// Those of the gait and, if no number of steps will do, what is wrong with the usual number.
pub fn choose_gait(scenario: &Scenario, robot: &Robot, surfaces: &Surfaces) -> Result<Gait> {
    let usual = Gait::of(scenario, robot)?;
    let Some(contact) = &surfaces.contact else { return Ok(usual) };
    // The map is not needed to count steps.
    let spaces = Spaces { base: Space::Direct, feet: Space::Direct };
    let cost_of_a_step = |gait: &Gait| {
        let model = Model::new(scenario, robot, gait, surfaces.clone(), spaces.clone());
        let found = assign(scenario, &model, contact)?;
        let steps = gait.swings.iter().map(Vec::len).sum::<usize>().max(1);
        found.walkable.map(|()| found.cost / steps as f64)
    };
    let mut best = cost_of_a_step(&usual).map(|cost| (cost, usual));
    for factor in SHORTER_CYCLES {
        let Some(Ok(gait)) = Gait::with_more_steps(scenario, robot, factor) else { break };
        if let Ok(cost) = cost_of_a_step(&gait) {
            let cost = cost + MORE_STEPS * (1.0 - factor);
            if best.as_ref().map_or(true, |(least, _)| cost < *least) {
                best = Ok((cost, gait));
            }
        }
    }
    best.map(|(_, gait)| gait)
}
