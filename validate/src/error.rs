//! Errors of the library as exceptions.

use pyo3::PyErr;
use pyo3::exceptions::PyRuntimeError;
use warpgait::Error;

pyo3::import_exception!(warpgait.errors, InputError);

/// What a user can act on is an `InputError` (a `ValueError`), the rest a `RuntimeError`.
pub fn exception(error: Error) -> PyErr {
    let message = error.to_string();
    // The fields of the exception: file, line, key.
    match error {
        Error::Input(_) => InputError::new_err(message),
        Error::Value { file, line, key, .. } => InputError::new_err((message, file, line, key)),
        Error::Key { key, .. } => InputError::new_err((message, None::<String>, None::<usize>, key)),
        Error::Io { path, .. } => InputError::new_err((message, path)),
        Error::Internal(_) => PyRuntimeError::new_err(error.to_string()),
    }
}
