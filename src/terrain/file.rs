//! Files that a scenario, or a file of it, names.

use std::path::Path;

use crate::error::{Error, Result};
use crate::files::{self, MAX_FILE};

/// The content of a file of heights.
///
/// # Errors
/// If it cannot be read, is no regular file, or is too large; says where it was looked for.
pub fn read_file(path: &Path) -> Result<Vec<u8>> {
    files::read(path, MAX_FILE).map_err(|e| match e {
        Error::Io { path, source } => Error::input(format!(
            "{source} (looked for {path}; relative paths start at the scenario's folder)"
        )),
        other => other,
    })
}
