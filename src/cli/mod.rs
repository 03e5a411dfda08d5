//! The command line: arguments in, exit codes out.
//!
//! Messages and progress go to standard error, results to standard output; with `--json` there is exactly one JSON
//! object on standard output. Exit codes: 0 all is well; 1 a plan that is not solved or fails a check; 2 bad input or
//! usage, nothing written; 130 interrupted.

mod bench;
mod check;
mod console;
mod init;
mod map;
mod progress;
mod solve;
mod validate;

use std::ffi::OsString;
use std::path::PathBuf;
use std::process::ExitCode;

use clap::{Parser, Subcommand};

use crate::{Error, Result, ipopt};
use console::Console;

/// How a command ended, when it was not an error.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
enum Ending {
    /// 0
    Good,
    /// 1: there is a result, and it is not good enough.
    NotGood,
    /// 130: Ctrl-C.
    Interrupted,
    /// The exit code of another program.
    Code(u8),
}

const EXAMPLES: &str = "\
Examples:
  warpgait init hill                            write hill.toml, a commented scenario
  warpgait solve hill.toml                      plan it: hill.plan.npz and hill.svg
  warpgait solve hill.toml --set gait.kind=trot --formulation direct -o trot.plan.npz
  warpgait map hill.toml                        build and judge the warp map alone
  warpgait check hill.plan.npz                  recompute every law of a plan
  warpgait check hill.plan.npz --plot hill.svg  and draw the residuals over time
  warpgait validate hill.plan.npz               replay it in MuJoCo
  warpgait bench table1 --quick                 a taste of the paper's Table I

Exit codes: 0 solved and every check holds; 1 a plan that is not solved or fails a check;
2 bad input or usage, nothing written; 130 interrupted.";

#[derive(Debug, Parser)]
#[command(name = "warpgait", version, about, after_help = EXAMPLES, arg_required_else_help = true)]
struct Arguments {
    #[command(subcommand)]
    command: Command,
    /// Print one JSON object on standard output and nothing else there
    #[arg(long, global = true)]
    json: bool,
    /// No progress and no tables, only errors
    #[arg(long, short, global = true)]
    quiet: bool,
}

#[derive(Debug, Subcommand)]
enum Command {
    /// Write a commented scenario to start from
    Init(init::InitArguments),
    /// Print the JSON Schema of scenario files, for editors
    Schema,
    /// Plan a motion: terrain, map, NLP, plan, check
    Solve(solve::SolveArguments),
    /// Build and judge the warp map of a scenario alone
    Map(map::MapArguments),
    /// Recompute every law of a plan in ambient space, on the plan's own samples
    Check(check::CheckArguments),
    /// Reproduce the paper's tables and figures, and measure beyond them
    Bench(bench::BenchArguments),
    #[command(hide = true)]
    BenchCase(bench::CaseArguments),
    /// Replay a plan on the full robot in MuJoCo (needs the Python package)
    Validate {
        /// NAME.plan.npz and options; `-- --help` lists them
        #[arg(trailing_var_arg = true, allow_hyphen_values = true, required = true)]
        arguments: Vec<OsString>,
    },
}

impl Command {
    /// Whether `--json` stands among the words that are handed over to Python.
    fn asks_for_json(&self) -> bool {
        matches!(self, Command::Validate { arguments } if arguments.iter().any(|word| word == "--json"))
    }
}

/// Runs the program with the arguments it was started with.
pub fn run() -> ExitCode {
    let arguments = match Arguments::try_parse() {
        Ok(arguments) => arguments,
        Err(error) => {
            // Help and version are no errors; their output may meet a closed pipe, which is none either.
            let _ = error.print();
            return ExitCode::from(if error.use_stderr() { 2 } else { 0 });
        }
    };
    let console = Console::new(arguments.json || arguments.command.asks_for_json(), arguments.quiet);
    match execute(arguments.command, &console) {
        Ok(Ending::Good) => ExitCode::SUCCESS,
        Ok(Ending::NotGood) => ExitCode::from(1),
        Ok(Ending::Interrupted) => {
            console.note("interrupted");
            ExitCode::from(130)
        }
        Ok(Ending::Code(code)) => ExitCode::from(code),
        Err(error) => {
            console.error(&error);
            ExitCode::from(2)
        }
    }
}

fn execute(command: Command, console: &Console) -> Result<Ending> {
    match command {
        Command::Init(arguments) => init::init(&arguments, console),
        Command::Schema => init::schema(console),
        Command::Solve(arguments) => solve::solve(&arguments, console),
        Command::Map(arguments) => map::map(&arguments, console),
        Command::Check(arguments) => check::check(&arguments, console),
        Command::Bench(arguments) => bench::bench(arguments, console),
        Command::BenchCase(arguments) => bench::case(&arguments),
        Command::Validate { arguments } => validate::validate(&arguments, console),
    }
}

/// `NAME` of `NAME.plan.npz` with another ending, in the same folder.
fn beside(plan: &std::path::Path, ending: &str) -> PathBuf {
    let name = plan.file_name().map(|n| n.to_string_lossy().into_owned()).unwrap_or_default();
    let stem = name.strip_suffix(".plan.npz").or(name.strip_suffix(".npz")).unwrap_or(&name);
    plan.with_file_name(format!("{stem}{ending}"))
}

/// From now on Ctrl-C stops the work at its next iteration, a second one the program.
fn listen_for_ctrl_c() -> Result<()> {
    ipopt::install_ctrl_c().map_err(|e| Error::Internal(e.to_string()))
}
