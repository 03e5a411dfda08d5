//! Which program this is, and how it is run once more, in a process of its own: the executable, or a module of the Python that it was
//! loaded into.

use std::io;
use std::path::{Path, PathBuf};
use std::process::Command;
use std::sync::OnceLock;

/// The module of the Python package that is the command line.
const MODULE: &str = "warpgait";

/// A Python that this program was loaded into.
#[derive(Debug)]
struct Host {
    python: PathBuf,
    file: PathBuf,
}

static HOST: OnceLock<Host> = OnceLock::new();

/// Says that this program was loaded into a Python, from the compiled file `file` of its package. The first call counts.
pub fn loaded_into(python: PathBuf, file: PathBuf) {
    let _ = HOST.set(Host { python, file });
}

/// The Python that this program was loaded into; none where it is an executable.
pub fn host() -> Option<&'static Path> {
    HOST.get().map(|host| &*host.python)
}

/// What [`commit`] says where it is not known, as in a program that was built from a tarball.
const UNKNOWN: &str = "unknown";

static COMMIT: OnceLock<&str> = OnceLock::new();

/// Says which commit this program was built from. The first call counts. It is `WARPGAIT_COMMIT` of the environment of the build, which the
/// scripts set; the library does not read it itself, because it would be compiled again for every commit.
pub fn built_from(commit: Option<&'static str>) {
    if let Some(commit) = commit.filter(|commit| !commit.is_empty()) {
        let _ = COMMIT.set(commit);
    }
}

/// The commit that this program was built from, or `unknown`.
pub fn commit() -> &'static str {
    COMMIT.get().copied().unwrap_or(UNKNOWN)
}

/// A command that runs this program; its arguments are still to be added.
///
/// # Errors
/// When the system does not tell which program this is.
pub fn command() -> io::Result<Command> {
    Ok(match HOST.get() {
        Some(host) => {
            let mut command = Command::new(&host.python);
            // -P: nothing is imported from the working folder.
            command.args(["-P", "-m", MODULE]);
            command
        }
        None => Command::new(file()?),
    })
}

/// The file that this program was compiled to.
///
/// # Errors
/// When the system does not tell which program this is.
pub fn file() -> io::Result<PathBuf> {
    HOST.get().map_or_else(std::env::current_exe, |host| Ok(host.file.clone()))
}
