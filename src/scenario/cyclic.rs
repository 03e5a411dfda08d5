//! Refuses what contradicts a cyclic motion (`gait.periodic`), whose end is its start.

use super::format::{Formulation, Scenario};
use super::gait_kind::GaitKind;
use super::motion::Footholds;
use super::section::SectionSpec;
use crate::Result;
use crate::input::Document;

/// By how much cycles may miss the horizon, in cycles.
const MISSED: f64 = 1e-6;

/// Refuses values that a cyclic motion cannot have, and a cycle that does not divide the horizon.
pub(super) fn check(document: &Document, scenario: &Scenario) -> Result<()> {
    let gait = &scenario.gait;
    if !gait.periodic {
        return Ok(());
    }
    let because = format!("the motion is cyclic ({})", document.place("gait.periodic"));
    let goal = &scenario.goal;
    for (key, given) in [
        ("start.state", scenario.start.state.is_some()),
        ("goal.velocity", goal.velocity.is_some()),
        ("goal.waypoints", !goal.waypoints.is_empty()),
        ("goal.circle", goal.circle.is_some()),
        ("force", !scenario.force.is_empty()),
        ("gait.sequence", gait.sequence.is_some()),
        ("gait.phases", gait.phases.is_some()),
        ("gait.optimize_durations", gait.optimize_durations),
    ] {
        if given {
            return Err(document.error(key, format!("given, but {because}; remove one of them")));
        }
    }
    if scenario.formulation() != Formulation::Direct {
        let what = format!(
            "given \"{}\", but {because}, and a shift in the warped space is not one in ambient space; allowed: \"direct\"",
            scenario.formulation()
        );
        return Err(document.error("formulation", what));
    }
    if scenario.footholds() == Footholds::Patches {
        let what = format!(
            "{}\"patches\", but {because}, and patches do not repeat; allowed: \"anywhere\"",
            if document.has("contact.footholds") { "given " } else { "by default " }
        );
        return Err(document.error("contact.footholds", what));
    }
    if gait.kind == GaitKind::Stand {
        let what = format!("given \"stand\", but {because}; allowed: a gait with steps");
        return Err(document.error("gait.kind", what));
    }
    let Some(cycle) = gait.cycle else { return Ok(()) };
    let cycles = scenario.horizon / cycle;
    if (cycles - cycles.round()).abs() > MISSED || cycles < 0.5 {
        let whole = cycles.round().max(1.0);
        let what = format!(
            "given {cycle} s, of which {cycles:.3} fit into the {} s of the motion ({}), but {because}; allowed: a whole number, such as with {} s, or a horizon of {} s",
            rounded(scenario.horizon),
            document.place("horizon"),
            rounded(scenario.horizon / whole),
            rounded(whole * cycle)
        );
        return Err(document.error("gait.cycle", what));
    }
    Ok(())
}

fn rounded(seconds: f64) -> f64 {
    (1e4 * seconds).round() / 1e4
}

impl Scenario {
    /// How often the cycle of a section is repeated in a cyclic motion, if one usually takes `usual` s.
    pub fn cycles(&self, section: &SectionSpec, usual: f64) -> f64 {
        (self.horizon / section.cycle.unwrap_or(usual)).round().max(1.0)
    }
}

#[cfg(test)]
mod tests {
    use crate::scenario::load_text;

    const HEAD: &str = "horizon = 2.0\n[terrain]\nkind = \"flat\"\n[start]\nposition = [0.0, 0.0]\n[goal]\nposition = [0.4, 0.0]\n";

    #[test]
    fn contradictions_of_a_cyclic_motion_are_refused_with_both_lines() {
        for (gait, rest, expected) in [
            (
                "cycle = 0.8",
                "",
                "s.toml:11: gait.cycle: given 0.8 s, of which 2.500 fit into the 2 s of the motion (horizon, line 1), but the motion is cyclic (gait.periodic, line 9); allowed: a whole number, such as with 0.6667 s, or a horizon of 2.4 s",
            ),
            (
                "optimize_durations = true",
                "",
                "s.toml:11: gait.optimize_durations: given, but the motion is cyclic (gait.periodic, line 9); remove",
            ),
            (
                "",
                "[[force]]\nvector = [1.0, 0.0, 0.0]\nfrom = 0.0\nuntil = 1.0\n",
                "s.toml:12: force: given, but",
            ),
            (
                "",
                "[contact]\nfootholds = \"patches\"\n",
                "s.toml:13: contact.footholds: given \"patches\", but",
            ),
        ] {
            let text = format!("{HEAD}[gait]\nperiodic = true\nkind = \"trot\"\n{gait}\n{rest}");
            let message = load_text("s.toml", &text, ".".as_ref(), &[]).expect_err(expected).to_string();
            assert!(message.starts_with(expected), "{message}\nis not\n{expected}");
        }
        let text = format!("formulation = \"hybrid\"\n{HEAD}[gait]\nperiodic = true\n");
        let message = load_text("s.toml", &text, ".".as_ref(), &[]).unwrap_err().to_string();
        assert!(message.starts_with("s.toml:1: formulation: given \"hybrid\", but"), "{message}");
    }

    #[test]
    fn a_speed_sets_the_horizon_of_a_cycle_without_standing() {
        let text = format!("{}speed = 0.5\n[gait]\nperiodic = true\n", HEAD.replace("horizon = 2.0\n", ""));
        let loaded = load_text("s.toml", &text, ".".as_ref(), &[]).expect("a scenario");
        assert_eq!(loaded.scenario.horizon, 0.8);
    }
}
