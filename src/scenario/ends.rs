//! Refuses what does not go with a motion that starts or ends moving, or from a given state.

use super::format::{Formulation, Scenario};
use super::motion::{Footholds, Law, Legs};
use crate::Result;
use crate::input::Document;
use crate::robot::Robot;

/// Times may differ by this, s.
const SAME: f64 = 1e-6;

/// Refuses values that contradict `[start.state]` or `goal.velocity`.
pub(super) fn check(document: &Document, scenario: &Scenario, robot: Option<&Robot>) -> Result<()> {
    moving(document, scenario)?;
    in_air(document, scenario)?;
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
    let rows = |given: &Option<Vec<[f64; 3]>>| given.as_ref().map(Vec::len);
    for (key, given) in [
        ("feet", rows(&state.feet)),
        ("feet_velocity", rows(&state.feet_velocity)),
        ("swings", state.swings.as_ref().map(Vec::len)),
        ("forces", rows(&state.forces)),
    ] {
        if let Some(given) = given.filter(|given| *given != count) {
            let what = format!("given {given} rows, allowed: one for each of the {count} feet");
            return Err(document.error(&format!("start.state.{key}"), what));
        }
    }
    Ok(())
}

/// Feet in the air at the start or the end have massless legs, stand nowhere on patches, and their phases do not contradict each other.
fn in_air(document: &Document, scenario: &Scenario) -> Result<()> {
    let (start, gait) = (&scenario.start, &scenario.gait);
    let state = start.state.as_ref();
    let lacks_feet = |key: &str| {
        document.error(
            &format!("start.state.{key}"),
            "given without start.state.feet, where the feet are; add these",
        )
    };
    let alone = state.filter(|state| state.feet.is_none());
    if alone.is_some_and(|state| state.feet_velocity.is_some()) {
        return Err(lacks_feet("feet_velocity"));
    }
    let swings = state.and_then(|state| state.swings.as_deref()).unwrap_or_default();
    for (foot, [since, left]) in swings.iter().enumerate() {
        if (*since > 0.0) != (*left > 0.0) {
            let what = format!(
                "given [{since}, {left}], allowed: for how long the foot has been in the air and when it lands, both more than 0 s, or both 0"
            );
            return Err(document.error(&format!("start.state.swings[{foot}]"), what));
        }
    }
    for (foot, row) in gait.phases.iter().flatten().enumerate() {
        let none = row.first() == Some(&0.0);
        let left = start.swing(foot).map_or(0.0, |[_, left]| left);
        let within = if none { row.get(1).copied().unwrap_or(0.0) } else { 0.0 };
        if !swings.is_empty() && (left - within).abs() > SAME {
            let what = format!(
                "the foot lands after {within} s, but after {left} s by {}; begin with {}",
                document.place(&format!("start.state.swings[{foot}]")),
                if left > 0.0 { format!("0, {left}") } else { "a stance".into() }
            );
            return Err(document.error(&format!("gait.phases[{foot}]"), what));
        }
    }
    let has_places = || match alone {
        Some(state) if state.swings.is_some() => Err(lacks_feet("swings")),
        _ => Ok(()),
    };
    if !scenario.is_in_air() {
        return has_places();
    }
    let key = if swings.is_empty() { "gait.phases" } else { "start.state.swings" };
    let because = format!("a foot is in the air at an end ({})", document.place(key));
    if scenario.physics.legs == Some(Legs::Massive) {
        let what = format!("given \"massive\", but {because}; allowed: \"massless\"");
        return Err(document.error("physics.legs", what));
    }
    if gait.optimize_durations {
        let what = format!("given true, but {because}; set it to false");
        return Err(document.error("gait.optimize_durations", what));
    }
    if scenario.footholds() == Footholds::Patches {
        let what =
            format!("patches are for feet that stand at both ends, but {because}; allowed: \"anywhere\"");
        return Err(document.error("contact.footholds", what));
    }
    has_places()
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
