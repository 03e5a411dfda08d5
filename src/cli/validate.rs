//! `warpgait validate`: hands over to the Python package, which replays the plan in MuJoCo.

use std::ffi::OsString;
use std::process::{Command, ExitStatus};

use super::console::Console;
use super::{Ending, listen_for_ctrl_c};
use crate::{Error, Result, ipopt, replay};

pub(super) fn validate(arguments: &[OsString], console: &Console) -> Result<Ending> {
    let python = replay::python()?;
    let mut command = Command::new(&python);
    command.args(["-m", "warpgait.validate"]).args(arguments);
    if console.is_json() && !arguments.iter().any(|word| word == "--json") {
        command.arg("--json");
    }
    if console.is_quiet() {
        command.arg("--quiet");
    }
    // Ctrl-C reaches Python, too, which says so and ends; the prompt is not to come back before.
    listen_for_ctrl_c()?;
    ending(command.status().map_err(|e| Error::io(&python, e))?)
}

fn ending(status: ExitStatus) -> Result<Ending> {
    match status.code() {
        Some(code) => Ok(Ending::Code(u8::try_from(code).unwrap_or(1))),
        None if ipopt::INTERRUPT.is_raised() => Ok(Ending::Interrupted),
        None => Err(Error::Internal(format!(
            "the replay crashed or was ended from outside ({status}); where memory is short, the system does that"
        ))),
    }
}
