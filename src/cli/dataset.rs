//! `warpgait dataset`: runs the Python package, which makes motions over random ground for training.

use clap::Args;

use super::python::PythonArguments;

const EXAMPLES: &str = "\
Examples:
  warpgait dataset -o walks --count 100                              motions of anymal_c for Isaac Lab, and a card; resumes
  warpgait dataset -o hops --robot go1 --gaits trot,pace --to amp    another robot, other gaits, another format
  warpgait dataset -- --help                                         all options

Motions are kept that obey every law and that the robot tracks in a replay. README.md in the folder says how many failed, and why.
Python is that of .venv in the program's repository, or else python3. Nothing in the working folder is run.
Exit codes: 0 as many as asked for; 1 fewer; 2 bad input, or the Python package is missing; 130 interrupted.";

#[derive(Debug, Args)]
#[command(after_help = EXAMPLES)]
pub(super) struct DatasetArguments {
    #[command(flatten)]
    pub python: PythonArguments,
}
