//! The command line: arguments in, exit codes out.
//!
//! Messages and progress go to standard error, results to standard output; with `--json`, standard output is exactly one
//! JSON object. Exit codes: 0 all is well; 1 a plan that is not solved or fails a check; 2 bad input or usage, nothing
//! written, or standard output cannot be written; 130 interrupted. A closed standard output is no error.

mod atlas;
mod bench;
mod check;
mod console;
mod dataset;
mod ending;
mod export;
mod figures;
mod init;
mod map;
mod progress_line;
mod python;
mod robot;
mod schema;
mod solve;
mod sweep;
mod terrain;
mod validate;
mod view;

use std::ffi::OsString;
use std::io::{ErrorKind, Write};
use std::process::ExitCode;

use clap::{Parser, Subcommand};

use crate::{Result, ipopt};
use console::Console;
use ending::{ERROR_CODE, Ending};

const EXAMPLES: &str = "\
Examples:
  warpgait init hill                  write hill.toml, a commented scenario
  warpgait solve hill.toml            plan it: hill.plan.npz and hill.svg
  warpgait check hill.plan.npz        recompute every law of the plan
  warpgait validate hill.plan.npz     replay the plan in MuJoCo
  warpgait view hill.plan.npz         look at the plan in the browser
  warpgait export hill.plan.npz --to csv            the motion for trainers, robots and viewers
  warpgait terrain show scan.npy --spacing 0.04     draw a ground before planning on it
  warpgait map hill.toml              build and judge the warp map alone
  warpgait sweep hills.toml           plan many scenarios, each in a process of its own
  warpgait atlas scan.png --robot go1 --spacing 0.04 --height-scale 1    where the robot can start
  warpgait dataset -o walks --count 100             motions for training
  warpgait bench table1 --quick       a few cases of the paper's Table I
  warpgait solve --help               options and examples of one command

Exit codes: 0 solved and every check holds; 1 a plan that is not solved or fails a check;
2 bad input or usage, nothing written (or standard output is full); 130 interrupted.";

#[derive(Debug, Parser)]
#[command(name = "warpgait", version, about, after_help = EXAMPLES, arg_required_else_help = true)]
struct Arguments {
    #[command(subcommand)]
    command: Command,
    /// Print one JSON object on standard output and nothing else there
    #[arg(long, global = true)]
    json: bool,
    /// Print errors only, no progress and no tables
    #[arg(long, short, global = true)]
    quiet: bool,
}

#[derive(Debug, Subcommand)]
enum Command {
    /// Write a commented scenario to start from
    Init(init::InitArguments),
    /// Print the JSON Schema of scenario files, for editors
    Schema(schema::SchemaArguments),
    /// Plan a motion: terrain, map, NLP, plan, check
    Solve(solve::SolveArguments),
    /// Build and judge the warp map of a scenario alone
    Map(map::MapArguments),
    /// Draw a ground and say what it was taken for, or convert it
    Terrain(terrain::TerrainArguments),
    /// Make a robot of a URDF or MJCF, show one, or list those that ship
    Robot(robot::RobotArguments),
    /// Recompute every law of a plan in ambient space, on the plan's own samples
    Check(check::CheckArguments),
    /// Reproduce the paper's tables and figures, and measure beyond them
    Bench(bench::BenchArguments),
    /// Compute one case of a bench; for use by `bench`
    #[command(hide = true)]
    BenchCase(bench::CaseArguments),
    /// Replay a plan on the full robot in MuJoCo (needs the Python package)
    Validate(validate::ValidateArguments),
    /// Write the motion of a plan for trainers, robots and viewers (needs the Python package)
    Export(export::ExportArguments),
    /// Show a plan in the browser, as one page to send to others (needs the Python package)
    View(view::ViewArguments),
    /// Plan many scenarios that differ in some values (needs the Python package)
    Sweep(sweep::SweepArguments),
    /// Map where on a ground a robot can start, and in which direction (needs the Python package)
    Atlas(atlas::AtlasArguments),
    /// Make motions over random ground for training, with a card (needs the Python package)
    Dataset(dataset::DatasetArguments),
}

/// Runs the program with the arguments of the process.
pub fn run() -> ExitCode {
    ExitCode::from(run_with(std::env::args_os()))
}

/// Runs the program with these arguments, the first of which is its name; returns the exit code. Everything is written when it returns.
pub fn run_with(arguments: impl IntoIterator<Item = OsString>) -> u8 {
    let code = parse_and_run(arguments);
    // A program in another language ends without this.
    let _ = std::io::stdout().flush();
    code
}

fn parse_and_run(arguments: impl IntoIterator<Item = OsString>) -> u8 {
    ipopt::keep_freed_memory();
    let arguments = match Arguments::try_parse_from(arguments) {
        Ok(arguments) => arguments,
        Err(error) => {
            // Help and version are not errors; neither is a closed pipe.
            let printed = error.print().or_else(|e| match e.kind() {
                ErrorKind::BrokenPipe => Ok(()),
                _ => Err(e),
            });
            if let Err(error) = &printed {
                eprintln!("error: standard output: {error}");
            }
            let good = printed.is_ok() && !error.use_stderr();
            return if good { Ending::Good.code() } else { ERROR_CODE };
        }
    };
    let console = Console::new(arguments.json || arguments.command.has_json(), arguments.quiet);
    match execute(arguments.command, &console).and_then(|ending| console.finish().map(|()| ending)) {
        Ok(ending) => {
            if ending == Ending::Interrupted {
                console.note("interrupted");
            }
            ending.code()
        }
        Err(error) => {
            console.error(&error);
            ERROR_CODE
        }
    }
}

impl Command {
    /// Whether `--json` is among the arguments that are passed on to Python.
    fn has_json(&self) -> bool {
        match self {
            Command::Validate(arguments) => arguments.python.has_json(),
            Command::Export(arguments) => arguments.python.has_json(),
            Command::View(arguments) => arguments.python.has_json(),
            Command::Sweep(arguments) => arguments.python.has_json(),
            Command::Atlas(arguments) => arguments.python.has_json(),
            Command::Dataset(arguments) => arguments.python.has_json(),
            Command::Robot(arguments) => arguments.has_json(),
            _ => false,
        }
    }
}

fn execute(command: Command, console: &Console) -> Result<Ending> {
    match command {
        Command::Init(arguments) => init::init(&arguments, console),
        Command::Schema(_) => schema::schema(console),
        Command::Solve(arguments) => solve::solve(&arguments, console),
        Command::Map(arguments) => map::map(&arguments, console),
        Command::Terrain(arguments) => terrain::terrain(&arguments, console),
        Command::Check(arguments) => check::check(&arguments, console),
        Command::Bench(arguments) => bench::bench(arguments, console),
        Command::Robot(arguments) => robot::robot(&arguments, console),
        Command::BenchCase(arguments) => bench::case(&arguments),
        Command::Validate(arguments) => arguments.python.run("warpgait.commands.validate", console),
        Command::Export(arguments) => arguments.python.run("warpgait.commands.export", console),
        Command::View(arguments) => arguments.python.run("warpgait.commands.view", console),
        Command::Sweep(arguments) => arguments.python.run("warpgait.commands.sweep", console),
        Command::Atlas(arguments) => arguments.python.run("warpgait.commands.atlas", console),
        Command::Dataset(arguments) => arguments.python.run("warpgait.commands.dataset", console),
    }
}
