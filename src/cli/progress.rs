//! Live progress on standard error: one line that changes at a terminal, now and then a plain line elsewhere.

use std::io::{IsTerminal, Write};
use std::time::{Duration, Instant};

use indicatif::{ProgressBar, ProgressStyle};

use crate::pipeline::Event;

/// Between two plain lines of the same stage.
const PLAIN_INTERVAL: Duration = Duration::from_secs(5);

/// Where progress is shown.
pub(super) struct Progress {
    line: Option<ProgressBar>,
    quiet: bool,
    stage: String,
    shown: Option<Instant>,
}

impl Progress {
    pub fn new(quiet: bool) -> Self {
        let line = (!quiet && std::io::stderr().is_terminal()).then(|| {
            let line = ProgressBar::new_spinner();
            // The template is a constant; should it be wrong, the default one does.
            if let Ok(style) = ProgressStyle::with_template("{spinner} {elapsed:>4} {msg}") {
                line.set_style(style);
            }
            line.enable_steady_tick(Duration::from_millis(120));
            line
        });
        Self { line, quiet, stage: String::new(), shown: None }
    }

    /// Shows what is going on.
    pub fn show(&mut self, event: &Event) {
        match event {
            Event::Step(step) => self.update(&step.to_string(), ""),
            Event::Note(text) => self.note(text),
            Event::Map(at) => {
                let [x, y, z] = at.cells;
                let detail = format!(
                    "iteration {}, decrement {:.1e} of {:.1e}",
                    at.iteration, at.decrement, at.tolerance
                );
                self.update(&format!("map {x}×{y}×{z}"), &detail);
            }
            Event::Iteration(at) => {
                let record = at.record;
                let detail = format!(
                    "iteration {}, violation {:.1e}, objective {:.3e}",
                    at.iteration, record.violation, record.objective
                );
                self.update(&at.stage.to_string(), &detail);
            }
        }
    }

    /// Shows where a stage stands.
    pub(super) fn update(&mut self, stage: &str, detail: &str) {
        if self.quiet {
            return;
        }
        let text = if detail.is_empty() { stage.to_owned() } else { format!("{stage}: {detail}") };
        if let Some(line) = &self.line {
            return line.set_message(text);
        }
        let due = self.shown.is_none_or(|shown| shown.elapsed() >= PLAIN_INTERVAL);
        if due || self.stage != stage {
            let _ = writeln!(std::io::stderr().lock(), "{text}");
            self.stage = stage.to_owned();
            self.shown = Some(Instant::now());
        }
    }

    /// Says something that stays.
    pub fn note(&self, text: &str) {
        match &self.line {
            _ if self.quiet => {}
            Some(line) => line.println(text),
            None => {
                let _ = writeln!(std::io::stderr().lock(), "{text}");
            }
        }
    }
}

impl Drop for Progress {
    fn drop(&mut self) {
        if let Some(line) = &self.line {
            line.finish_and_clear();
        }
    }
}
