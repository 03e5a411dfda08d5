//! `warpgait validate`: hands over to the Python package, which replays the plan in MuJoCo.

use std::ffi::OsString;
use std::path::{Path, PathBuf};
use std::process::{Command, Stdio};

use super::Ending;
use super::console::Console;
use crate::{Error, Result};

/// Exits with 0 when Python finds the package; does not import it, which would take a second.
const HAS_PACKAGE: &str =
    "import importlib.util, sys; sys.exit(importlib.util.find_spec('warpgait') is None)";

pub(super) fn validate(arguments: &[OsString], console: &Console) -> Result<Ending> {
    let Some(python) = candidates().into_iter().find(|python| has_package(python)) else {
        return Err(Error::input(
            "the replay needs the Python package `warpgait`, found neither in a .venv nor in python3. Install it: \
             python3 -m venv .venv && .venv/bin/pip install ./validate",
        ));
    };
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

/// The `.venv` of the working folder, those above the program, and `python3`.
fn candidates() -> Vec<PathBuf> {
    let mut folders = vec![PathBuf::from(".")];
    if let Ok(program) = std::env::current_exe() {
        folders.extend(program.ancestors().skip(1).take(4).map(Path::to_path_buf));
    }
    let mut pythons: Vec<PathBuf> = folders.iter().map(|folder| folder.join(".venv/bin/python")).collect();
    pythons.retain(|python| python.exists());
    pythons.push("python3".into());
    pythons
}

fn has_package(python: &Path) -> bool {
    let mut command = Command::new(python);
    command.args(["-c", HAS_PACKAGE]).stdin(Stdio::null()).stdout(Stdio::null()).stderr(Stdio::null());
    command.status().is_ok_and(|status| status.success())
}
