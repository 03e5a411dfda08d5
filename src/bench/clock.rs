//! Processor time of a process.

use std::time::Instant;

use serde::{Deserialize, Serialize};

/// Ticks per second in `/proc/self/stat`: USER_HZ, which is 100 on all architectures, whatever the kernel's own rate
/// (proc(5)).
const TICKS: f64 = 100.0;

/// Which time a clock measures.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq, Serialize, Deserialize)]
#[serde(rename_all = "kebab-case")]
pub enum ClockKind {
    /// Processor time of all threads of the process, user and system, in steps of 10 ms. Other load does not count.
    #[default]
    Cpu,
    /// Wall time, where the operating system does not report processor time.
    Wall,
}

/// A stopwatch of processor time.
pub struct CpuClock {
    start: Instant,
    kind: ClockKind,
    last: f64,
}

impl CpuClock {
    /// Starts a stopwatch.
    pub fn start() -> Self {
        let (last, kind) = match processor_seconds() {
            Some(seconds) => (seconds, ClockKind::Cpu),
            None => (0.0, ClockKind::Wall),
        };
        Self { start: Instant::now(), kind, last }
    }

    /// Which time it measures.
    pub fn kind(&self) -> ClockKind {
        self.kind
    }

    /// Seconds since the start or the last lap.
    pub fn lap(&mut self) -> f64 {
        let now = match self.kind {
            ClockKind::Cpu => processor_seconds().unwrap_or(self.last),
            ClockKind::Wall => self.start.elapsed().as_secs_f64(),
        };
        let lap = now - self.last;
        self.last = now;
        lap
    }
}

/// Processor time of a process so far, s; none where the operating system does not report it, or the process has ended.
pub fn processor_seconds_of(process: u32) -> Option<f64> {
    read_seconds(&format!("/proc/{process}/stat"))
}

fn processor_seconds() -> Option<f64> {
    read_seconds("/proc/self/stat")
}

/// User and system time, s.
fn read_seconds(stat: &str) -> Option<f64> {
    ticks(&std::fs::read_to_string(stat).ok()?).map(|ticks| ticks / TICKS)
}

/// utime + stime, fields 14 and 15. The second field, the name, may hold blanks, but ends with the last `)`.
fn ticks(stat: &str) -> Option<f64> {
    let mut fields = stat[stat.rfind(')')? + 1..].split_whitespace().skip(11);
    let mut next = || fields.next()?.parse::<f64>().ok();
    Some(next()? + next()?)
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn reads_the_right_fields() {
        let stat = "17 (a) b) S 1 17 17 0 -1 4194304 1 2 3 4 120 31 7 8 20 0 1 0 99";
        assert_eq!(ticks(stat), Some(151.0));
        assert_eq!(ticks("17 (a"), None);
    }

    /// The clock measures the whole process, including tests in other threads, so that only a lower limit can be checked.
    #[test]
    fn advances_with_work() {
        let mut clock = CpuClock::start();
        let (start, mut total, mut sum) = (Instant::now(), 0.0, 0u64);
        while total < 0.02 && start.elapsed().as_secs() < 60 {
            for _ in 0..1_000_000 {
                sum = std::hint::black_box(sum.wrapping_mul(3).wrapping_add(1));
            }
            total += clock.lap();
        }
        assert!(total >= 0.02);
        let here = processor_seconds_of(std::process::id());
        assert!(clock.kind() == ClockKind::Wall || here.is_some_and(|seconds| seconds >= 0.02), "{here:?}");
        assert_eq!(processor_seconds_of(u32::MAX), None);
    }
}
