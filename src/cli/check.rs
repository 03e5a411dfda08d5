//! `warpgait check`.

use std::path::PathBuf;

use clap::Args;
use serde_json::json;

use super::Ending;
use super::console::Console;
use crate::check::{CheckLimits, CheckReport, check_with};
use crate::files::{ensure_writable, write_atomically};
use crate::plan::Plan;
use crate::{Result, report};

#[derive(Debug, Args)]
pub(super) struct CheckArguments {
    /// NAME.plan.npz
    plan: PathBuf,
    /// TOML file of `law = limit`, for laws whose limit should be another
    #[arg(long, value_name = "FILE")]
    limits: Option<PathBuf>,
    /// How smoothly the base moves counts, too
    #[arg(long)]
    strict: bool,
    /// Draw the residuals over time into an SVG file
    #[arg(long, value_name = "FILE")]
    plot: Option<PathBuf>,
}

pub(super) fn check(arguments: &CheckArguments, console: &Console) -> Result<Ending> {
    if let Some(plot) = &arguments.plot {
        ensure_writable(plot)?;
    }
    let mut limits = CheckLimits::new(arguments.strict);
    if let Some(file) = &arguments.limits {
        limits = limits.read(file)?;
    }
    let plan = Plan::read(&arguments.plan)?;
    let found = check_with(&plan, &limits)?;
    if let Some(plot) = &arguments.plot {
        write_atomically(plot, report::residuals(&plan, &found).as_bytes())?;
    }
    console.result(&report::check_table(&found, console.colour()));
    console.result(&summary(&plan, &found));
    console.object(&json!({
        "plan": arguments.plan,
        "passed": found.passed,
        "solved": plan.meta.solver.success,
        "checks": found.rows,
        "figures": figures(&found),
    }));
    Ok(if found.passed && plan.meta.solver.success { Ending::Good } else { Ending::NotGood })
}

/// Measured values without a limit, which JSON could not write as infinite.
pub(super) fn figures(report: &CheckReport) -> Vec<serde_json::Value> {
    let object = |row: &crate::plan::CheckRow| json!({ "name": row.name, "value": row.value, "unit": row.unit, "time": row.time, "foot": row.foot });
    report.figures.iter().map(object).collect()
}

fn summary(plan: &Plan, found: &CheckReport) -> String {
    let failed = found.rows.iter().filter(|row| !row.passed).count();
    let solver = match plan.meta.solver.success {
        true => "",
        false => "The plan is marked as not solved. ",
    };
    match failed {
        0 => format!("{solver}All {} checks hold.", found.rows.len()),
        n => format!("{solver}{n} of {} checks fail.", found.rows.len()),
    }
}
