//! Scenarios as Python gives them: a file or a text, and values by dotted key.

use std::path::{Path, PathBuf};
use std::sync::Arc;

use pyo3::exceptions::PyRuntimeError;
use pyo3::prelude::*;
use pyo3::types::{PyBool, PyDict, PyFloat, PyInt, PyString};
use warpgait::scenario::{self, LoadedScenario};

use crate::error::{InputError, exception};
use crate::terrain::Terrain;

/// The JSON Schema of scenario files, as `warpgait schema` prints it.
#[pyfunction]
pub fn schema() -> PyResult<String> {
    serde_json::to_string(&scenario::json_schema()).map_err(|e| PyRuntimeError::new_err(e.to_string()))
}

/// The ground of a scenario, as it is planned on. `scenario` and `overrides` are those of `solve`.
#[pyfunction]
#[pyo3(signature = (scenario, *, overrides = None))]
pub fn terrain(
    py: Python<'_>,
    scenario: &Bound<'_, PyAny>,
    overrides: Option<&Bound<'_, PyDict>>,
) -> PyResult<Terrain> {
    let loaded = load(scenario, overrides)?;
    let ground = py.detach(|| warpgait::terrain::build(&loaded.scenario, &loaded.robot, &loaded.base_dir));
    Ok(Terrain(Arc::new(ground.map_err(|e| exception(loaded.locate(e)))?.field)))
}

/// A scenario: a file, or a `str` with a line break.
pub fn load(scenario: &Bound<'_, PyAny>, overrides: Option<&Bound<'_, PyDict>>) -> PyResult<LoadedScenario> {
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
    loaded.map_err(exception)
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
