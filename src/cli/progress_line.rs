//! Progress on standard error: a line that is updated in place at a terminal, a new line every few seconds elsewhere.

use std::io::{IsTerminal, Write};
use std::sync::{Arc, Mutex, PoisonError, Weak};
use std::time::{Duration, Instant};

use indicatif::{ProgressBar, ProgressStyle};

use crate::pipeline::Event;
use crate::visible::visible;

/// Least time between two lines of the same stage where they are not updated in place.
const LINE_INTERVAL: Duration = Duration::from_secs(5);
/// How often it is seen whether a stage that reports nothing is due for a line.
const POLL: Duration = Duration::from_millis(250);
/// Time between two frames of the spinner.
const SPINNER_INTERVAL: Duration = Duration::from_millis(120);

/// Shows progress.
pub(super) struct ProgressLine {
    /// The line that is updated in place; none when quiet or not at a terminal.
    bar: Option<ProgressBar>,
    quiet: bool,
    /// Shared with the thread that writes a line when the stage is silent.
    lines: Arc<Mutex<Lines>>,
}

/// What was written where lines are not updated in place.
#[derive(Default)]
struct Lines {
    stage: String,
    /// When the stage began, and when the last line was written.
    times: Option<[Instant; 2]>,
}

impl Lines {
    /// Writes a line if it is due: for a new stage, or a while after the last one.
    fn write(&mut self, stage: &str, text: impl FnOnce(Duration) -> String) {
        let now = Instant::now();
        let began = self.times.filter(|_| self.stage == stage).map_or(now, |[began, _]| began);
        if began == now || self.times.is_none_or(|[_, written]| now - written >= LINE_INTERVAL) {
            let _ = writeln!(std::io::stderr().lock(), "{}", text(now - began));
            self.stage = stage.to_owned();
            self.times = Some([began, now]);
        }
    }
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
        let lines = Arc::new(Mutex::new(Lines::default()));
        if bar.is_none() && !quiet {
            let lines = Arc::downgrade(&lines);
            std::thread::spawn(move || report_silent_stages(&lines));
        }
        Self { bar, quiet, lines }
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
        let text = if detail.is_empty() { stage.to_owned() } else { format!("{stage}: {}", visible(detail)) };
        if let Some(bar) = &self.bar {
            return bar.set_message(text);
        }
        let mut lines = self.lines.lock().unwrap_or_else(PoisonError::into_inner);
        lines.write(stage, |_| text);
    }

    /// Writes a message that stays on the screen.
    pub fn note(&self, text: &str) {
        let text = &visible(text);
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

/// Writes a line when the current stage has reported nothing for a while; ends with the progress line.
fn report_silent_stages(lines: &Weak<Mutex<Lines>>) {
    while let Some(lines) = lines.upgrade() {
        {
            let mut lines = lines.lock().unwrap_or_else(PoisonError::into_inner);
            let stage = lines.stage.clone();
            if !stage.is_empty() {
                lines.write(&stage, |passed| format!("{stage}: {} s", passed.as_secs()));
            }
        }
        drop(lines);
        std::thread::sleep(POLL);
    }
}
