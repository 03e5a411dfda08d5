//! The paper's tables and figures, and what goes beyond them, as sweeps of cases that are measured one by one.
//!
//! | module | does |
//! | --- | --- |
//! | [`protocol`] | which cases there are: scenarios written as text |
//! | `ways` | where their motions start and end, and how terrains get steeper |
//! | [`sweep`] | runs each in a process of its own, keeps finished ones |
//! | [`case`] | what happens in that process, and what it measures |
//! | [`clock`] | processor time |
//! | `orphan` | no case outlives its sweep |
//! | `tracking` | replays on the full robot, summed up |
//! | [`summary`] | rows to groups: rates, medians, failures; JSON |
//! | [`tables`], `csv` | the groups for the terminal, the rows for spreadsheets |
//! | [`pictures`] | drawings like the paper's |
//!
//! Times: `cpu_…` is processor time of the case's process (user and system, `/proc/self/stat`, steps of 10 ms), so other
//! load on the machine counts only in so far as it crowds caches and memory. Where a column says wall, it is wall time.

pub mod case;
pub mod clock;
mod csv;
mod orphan;
pub mod pictures;
pub mod protocol;
pub mod summary;
pub mod sweep;
pub mod tables;
mod tracking;
mod ways;

use std::path::PathBuf;
use std::time::Duration;

use crate::Result;
use crate::files::write_atomically;
pub use orphan::end_with;
pub use protocol::Bench;

/// What to run and where to put it. Empty lists stand for what the bench does by default.
#[derive(Clone, Debug)]
pub struct Options {
    /// Folder of all results; the tables go to a folder of the bench's name in it.
    pub out: PathBuf,
    /// Few cases.
    pub quick: bool,
    /// Processes at a time.
    pub jobs: usize,
    /// Name of a shipped robot; none stands for the bench's own.
    pub robot: Option<String>,
    /// Levels of the terrains.
    pub levels: Vec<String>,
    /// Formulations.
    pub formulations: Vec<String>,
    /// Kinds of terrain.
    pub terrains: Vec<String>,
    /// Processor time that the process of a case may take; so may its replay.
    pub time_limit: Duration,
    /// Take finished cases of other builds of the program, too.
    pub any_program: bool,
}

impl Default for Options {
    fn default() -> Self {
        Self {
            out: "bench".into(),
            quick: false,
            jobs: 1,
            robot: None,
            levels: Vec::new(),
            formulations: Vec::new(),
            terrains: Vec::new(),
            time_limit: Duration::from_secs(900),
            any_program: false,
        }
    }
}

/// What a bench came to.
#[derive(Clone, Debug)]
pub struct Outcome {
    /// All rows.
    pub rows: Vec<sweep::Row>,
    /// The same by groups.
    pub groups: Vec<summary::Group>,
    /// Files written.
    pub files: Vec<PathBuf>,
}

/// Runs a bench and writes `results.json`, `results.csv` and pictures; none when interrupted.
///
/// # Errors
/// When files cannot be written.
pub fn run(
    bench: Bench,
    options: &Options,
    on_progress: &mut dyn FnMut(&sweep::SweepProgress),
) -> Result<Option<Outcome>> {
    let folder = options.out.join(bench.name());
    std::fs::create_dir_all(&folder).map_err(|e| crate::Error::io(&folder, e))?;
    let python = if bench == Bench::Track { Some(crate::replay::python()?) } else { None };
    let Some(rows) = sweep::run(bench.cases(options), python, options, on_progress)? else {
        return Ok(None);
    };
    let groups = summary::groups(&rows);
    let mut files = vec![
        ("results.json".to_owned(), summary::json(bench, options, &rows, &groups)?),
        ("results.csv".to_owned(), csv::csv(&rows)),
    ];
    if bench == Bench::Track {
        files.push(("metrics.csv".to_owned(), tracking::metrics_csv(&rows)));
    }
    files.extend(pictures::draw(bench, &rows, &groups));
    let mut written = Vec::new();
    for (name, text) in files {
        let path = folder.join(name);
        write_atomically(&path, text.as_bytes())?;
        written.push(path);
    }
    Ok(Some(Outcome { rows, groups, files: written }))
}
