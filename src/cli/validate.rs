//! `warpgait validate`: runs the Python package, which replays the plan in MuJoCo.

use clap::Args;

use super::python::PythonArguments;

const EXAMPLES: &str = "\
Examples:
  warpgait validate hill.plan.npz                   replay a plan and judge it
  warpgait validate hill.plan.npz --friction 0.5    on slippery ground
  warpgait validate -- --help                       all options of the Python package
  WARPGAIT_PYTHON=.venv/bin/python warpgait validate hill.plan.npz    with a Python of your own

Python is that of .venv in the program's repository, or else python3. Nothing in the working folder is run.
Exit codes: 0 trackable; 1 not trackable; 2 bad input, or the Python package is missing; 130 interrupted.";

#[derive(Debug, Args)]
#[command(after_help = EXAMPLES)]
pub(super) struct ValidateArguments {
    #[command(flatten)]
    pub python: PythonArguments,
}
