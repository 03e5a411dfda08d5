//! Refuses what does not go with a motion that starts or ends moving, or from a given state.

use super::format::{Formulation, Scenario};
use super::motion::{Footholds, Law, Legs};
use crate::Result;
use crate::input::Document;
use crate::robot::Robot;

/// Refuses values that contradict `[start.state]` or `goal.velocity`.
pub(super) fn check(document: &Document, scenario: &Scenario, robot: Option<&Robot>) -> Result<()> {
    moving(document, scenario)?;
    let Some(state) = &scenario.start.state else { return Ok(()) };
    if state.forces.is_some() && state.feet.is_none() {
        let what = "given without start.state.feet, at which they act; add these";
        return Err(document.error("start.state.forces", what));
    }
    if state.feet.is_some() && scenario.footholds() == Footholds::Patches {
        let what = "given, but feet stand on patches here, whose places the planner chooses; only with contact.footholds = \"anywhere\"";
        return Err(document.error("start.state.feet", what));
    }
    let count = robot.map_or_else(|| state.feet.as_ref().map_or(0, Vec::len), |robot| robot.feet.len());
    for (key, given) in [("feet", &state.feet), ("forces", &state.forces)] {
        if let Some(given) = given.as_ref().filter(|given| given.len() != count) {
            let what = format!("given {} rows, allowed: one for each of the {count} feet", given.len());
            return Err(document.error(&format!("start.state.{key}"), what));
        }
    }
    Ok(())
}

/// A base that moves at an end is planned in ambient space, as one rigid body, with the centered law.
fn moving(document: &Document, scenario: &Scenario) -> Result<()> {
    if !scenario.moves_at_ends() {
        return Ok(());
    }
    let key = match () {
        () if scenario.gait.periodic => "gait.periodic",
        () if scenario.start.moves() => "start.state",
        () => "goal.velocity",
    };
    let because = format!("the base moves at an end ({})", document.place(key));
    if scenario.formulation() == Formulation::Warped {
        let what = format!("given \"warped\", but {because}; allowed: \"hybrid\", \"direct\"");
        return Err(document.error("formulation", what));
    }
    if scenario.physics.legs == Some(Legs::Massive) {
        let what = format!("given \"massive\", but {because}; allowed: \"massless\"");
        return Err(document.error("physics.legs", what));
    }
    if scenario.physics.law != Law::Pcdm {
        let what = format!("given another than \"pcdm\", but {because}; allowed: \"pcdm\"");
        return Err(document.error("physics.law", what));
    }
    Ok(())
}
