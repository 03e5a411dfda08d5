//! Runs the cases of a bench that are not finished yet, several at a time. Each has a process of its own, since Ipopt is not
//! re-entrant. A case without a result becomes a row with the reason, and is tried again by the next sweep.

use std::collections::VecDeque;
use std::path::PathBuf;
use std::sync::{Mutex, PoisonError, mpsc};
use std::time::Instant;

use super::case::{Case, CaseRow};
use super::folder::ResultsFolder;
use super::options::BenchOptions;
use crate::Result;
use crate::ipopt::INTERRUPT;

/// The state of a sweep.
#[derive(Clone, Debug)]
pub struct SweepProgress<'a> {
    /// Cases that have a row.
    pub done: usize,
    /// How many of these were finished by an earlier sweep.
    pub kept: usize,
    /// Number of all cases.
    pub total: usize,
    /// The case that ended last.
    pub last: &'a CaseRow,
    /// Estimate of the time left, s.
    pub seconds_left: f64,
}

/// Runs all cases that are not finished and returns the rows in the order of the cases; none when interrupted. Plans are
/// replayed with `python`.
///
/// # Errors
/// When the folder of results cannot be written. A case that fails is not an error: its row holds the reason.
pub fn run(
    cases: Vec<Case>,
    python: Option<PathBuf>,
    options: &BenchOptions,
    on_progress: &mut dyn FnMut(&SweepProgress),
) -> Result<Option<Vec<CaseRow>>> {
    let folder = ResultsFolder::new(&options.out, python)?;
    let mut rows: Vec<Option<CaseRow>> = Vec::with_capacity(cases.len());
    let mut open = VecDeque::new();
    for (index, case) in cases.into_iter().enumerate() {
        match folder.kept(&case, options.any_program) {
            Some(measured) => rows.push(Some(CaseRow { case, outcome: Ok(measured) })),
            None => {
                rows.push(None);
                open.push_back((index, case));
            }
        }
    }
    run_open(open, &mut rows, &folder, options, on_progress);
    Ok(if INTERRUPT.is_raised() { None } else { rows.into_iter().collect() })
}

/// Runs the open cases, each given with the index of its row, and fills in their rows.
fn run_open(
    open: VecDeque<(usize, Case)>,
    rows: &mut [Option<CaseRow>],
    folder: &ResultsFolder,
    options: &BenchOptions,
    on_progress: &mut dyn FnMut(&SweepProgress),
) {
    let total = rows.len();
    let kept = total - open.len();
    let jobs = options.jobs.clamp(1, open.len().max(1));
    let (queue, start) = (Mutex::new(open), Instant::now());
    let next = || {
        let mut queue = queue.lock().unwrap_or_else(PoisonError::into_inner);
        if INTERRUPT.is_raised() { None } else { queue.pop_front() }
    };
    let (sender, receiver) = mpsc::channel();
    std::thread::scope(|scope| {
        for _ in 0..jobs {
            let (sender, next) = (sender.clone(), &next);
            scope.spawn(move || {
                while let Some((index, case)) = next() {
                    let outcome = folder.compute(&case, options.time_limit);
                    // The receiver outlives all senders.
                    let _ = sender.send((index, CaseRow { case, outcome }));
                }
            });
        }
        drop(sender);
        let mut done = kept;
        for (index, row) in receiver {
            done += 1;
            let seconds_each = start.elapsed().as_secs_f64() / (done - kept) as f64;
            let seconds_left = seconds_each * (total - done) as f64;
            let last = &*rows[index].insert(row);
            on_progress(&SweepProgress { done, kept, total, last, seconds_left });
        }
    });
}
