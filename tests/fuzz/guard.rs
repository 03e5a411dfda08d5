//! Watches a reader: panics, time and memory.

use std::panic::{AssertUnwindSafe, catch_unwind};
use std::path::PathBuf;
use std::sync::{Mutex, MutexGuard, PoisonError};
use std::time::{Duration, Instant};

use warpgait::bench::clock::processor_seconds_of;

/// An input may take this much processor time, s, which other load on the machine does not change …
const MOST_TIME: f64 = 5.0;
/// … and this much memory, bytes.
const MOST_MEMORY: u64 = 500_000_000;
/// An input that takes this long is kept, and ends the program.
const HANGS: Duration = Duration::from_secs(60);

/// One reader at a time, so that time and memory are its own.
static ONE: Mutex<()> = Mutex::new(());
/// The input at work, for the thread that notices when it hangs.
static RUNNING: Mutex<Option<(Instant, PathBuf, Vec<u8>)>> = Mutex::new(None);

/// Watches one reader after the other.
pub struct Guard {
    reader: &'static str,
    failures: Vec<String>,
    slowest: f64,
    inputs: u64,
    /// The largest memory so far, bytes.
    peak: u64,
    base: u64,
    _one: MutexGuard<'static, ()>,
}

impl Guard {
    pub fn of(reader: &'static str) -> Self {
        static WATCHDOG: std::sync::Once = std::sync::Once::new();
        let one = ONE.lock().unwrap_or_else(PoisonError::into_inner);
        WATCHDOG.call_once(|| {
            std::thread::spawn(end_what_hangs);
        });
        let peak = peak_memory();
        Self { reader, failures: Vec::new(), slowest: 0.0, inputs: 0, peak, base: peak, _one: one }
    }

    /// Runs a reader on an input.
    pub fn watch(&mut self, number: u64, input: &[u8], read: impl FnOnce()) {
        let kept = PathBuf::from(env!("CARGO_TARGET_TMPDIR"))
            .with_file_name("fuzz")
            .join(format!("{}-{number}", self.reader));
        let start = processor_seconds();
        *running() = Some((Instant::now(), kept.clone(), input.to_vec()));
        let panicked = catch_unwind(AssertUnwindSafe(read)).is_err();
        let took = processor_seconds() - start;
        *running() = None;
        let memory = peak_memory().saturating_sub(self.peak.max(self.base));
        self.peak = self.peak.max(peak_memory());
        self.slowest = self.slowest.max(took);
        self.inputs += 1;
        let why = match (panicked, took > MOST_TIME, memory > MOST_MEMORY) {
            (true, ..) => "panics".to_owned(),
            (_, true, _) => format!("takes {took:.1} s"),
            (.., true) => format!("takes {} MB", memory / 1_000_000),
            _ => return,
        };
        keep(&kept, input);
        self.failures.push(format!("{}: {why}", kept.display()));
    }

    pub fn finish(self) {
        println!(
            "{}: {} inputs, {} failures, slowest {:.2} s, memory at most {} MB more",
            self.reader,
            self.inputs,
            self.failures.len(),
            self.slowest,
            (self.peak - self.base) / 1_000_000
        );
        assert!(self.failures.is_empty(), "{}", self.failures.join("\n"));
    }
}

fn running() -> MutexGuard<'static, Option<(Instant, PathBuf, Vec<u8>)>> {
    RUNNING.lock().unwrap_or_else(PoisonError::into_inner)
}

fn keep(path: &PathBuf, input: &[u8]) {
    std::fs::create_dir_all(path.parent().expect("a folder")).unwrap();
    std::fs::write(path, input).unwrap();
}

fn end_what_hangs() {
    loop {
        std::thread::sleep(Duration::from_secs(1));
        if let Some((start, path, input)) = &*running()
            && start.elapsed() > HANGS
        {
            keep(path, input);
            eprintln!("{} hangs", path.display());
            std::process::abort();
        }
    }
}

/// Of this process, which runs one reader at a time.
fn processor_seconds() -> f64 {
    processor_seconds_of(std::process::id()).unwrap_or(0.0)
}

/// The largest memory that this process has had in RAM, bytes; zero where Linux does not tell.
fn peak_memory() -> u64 {
    let status = std::fs::read_to_string("/proc/self/status").unwrap_or_default();
    let line = status.lines().find_map(|line| line.strip_prefix("VmHWM:"));
    let kilobytes = line.and_then(|line| line.trim().strip_suffix(" kB")?.parse::<u64>().ok());
    1000 * kilobytes.unwrap_or(0)
}
