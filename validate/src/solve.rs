//! Planning from Python: the pipeline of `warpgait solve` without the interpreter lock.

use std::ops::ControlFlow;
use std::time::{Duration, Instant};

use pyo3::exceptions::{PyRuntimeError, PyStopIteration};
use pyo3::prelude::*;
use pyo3::types::PyDict;
use warpgait::pipeline::{self, Event};
use warpgait::scenario::LoadedScenario;

use crate::error::exception;
use crate::iterate::Iterate;
use crate::scenario;
use crate::trajectory::Trajectory;

/// Time between two iterates that are shown, at least.
const BETWEEN: Duration = Duration::from_millis(100);

/// Plan the motion of a scenario and check it, as `warpgait solve` does.
///
/// `scenario` is a file, or the text of one: a `str` with a line break (its relative paths are relative to the working folder).
/// `overrides` sets values by dotted key, `{"gait.kind": "trot"}`. `progress(iteration, violation, objective)` is called at every
/// iteration of the nonlinear program, and `watch(iterate)` at most ten times a second with an `Iterate`, the motion so far. An exception that
/// they raise ends the solve and is raised here, and so is Ctrl-C; after `StopIteration`, the motion so far is returned, with its check.
/// Other threads run meanwhile. One solve runs at a time in a process. A
/// solve that does not converge is not an error: see `solved` and `passed`.
#[pyfunction]
#[pyo3(signature = (scenario, *, overrides = None, progress = None, watch = None))]
pub fn solve(
    py: Python<'_>,
    scenario: &Bound<'_, PyAny>,
    overrides: Option<&Bound<'_, PyDict>>,
    progress: Option<Py<PyAny>>,
    watch: Option<Py<PyAny>>,
) -> PyResult<Trajectory> {
    let loaded = scenario::load(scenario, overrides)?;

    let mut raised: Option<PyErr> = None;
    let mut shown: Option<Instant> = None;
    let outcome = py.detach(|| {
        let outcome = pipeline::run(&loaded, false, &mut |event| {
            if raised.is_none() {
                raised = Python::attach(|py| {
                    tell(py, event, progress.as_ref())?;
                    show(py, event, &loaded, watch.as_ref(), &mut shown)
                })
                .err();
            }
            if raised.is_some() { ControlFlow::Break(()) } else { ControlFlow::Continue(()) }
        });
        outcome.and_then(|outcome| outcome.map(|outcome| Trajectory::new(outcome.plan)).transpose())
    });
    match (raised, outcome) {
        (Some(raised), Ok(Some(trajectory))) if raised.is_instance_of::<PyStopIteration>(py) => {
            Ok(trajectory)
        }
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

/// Shows the motion at an iteration to the caller, unless one was shown just before.
fn show(
    py: Python<'_>,
    event: &Event,
    loaded: &LoadedScenario,
    watch: Option<&Py<PyAny>>,
    shown: &mut Option<Instant>,
) -> PyResult<()> {
    if let (Event::Iteration(at), Some(watch)) = (event, watch)
        && let Some(point) = &at.iterate
        && shown.is_none_or(|last| last.elapsed() >= BETWEEN)
    {
        watch.call1(py, (Iterate::new(py, at, point, loaded)?,))?;
        *shown = Some(Instant::now());
    }
    Ok(())
}
