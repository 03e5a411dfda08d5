//! `[[gait.sequence]]`: gaits one after the other.

use super::gait::GaitSpec;
use super::gait_kind::GaitKind;
use super::section::SectionSpec;
use crate::Result;
use crate::input::Document;

/// Durations may miss the horizon by this, s.
const TOLERANCE: f64 = 1e-6;
/// Least duration that is left for sections without one, s, each.
const LEAST_LEFT: f64 = 0.1;

impl GaitSpec {
    /// The gait's sections in order of time; one, if there is no sequence.
    pub fn sections(&self) -> Vec<SectionSpec> {
        let alone = || SectionSpec { kind: self.kind, duration: None, cycle: self.cycle, duty: self.duty };
        self.sequence.clone().unwrap_or_else(|| vec![alone()])
    }

    /// Whether all feet are in the air at times, by the kind of a section and its duty factor.
    pub fn flies(&self) -> bool {
        self.sections().iter().any(|section| section.kind.flies_with(section.duty))
    }

    /// When each section ends, s.
    pub fn section_ends(&self, horizon: f64) -> Vec<f64> {
        let sections = self.sections();
        let given: f64 = sections.iter().filter_map(|section| section.duration).sum();
        let others = sections.iter().filter(|section| section.duration.is_none()).count();
        let each = (horizon - given) / others.max(1) as f64;
        let mut end = 0.0;
        sections
            .iter()
            .map(|section| {
                end += section.duration.unwrap_or(each);
                end
            })
            .collect()
    }
}

/// The key of a value of a section: `gait.sequence[2].cycle`, or `gait.cycle` if there is no sequence.
pub fn section_key(gait: &GaitSpec, section: usize, key: &str) -> String {
    if gait.sequence.is_some() { format!("gait.sequence[{section}].{key}") } else { format!("gait.{key}") }
}

/// Refuses a sequence that contradicts itself, the rest of `[gait]`, or the horizon.
pub(super) fn check(document: &Document, gait: &GaitSpec, horizon: f64) -> Result<()> {
    let Some(sections) = &gait.sequence else { return Ok(()) };
    if sections.is_empty() {
        return Err(document.error("gait.sequence", "given none, allowed: one section or more"));
    }
    for key in ["kind", "cycle", "duty", "phases"] {
        if document.has(&format!("gait.{key}")) {
            let what = format!(
                "given together with {}, whose sections have their own {key}; remove one of them",
                document.place("gait.sequence")
            );
            return Err(document.error(&format!("gait.{key}"), what));
        }
    }
    if let Some(n) = sections.iter().position(|section| section.kind == GaitKind::Custom) {
        let what = "given \"custom\", which is for the whole motion; use gait.kind and gait.phases, or another kind here";
        return Err(document.error(&format!("gait.sequence[{n}].kind"), what));
    }
    for (n, section) in sections.iter().enumerate() {
        let given =
            [("cycle", section.cycle), ("duty", section.duty)].into_iter().find(|(_, given)| given.is_some());
        if let Some((key, _)) = given.filter(|_| !section.kind.is_cyclic()) {
            let what = format!(
                "given for \"stand\" ({}), which has no steps; remove one of them",
                document.place(&format!("gait.sequence[{n}].kind"))
            );
            return Err(document.error(&format!("gait.sequence[{n}].{key}"), what));
        }
    }
    let given: f64 = sections.iter().filter_map(|section| section.duration).sum();
    let others = sections.iter().filter(|section| section.duration.is_none()).count();
    if others == 0 && (given - horizon).abs() > TOLERANCE {
        let what = format!(
            "the durations sum to {given} s, but the horizon is {horizon} s ({}); leave out one of them, or set the horizon to the sum",
            document.place("horizon")
        );
        return Err(document.error("gait.sequence", what));
    }
    if others > 0 && horizon - given < LEAST_LEFT * others as f64 {
        let what = format!(
            "the durations sum to {given} s, which leaves {:.3} s of the horizon of {horizon} s ({}) for {others} without a duration; lengthen the horizon",
            horizon - given,
            document.place("horizon")
        );
        return Err(document.error("gait.sequence", what));
    }
    Ok(())
}
