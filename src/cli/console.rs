//! Output of commands: results on standard output, everything else on standard error.

use std::cell::Cell;
use std::io::{self, ErrorKind, IsTerminal, Write};

use serde_json::json;

use crate::visible::visible;
use crate::{Error, Result};

/// Writes what the options `--json` and `--quiet` allow.
pub(super) struct Console {
    json: bool,
    quiet: bool,
    /// Why standard output could not be written.
    failure: Cell<Option<io::Error>>,
}

impl Console {
    pub fn new(json: bool, quiet: bool) -> Self {
        Self { json, quiet, failure: Cell::new(None) }
    }

    /// Whether everything could be written to standard output. A reader who has closed it, as in `warpgait … | head`, is no failure.
    ///
    /// # Errors
    /// Why it could not, for instance because the disk is full.
    pub fn finish(&self) -> Result<()> {
        self.failure.take().map_or(Ok(()), |e| Err(Error::io("standard output", e)))
    }

    /// Whether the result is one JSON object.
    pub fn is_json(&self) -> bool {
        self.json
    }

    /// Whether only errors are shown.
    pub fn is_quiet(&self) -> bool {
        self.quiet
    }

    /// Whether to use color: at a terminal, unless NO_COLOR is set.
    pub fn has_color(&self) -> bool {
        std::io::stdout().is_terminal() && std::env::var_os("NO_COLOR").is_none()
    }

    /// A result for human readers, on standard output.
    pub fn result(&self, text: &str) {
        if !self.json && !self.quiet {
            self.print(text);
        }
    }

    /// A result for programs, on standard output.
    pub fn object(&self, value: &serde_json::Value) {
        if self.json {
            self.print(&value.to_string());
        }
    }

    /// The output of a command that has no other purpose: it is printed whatever the options.
    pub fn output(&self, text: &str) {
        self.print(text);
    }

    /// A message on standard error.
    pub fn note(&self, text: &str) {
        if !self.quiet {
            print_error(&visible(text));
        }
    }

    /// A failure on standard error that does not end the command.
    pub fn warn(&self, text: &str) {
        print_error(&visible(text));
    }

    /// An error on standard error; with `--json` also as an object.
    pub fn error(&self, error: &Error) {
        print_error(&format!("error: {}", visible(&error.to_string())));
        self.object(&json!({ "error": error.to_string() }));
    }

    fn print(&self, text: &str) {
        let mut out = io::stdout().lock();
        let written = writeln!(out, "{text}").and_then(|()| out.flush());
        if let Some(error) = written.err().filter(|e| e.kind() != ErrorKind::BrokenPipe) {
            self.failure.set(Some(error));
        }
    }
}

fn print_error(text: &str) {
    let _ = writeln!(io::stderr().lock(), "{text}");
}
