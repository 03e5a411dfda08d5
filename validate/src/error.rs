//! Errors of the library as exceptions.

use pyo3::PyErr;
use pyo3::exceptions::PyRuntimeError;
use warpgait::Error;

pyo3::import_exception!(warpgait.errors, InputError);

/// What a user can act on is an `InputError` (a `ValueError`), the rest a `RuntimeError`.
pub fn exception(error: Error) -> PyErr {
    match error {
        Error::Input(_) | Error::Key { .. } | Error::Io { .. } => InputError::new_err(error.to_string()),
        Error::Internal(_) => PyRuntimeError::new_err(error.to_string()),
    }
}
