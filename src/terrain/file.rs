//! Files that a scenario names.

use std::fs::{self, File};
use std::io::Read;
use std::path::Path;

use crate::error::{Error, Result};

/// Larger files are refused unread, bytes.
const MAX_FILE: u64 = 512 << 20;

/// The content of a file.
///
/// # Errors
/// If it cannot be read, is no regular file, or is too large.
pub fn read_file(path: &Path) -> Result<Vec<u8>> {
    let complain = |what: &dyn std::fmt::Display| {
        Error::input(format!(
            "{what} (looked for {}; relative paths start at the scenario's folder)",
            path.display()
        ))
    };
    let about = fs::metadata(path).map_err(|e| complain(&e))?;
    if !about.is_file() {
        return Err(complain(&"not a file"));
    }
    let too_many = |count: u64| complain(&format!("{count} bytes are too many; at most {MAX_FILE}"));
    if about.len() > MAX_FILE {
        return Err(too_many(about.len()));
    }
    // A file may grow meanwhile.
    let mut bytes = Vec::with_capacity(about.len() as usize);
    let file = File::open(path).map_err(|e| complain(&e))?;
    file.take(MAX_FILE + 1).read_to_end(&mut bytes).map_err(|e| complain(&e))?;
    if bytes.len() as u64 > MAX_FILE { Err(too_many(bytes.len() as u64)) } else { Ok(bytes) }
}
