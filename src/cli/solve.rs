//! `warpgait solve`: terrain → map → NLP → plan → check.

use std::ops::ControlFlow;
use std::path::{Path, PathBuf};
use std::time::Instant;

use clap::Args;
use serde_json::json;

use super::console::Console;
use super::progress::Progress;
use super::{Ending, beside, check};
use crate::check::CheckReport;
use crate::files::{ensure_writable, write_atomically};
use crate::pipeline::{self, Planned};
use crate::plan::Plan;
use crate::planner::Motion;
use crate::planner::derivatives::DerivativeError;
use crate::scenario::{self, LoadedScenario};
use crate::{Error, Result, report};

/// Derivatives that differ more than this from central differences are wrong.
const DERIVATIVE_TOLERANCE: f64 = 1e-4;

#[derive(Debug, Args)]
pub(super) struct SolveArguments {
    /// The scenario to solve
    scenario: PathBuf,
    /// Where the plan goes [default: NAME.plan.npz in the working folder]
    #[arg(short, long, value_name = "FILE")]
    output: Option<PathBuf>,
    /// Set a value of the scenario; the key dotted, the value in TOML or a bare word
    #[arg(long, value_name = "KEY=VALUE")]
    set: Vec<String>,
    /// Same as --set formulation=…
    #[arg(long, value_name = "warped|direct")]
    formulation: Option<String>,
    /// Where the drawing of the plan goes, an SVG file [default: NAME.svg beside the plan]
    #[arg(long, value_name = "FILE", conflicts_with = "no_plot")]
    plot: Option<PathBuf>,
    /// Draw nothing
    #[arg(long)]
    no_plot: bool,
    /// Compare the derivatives with differences before solving
    #[arg(long)]
    check_derivatives: bool,
}

pub(super) fn solve(arguments: &SolveArguments, console: &Console) -> Result<Ending> {
    let start = Instant::now();
    let loaded = load(arguments)?;
    let scenario = &loaded.scenario;
    let output = output(arguments)?;
    let plot =
        (!arguments.no_plot).then(|| arguments.plot.clone().unwrap_or_else(|| beside(&output, ".svg")));
    for file in [Some(&output), plot.as_ref()].into_iter().flatten() {
        ensure_writable(file)?;
    }
    super::listen_for_ctrl_c()?;

    let mut progress = Progress::new(console.is_quiet());
    let planned = pipeline::run(&loaded, arguments.check_derivatives, &mut |event| {
        progress.show(event);
        ControlFlow::Continue(())
    })?;
    // Without a map there is no iterate to keep.
    let Some(planned) = planned else { return Ok(Ending::Interrupted) };
    let Planned { prepared, map: built, plan, motion, check: found, derivatives } = planned;
    plan.write(&output)?;
    if let Some(plot) = &plot {
        write_atomically(plot, report::sheet(&plan).as_bytes())?;
    }
    drop(progress);

    let good_derivatives = derivatives.as_ref().is_none_or(|errors| errors.iter().all(is_right));
    if let Some(errors) = &derivatives {
        console.result(&format!("{}\n", report::derivative_table(errors)));
    }
    console.result(&format!("{}\n", report::violation_table(&motion.violations, scenario.solver.tolerance)));
    console.result(&format!("{}\n", report::check_table(&found, console.colour())));
    console.result(&summary(&plan, &motion, &found, &output, start.elapsed().as_secs_f64()));
    console.object(&json!({
        "plan": output,
        "plot": plot,
        "solved": motion.solved,
        "passed": found.passed,
        "interrupted": motion.interrupted,
        "solver": plan.meta.solver,
        "terrain": prepared.ground.report,
        "map": built.as_ref().map(|built| json!({ "cached": built.cached, "report": built.report })),
        "violations": motion.violations,
        "derivatives": derivatives,
        "checks": found.rows,
        "figures": check::figures(&found),
    }));
    Ok(match () {
        () if motion.interrupted => Ending::Interrupted,
        () if motion.solved && found.passed && good_derivatives => Ending::Good,
        () => Ending::NotGood,
    })
}

fn load(arguments: &SolveArguments) -> Result<LoadedScenario> {
    let mut overrides = arguments.set.clone();
    overrides.extend(arguments.formulation.as_ref().map(|name| format!("formulation={name}")));
    scenario::load(&arguments.scenario, &overrides)
}

/// The plan's file: as given, or the scenario's name in the working folder.
fn output(arguments: &SolveArguments) -> Result<PathBuf> {
    match (&arguments.output, arguments.scenario.file_stem()) {
        (Some(output), _) => Ok(output.clone()),
        (None, Some(stem)) => Ok(PathBuf::from(format!("{}.plan.npz", stem.to_string_lossy()))),
        (None, None) => {
            Err(Error::input(format!("{}: not the name of a file", arguments.scenario.display())))
        }
    }
}

fn is_right(error: &DerivativeError) -> bool {
    error.missing == 0 && error.largest <= DERIVATIVE_TOLERANCE
}

fn summary(plan: &Plan, motion: &Motion, found: &CheckReport, output: &Path, seconds: f64) -> String {
    let solver = &plan.meta.solver;
    let [total, map, evaluation, linear] =
        [seconds, solver.seconds.map, solver.seconds.evaluation, solver.seconds.linear_solver]
            .map(report::number);
    let verdict = if motion.solved { "Solved" } else { "NOT SOLVED" };
    let failed = found.rows.iter().filter(|row| !row.passed).count();
    let checks = match failed {
        0 => format!("All {} checks hold.", found.rows.len()),
        n => format!("{n} of {} checks fail.", found.rows.len()),
    };
    format!(
        "{verdict}: {} after {} iterations. {checks}\n\
         {total} s in all: map {map} s, evaluation {evaluation} s, linear solver {linear} s.\n\
         Written: {}",
        motion.status,
        motion.iterations,
        output.display()
    )
}
