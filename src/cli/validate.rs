//! `warpgait validate`: hands over to the Python package, which replays the plan in MuJoCo.

use std::ffi::OsString;
use std::process::Command;

use super::Ending;
use super::console::Console;
use crate::{Error, Result, replay};

pub(super) fn validate(arguments: &[OsString], console: &Console) -> Result<Ending> {
    let python = replay::python()?;
    let mut command = Command::new(&python);
    command.args(["-m", "warpgait.validate"]).args(arguments);
    if console.is_json() {
        command.arg("--json");
    }
    if console.is_quiet() {
        command.arg("--quiet");
    }
    let status = command.status().map_err(|e| Error::io(&python, e))?;
    // Without a code a signal ended it.
    Ok(Ending::Code(status.code().map_or(130, |code| u8::try_from(code).unwrap_or(1))))
}
