//! Figures of a check in JSON.

use serde_json::{Value, json};

use crate::check::CheckReport;
use crate::plan::CheckRow;

/// Measured values without a limit. Their limit is infinite, which JSON cannot express, and is left out.
pub(super) fn figures(report: &CheckReport) -> Vec<Value> {
    let figure = |row: &CheckRow| json!({ "name": row.name, "value": row.value, "unit": row.unit, "time": row.time, "foot": row.foot });
    report.figures.iter().map(figure).collect()
}
