//! Runs a command of the Python package in place of this program, with the same arguments and the same exit codes.

use std::ffi::OsString;
use std::io;
use std::path::Path;
use std::process::{Child, ExitStatus};
use std::thread;
use std::time::Duration;

use clap::Args;
use nix::sys::signal::{Signal, kill};
use nix::unistd::Pid;

use super::console::Console;
use super::ending::{Ending, listen_for_ctrl_c};
use crate::ipopt::InGoodOrder;
use crate::{Error, Result, ipopt, replay};

/// How often this process looks whether Python has ended, or Ctrl-C has come.
const POLL: Duration = Duration::from_millis(10);

/// Arguments that Python reads.
#[derive(Debug, Args)]
pub(super) struct PythonArguments {
    /// A file, and options of the Python package
    #[arg(trailing_var_arg = true, allow_hyphen_values = true, required = true, value_name = "ARGUMENTS")]
    arguments: Vec<OsString>,
}

impl PythonArguments {
    /// Whether `--json` is among them.
    pub fn has_json(&self) -> bool {
        self.arguments.iter().any(|argument| argument == "--json")
    }

    /// Runs `python -m MODULE` with these arguments.
    ///
    /// # Errors
    /// When no Python has the package, or it cannot be run.
    pub fn run(&self, module: &str, console: &Console) -> Result<Ending> {
        let python = replay::python()?;
        let mut command = replay::command(&python);
        command.args(["-m", module]).args(&self.arguments);
        if console.is_json() && !self.has_json() {
            command.arg("--json");
        }
        if console.is_quiet() {
            command.arg("--quiet");
        }
        // At Ctrl-C, Python reports it and ends, and this process waits for that.
        listen_for_ctrl_c()?;
        let _in_good_order = InGoodOrder::begin();
        let status = command.spawn().and_then(end_of).map_err(|e| Error::io(&python, e))?;
        ending(&python, status)
    }
}

/// Waits for Python. A SIGINT to this process alone is passed on to it; one that a terminal sends to both counts once there
/// (`warpgait.console` in Python).
fn end_of(mut python: Child) -> io::Result<ExitStatus> {
    let mut passed_on = false;
    loop {
        if let Some(status) = python.try_wait()? {
            return Ok(status);
        }
        if ipopt::INTERRUPT.is_raised() && !passed_on {
            passed_on = true;
            // It is not reaped yet, so that this is its id; an error would say that it has ended.
            let _ = kill(Pid::from_raw(python.id().cast_signed()), Signal::SIGINT);
        }
        thread::sleep(POLL);
    }
}

fn ending(python: &Path, status: ExitStatus) -> Result<Ending> {
    match status.code() {
        Some(code) => Ok(Ending::Code(u8::try_from(code).unwrap_or(1))),
        None if ipopt::INTERRUPT.is_raised() => Ok(Ending::Interrupted),
        None => Err(Error::Internal(format!(
            "{} crashed or was killed ({status}); the system kills programs when memory runs out",
            python.display()
        ))),
    }
}
