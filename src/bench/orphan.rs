//! Ends the process of a case when its sweep ends, for whatever reason.

use std::os::unix::process::parent_id;
use std::time::Duration;

use crate::{Error, Result};

/// How often a process checks that its parent is still running.
const PARENT_POLL: Duration = Duration::from_millis(200);
/// 128 + SIGTERM, the shell's code for a terminated process. No process is left to read it.
const EXIT_CODE: i32 = 143;

/// From now on this process exits as soon as its parent is no longer `parent`: the system gives orphans another parent.
/// Files are written atomically, so that none is left incomplete.
///
/// # Errors
/// Internal, when no thread can be started.
pub fn end_with(parent: u32) -> Result<()> {
    let watch = move || {
        while parent_id() == parent {
            std::thread::sleep(PARENT_POLL);
        }
        std::process::exit(EXIT_CODE);
    };
    std::thread::Builder::new()
        .name("orphan".into())
        .spawn(watch)
        .map_err(|e| Error::Internal(format!("cannot start the thread that watches the parent: {e}")))?;
    Ok(())
}
