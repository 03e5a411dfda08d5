//! `warpgait solve`: terrain → map → NLP → plan → check.

use std::ops::ControlFlow;
use std::path::{Path, PathBuf};
use std::time::Instant;

use clap::Args;
use serde_json::{Value, json};

use super::console::Console;
use super::ending::{Ending, listen_for_ctrl_c};
use super::figures::figures;
use super::progress_line::ProgressLine;
use crate::files::{ensure_no_inputs, ensure_outputs, write_atomically};
use crate::ipopt::InGoodOrder;
use crate::pipeline::{self, Event, Planned, Step};
use crate::planner::derivatives::DerivativeError;
use crate::scenario::{self, LoadedScenario};
use crate::visible::visible;
use crate::{Error, Result, report};

/// Derivatives that differ from central differences by more than this are wrong.
const DERIVATIVE_TOLERANCE: f64 = 1e-4;

const EXAMPLES: &str = "\
Examples:
  warpgait solve hill.toml                               write hill.plan.npz and hill.svg
  warpgait solve hill.toml -o trot.plan.npz --set gait.kind=trot
  warpgait solve hill.toml --formulation direct          plan without a map
  warpgait solve hill.toml --set \"goal.position=[1.5, 0.0]\" --no-plot --json

Exit codes: 0 solved and every check holds; 1 not solved, or a check fails, the plan is written;
2 bad input, nothing written; 130 interrupted, the best plan so far is written.
An output never replaces an input, the other output, or anything but a regular file.";

#[derive(Debug, Args)]
#[command(after_help = EXAMPLES)]
pub(super) struct SolveArguments {
    /// The scenario to solve
    scenario: PathBuf,
    /// The plan to write [default: NAME.plan.npz in the working folder]
    #[arg(short, long, value_name = "FILE")]
    output: Option<PathBuf>,
    /// Override a value of the scenario: a dotted key, and a TOML value or a bare word; may be repeated
    #[arg(long, value_name = "KEY=VALUE")]
    set: Vec<String>,
    /// Override the formulation: warped, direct or hybrid
    #[arg(long, value_name = "NAME")]
    formulation: Option<String>,
    /// The drawing of the plan to write, an SVG file [default: NAME.svg next to the plan]
    #[arg(long, value_name = "FILE", conflicts_with = "no_plot")]
    plot: Option<PathBuf>,
    /// Do not look for the limits that would have to give when no motion is found
    #[arg(long)]
    no_explain: bool,
    /// Draw nothing
    #[arg(long)]
    no_plot: bool,
    /// Compare the derivatives with central differences before solving
    #[arg(long)]
    check_derivatives: bool,
}

pub(super) fn solve(arguments: &SolveArguments, console: &Console) -> Result<Ending> {
    let start = Instant::now();
    let loaded = load(arguments)?;
    let output = output(arguments)?;
    let plot =
        (!arguments.no_plot).then(|| arguments.plot.clone().unwrap_or_else(|| beside(&output, ".svg")));
    let outputs: Vec<&Path> = std::iter::once(&*output).chain(plot.as_deref()).collect();
    ensure_outputs(&outputs, &loaded.files())?;
    listen_for_ctrl_c()?;

    let mut progress = ProgressLine::new(console.is_quiet());
    let mut in_good_order = None;
    let planned = pipeline::run(&loaded, arguments.check_derivatives, &mut |event| {
        if matches!(event, Event::Step(Step::Solve)) {
            // From here on there is an iterate to keep.
            in_good_order = Some(InGoodOrder::begin());
        }
        progress.show(event);
        ControlFlow::Continue(())
    })?;
    // Interrupted before the first iterate: there is no plan to write.
    let Some(planned) = planned else { return Ok(Ending::Interrupted) };
    // Also files that the terrain's file names, which are known only now.
    ensure_no_inputs(&outputs, &loaded.paths(&planned.prepared.ground.inputs))?;
    planned.plan.write(&output)?;
    // The plan is written: a drawing that fails does not change that.
    let drawn = plot.as_ref().map_or(Ok(()), |plot| {
        let drawing = report::sheet(&planned.plan, &planned.prepared.surfaces);
        write_atomically(plot, drawing.as_bytes())
    });
    drop(progress);

    let seconds = start.elapsed().as_secs_f64();
    print_tables(&planned, loaded.scenario.solver.tolerance, console);
    console.result(&summary(&planned, &output, seconds));
    if let Err(error) = &drawn {
        console.warn(&format!("error: {error}; the plan is written, without a drawing"));
    }
    console.object(&object(&planned, &output, plot.as_deref(), drawn.err()));
    Ok(ending(&planned))
}

fn load(arguments: &SolveArguments) -> Result<LoadedScenario> {
    let mut overrides = arguments.set.clone();
    overrides.extend(arguments.formulation.as_ref().map(|name| format!("formulation={name}")));
    if arguments.no_explain {
        overrides.push("solver.explain=false".into());
    }
    scenario::load(&arguments.scenario, &overrides)
}

/// The plan's file: the one given, or one named after the scenario in the working folder.
fn output(arguments: &SolveArguments) -> Result<PathBuf> {
    match (&arguments.output, arguments.scenario.file_stem()) {
        (Some(output), _) => Ok(output.clone()),
        (None, Some(stem)) => Ok(PathBuf::from(format!("{}.plan.npz", stem.to_string_lossy()))),
        (None, None) => {
            Err(Error::input(format!("{}: this is not the name of a file", arguments.scenario.display())))
        }
    }
}

/// `NAME` of `NAME.plan.npz` with another ending, in the same folder.
fn beside(plan: &Path, ending: &str) -> PathBuf {
    let name = plan.file_name().map(|n| n.to_string_lossy().into_owned()).unwrap_or_default();
    let stem = name.strip_suffix(".plan.npz").or(name.strip_suffix(".npz")).unwrap_or(&name);
    plan.with_file_name(format!("{stem}{ending}"))
}

fn print_tables(planned: &Planned, tolerance: f64, console: &Console) {
    if let Some(errors) = &planned.derivatives {
        console.result(&format!("{}\n", report::derivative_table(errors)));
    }
    console.result(&format!("{}\n", report::violation_table(&planned.motion.violations, tolerance)));
    console.result(&format!("{}\n", report::check_table(&planned.check, console.has_color())));
}

/// Laws that say something of the ground itself, which a smaller time step does not change.
const OF_THE_GROUND: [&str; 2] = ["ground_moved", "unknown_ground"];

fn summary(planned: &Planned, output: &Path, seconds: f64) -> String {
    let (motion, solver) = (&planned.motion, &planned.plan.meta.solver);
    let [total, map, evaluation, linear] =
        [seconds, solver.seconds.map, solver.seconds.evaluation, solver.seconds.linear_solver]
            .map(report::number);
    let verdict = if motion.solved { "Solved" } else { "NOT SOLVED" };
    let failing = planned.check.rows.iter().find(|row| !row.passed);
    // The laws hold at the samples of the solver; what fails, fails between them.
    let advice = match failing {
        Some(row) if motion.solved => format!(
            "\nThe first that fails: {} is {} {}, allowed {}.{}",
            row.name,
            report::number(row.value),
            row.unit,
            report::number(row.limit),
            if OF_THE_GROUND.contains(&row.name.as_str()) { "" } else { " A smaller time_step often helps." }
        ),
        _ => String::new(),
    };
    let why = motion.explanation.as_ref();
    let why = why.map_or(String::new(), |why| format!("\nWhat would have to give: {}.", why.sentences()));
    format!(
        "{verdict}: {} after {} iterations; {}.{advice}{why}\n\
         {total} s in total: map {map} s, evaluation {evaluation} s, linear solver {linear} s.\n\
         Written: {}",
        motion.status,
        motion.iterations,
        report::check_counts(&planned.check.rows),
        visible(&output.display().to_string())
    )
}

/// The result for `--json`.
fn object(planned: &Planned, output: &Path, plot: Option<&Path>, no_plot: Option<Error>) -> Value {
    let Planned { prepared, map, plan, motion, check, derivatives } = planned;
    json!({
        "plan": output,
        "plot": plot.filter(|_| no_plot.is_none()),
        "plot_error": no_plot.map(|error| error.to_string()),
        "solved": motion.solved,
        "passed": check.passed,
        "interrupted": motion.interrupted,
        "solver": plan.meta.solver,
        "explanation": plan.meta.explanation,
        "terrain": prepared.ground.report,
        "map": map.as_ref().map(|built| json!({ "cached": built.cached, "report": built.report })),
        "violations": motion.violations,
        "derivatives": derivatives,
        "checks": check.rows,
        "figures": figures(check),
    })
}

fn ending(planned: &Planned) -> Ending {
    let right_derivatives = planned.derivatives.as_ref().is_none_or(|errors| errors.iter().all(is_right));
    match planned.motion.interrupted {
        true => Ending::Interrupted,
        false if planned.motion.solved && planned.check.passed && right_derivatives => Ending::Good,
        false => Ending::NotGood,
    }
}

fn is_right(error: &DerivativeError) -> bool {
    error.missing == 0 && error.largest <= DERIVATIVE_TOLERANCE
}
