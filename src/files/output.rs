//! Files that are written whole or not at all, by one rule for every output of every command.
//!
//! A file is written under a temporary name in its folder and then renamed. What is there is replaced only if it is a regular file that
//! may be written; its permissions stay. A symbolic link is followed: its target is replaced. Nobody can foresee the temporary
//! name. It is locked while its process runs, so that a later run can tell what a killed one left, and clear it.
//! `validate/python/warpgait/files.py` does the same.

use std::collections::hash_map::RandomState;
use std::ffi::OsString;
use std::fs::{self, File, Metadata, OpenOptions, TryLockError};
use std::hash::{BuildHasher, Hasher};
use std::io::{self, ErrorKind, Write};
use std::os::unix::fs::{FileTypeExt, MetadataExt, OpenOptionsExt, PermissionsExt, fchown};
use std::path::{Path, PathBuf};
use std::time::Duration;

use crate::{Error, Result};

/// Start of every temporary name; 16 hexadecimal digits and [`ENDING`] follow.
const START: &str = ".warpgait-";
/// End of every temporary name.
const ENDING: &str = ".part";
/// Links that are followed until they count as a circle.
const MOST_LINKS: usize = 40;
/// Where files cannot be locked, older temporary files count as left behind.
const OLD: Duration = Duration::from_secs(24 * 3600);
/// The permission bits of a mode, without those that change the user.
const PERMISSIONS: u32 = 0o777;
/// Permission to write, of anyone.
const WRITABLE: u32 = 0o222;

/// Writes a whole file, or leaves what was there.
///
/// # Errors
/// For targets that must not be replaced, and when the file cannot be written.
pub fn write_atomically(target: &Path, content: &[u8]) -> Result<()> {
    let mut pending = Pending::create(target)?;
    let written = pending.write_all(content);
    written.map_err(|e| pending.error(&e))?;
    pending.commit()
}

/// Opens a file that another process writes to, such as a log: by the same rule, but not whole or not at all.
///
/// # Errors
/// As [`write_atomically`].
pub fn open_for_process(target: &Path) -> Result<File> {
    let Target { path, .. } = Target::of(target)?;
    File::create(path).map_err(|e| refusal(target, &e))
}

/// Refuses outputs of a command before it computes anything: those that cannot be written, are an input of it, or are the same file
/// as another output. Files count as the same by device and inode, however they are spelled. What is there stays untouched.
///
/// # Errors
/// Which output is refused, and why.
pub fn ensure_outputs(outputs: &[&Path], inputs: &[PathBuf]) -> Result<()> {
    let mut places: Vec<(Place, &Path)> = Vec::new();
    for output in outputs {
        let target = Target::of(output)?;
        let place = target.place();
        if let Some(file) = place.file {
            ensure_no_input(output, file, inputs)?;
        }
        if let Some((_, other)) = places.iter().find(|(other, _)| other.is(&place)) {
            let what = format!("this command writes {} there as well; name another file", other.display());
            return Err(refusal(output, &what));
        }
        places.push((place, output));
        drop(Pending::new(output, target)?);
    }
    Ok(())
}

/// Refuses outputs that are one of these inputs, which were not known when the command began.
///
/// # Errors
/// Which output is refused.
pub fn ensure_no_inputs(outputs: &[&Path], inputs: &[PathBuf]) -> Result<()> {
    for output in outputs {
        if let Ok(about) = fs::metadata(output) {
            ensure_no_input(output, identity(&about), inputs)?;
        }
    }
    Ok(())
}

fn ensure_no_input(output: &Path, file: (u64, u64), inputs: &[PathBuf]) -> Result<()> {
    let same = |input: &&PathBuf| fs::metadata(input).is_ok_and(|about| identity(&about) == file);
    match inputs.iter().find(same) {
        Some(input) => {
            let what = format!("it is {}, which this command reads; name another file", input.display());
            Err(refusal(output, &what))
        }
        None => Ok(()),
    }
}

/// A file under its temporary name, removed unless it is committed.
pub struct Pending {
    file: File,
    temporary: PathBuf,
    target: Target,
    /// The target as the user named it.
    shown: PathBuf,
}

impl Pending {
    /// Opens a temporary file for a target, and clears what killed runs left in its folder.
    ///
    /// # Errors
    /// For targets that must not be replaced, and folders that cannot be written.
    pub fn create(target: &Path) -> Result<Self> {
        Self::new(target, Target::of(target)?)
    }

    fn new(shown: &Path, target: Target) -> Result<Self> {
        clear_left_behind(&target.folder);
        let mode = target.about.as_ref().map(|about| about.mode() & PERMISSIONS);
        let (file, temporary) = open_temporary(&target.folder, mode).map_err(|e| refusal(shown, &e))?;
        let pending = Self { file, temporary, target, shown: shown.to_path_buf() };
        if let (Some(about), Some(mode)) = (&pending.target.about, mode) {
            // Only root may give a file away; for others it becomes theirs.
            let _ = fchown(&pending.file, Some(about.uid()), Some(about.gid()));
            let permissions = fs::Permissions::from_mode(mode);
            pending.file.set_permissions(permissions).map_err(|e| pending.error(&e))?;
        }
        Ok(pending)
    }

    /// Gives the file its name, in place of what is there.
    ///
    /// # Errors
    /// When the disk is full, and for every other failure; what was there then stays.
    pub fn commit(self) -> Result<()> {
        let done = self.file.sync_all().and_then(|()| fs::rename(&self.temporary, &self.target.path));
        done.map_err(|e| self.error(&e))
    }

    /// The error of a failed write.
    pub fn error(&self, error: &io::Error) -> Error {
        failed(&self.shown, error)
    }
}

impl Write for Pending {
    fn write(&mut self, bytes: &[u8]) -> io::Result<usize> {
        self.file.write(bytes)
    }

    fn flush(&mut self) -> io::Result<()> {
        self.file.flush()
    }
}

impl io::Seek for Pending {
    fn seek(&mut self, to: io::SeekFrom) -> io::Result<u64> {
        self.file.seek(to)
    }
}

impl Drop for Pending {
    fn drop(&mut self) {
        // After `commit` there is no such file.
        let _ = fs::remove_file(&self.temporary);
    }
}

/// Creates a file with a name that did not exist, and locks it.
fn open_temporary(folder: &Path, mode: Option<u32>) -> io::Result<(File, PathBuf)> {
    loop {
        let mut options = OpenOptions::new();
        options.write(true).create_new(true);
        if let Some(mode) = mode {
            options.mode(mode);
        }
        let path = folder.join(temporary_name());
        let file = match options.open(&path) {
            Err(e) if e.kind() == ErrorKind::AlreadyExists => continue,
            other => other?,
        };
        // Where files cannot be locked, age alone tells what was left behind.
        let _ = file.lock();
        // Another process may have taken it for one left behind before it was locked.
        if file.metadata()?.nlink() > 0 {
            return Ok((file, path));
        }
    }
}

/// Random digits come from the keys of the standard library's hash maps, which the operating system provides.
fn temporary_name() -> String {
    format!("{START}{:016x}{ENDING}", RandomState::new().build_hasher().finish())
}

fn is_temporary_name(name: &str) -> bool {
    let digits = name.strip_prefix(START).and_then(|rest| rest.strip_suffix(ENDING));
    digits.is_some_and(|d| d.len() == 16 && d.bytes().all(|b| matches!(b, b'0'..=b'9' | b'a'..=b'f')))
}

/// Removes the temporary files in a folder whose processes were killed.
fn clear_left_behind(folder: &Path) {
    let Ok(entries) = fs::read_dir(folder) else { return };
    for entry in entries.flatten() {
        let regular = entry.file_type().is_ok_and(|kind| kind.is_file());
        if regular && entry.file_name().to_str().is_some_and(is_temporary_name) {
            let path = entry.path();
            let Ok(file) = File::open(&path) else { continue };
            let left = match file.try_lock() {
                Ok(()) => true,
                Err(TryLockError::WouldBlock) => false,
                Err(TryLockError::Error(_)) => {
                    let age = file.metadata().and_then(|about| about.modified()).map(|at| at.elapsed());
                    age.is_ok_and(|age| age.is_ok_and(|age| age > OLD))
                }
            };
            if left {
                // Another run may have cleared it.
                let _ = fs::remove_file(path);
            }
        }
    }
}

/// Where an output goes once links are followed.
struct Target {
    path: PathBuf,
    folder: PathBuf,
    /// What is there now.
    about: Option<Metadata>,
}

impl Target {
    /// Follows links, and refuses what must not be replaced.
    fn of(shown: &Path) -> Result<Self> {
        let refuse = |why: &dyn std::fmt::Display| Err(refusal(shown, why));
        if shown.file_name().is_none() || shown.as_os_str().as_encoded_bytes().ends_with(b"/") {
            return refuse(&"this is not the name of a file");
        }
        // Also for links that only the kernel can follow, such as /dev/stdout.
        if let Ok(about) = fs::metadata(shown)
            && !about.is_file()
        {
            return refuse(&format!("this is {}; name a file", kind(&about)));
        }
        let mut path = shown.to_path_buf();
        for _ in 0..MOST_LINKS {
            let folder = match path.parent() {
                Some(parent) if !parent.as_os_str().is_empty() => parent.to_path_buf(),
                _ => PathBuf::from("."),
            };
            match fs::symlink_metadata(&path) {
                Ok(about) if about.is_symlink() => match fs::read_link(&path) {
                    Ok(to) => path = folder.join(to),
                    Err(e) => return refuse(&e),
                },
                Ok(about) => {
                    if about.mode() & WRITABLE == 0 {
                        return refuse(&"it is read-only; name another file, or allow writing (chmod u+w)");
                    }
                    // Opening it changes nothing, and finds what permissions do not tell.
                    if let Err(e) = OpenOptions::new().write(true).open(&path) {
                        return refuse(&e);
                    }
                    return Ok(Self { path, folder, about: Some(about) });
                }
                Err(e) if e.kind() == ErrorKind::NotFound && !folder.is_dir() => {
                    return refuse(&format!("there is no folder {}; create it first", folder.display()));
                }
                Err(e) if e.kind() == ErrorKind::NotFound => return Ok(Self { path, folder, about: None }),
                Err(e) => return refuse(&e),
            }
        }
        refuse(&"its symbolic links form a circle")
    }

    fn place(&self) -> Place {
        let folder = fs::metadata(&self.folder).ok().map(|about| identity(&about));
        Place {
            file: self.about.as_ref().map(identity),
            entry: folder.zip(self.path.file_name().map(OsString::from)),
        }
    }
}

/// What tells whether two paths are one file.
struct Place {
    /// Device and inode of the file, if it exists …
    file: Option<(u64, u64)>,
    /// … and those of its folder, with its name there.
    entry: Option<((u64, u64), OsString)>,
}

impl Place {
    fn is(&self, other: &Self) -> bool {
        (self.file.is_some() && self.file == other.file)
            || (self.entry.is_some() && self.entry == other.entry)
    }
}

fn identity(about: &Metadata) -> (u64, u64) {
    (about.dev(), about.ino())
}

/// What something is that is not a regular file.
pub(super) fn kind(about: &Metadata) -> &'static str {
    let kind = about.file_type();
    if kind.is_dir() {
        "a folder"
    } else if kind.is_fifo() {
        "a pipe"
    } else if kind.is_socket() {
        "a socket"
    } else {
        "a device"
    }
}

fn refusal(shown: &Path, why: &dyn std::fmt::Display) -> Error {
    Error::input(format!("{}: cannot be written: {why}", shown.display()))
}

/// The error of a failed write, after which there is what was there before.
pub(super) fn failed(shown: &Path, error: &io::Error) -> Error {
    refusal(shown, &format!("{error}; nothing was replaced"))
}

#[cfg(test)]
mod tests;
