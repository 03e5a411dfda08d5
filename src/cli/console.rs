//! Where words go: results to standard output, all else to standard error.

use std::io::{IsTerminal, Write};

use serde_json::json;

use crate::Error;

/// What may be said, and how.
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

    /// Whether only errors are wanted.
    pub fn is_quiet(&self) -> bool {
        self.quiet
    }

    /// Colour is for people at a terminal who have not declined it.
    pub fn colour(&self) -> bool {
        std::io::stdout().is_terminal() && std::env::var_os("NO_COLOR").is_none()
    }

    /// A result for people, on standard output.
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

    /// What was asked for, whatever the options.
    pub fn always(&self, text: &str) {
        print(text);
    }

    /// A message on standard error.
    pub fn note(&self, text: &str) {
        if !self.quiet {
            say(text);
        }
    }

    /// An error on standard error; with `--json` as an object as well.
    pub fn error(&self, error: &Error) {
        say(&format!("error: {error}"));
        self.object(&json!({ "error": error.to_string() }));
    }
}

/// A closed pipe (`warpgait … | head`) is no reason to fail.
fn print(text: &str) {
    let mut out = std::io::stdout().lock();
    let _ = writeln!(out, "{text}").and_then(|()| out.flush());
}

fn say(text: &str) {
    let _ = writeln!(std::io::stderr().lock(), "{text}");
}
