//! Runs a bench and writes its files.

use std::path::PathBuf;

use super::case::CaseRow;
use super::kind::Bench;
use super::options::BenchOptions;
use super::summary::{self, Group};
use super::sweep::{self, SweepProgress};
use super::{csv, json, pictures, protocol};
use crate::files::{ensure_outputs, write_atomically};
use crate::{Error, Result, replay};

/// Files that every bench writes.
const RESULTS: [&str; 2] = ["results.json", "results.csv"];

/// The results of a bench.
#[derive(Clone, Debug)]
pub struct BenchResults {
    /// All cases.
    pub rows: Vec<CaseRow>,
    /// Their summary by groups.
    pub groups: Vec<Group>,
    /// The files written.
    pub files: Vec<PathBuf>,
}

/// Runs a bench and writes `results.json`, `results.csv` and drawings, for replays also `metrics.csv`; none when interrupted.
///
/// # Errors
/// When files cannot be written, or the Python package is missing that replays need.
pub fn run(
    bench: Bench,
    options: &BenchOptions,
    on_progress: &mut dyn FnMut(&SweepProgress),
) -> Result<Option<BenchResults>> {
    let folder = options.out.join(bench.name());
    std::fs::create_dir_all(&folder).map_err(|e| Error::io(&folder, e))?;
    let results = RESULTS.map(|name| folder.join(name));
    ensure_outputs(&results.iter().map(PathBuf::as_path).collect::<Vec<_>>(), &[])?;
    let python = if bench == Bench::Track { Some(replay::python()?) } else { None };
    let cases = protocol::cases(bench, options);
    let Some(rows) = sweep::run(cases, python, options, on_progress)? else {
        return Ok(None);
    };
    let groups = summary::groups(&rows);
    let mut texts = vec![
        (RESULTS[0].to_owned(), json::results(bench, options, &rows, &groups)?),
        (RESULTS[1].to_owned(), csv::results(&rows)),
    ];
    if bench == Bench::Track {
        texts.push(("metrics.csv".to_owned(), csv::metrics(&rows)));
    }
    texts.extend(pictures::draw(bench, &rows, &groups));
    let mut files = Vec::new();
    for (name, text) in texts {
        let path = folder.join(name);
        write_atomically(&path, text.as_bytes())?;
        files.push(path);
    }
    Ok(Some(BenchResults { rows, groups, files }))
}
