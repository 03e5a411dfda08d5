//! `warpgait validate`: runs the Python package, which replays the plan in MuJoCo.

use std::ffi::OsString;
use std::process::ExitStatus;

use clap::Args;

use super::console::Console;
use super::ending::{Ending, listen_for_ctrl_c};
use crate::ipopt::InGoodOrder;
use crate::{Error, Result, ipopt, replay};

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
    /// NAME.plan.npz and options of the Python package
    #[arg(trailing_var_arg = true, allow_hyphen_values = true, required = true, value_name = "ARGUMENTS")]
    arguments: Vec<OsString>,
}

impl ValidateArguments {
    /// Whether `--json` is among the arguments for Python.
    pub fn has_json(&self) -> bool {
        self.arguments.iter().any(|argument| argument == "--json")
    }
}

pub(super) fn validate(arguments: &ValidateArguments, console: &Console) -> Result<Ending> {
    let python = replay::python()?;
    let mut command = replay::command(&python);
    command.args(["-m", "warpgait.validate"]).args(&arguments.arguments);
    if console.is_json() && !arguments.has_json() {
        command.arg("--json");
    }
    if console.is_quiet() {
        command.arg("--quiet");
    }
    // Ctrl-C reaches Python, too, which reports it and ends. This process waits for that.
    listen_for_ctrl_c()?;
    let _in_good_order = InGoodOrder::begin();
    ending(command.status().map_err(|e| Error::io(&python, e))?)
}

fn ending(status: ExitStatus) -> Result<Ending> {
    match status.code() {
        Some(code) => Ok(Ending::Code(u8::try_from(code).unwrap_or(1))),
        None if ipopt::INTERRUPT.is_raised() => Ok(Ending::Interrupted),
        None => Err(Error::Internal(format!(
            "the replay crashed or was killed ({status}); the system kills programs when memory runs out"
        ))),
    }
}
