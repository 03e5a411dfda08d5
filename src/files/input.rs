//! Reading files, within bounds of memory and time.

use std::fs::{self, File};
use std::io::{self, Read};
use std::path::Path;

use super::output::kind;
use crate::{Error, Result};

/// Largest text files that are read (scenarios, robots, limits), bytes.
pub const MAX_TEXT: u64 = 4 << 20;
/// Largest other files that are read (heights, plans, maps), bytes.
pub const MAX_FILE: u64 = 512 << 20;

/// The content of a regular file of at most `limit` bytes. Devices, pipes and folders are refused without being opened, so that nothing
/// waits or grows without end.
///
/// # Errors
/// For files that are missing, too large, no regular files, or cannot be read.
pub fn read(path: &Path, limit: u64) -> Result<Vec<u8>> {
    content(path, limit).map_err(|e| Error::io(path, e))
}

/// The text of a file of at most [`MAX_TEXT`] bytes.
///
/// # Errors
/// As [`read`], and if it is not UTF-8.
pub fn read_text(path: &Path) -> Result<String> {
    String::from_utf8(read(path, MAX_TEXT)?)
        .map_err(|_| Error::input(format!("{}: not a text file in UTF-8", path.display())))
}

fn content(path: &Path, limit: u64) -> io::Result<Vec<u8>> {
    let about = fs::metadata(path)?;
    if !about.is_file() {
        return Err(io::Error::other(format!("this is {}, not a file", kind(&about))));
    }
    let too_large = || io::Error::other(format!("too large: more than the {limit} bytes that are read"));
    if about.len() > limit {
        return Err(too_large());
    }
    let mut bytes = Vec::with_capacity(about.len() as usize);
    // It may grow meanwhile.
    File::open(path)?.take(limit + 1).read_to_end(&mut bytes)?;
    if bytes.len() as u64 > limit { Err(too_large()) } else { Ok(bytes) }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn special_and_large_files_are_refused_at_once() {
        let folder = tempfile::tempdir().unwrap();
        let at = |name: &str| folder.path().join(name);
        fs::write(at("text"), "abc").unwrap();
        assert_eq!(read(&at("text"), 3).unwrap(), b"abc");
        assert!(read(&at("text"), 2).unwrap_err().to_string().contains("too large"));
        fs::write(at("latin"), [b'a', 0xe9]).unwrap();
        assert!(read_text(&at("latin")).unwrap_err().to_string().contains("UTF-8"));
        assert!(std::process::Command::new("mkfifo").arg(at("pipe")).status().unwrap().success());
        for (path, what) in [
            (at("pipe"), "a pipe"),
            (folder.path().to_path_buf(), "a folder"),
            ("/dev/zero".into(), "a device"),
        ] {
            let message = read(&path, 1 << 20).unwrap_err().to_string();
            assert!(message.contains(what), "{message}");
        }
    }
}
