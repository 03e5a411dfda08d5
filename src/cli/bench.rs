//! `warpgait bench`, and the process of one case.

use std::path::PathBuf;
use std::time::Duration;

use clap::Args;
use clap::builder::{PossibleValuesParser, TypedValueParser};
use serde_json::json;

use super::Ending;
use super::console::Console;
use super::progress::Progress;
use crate::bench::case::{self, Work};
use crate::bench::protocol::{FORMULATIONS, LEVELS, TERRAINS};
use crate::bench::{self, Bench, Options, summary, tables};
use crate::robot::Robot;
use crate::{Error, Result};

#[derive(Debug, Args)]
pub(super) struct BenchArguments {
    /// What to reproduce
    #[arg(value_parser = PossibleValuesParser::new(Bench::ALL.map(Bench::name)).try_map(bench_named))]
    name: Bench,
    /// Folder of the results; what is finished there is not computed again
    #[arg(long, value_name = "DIR", default_value = "bench")]
    out: PathBuf,
    /// A few cases only
    #[arg(long)]
    quick: bool,
    /// Cases at a time; more than 1 disturbs the timings
    #[arg(long, value_name = "N", default_value_t = 1, value_parser = clap::value_parser!(u16).range(1..=256))]
    jobs: u16,
    /// A shipped robot [default: anymal_towr; for track: anymal_b and anymal_c, which have full models]
    #[arg(long, value_name = "NAME", value_parser = PossibleValuesParser::new(Robot::shipped()))]
    robot: Option<String>,
    /// Only these levels of the terrains
    #[arg(long, value_delimiter = ',', value_parser = PossibleValuesParser::new(LEVELS))]
    level: Vec<String>,
    /// Only these formulations
    #[arg(long, value_delimiter = ',', value_parser = PossibleValuesParser::new(FORMULATIONS))]
    formulation: Vec<String>,
    /// Only these terrains
    #[arg(long, value_delimiter = ',', value_parser = PossibleValuesParser::new(TERRAINS))]
    terrain: Vec<String>,
    /// Processor time after which the process of a case is given up; of wall time, a tenth counts at least
    #[arg(long, value_name = "SECONDS", default_value_t = 900, value_parser = clap::value_parser!(u64).range(1..=86400))]
    time_limit: u64,
    /// Take finished cases of other builds of this program, too
    #[arg(long)]
    any_program: bool,
}

/// The process of one case; what `bench` starts.
#[derive(Debug, Args)]
pub(super) struct CaseArguments {
    /// Id of the process that waits for the case: when that ends, so does this one
    #[arg(long, value_name = "PID")]
    parent: Option<u32>,
    #[arg(value_parser = PossibleValuesParser::new(Work::ALL.map(Work::name)).try_map(work_named))]
    work: Work,
    scenario: PathBuf,
    plan: PathBuf,
    result: PathBuf,
}

fn bench_named(name: String) -> std::result::Result<Bench, String> {
    Bench::ALL.into_iter().find(|bench| bench.name() == name).ok_or(name)
}

fn work_named(name: String) -> std::result::Result<Work, String> {
    Work::ALL.into_iter().find(|work| work.name() == name).ok_or(name)
}

pub(super) fn bench(arguments: BenchArguments, console: &Console) -> Result<Ending> {
    let options = Options {
        out: arguments.out,
        quick: arguments.quick,
        jobs: arguments.jobs.into(),
        robot: arguments.robot,
        levels: arguments.level,
        formulations: arguments.formulation,
        terrains: arguments.terrain,
        time_limit: Duration::from_secs(arguments.time_limit),
        any_program: arguments.any_program,
    };
    if arguments.name.cases(&options).is_empty() {
        return Err(Error::input(format!(
            "bench {}: nothing is left to run with these --robot, --terrain, --level and --formulation",
            arguments.name.name()
        )));
    }
    super::listen_for_ctrl_c()?;
    let mut progress = Progress::new(console.is_quiet());
    progress.update(&format!("bench {}", arguments.name.name()), "starting");
    let outcome = bench::run(arguments.name, &options, &mut |at| {
        progress.update(
            &format!("bench {}", arguments.name.name()),
            &format!(
                "{} of {} cases ({} from before), about {} left; last: {}: {}",
                at.done,
                at.all,
                at.kept,
                duration(at.left),
                at.last.case.name,
                summary::verdict(at.last)
            ),
        );
    })?;
    drop(progress);
    let Some(outcome) = outcome else {
        console.note("what is finished is kept: the same command goes on from there");
        return Ok(Ending::Interrupted);
    };
    console.result(&tables::table(&outcome));
    for file in &outcome.files {
        console.result(&format!("Written: {}", file.display()));
    }
    console.object(&json!({
        "bench": arguments.name.name(),
        "groups": outcome.groups,
        "files": outcome.files,
    }));
    Ok(Ending::Good)
}

pub(super) fn case(arguments: &CaseArguments) -> Result<Ending> {
    if let Some(parent) = arguments.parent {
        bench::end_with(parent)?;
    }
    case::run_to_file(arguments.work, &arguments.scenario, &arguments.plan, &arguments.result)?;
    Ok(Ending::Good)
}

fn duration(seconds: f64) -> String {
    match seconds {
        s if s < 90.0 => format!("{s:.0} s"),
        s if s < 5400.0 => format!("{:.0} min", s / 60.0),
        s => format!("{:.1} h", s / 3600.0),
    }
}
