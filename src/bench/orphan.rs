//! A case's process ends when the sweep that started it is gone, however that ended.

use std::os::unix::process::parent_id;
use std::time::Duration;

use crate::{Error, Result};

/// How often a process looks whether its parent is still there.
const POLL: Duration = Duration::from_millis(200);
/// Nobody is left to read it: 128 + SIGTERM.
const EXIT_CODE: i32 = 143;

/// From now on this process ends as soon as `parent` is not its parent any more: an orphan is adopted by another process.
/// What it was writing is left beside its target, not in its place.
///
/// # Errors
/// Internal, when no thread can be started.
pub fn end_with(parent: u32) -> Result<()> {
    let watch = move || {
        while parent_id() == parent {
            std::thread::sleep(POLL);
        }
        std::process::exit(EXIT_CODE);
    };
    std::thread::Builder::new()
        .name("orphan".into())
        .spawn(watch)
        .map_err(|e| Error::Internal(format!("a thread that watches the parent: {e}")))?;
    Ok(())
}
