//! `warpgait sweep`: runs the Python package, which plans many scenarios, each in a process of its own.

use clap::Args;

use super::python::PythonArguments;

const EXAMPLES: &str = "\
Examples:
  warpgait sweep hills.toml                            hills.sweep/: results.csv, index.html, plans; resumes
  warpgait sweep hills.toml --workers 4 --shard 2/8    the second of eight parts, for the second of eight machines
  warpgait sweep hills.toml --list                     the cases, nothing is planned
  warpgait sweep -- --help                             all options, and what the file has

A sweep file names a scenario and values of its keys:
  scenario = \"hill.toml\"
  [values]
  gait.kind = [\"walk\", \"trot\"]
  start.yaw = { from = -1.0, to = 1.0, count = 5 }

Python is that of .venv in the program's repository, or else python3. Nothing in the working folder is run.
Exit codes: 0 every case has a result; 2 bad input, or the Python package is missing; 130 interrupted.";

#[derive(Debug, Args)]
#[command(after_help = EXAMPLES)]
pub(super) struct SweepArguments {
    #[command(flatten)]
    pub python: PythonArguments,
}
