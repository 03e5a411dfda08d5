//! The ground as planned on.

use std::sync::Arc;

use numpy::PyArrayDyn;
use pyo3::prelude::*;
use warpgait::heightfield::Heightfield;

use crate::arrays::{Numbers, array, values};
use crate::error::InputError;

/// The ground of a plan or a scenario: a C² spline through the heights, extended beyond their rectangle.
#[pyclass(frozen, module = "warpgait")]
pub struct Terrain(pub Arc<Heightfield>);

impl Terrain {
    /// Evaluates `f` at points of shape (…, 2); a result of length D has the shape (…, D), of length 1 with `inner` empty (…).
    fn at<const D: usize>(
        &self,
        py: Python<'_>,
        points: &Numbers,
        inner: &[usize],
        f: impl Fn(&Heightfield, f64, f64) -> [f64; D] + Sync,
    ) -> PyResult<Py<PyArrayDyn<f64>>> {
        let (shape, points) = values(points);
        let Some((2, outer)) = shape.split_last() else {
            return Err(InputError::new_err(format!(
                "points of shape {shape:?}: expected (…, 2), x and y in m"
            )));
        };
        let pairs = points.as_chunks::<2>().0;
        if let Some([x, y]) = pairs.iter().find(|p| p.iter().any(|v| !v.is_finite())) {
            return Err(InputError::new_err(format!("the point ({x}, {y}) is not finite")));
        }
        let field = &*self.0;
        let found = py.detach(|| pairs.iter().flat_map(|&[x, y]| f(field, x, y)).collect());
        array(py, outer, inner, found)
    }
}

#[pymethods]
impl Terrain {
    /// x_min, x_max, y_min, y_max, m.
    #[getter]
    fn extent(&self) -> (f64, f64, f64, f64) {
        self.0.extent().into()
    }

    /// h, m, (…), at points (…, 2), x and y in m.
    fn height(&self, py: Python<'_>, points: Numbers) -> PyResult<Py<PyArrayDyn<f64>>> {
        self.at(py, &points, &[], |field, x, y| [field.height(x, y)])
    }

    /// ∂h/∂x and ∂h/∂y, (…, 2), at points (…, 2).
    fn gradient(&self, py: Python<'_>, points: Numbers) -> PyResult<Py<PyArrayDyn<f64>>> {
        self.at(py, &points, &[2], |field, x, y| field.gradient(x, y))
    }

    /// The upward unit normal, (…, 3), at points (…, 2).
    fn normal(&self, py: Python<'_>, points: Numbers) -> PyResult<Py<PyArrayDyn<f64>>> {
        self.at(py, &points, &[3], |field, x, y| field.normal(x, y))
    }

    fn __repr__(&self) -> String {
        let [x_min, x_max, y_min, y_max] = self.0.extent();
        format!("<warpgait.Terrain x {x_min}…{x_max} m, y {y_min}…{y_max} m>")
    }
}
