//! NumPy arrays in and out.

use numpy::{
    AllowTypeChange, Element, PyArray1, PyArrayDyn, PyArrayLikeDyn, PyArrayMethods, PyUntypedArrayMethods,
};
use pyo3::prelude::*;

/// Anything that NumPy takes for an array of numbers, of any shape.
pub type Numbers<'py> = PyArrayLikeDyn<'py, f64, AllowTypeChange>;

/// The shape and, in C order, the values.
pub fn values(array: &Numbers) -> (Vec<usize>, Vec<f64>) {
    (array.shape().to_vec(), array.as_array().iter().copied().collect())
}

/// A new array of shape `outer` + `inner` from its values in C order.
pub fn array<T: Element>(
    py: Python<'_>,
    outer: &[usize],
    inner: &[usize],
    values: Vec<T>,
) -> PyResult<Py<PyArrayDyn<T>>> {
    let array = PyArray1::from_vec(py, values).reshape([outer, inner].concat())?;
    Ok(array.unbind())
}
