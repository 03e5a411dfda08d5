//! `results.json`: everything about a bench.

use serde_json::{Value, json};

use super::case::CaseRow;
use super::kind::Bench;
use super::options::BenchOptions;
use super::summary::Group;
use super::verdict::verdict;
use crate::{Error, Result};

/// The text of `results.json`.
///
/// # Errors
/// Internal, when a value cannot be written as JSON.
pub(super) fn results(
    bench: Bench,
    options: &BenchOptions,
    rows: &[CaseRow],
    groups: &[Group],
) -> Result<String> {
    let results = json!({
        "bench": bench.name(),
        "version": env!("CARGO_PKG_VERSION"),
        "robot": options.robot,
        "machine": machine(),
        "jobs": options.jobs,
        "groups": groups,
        "cases": rows.iter().map(case).collect::<Vec<_>>(),
    });
    serde_json::to_string_pretty(&results).map_err(|e| Error::Internal(format!("results: {e}")))
}

fn case(row: &CaseRow) -> Value {
    let case = &row.case;
    json!({
        "name": case.name,
        "robot": case.robot,
        "terrain": case.terrain,
        "level": case.level,
        "method": case.method,
        "parameter": case.parameter,
        "heading": case.heading,
        "good": row.is_good(),
        "verdict": verdict(row),
        "measured": row.measured(),
    })
}

/// Model and number of the processors, as far as the operating system reports them.
fn machine() -> String {
    let text = std::fs::read_to_string("/proc/cpuinfo").unwrap_or_default();
    let model = text.lines().find_map(|line| line.strip_prefix("model name")?.split_once(": "));
    let count = std::thread::available_parallelism().map_or(0, |n| n.get());
    format!("{} × {count}", model.map_or("unknown processor", |(_, name)| name))
}
