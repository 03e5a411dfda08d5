//! Planning from Python: the pipeline of `warpgait solve` without the interpreter lock.

use std::ops::ControlFlow;
use std::path::{Path, PathBuf};

use pyo3::exceptions::PyRuntimeError;
use pyo3::prelude::*;
use pyo3::types::{PyBool, PyDict, PyFloat, PyInt, PyString};
use warpgait::pipeline::{self, Event};
use warpgait::scenario;

use crate::error::{InputError, exception};
use crate::trajectory::Trajectory;

/// Plan the motion of a scenario and check it, as `warpgait solve` does.
///
/// `scenario` is a file, or the text of one: a `str` with a line break (its relative paths are relative to the working folder).
/// `overrides` sets values by dotted key, `{"gait.kind": "trot"}`. `progress(iteration, violation, objective)` is called at every
/// iteration of the nonlinear program. An exception that it raises ends the solve and is raised here, and so is Ctrl-C. Other threads run
/// meanwhile. One solve runs at a time in a process. A solve that does not converge is not an error: see `solved` and `passed`.
#[pyfunction]
#[pyo3(signature = (scenario, *, overrides = None, progress = None))]
pub fn solve(
    py: Python<'_>,
    scenario: &Bound<'_, PyAny>,
    overrides: Option<&Bound<'_, PyDict>>,
    progress: Option<Py<PyAny>>,
) -> PyResult<Trajectory> {
    let overrides = match overrides {
        Some(overrides) => assignments(overrides)?,
        None => Vec::new(),
    };
    let text = scenario.cast::<PyString>().ok().map(|text| text.to_str()).transpose()?;
    let loaded = match text {
        Some(text) if text.contains('\n') => {
            scenario::load_text("scenario", text, Path::new("."), &overrides)
        }
        _ => scenario::load(&scenario.extract::<PathBuf>()?, &overrides),
    };
    let loaded = loaded.map_err(exception)?;

    let mut raised: Option<PyErr> = None;
    let outcome = py.detach(|| {
        let outcome = pipeline::run(&loaded, false, &mut |event| {
            if raised.is_none() {
                raised = Python::attach(|py| tell(py, event, progress.as_ref())).err();
            }
            if raised.is_some() { ControlFlow::Break(()) } else { ControlFlow::Continue(()) }
        });
        outcome.and_then(|outcome| outcome.map(|outcome| Trajectory::new(outcome.plan)).transpose())
    });
    match (raised, outcome) {
        (Some(raised), _) => Err(raised),
        (None, Err(error)) => Err(exception(error)),
        (None, Ok(Some(trajectory))) => Ok(trajectory),
        (None, Ok(None)) => Err(PyRuntimeError::new_err("the solve was stopped before it had begun")),
    }
}

/// Checks for Ctrl-C, and reports an iteration to the caller.
fn tell(py: Python<'_>, event: &Event, progress: Option<&Py<PyAny>>) -> PyResult<()> {
    py.check_signals()?;
    if let (Event::Iteration(at), Some(progress)) = (event, progress) {
        progress.call1(py, (at.iteration, at.record.violation, at.record.objective))?;
    }
    Ok(())
}

/// `key=value` for each entry, the value in TOML.
fn assignments(overrides: &Bound<'_, PyDict>) -> PyResult<Vec<String>> {
    overrides
        .iter()
        .map(|(key, value)| {
            let key: String = key.extract().map_err(|_| {
                InputError::new_err(format!("overrides: the key {key} is no string, such as \"gait.kind\""))
            })?;
            Ok(format!("{key}={}", toml_value(&key, &value)?))
        })
        .collect()
}

fn toml_value(key: &str, value: &Bound<'_, PyAny>) -> PyResult<toml::Value> {
    // A bool is an int too, so it comes first.
    if value.is_instance_of::<PyBool>() {
        return Ok(toml::Value::Boolean(value.extract()?));
    }
    if value.is_instance_of::<PyInt>() {
        return Ok(toml::Value::Integer(value.extract()?));
    }
    if value.is_instance_of::<PyFloat>() {
        return Ok(toml::Value::Float(value.extract()?));
    }
    if let Ok(text) = value.cast::<PyString>() {
        return Ok(toml::Value::String(text.to_str()?.to_owned()));
    }
    // NumPy's scalars and arrays say what they are in Python's own types.
    if value.hasattr("tolist")? {
        return toml_value(key, &value.call_method0("tolist")?);
    }
    let refuse = || {
        let what = format!("overrides: {key}: {value} is no bool, number, string, or list of these");
        InputError::new_err(what)
    };
    let items = value.try_iter().map_err(|_| refuse())?;
    if value.is_instance_of::<PyDict>() {
        return Err(refuse());
    }
    Ok(toml::Value::Array(items.map(|item| toml_value(key, &item?)).collect::<PyResult<_>>()?))
}
