//! What a reader is given.

use std::path::Path;

/// A file, and what the scenario says about reading it.
pub struct Input<'a> {
    /// The content.
    pub bytes: &'a [u8],
    /// Where it is, for files that it names.
    pub path: &'a Path,
    /// `terrain.member`.
    pub member: Option<&'a str>,
    /// `terrain.spacing`, m.
    pub spacing: Option<f64>,
}

impl Input<'_> {
    /// Whether the file's name ends like this, in any case.
    pub fn ends_in(&self, extension: &str) -> bool {
        self.path.extension().is_some_and(|e| e.eq_ignore_ascii_case(extension))
    }
}
