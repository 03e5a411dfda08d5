//! `warpgait solve`: terrain → map → NLP → plan → check.

use std::collections::BTreeMap;
use std::ops::ControlFlow;
use std::path::{Path, PathBuf};
use std::sync::Arc;
use std::time::Instant;

use clap::Args;
use serde_json::json;
use sha2::{Digest, Sha256};

use super::console::Console;
use super::progress::Progress;
use super::{Ending, beside, check, map};
use crate::check::{CheckReport, check as check_plan};
use crate::ipopt::NlpProblem;
use crate::nlp::derivatives::{self, DerivativeError};
use crate::nlp::solve::{self as nlp, Motion};
use crate::plan::Plan;
use crate::plan::npz::{ensure_writable, write_atomically};
use crate::plan::sampled::Provenance;
use crate::robot::Robot;
use crate::scenario::{self, Formulation, LoadedScenario};
use crate::terrain::{self, Ground};
use crate::{Error, Result, report};

/// Derivatives that differ more than this from central differences are wrong.
const DERIVATIVE_TOLERANCE: f64 = 1e-4;
/// So many variables are moved in a check of the derivatives.
const DERIVATIVE_VARIABLES: usize = 200;

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
    let robot = Robot::load(&scenario.robot, &loaded.base_dir)?;
    phases_match(&loaded, &robot)?;
    nlp::validate(scenario)?;
    super::listen_for_ctrl_c()?;

    let mut progress = Progress::new(console.is_quiet());
    progress.update("terrain", "");
    let mut ground = terrain::build(&scenario.terrain, &loaded.base_dir)?;
    loaded.ensure_inside(ground.field.extent())?;
    ground.report.notes.iter().for_each(|note| progress.note(&format!("terrain: {note}")));
    let inputs = inputs(&loaded, &mut ground)?;

    let map_start = Instant::now();
    let built = match scenario.formulation {
        Formulation::Direct => None,
        Formulation::Warped => match map::build(&ground.field, &scenario.map, true, &mut progress)? {
            Some(built) => Some(built),
            // Without a map there is no iterate to keep.
            None => return Ok(Ending::Interrupted),
        },
    };
    let map_seconds = map_start.elapsed().as_secs_f64();
    let warp = built.as_ref().map(|built| &built.map);
    let field = Arc::new(ground.field.clone());

    let derivatives = match arguments.check_derivatives {
        true => {
            progress.update("derivatives", "");
            let mut problem = nlp::problem(scenario, &robot, &field, warp)?;
            Some(check_derivatives(&mut problem)?)
        }
        false => None,
    };

    let motion = nlp::solve(scenario, &robot, &field, warp, &mut |at| {
        let record = at.record;
        let detail = format!(
            "iteration {}, violation {:.1e}, objective {:.3e}",
            at.iteration, record.violation, record.objective
        );
        progress.update(at.stage, &detail);
        ControlFlow::Continue(())
    })?;
    progress.update("plan", "");
    let text = &loaded.text;
    let provenance = Provenance { scenario, text, robot: &robot, ground: &ground, inputs, map_seconds };
    let mut plan = Plan::from_motion(&motion, &provenance);
    let found = check_plan(&plan)?;
    plan.meta.checks = found.rows.clone();
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
        "terrain": ground.report,
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

fn phases_match(loaded: &LoadedScenario, robot: &Robot) -> Result<()> {
    match &loaded.scenario.gait.phases {
        Some(rows) if rows.len() != robot.feet.len() => {
            let names: Vec<&str> = robot.feet.iter().map(|foot| foot.name.as_str()).collect();
            let what = format!("given {} rows, allowed: one by foot, for {}", rows.len(), names.join(", "));
            Err(loaded.error("gait.phases", what))
        }
        _ => Ok(()),
    }
}

/// SHA-256 of every file that goes in.
fn inputs(loaded: &LoadedScenario, ground: &mut Ground) -> Result<BTreeMap<String, String>> {
    let mut inputs: BTreeMap<String, String> = ground.inputs.drain(..).collect();
    let robot = loaded.scenario.robot.file.as_ref().map(|file| (file.clone(), loaded.base_dir.join(file)));
    let scenario =
        loaded.path.file_name().map(|name| (name.to_string_lossy().into_owned(), loaded.path.clone()));
    for (name, path) in robot.into_iter().chain(scenario) {
        inputs.insert(name, sha256(&path)?);
    }
    Ok(inputs)
}

fn sha256(path: &Path) -> Result<String> {
    let bytes = std::fs::read(path).map_err(|e| Error::io(path, e))?;
    Ok(Sha256::digest(bytes).iter().map(|byte| format!("{byte:02x}")).collect())
}

/// At the guess, in directions spread over all variables.
fn check_derivatives(problem: &mut crate::nlp::Problem) -> Result<Vec<DerivativeError>> {
    let n = problem.num_variables();
    let mut x = vec![0.0; n];
    problem.initial_point(&mut x);
    let variables: Vec<usize> = (0..n).step_by(n.div_ceil(DERIVATIVE_VARIABLES).max(1)).collect();
    Ok(derivatives::check(problem, &x, &variables))
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
