//! Runs the program of a case, or its replay, and kills it when it exceeds its time.

use std::path::Path;
use std::process::{Command, ExitStatus, Stdio};
use std::time::{Duration, Instant};

use super::clock::processor_seconds_of;
use crate::files::open_for_process;
use crate::ipopt::INTERRUPT;

/// How often a running process is polled.
const POLL: Duration = Duration::from_millis(10);
/// This fraction of the wall time counts as processor time at least, so that a process that only waits times out, too.
const LEAST_ACTIVITY: f64 = 0.1;

/// Waits for a program to end, within `limit` of processor time, which does not depend on other load. Its standard error goes
/// to the file `log`.
///
/// # Errors
/// When it cannot be started, times out, or the sweep is interrupted.
pub(super) fn wait(mut command: Command, log: &Path, limit: Duration) -> Result<ExitStatus, String> {
    let stderr = open_for_process(log).map_err(|e| format!("failed: {e}"))?;
    let mut child =
        command.stdin(Stdio::null()).stderr(stderr).spawn().map_err(|e| {
            format!("failed: cannot start {}: {e}", Path::new(command.get_program()).display())
        })?;
    let start = Instant::now();
    loop {
        match child.try_wait() {
            Ok(Some(status)) => return Ok(status),
            Ok(None) => {}
            Err(e) => return Err(format!("failed: cannot wait for the process: {e}")),
        }
        let wall = start.elapsed().as_secs_f64();
        let spent = processor_seconds_of(child.id()).map_or(wall, |cpu| cpu.max(LEAST_ACTIVITY * wall));
        let timed_out = spent > limit.as_secs_f64();
        if timed_out || INTERRUPT.is_raised() {
            // Both fail only for a process that has just ended by itself.
            let _ = child.kill();
            let _ = child.wait();
            return Err(match timed_out {
                true => format!("timed out after {} s of processor time (--time-limit)", limit.as_secs()),
                false => "interrupted".into(),
            });
        }
        std::thread::sleep(POLL);
    }
}

/// Why a process left no result: how it ended, and the last line of its log.
pub(super) fn failure(status: ExitStatus, log: &Path) -> String {
    let log = std::fs::read_to_string(log).unwrap_or_default();
    describe(status, &log)
}

fn describe(status: ExitStatus, log: &str) -> String {
    // A process that ends by itself has an exit code.
    let ending = if status.code().is_some() { "failed" } else { "killed" };
    match log.lines().rev().find(|line| !line.trim().is_empty()) {
        Some(line) => format!("{ending} ({status}): {}", line.trim()),
        None => format!("{ending} ({status}), no message"),
    }
}

#[cfg(test)]
mod tests {
    use std::os::unix::process::ExitStatusExt;

    use super::*;

    #[test]
    fn a_failure_names_status_and_last_line() {
        let (killed, failed) = (ExitStatus::from_raw(9), ExitStatus::from_raw(2 << 8));
        let reason = describe(killed, "a\nboom\n\n");
        assert!(reason.starts_with("killed (signal: 9") && reason.ends_with("): boom"), "{reason}");
        assert_eq!(describe(failed, ""), "failed (exit status: 2), no message");
    }

    #[test]
    fn a_process_that_only_waits_times_out() {
        let folder = tempfile::tempdir().unwrap();
        let log = folder.path().join("log");
        let mut command = Command::new("sleep");
        command.arg("60");
        let ending = wait(command, &log, Duration::from_millis(20));
        assert!(ending.unwrap_err().starts_with("timed out"));
        let mut command = Command::new("sh");
        command.args(["-c", "echo why >&2; exit 3"]);
        let status = wait(command, &log, Duration::from_secs(60)).unwrap();
        assert_eq!(failure(status, &log), "failed (exit status: 3): why");
    }
}
