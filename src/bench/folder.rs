//! The folder of results: computes single cases, keeps finished ones, and finds them again.
//!
//! | file | holds |
//! | --- | --- |
//! | `cases/NAME.json` | a finished case |
//! | `cases/NAME.toml` | its scenario |
//! | `cases/NAME.log` | standard error of a process that left no result |
//! | `plans/NAME.plan.npz` | the plan, unless it and its replay are good |
//! | `maps/` | the maps of each build of the program |
//!
//! A finished case holds the SHA-256 of its scenario and of the program; when either differs, the case is computed again.

use std::path::{Path, PathBuf};
use std::process::Stdio;
use std::time::Duration;

use serde::{Deserialize, Serialize};

use super::case::{Case, Work};
use super::measured::Measured;
use super::process::{failure, wait};
use crate::digest::sha256_hex;
use crate::files::{self, MAX_FILE, open_for_process, write_atomically};
use crate::replay::{self, Tracked};
use crate::{Error, Result, program};

/// Digits of the program's SHA-256 that name the folder of its maps.
const DIGEST_DIGITS: usize = 16;

/// A finished case on disk.
#[derive(Serialize, Deserialize)]
struct KeptCase {
    /// SHA-256 of work and scenario.
    key: String,
    /// SHA-256 of the program.
    program: String,
    measured: Measured,
}

/// The folder of results.
pub(super) struct ResultsFolder {
    cases: PathBuf,
    plans: PathBuf,
    maps: PathBuf,
    /// SHA-256 of the program.
    digest: String,
    /// A Python that has the replay's package; none where nothing is replayed.
    python: Option<PathBuf>,
}

impl ResultsFolder {
    /// Creates the folder `out` unless it exists.
    ///
    /// # Errors
    /// When it cannot be written, or the program cannot be read.
    pub fn new(out: &Path, python: Option<PathBuf>) -> Result<Self> {
        let program = program::file().map_err(|e| Error::io("the running program", e))?;
        let digest = sha256_hex(&std::fs::read(&program).map_err(|e| Error::io(&program, e))?);
        let folder = Self {
            cases: out.join("cases"),
            plans: out.join("plans"),
            // A map cached by another build would hide how long this one takes.
            maps: out.join("maps").join(&digest[..DIGEST_DIGITS]),
            digest,
            python,
        };
        for path in [&folder.cases, &folder.plans, &folder.maps] {
            std::fs::create_dir_all(path).map_err(|e| Error::io(path, e))?;
        }
        Ok(folder)
    }

    /// The result of a case that is finished; none if it is missing, damaged, or that of another scenario or program.
    pub fn kept(&self, case: &Case, any_program: bool) -> Option<Measured> {
        let kept: KeptCase =
            serde_json::from_slice(&files::read(&self.file(case, "json"), MAX_FILE).ok()?).ok()?;
        let same = kept.key == key(case) && (any_program || kept.program == self.digest);
        same.then_some(kept.measured)
    }

    /// Computes a case, replays its plan where that is its work, and keeps the result.
    ///
    /// # Errors
    /// Why there is no result.
    pub fn compute(&self, case: &Case, limit: Duration) -> std::result::Result<Measured, String> {
        let mut measured = self.measure(case, limit)?;
        if let (Work::Track, Some(python), true) = (case.work, &self.python, measured.is_good()) {
            measured.track = Some(self.replay(python, case, limit).map_err(|e| format!("replay: {e}"))?);
        }
        if measured.is_good() {
            // Plans take megabytes, and only those of bad cases are looked into. A map has no plan to remove.
            let _ = std::fs::remove_file(self.plan(case));
        }
        let kept = KeptCase { key: key(case), program: self.digest.clone(), measured };
        let json = serde_json::to_vec(&kept).map_err(|e| e.to_string())?;
        write_atomically(&self.file(case, "json"), &json).map_err(|e| e.to_string())?;
        Ok(kept.measured)
    }

    /// Computes a case in a process of its own.
    fn measure(&self, case: &Case, limit: Duration) -> std::result::Result<Measured, String> {
        let [scenario, result, log] = ["toml", "result", "log"].map(|extension| self.file(case, extension));
        write_atomically(&scenario, case.scenario.as_bytes()).map_err(|e| e.to_string())?;
        // A result left by an earlier attempt must not pass for this one's.
        let _ = std::fs::remove_file(&result);
        let mut command = program::command().map_err(|e| format!("failed: {e}"))?;
        command
            .args(["bench-case", "--parent", &std::process::id().to_string(), case.work.name()])
            .args([&scenario, &self.plan(case), &result])
            .env("WARPGAIT_CACHE", &self.maps)
            .stdout(Stdio::null());
        let status = wait(command, &log, limit)?;
        let read = files::read(&result, MAX_FILE).ok().and_then(|json| serde_json::from_slice(&json).ok());
        let _ = std::fs::remove_file(&result);
        match read {
            Some(measured) if status.success() => {
                let _ = std::fs::remove_file(&log);
                Ok(measured)
            }
            _ => Err(failure(status, &log)),
        }
    }

    /// Replays the plan of a case in a process of its own, the simulation in Python.
    fn replay(&self, python: &Path, case: &Case, limit: Duration) -> std::result::Result<Tracked, String> {
        let [report, log] = ["report", "log"].map(|extension| self.file(case, extension));
        let stdout = open_for_process(&report).map_err(|e| format!("failed: {e}"))?;
        let mut command = replay::command(python);
        command
            .args(["-m", "warpgait.commands.validate", "--json", "--no-files", "--no-robust"])
            .arg(self.plan(case))
            // For matrices as small as these, more threads are slower.
            .env("OPENBLAS_NUM_THREADS", "1")
            .stdout(stdout);
        let status = wait(command, &log, limit)?;
        let text = files::read(&report, MAX_FILE).unwrap_or_default();
        let _ = std::fs::remove_file(&report);
        // 0: the robot walks; 1: it does not; any other exit code comes without a verdict.
        if !matches!(status.code(), Some(0 | 1)) {
            return Err(failure(status, &log));
        }
        let _ = std::fs::remove_file(&log);
        Tracked::read(&text)
    }

    fn file(&self, case: &Case, extension: &str) -> PathBuf {
        self.cases.join(format!("{}.{extension}", case.name))
    }

    fn plan(&self, case: &Case) -> PathBuf {
        self.plans.join(format!("{}.plan.npz", case.name))
    }
}

/// What the result of a case depends on besides the program.
fn key(case: &Case) -> String {
    sha256_hex(format!("{}\n{}", case.work.name(), case.scenario).as_bytes())
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::bench::{Bench, BenchOptions, protocol};

    #[test]
    fn results_of_other_scenarios_and_programs_are_not_reused() {
        let temporary = tempfile::tempdir().unwrap();
        let folder = ResultsFolder::new(temporary.path(), None).unwrap();
        let mut case = protocol::cases(Bench::Table1, &BenchOptions::default()).remove(0);
        assert_eq!(folder.kept(&case, false), None);
        let write = |program: &str| {
            let kept = KeptCase { key: key(&case), program: program.into(), measured: Measured::default() };
            std::fs::write(folder.file(&case, "json"), serde_json::to_vec(&kept).unwrap()).unwrap();
        };
        write(&folder.digest);
        assert_eq!(folder.kept(&case, false), Some(Measured::default()));
        write("another");
        assert_eq!(folder.kept(&case, false), None);
        assert_eq!(folder.kept(&case, true), Some(Measured::default()));
        std::fs::write(folder.file(&case, "json"), "{\"key\": ").unwrap();
        assert_eq!(folder.kept(&case, true), None);
        write(&folder.digest);
        case.scenario.push('\n');
        assert_eq!(folder.kept(&case, true), None);
    }
}
