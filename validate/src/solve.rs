//! Planning from Python: the pipeline of `warpgait solve` without the interpreter lock.

use std::ops::ControlFlow;

use pyo3::exceptions::PyRuntimeError;
use pyo3::prelude::*;
use pyo3::types::PyDict;
use warpgait::pipeline::{self, Event};

use crate::error::exception;
use crate::scenario;
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
    let loaded = scenario::load(scenario, overrides)?;

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
