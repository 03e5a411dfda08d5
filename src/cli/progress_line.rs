//! Progress on standard error: a line that is updated in place at a terminal, a new line every few seconds elsewhere.

use std::io::{IsTerminal, Write};
use std::time::{Duration, Instant};

use indicatif::{ProgressBar, ProgressStyle};

use crate::pipeline::Event;

/// Least time between two lines of the same stage where they are not updated in place.
const LINE_INTERVAL: Duration = Duration::from_secs(5);
/// Time between two frames of the spinner.
const SPINNER_INTERVAL: Duration = Duration::from_millis(120);

/// Shows progress.
pub(super) struct ProgressLine {
    /// The line that is updated in place; none when quiet or not at a terminal.
    bar: Option<ProgressBar>,
    quiet: bool,
    stage: String,
    /// When the last line was written.
    written: Option<Instant>,
}

impl ProgressLine {
    pub fn new(quiet: bool) -> Self {
        let bar = (!quiet && std::io::stderr().is_terminal()).then(|| {
            let bar = ProgressBar::new_spinner();
            // The template is constant and valid; without it, indicatif's own is used.
            if let Ok(style) = ProgressStyle::with_template("{spinner} {elapsed:>4} {msg}") {
                bar.set_style(style);
            }
            bar.enable_steady_tick(SPINNER_INTERVAL);
            bar
        });
        Self { bar, quiet, stage: String::new(), written: None }
    }

    /// Shows an event of the pipeline.
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

    /// Shows a stage and how far it is.
    pub fn update(&mut self, stage: &str, detail: &str) {
        if self.quiet {
            return;
        }
        let text = if detail.is_empty() { stage.to_owned() } else { format!("{stage}: {detail}") };
        if let Some(bar) = &self.bar {
            return bar.set_message(text);
        }
        let due = self.written.is_none_or(|written| written.elapsed() >= LINE_INTERVAL);
        if due || self.stage != stage {
            let _ = writeln!(std::io::stderr().lock(), "{text}");
            self.stage = stage.to_owned();
            self.written = Some(Instant::now());
        }
    }

    /// Writes a message that stays on the screen.
    pub fn note(&self, text: &str) {
        match &self.bar {
            _ if self.quiet => {}
            Some(bar) => bar.println(text),
            None => {
                let _ = writeln!(std::io::stderr().lock(), "{text}");
            }
        }
    }
}

impl Drop for ProgressLine {
    fn drop(&mut self) {
        if let Some(bar) = &self.bar {
            bar.finish_and_clear();
        }
    }
}
