//! `warpgait check`.

use std::path::PathBuf;

use clap::Args;
use serde_json::json;

use super::console::Console;
use super::ending::Ending;
use super::figures::figures;
use crate::check::{CheckLimits, check_with};
use crate::files::{ensure_outputs, write_atomically};
use crate::plan::Plan;
use crate::visible::visible;
use crate::{Error, Result, report};

const EXAMPLES: &str = "\
Examples:
  warpgait check hill.plan.npz                        value, limit and verdict of every law
  warpgait check hill.plan.npz --plot residuals.svg   and a drawing of the residuals over time
  warpgait check hill.plan.npz --limits limits.toml   with other limits, such as: friction = 1.0

Exit codes: 0 the plan is solved and every check holds; 1 otherwise; 2 bad input.";

#[derive(Debug, Args)]
#[command(after_help = EXAMPLES)]
pub(super) struct CheckArguments {
    /// The plan, NAME.plan.npz
    plan: PathBuf,
    /// TOML file with lines `law = limit`, each of which replaces the default limit of a law
    #[arg(long, value_name = "FILE")]
    limits: Option<PathBuf>,
    /// Check the smoothness of the base's motion, too
    #[arg(long)]
    strict: bool,
    /// Draw the residuals over time to this SVG file
    #[arg(long, value_name = "FILE")]
    plot: Option<PathBuf>,
}

pub(super) fn check(arguments: &CheckArguments, console: &Console) -> Result<Ending> {
    let inputs: Vec<PathBuf> = std::iter::once(&arguments.plan).chain(&arguments.limits).cloned().collect();
    ensure_outputs(&arguments.plot.iter().map(PathBuf::as_path).collect::<Vec<_>>(), &inputs)?;
    let mut limits = CheckLimits::new(arguments.strict);
    if let Some(file) = &arguments.limits {
        limits = limits.read(file)?;
    }
    let plan = Plan::read(&arguments.plan)?;
    let file = arguments.plan.display();
    let found = check_with(&plan, &limits).map_err(|error| match error {
        Error::Input(what) => Error::Input(format!("{file}: {what}")),
        other => other,
    })?;
    if let Some(plot) = &arguments.plot {
        write_atomically(plot, report::residuals(&plan, &found).as_bytes())?;
    }
    let solved = plan.meta.solver.success;
    let state = if solved { "Solved" } else { "Marked as not solved" };
    console.result(&report::check_table(&found, console.has_color()));
    for remark in &found.remarks {
        console.result(&visible(&format!("claims: {remark}.")));
    }
    console.result(&format!("{state}; {}.", report::check_counts(&found.rows)));
    console.object(&json!({
        "plan": arguments.plan,
        "passed": found.passed,
        "solved": solved,
        "checks": found.rows,
        "remarks": found.remarks,
        "figures": figures(&found),
    }));
    Ok(if found.passed && solved { Ending::Good } else { Ending::NotGood })
}
