//! `warpgait bench`, and `warpgait bench-case`, the process of one case.

use std::path::PathBuf;
use std::time::Duration;

use clap::Args;
use clap::builder::{PossibleValuesParser, TypedValueParser};
use serde_json::json;

use super::console::Console;
use super::ending::{Ending, listen_for_ctrl_c};
use super::progress_line::ProgressLine;
use crate::bench::case::Work;
use crate::bench::protocol::{self, FORMULATIONS, LEVELS, TERRAINS};
use crate::bench::sweep::SweepProgress;
use crate::bench::verdict::verdict;
use crate::bench::{self, Bench, BenchOptions, measure, tables};
use crate::ipopt::InGoodOrder;
use crate::robot::Robot;
use crate::visible::visible;
use crate::{Error, Result};

const EXAMPLES: &str = "\
Examples:
  warpgait bench table1 --quick                     a few cases of Table I, in minutes
  warpgait bench table1 --level medium --jobs 2     two cases at a time, which disturbs the timings
  warpgait bench frontier --terrain pit --time-limit 100
  warpgait bench track --robot anymal_c             replays, which need the Python package

An interrupted bench continues where it stopped. DIR/NAME holds tables and drawings; DIR/cases holds
the scenario of every case, and the log of those without a result.";

#[derive(Debug, Args)]
#[command(after_help = EXAMPLES)]
pub(super) struct BenchArguments {
    /// The table, figure or measurement to compute
    #[arg(value_parser = PossibleValuesParser::new(Bench::ALL.map(Bench::name)).try_map(bench_named))]
    name: Bench,
    /// Folder of the results; cases finished there are not computed again
    #[arg(long, value_name = "DIR", default_value = "bench")]
    out: PathBuf,
    /// Run a few cases only
    #[arg(long)]
    quick: bool,
    /// Cases at a time; more than 1 disturbs the timings
    #[arg(long, value_name = "N", default_value_t = 1, value_parser = clap::value_parser!(u16).range(1..=256))]
    jobs: u16,
    /// A shipped robot [default: anymal_towr; for track: anymal_b and anymal_c, which have full models]
    #[arg(long, value_name = "NAME", value_parser = PossibleValuesParser::new(Robot::shipped()))]
    robot: Option<String>,
    /// Only these levels of the terrains, separated by commas
    #[arg(long, value_delimiter = ',', value_parser = PossibleValuesParser::new(LEVELS))]
    level: Vec<String>,
    /// Only these formulations, separated by commas
    #[arg(long, value_delimiter = ',', value_parser = PossibleValuesParser::new(FORMULATIONS))]
    formulation: Vec<String>,
    /// Only these terrains, separated by commas
    #[arg(long, value_delimiter = ',', value_parser = PossibleValuesParser::new(TERRAINS))]
    terrain: Vec<String>,
    /// Processor time after which a case times out; a tenth of its wall time counts at least
    #[arg(long, value_name = "SECONDS", default_value_t = 900, value_parser = clap::value_parser!(u64).range(1..=86400))]
    time_limit: u64,
    /// Reuse finished cases of other builds of this program, too
    #[arg(long)]
    any_program: bool,
}

#[derive(Debug, Args)]
pub(super) struct CaseArguments {
    /// Process whose end ends this one, too
    #[arg(long, value_name = "PID")]
    parent: Option<u32>,
    /// What to compute
    #[arg(value_parser = PossibleValuesParser::new(Work::ALL.map(Work::name)).try_map(work_named))]
    work: Work,
    /// The scenario file
    scenario: PathBuf,
    /// The plan to write
    plan: PathBuf,
    /// The result to write, in JSON
    result: PathBuf,
}

fn bench_named(name: String) -> std::result::Result<Bench, String> {
    Bench::ALL.into_iter().find(|bench| bench.name() == name).ok_or(name)
}

fn work_named(name: String) -> std::result::Result<Work, String> {
    Work::ALL.into_iter().find(|work| work.name() == name).ok_or(name)
}

pub(super) fn bench(arguments: BenchArguments, console: &Console) -> Result<Ending> {
    let bench = arguments.name;
    let options = options(arguments);
    let title = format!("bench {}", bench.name());
    if protocol::cases(bench, &options).is_empty() {
        return Err(Error::input(format!(
            "{title}: no case matches; drop one of --robot, --terrain, --level and --formulation"
        )));
    }
    listen_for_ctrl_c()?;
    let _in_good_order = InGoodOrder::begin();
    let mut progress = ProgressLine::new(console.is_quiet());
    progress.update(&title, "starting");
    let results = bench::run(bench, &options, &mut |at| progress.update(&title, &progress_text(at)))?;
    drop(progress);
    let Some(results) = results else {
        console.note("Finished cases are kept; run the same command again to continue.");
        return Ok(Ending::Interrupted);
    };
    console.result(&tables::table(&results.rows, &results.groups));
    for file in &results.files {
        console.result(&format!("Written: {}", visible(&file.display().to_string())));
    }
    console.object(&json!({
        "bench": bench.name(),
        "groups": results.groups,
        "files": results.files,
    }));
    Ok(Ending::Good)
}

fn options(arguments: BenchArguments) -> BenchOptions {
    BenchOptions {
        out: arguments.out,
        quick: arguments.quick,
        jobs: arguments.jobs.into(),
        robot: arguments.robot,
        levels: arguments.level,
        formulations: arguments.formulation,
        terrains: arguments.terrain,
        time_limit: Duration::from_secs(arguments.time_limit),
        any_program: arguments.any_program,
    }
}

fn progress_text(at: &SweepProgress) -> String {
    format!(
        "{} of {} cases ({} finished before), about {} left; last: {}: {}",
        at.done,
        at.total,
        at.kept,
        duration(at.seconds_left),
        at.last.case.name,
        verdict(at.last)
    )
}

/// A duration in seconds, in minutes from 90 s on, in hours from 90 min on.
fn duration(seconds: f64) -> String {
    const MINUTE: f64 = 60.0;
    const HOUR: f64 = 60.0 * MINUTE;
    if seconds < 1.5 * MINUTE {
        format!("{seconds:.0} s")
    } else if seconds < 1.5 * HOUR {
        format!("{:.0} min", seconds / MINUTE)
    } else {
        format!("{:.1} h", seconds / HOUR)
    }
}

pub(super) fn case(arguments: &CaseArguments) -> Result<Ending> {
    if let Some(parent) = arguments.parent {
        bench::end_with(parent)?;
    }
    measure::run_to_file(arguments.work, &arguments.scenario, &arguments.plan, &arguments.result)?;
    Ok(Ending::Good)
}
