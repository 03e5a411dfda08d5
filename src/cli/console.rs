//! Output of commands: results on standard output, everything else on standard error.

use std::io::{IsTerminal, Write};

use serde_json::json;

use crate::Error;

/// Writes what the options `--json` and `--quiet` allow.
pub(super) struct Console {
    json: bool,
    quiet: bool,
}

impl Console {
    pub fn new(json: bool, quiet: bool) -> Self {
        Self { json, quiet }
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
            print(text);
        }
    }

    /// A result for programs, on standard output.
    pub fn object(&self, value: &serde_json::Value) {
        if self.json {
            print(&value.to_string());
        }
    }

    /// The output of a command that has no other purpose: it is printed whatever the options.
    pub fn output(&self, text: &str) {
        print(text);
    }

    /// A message on standard error.
    pub fn note(&self, text: &str) {
        if !self.quiet {
            print_error(text);
        }
    }

    /// An error on standard error; with `--json` also as an object.
    pub fn error(&self, error: &Error) {
        print_error(&format!("error: {error}"));
        self.object(&json!({ "error": error.to_string() }));
    }
}

/// Errors are ignored: a closed pipe, as in `warpgait … | head`, is no reason to fail.
fn print(text: &str) {
    let mut out = std::io::stdout().lock();
    let _ = writeln!(out, "{text}").and_then(|()| out.flush());
}

fn print_error(text: &str) {
    let _ = writeln!(std::io::stderr().lock(), "{text}");
}
