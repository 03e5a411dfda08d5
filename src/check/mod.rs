//! The check: every law recomputed in ambient space from the plan alone, on the plan's own samples.
//!
//! No code of the planner is used: positions, forces and heights are read from the plan, derivatives are differences, and normals
//! come from a spline through the plan's own height grid. Robot and limits are those that the plan's scenario asks for. Every row is
//! "value ≤ limit". `docs/plan-file.md` says which law covers which member.

mod claims;
mod contact;
mod cycle;
mod derivatives;
mod dynamics;
mod ends;
mod ground;
mod joints;
mod laws;
mod legs;
mod measured;
mod motion;
mod patches;
mod splines;
mod start;
mod subject;
mod terrain;
mod vector;
mod way;

use crate::Result;
use crate::plan::{CheckRow, Plan};
use crate::scenario;
pub use laws::{CheckLimits, CheckedLaw, LAWS};
pub use start::ensure_start;
pub use subject::Residuals;
use subject::Subject;

/// What the check found.
#[derive(Clone, Debug)]
pub struct CheckReport {
    /// The laws, each with its worst value and verdict.
    pub rows: Vec<CheckRow>,
    /// Figures without a limit; their limits are infinite.
    pub figures: Vec<CheckRow>,
    /// Whether every row holds.
    pub passed: bool,
    /// Where the plan states something else than its scenario asks for, in sentences.
    pub remarks: Vec<String>,
    /// The main residuals over time.
    pub residuals: Residuals,
}

/// Checks a plan against the default limits.
///
/// # Errors
/// When a value is not finite, an array has the wrong length, or the scenario in the plan cannot be read (limits such as the swing
/// clearance come from it).
pub fn check(plan: &Plan) -> Result<CheckReport> {
    check_with(plan, &CheckLimits::default())
}

/// Checks a plan against given limits.
pub fn check_with(plan: &Plan, limits: &CheckLimits) -> Result<CheckReport> {
    plan.ensure_sound()?;
    let scenario = scenario::parse("meta.scenario", &plan.meta.scenario)?;
    let subject = Subject::new(plan, &scenario, claims::asked_robot(plan, &scenario)?)?;
    let mut residuals = Residuals { t: plan.t.clone(), ..Default::default() };
    let (mut findings, mut remarks) = (Vec::new(), Vec::new());
    claims::findings(&subject, &mut findings, &mut remarks);
    way::findings(&subject, &mut findings);
    splines::findings(&subject, &mut findings)?;
    terrain::findings(&subject, &mut findings)?;
    derivatives::findings(&subject, &mut findings)?;
    ends::findings(&subject, &mut findings);
    dynamics::findings(&subject, &mut findings, &mut residuals);
    joints::findings(&subject, &mut findings);
    contact::findings(&subject, &mut findings, &mut residuals);
    patches::findings(&subject, &mut findings);
    measured::findings(&subject, &mut findings);
    motion::findings(&subject, &mut findings, &mut residuals);

    let (mut rows, mut figures) = (Vec::new(), Vec::new());
    // In the order of the table of laws.
    findings.sort_by_key(|(law, _)| LAWS.iter().position(|known| known.name == law.name));
    for (law, worst) in findings {
        let limit = limits.of(law, &subject.robot);
        let row = CheckRow {
            name: law.name.into(),
            value: worst.value,
            unit: law.unit.into(),
            limit: limit.unwrap_or(f64::INFINITY),
            passed: limit.is_none_or(|limit| worst.value <= limit),
            time: worst.sample.map(|n| plan.t[n]),
            foot: worst.foot.map(|e| plan.foot_names[e].clone()),
        };
        if limit.is_some() { rows.push(row) } else { figures.push(row) }
    }
    let passed = rows.iter().all(|row| row.passed);
    Ok(CheckReport { rows, figures, passed, remarks, residuals })
}
