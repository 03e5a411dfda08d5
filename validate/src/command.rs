//! The command line, for the program `warpgait` that the package installs.

use std::ffi::OsString;
use std::path::PathBuf;

use pyo3::prelude::*;
use warpgait::{cli, program};

/// Run the command line with these arguments, the first of which is its name; returns the exit code.
///
/// It writes to the standard output and error of the process, not to `sys.stdout`, and handles Ctrl-C itself. Processes of its own are run
/// with the interpreter `python`; `file` is the compiled module.
#[pyfunction]
pub fn run_command(py: Python<'_>, arguments: Vec<OsString>, python: PathBuf, file: PathBuf) -> u8 {
    program::loaded_into(python, file);
    py.detach(|| cli::run_with(arguments))
}
