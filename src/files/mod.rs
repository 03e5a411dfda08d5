//! Files that are written whole or not at all: each is written under a temporary name beside its target and then renamed.

pub mod npy;
pub mod npz;

use std::fs::File;
use std::path::{Path, PathBuf};

use crate::{Error, Result};

/// Writes a whole file, or leaves what was there.
pub fn write_atomically(target: &Path, content: &[u8]) -> Result<()> {
    let temporary = temporary_beside(target)?;
    let written = std::fs::write(&temporary, content).and_then(|()| std::fs::rename(&temporary, target));
    written.map_err(|e| {
        let _ = std::fs::remove_file(&temporary);
        Error::io(target, e)
    })
}

/// Checks that a file can be written at `target`, without touching what is there.
pub fn ensure_writable(target: &Path) -> Result<()> {
    let temporary = temporary_beside(target)?;
    File::create(&temporary)
        .and_then(|_| std::fs::remove_file(&temporary))
        .map_err(|e| Error::input(format!("{}: cannot be written: {e}", target.display())))
}

/// A temporary name in the same folder, so that renaming does not copy.
///
/// # Errors
/// For targets that cannot be files.
pub(crate) fn temporary_beside(target: &Path) -> Result<PathBuf> {
    let refuse = |why: &str| Err(Error::input(format!("{}: cannot be written: {why}", target.display())));
    let Some(name) = target.file_name() else { return refuse("this is not the name of a file") };
    if target.is_dir() {
        return refuse("this is a folder; name a file in it");
    }
    let folder = match target.parent() {
        Some(parent) if parent.as_os_str().is_empty() => Path::new("."),
        Some(parent) => parent,
        None => return refuse("this is not the name of a file"),
    };
    if !folder.is_dir() {
        return refuse(&format!("there is no folder {}; create it first", folder.display()));
    }
    let mut hidden = std::ffi::OsString::from(".");
    hidden.push(name);
    hidden.push(format!(".{}.part", std::process::id()));
    Ok(folder.join(hidden))
}
