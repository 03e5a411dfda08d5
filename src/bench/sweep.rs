//! Runs cases in processes of their own (Ipopt is not re-entrant), keeps what is finished, goes on where it stopped.
//!
//! In the folder of results: `cases/NAME.json` a finished case, `cases/NAME.toml` its scenario, `cases/NAME.log` what its
//! process said, `plans/NAME.plan.npz` its plan unless all is well with it (its replay included), `maps/` the maps of this program. A finished case carries the SHA-256 of
//! its scenario and of the program; when either is another, it is computed again. A case without a result is a row with
//! its reason, and is tried again next time.

use std::collections::VecDeque;
use std::fs::File;
use std::path::{Path, PathBuf};
use std::process::{Command, ExitStatus, Stdio};
use std::sync::{Mutex, PoisonError, mpsc};
use std::time::{Duration, Instant};

use serde::{Deserialize, Serialize};

use super::Options;
use super::case::{Measured, Work};
use super::clock::processor_seconds_of;
use super::protocol::Case;
use crate::digest::sha256_hex;
use crate::ipopt::INTERRUPT;
use crate::plan::npz::write_atomically;
use crate::replay::Tracked;
use crate::{Error, Result};

/// How often a running process is looked at.
const POLL: Duration = Duration::from_millis(10);
/// A process that waits more than it computes is given up as well: this part of the wall time counts at least.
const WAITING: f64 = 0.1;

/// A case with what became of it.
#[derive(Clone, Debug)]
pub struct Row {
    /// The case.
    pub case: Case,
    /// What was measured, or why nothing was.
    pub outcome: std::result::Result<Measured, String>,
}

/// Where a sweep stands.
#[derive(Clone, Debug)]
pub struct SweepProgress<'a> {
    /// Cases with a row.
    pub done: usize,
    /// Of these, how many were there before.
    pub kept: usize,
    /// All cases.
    pub all: usize,
    /// The case that ended last.
    pub last: &'a Row,
    /// Estimate of the seconds left.
    pub left: f64,
}

/// A finished case on disk.
#[derive(Serialize, Deserialize)]
struct Kept {
    /// Of scenario and work.
    key: String,
    /// SHA-256 of the program.
    program: String,
    measured: Measured,
}

/// Runs all cases that are not there yet, replays their plans with `python` where they ask for it, and returns the rows in the order of the cases; none when interrupted.
///
/// # Errors
/// When the folder of results cannot be written. Whatever happens to a case is no error but its row.
pub fn run(
    cases: Vec<Case>,
    python: Option<PathBuf>,
    options: &Options,
    on_progress: &mut dyn FnMut(&SweepProgress),
) -> Result<Option<Vec<Row>>> {
    let place = Place { python, ..Place::new(&options.out)? };
    let all = cases.len();
    let mut rows: Vec<Option<Row>> = Vec::with_capacity(all);
    let mut open: VecDeque<(usize, Case)> = VecDeque::new();
    for (index, case) in cases.into_iter().enumerate() {
        match place.kept(&case, options.any_program) {
            Some(measured) => rows.push(Some(Row { case, outcome: Ok(measured) })),
            None => {
                rows.push(None);
                open.push_back((index, case));
            }
        }
    }
    let kept = all - open.len();
    let jobs = options.jobs.clamp(1, open.len().max(1));
    let (queue, start) = (Mutex::new(open), Instant::now());
    let (sender, receiver) = mpsc::channel();
    let next = || {
        let mut queue = queue.lock().unwrap_or_else(PoisonError::into_inner);
        if INTERRUPT.is_raised() { None } else { queue.pop_front() }
    };
    std::thread::scope(|scope| {
        for _ in 0..jobs {
            let (sender, place, next) = (sender.clone(), &place, &next);
            scope.spawn(move || {
                while let Some((index, case)) = next() {
                    let outcome = place.compute(&case, options.time_limit);
                    // Nobody listens any more only when the sweep is over.
                    let _ = sender.send((index, Row { case, outcome }));
                }
            });
        }
        drop(sender);
        let mut done = kept;
        for (index, row) in receiver {
            done += 1;
            let each = start.elapsed().as_secs_f64() / (done - kept) as f64;
            let last = &*rows[index].insert(row);
            on_progress(&SweepProgress { done, kept, all, last, left: each * (all - done) as f64 });
        }
    });
    Ok(if INTERRUPT.is_raised() { None } else { rows.into_iter().collect() })
}

/// The folder of results.
struct Place {
    cases: PathBuf,
    plans: PathBuf,
    maps: PathBuf,
    program: PathBuf,
    digest: String,
    /// With the package that replays; none where nothing is replayed.
    python: Option<PathBuf>,
}

impl Place {
    fn new(out: &Path) -> Result<Self> {
        let program = std::env::current_exe().map_err(|e| Error::io("the program itself", e))?;
        let digest = sha256_hex(std::fs::read(&program).map_err(|e| Error::io(&program, e))?);
        let place = Self {
            cases: out.join("cases"),
            plans: out.join("plans"),
            // A map of another program would hide how long this one takes.
            maps: out.join("maps").join(&digest[..16]),
            program,
            digest,
            python: None,
        };
        for folder in [&place.cases, &place.plans, &place.maps] {
            std::fs::create_dir_all(folder).map_err(|e| Error::io(folder, e))?;
        }
        Ok(place)
    }

    fn file(&self, case: &Case, ending: &str) -> PathBuf {
        self.cases.join(format!("{}.{ending}", case.name))
    }

    fn plan(&self, case: &Case) -> PathBuf {
        self.plans.join(format!("{}.plan.npz", case.name))
    }

    /// The result of a case that is there already; none if it is not, or is damaged, or of something else.
    fn kept(&self, case: &Case, any_program: bool) -> Option<Measured> {
        let kept: Kept = serde_json::from_slice(&std::fs::read(self.file(case, "json")).ok()?).ok()?;
        let same = kept.key == key(case) && (any_program || kept.program == self.digest);
        same.then_some(kept.measured)
    }

    /// Computes a case in a process of its own.
    fn compute(&self, case: &Case, limit: Duration) -> std::result::Result<Measured, String> {
        let mut measured = self.spawn(case, limit)?;
        if let (Work::Track, Some(python), true) = (case.work, &self.python, measured.is_good()) {
            measured.track = Some(self.replay(python, case, limit)?);
        }
        if measured.is_good() {
            // Plans are megabytes; those that are looked into are those that fail. A map has none to remove.
            let _ = std::fs::remove_file(self.plan(case));
        }
        let kept = Kept { key: key(case), program: self.digest.clone(), measured };
        let json = serde_json::to_vec(&kept).map_err(|e| e.to_string())?;
        write_atomically(&self.file(case, "json"), &json).map_err(|e| e.to_string())?;
        Ok(kept.measured)
    }

    fn spawn(&self, case: &Case, limit: Duration) -> std::result::Result<Measured, String> {
        let (scenario, result, log) =
            (self.file(case, "toml"), self.file(case, "result"), self.file(case, "log"));
        write_atomically(&scenario, case.scenario.as_bytes()).map_err(|e| e.to_string())?;
        // What an earlier attempt left must not be taken for this one's result.
        let _ = std::fs::remove_file(&result);
        let mut command = Command::new(&self.program);
        command
            .args(["bench-case", "--parent", &std::process::id().to_string(), case.work.name()])
            .args([&scenario, &self.plan(case), &result])
            .env("WARPGAIT_CACHE", &self.maps)
            .stdout(Stdio::null());
        let status = wait(command, &log, limit)?;
        let read = std::fs::read(&result).ok().and_then(|json| serde_json::from_slice(&json).ok());
        let _ = std::fs::remove_file(&result);
        match read {
            Some(measured) if status.success() => {
                let _ = std::fs::remove_file(&log);
                Ok(measured)
            }
            _ => Err(reason(&status.to_string(), &std::fs::read_to_string(&log).unwrap_or_default())),
        }
    }

    /// Replays the plan of a case, in a process of its own as well: Python's simulation.
    fn replay(&self, python: &Path, case: &Case, limit: Duration) -> std::result::Result<Tracked, String> {
        let (report, log) = (self.file(case, "report"), self.file(case, "log"));
        let printed = File::create(&report).map_err(|e| format!("{}: {e}", report.display()))?;
        let mut command = Command::new(python);
        command
            .args(["-m", "warpgait.validate", "--json", "--no-files", "--no-second-opinion"])
            .arg(self.plan(case))
            // The matrices are small: more threads only get in each other's way.
            .env("OPENBLAS_NUM_THREADS", "1")
            .stdout(printed);
        let status = wait(command, &log, limit).map_err(|e| format!("replay: {e}"))?;
        let text = std::fs::read(&report).unwrap_or_default();
        let _ = std::fs::remove_file(&report);
        // 0: walks; 1: does not; anything else is no verdict.
        if !matches!(status.code(), Some(0 | 1)) {
            let said = std::fs::read_to_string(&log).unwrap_or_default();
            return Err(format!("replay: {}", reason(&status.to_string(), &said)));
        }
        let _ = std::fs::remove_file(&log);
        Tracked::read(&text)
    }
}

/// Runs a program to its end, at most for `limit` of processor time, so that other load does not decide; what it says on standard error goes to `log`.
fn wait(mut command: Command, log: &Path, limit: Duration) -> std::result::Result<ExitStatus, String> {
    let said = File::create(log).map_err(|e| format!("{}: {e}", log.display()))?;
    let mut child = command
        .stdin(Stdio::null())
        .stderr(said)
        .spawn()
        .map_err(|e| format!("cannot start {}: {e}", Path::new(command.get_program()).display()))?;
    let start = Instant::now();
    loop {
        match child.try_wait() {
            Ok(Some(status)) => return Ok(status),
            Ok(None) => {}
            Err(error) => return Err(format!("lost sight of the process: {error}")),
        }
        let waited = start.elapsed().as_secs_f64();
        let spent = processor_seconds_of(child.id()).map_or(waited, |cpu| cpu.max(WAITING * waited));
        let late = spent > limit.as_secs_f64();
        if late || INTERRUPT.is_raised() {
            // It may have ended in between, which is as well.
            let _ = child.kill();
            let _ = child.wait();
            return Err(match late {
                true => format!("took longer than {} s of processor time (--time-limit)", limit.as_secs()),
                false => "interrupted".into(),
            });
        }
        std::thread::sleep(POLL);
    }
}

/// Why a process left no result: how it ended, and the last it said.
fn reason(status: &str, log: &str) -> String {
    match log.lines().rev().find(|line| !line.trim().is_empty()) {
        Some(line) => format!("no result ({status}): {}", line.trim()),
        None => format!("no result ({status}), nothing said"),
    }
}

/// What the result of a case depends on besides the program.
fn key(case: &Case) -> String {
    sha256_hex(format!("{}\n{}", case.work.name(), case.scenario))
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::bench::Bench;

    #[test]
    fn results_of_other_scenarios_and_programs_are_not_taken() {
        let folder = tempfile::tempdir().unwrap();
        let place = Place::new(folder.path()).unwrap();
        let mut case = Bench::Table1.cases(&Options::default()).remove(0);
        assert_eq!(place.kept(&case, false), None);
        let write = |program: &str| {
            let kept = Kept { key: key(&case), program: program.into(), measured: Measured::default() };
            std::fs::write(place.file(&case, "json"), serde_json::to_vec(&kept).unwrap()).unwrap();
        };
        write(&place.digest);
        assert_eq!(place.kept(&case, false), Some(Measured::default()));
        write("another");
        assert_eq!(place.kept(&case, false), None);
        assert_eq!(place.kept(&case, true), Some(Measured::default()));
        std::fs::write(place.file(&case, "json"), "{\"key\": ").unwrap();
        assert_eq!(place.kept(&case, true), None);
        write(&place.digest);
        case.scenario.push('\n');
        assert_eq!(place.kept(&case, true), None);
    }

    #[test]
    fn a_reason_names_status_and_last_words() {
        assert_eq!(reason("signal: 9", "a\nboom\n\n"), "no result (signal: 9): boom");
        assert_eq!(reason("exit status: 0", ""), "no result (exit status: 0), nothing said");
    }
}
