//! The laws of `warpgait check` from Python.

use std::path::PathBuf;

use pyo3::exceptions::PyRuntimeError;
use pyo3::prelude::*;
use serde_json::json;
use warpgait::plan::Plan;
use warpgait::{Error, check};

use crate::error::exception;

/// Recompute every law of a plan from its file, as `warpgait check` does.
///
/// Returns JSON: `checks` [{`name`, `value` (null where it is not a number), `unit`, `limit`, `passed`, `time`, `foot`}], `figures` (the
/// same without a limit), `remarks` (where the plan states something else than its scenario asks for, in sentences), `passed`.
/// A damaged file is refused with file, member and reason.
#[pyfunction]
pub fn check_plan(py: Python<'_>, path: PathBuf) -> PyResult<String> {
    let named = |error| match error {
        Error::Input(what) => Error::Input(format!("{}: {what}", path.display())),
        other => other,
    };
    let report = py
        .detach(|| Plan::read(&path).and_then(|plan| check::check(&plan).map_err(named)))
        .map_err(exception)?;
    let object = json!({
        "checks": report.rows,
        "figures": report.figures,
        "remarks": report.remarks,
        "passed": report.passed,
    });
    serde_json::to_string(&object).map_err(|e| PyRuntimeError::new_err(e.to_string()))
}
