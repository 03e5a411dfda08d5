//! Iterates of a solve, for those who watch it.

use std::sync::Arc;

use numpy::PyArrayDyn;
use pyo3::exceptions::PyRuntimeError;
use pyo3::prelude::*;
use pyo3::types::PyTuple;
use warpgait::plan::MetaRobot;
use warpgait::planner::{Iterate as Point, Progress};
use warpgait::scenario::LoadedScenario;
use warpgait::trajectory::space::Space;
use warpgait::warp::WarpMap;

use crate::arrays::{Numbers, array, values};
use crate::error::InputError;
use crate::terrain::Terrain;

/// The motion at an iteration, at N equally spaced times: 25 a second, but at most 500. E feet. World frame, SI units.
#[pyclass(frozen, module = "warpgait")]
pub struct Iterate {
    /// What is being solved, in words.
    #[pyo3(get)]
    stage: String,
    /// Counted over all stages.
    #[pyo3(get)]
    iteration: usize,
    /// How far the constraints are violated at most.
    #[pyo3(get)]
    violation: f64,
    /// The objective.
    #[pyo3(get)]
    objective: f64,
    /// (N,) s.
    #[pyo3(get)]
    t: Py<PyArrayDyn<f64>>,
    /// (N, 3) center of mass, m.
    #[pyo3(get)]
    base_position: Py<PyArrayDyn<f64>>,
    /// (N, 4) body to world.
    #[pyo3(get)]
    base_quaternion_wxyz: Py<PyArrayDyn<f64>>,
    /// (N, E, 3) contact points, m.
    #[pyo3(get)]
    foot_position: Py<PyArrayDyn<f64>>,
    /// (N, E, 3) of the ground on the robot, N.
    #[pyo3(get)]
    foot_force: Py<PyArrayDyn<f64>>,
    /// (N, E) in stance.
    #[pyo3(get)]
    foot_contact: Py<PyArrayDyn<bool>>,
    /// (N, 6) x, y, z, roll, pitch, yaw of the base in the warped space, m and rad, if it is planned there.
    #[pyo3(get)]
    warped_base: Option<Py<PyArrayDyn<f64>>>,
    /// (N, E, 3) contact points in the warped space, m, if they are planned there.
    #[pyo3(get)]
    warped_foot_position: Option<Py<PyArrayDyn<f64>>>,
    /// (N, E, 3) forces in the warped space, N, if they are planned there.
    #[pyo3(get)]
    warped_foot_force: Option<Py<PyArrayDyn<f64>>>,
    /// The ground of this stage, which a continuation raises step by step.
    #[pyo3(get)]
    terrain: Py<Terrain>,
    /// The E feet in order.
    #[pyo3(get)]
    foot_names: Py<PyTuple>,
    /// The robot, as JSON; `meta["robot"]` of the plan.
    #[pyo3(get)]
    robot: String,
    map: Option<Arc<WarpMap>>,
}

impl Iterate {
    /// Samples the iterate `point` of `at`.
    pub fn new(py: Python<'_>, at: &Progress, point: &Point, loaded: &LoadedScenario) -> PyResult<Self> {
        let found = point.sampled();
        let (model, n, feet) = (point.model, found.t.len(), point.model.feet());
        let vectors = |values: &[[f64; 3]]| array(py, &[n], &[feet, 3], values.as_flattened().to_vec());
        let (base, warped) = (model.spaces.base.is_warped(), model.spaces.feet.is_warped());
        let robot = serde_json::to_string(&MetaRobot::of(loaded));
        let when = |is: bool, values: &[[f64; 3]]| is.then(|| vectors(values)).transpose();
        Ok(Self {
            stage: at.stage.to_string(),
            iteration: at.iteration,
            violation: at.record.violation,
            objective: at.record.objective,
            base_position: array(py, &[n], &[3], found.base_position.as_flattened().to_vec())?,
            base_quaternion_wxyz: array(py, &[n], &[4], found.base_quaternion_wxyz.as_flattened().to_vec())?,
            foot_position: vectors(&found.foot_position)?,
            foot_force: vectors(&found.foot_force)?,
            foot_contact: array(py, &[n], &[feet], found.foot_contact)?,
            warped_base: base
                .then(|| array(py, &[n], &[6], found.base_variables.as_flattened().to_vec()))
                .transpose()?,
            warped_foot_position: when(warped, &found.foot_variables)?,
            warped_foot_force: when(warped, &found.force_variables)?,
            t: array(py, &[n], &[], found.t)?,
            terrain: Py::new(py, Terrain(model.surfaces.feet.clone()))?,
            foot_names: PyTuple::new(py, &model.foot_names)?.unbind(),
            robot: robot.map_err(|e| PyRuntimeError::new_err(e.to_string()))?,
            map: match &model.spaces.feet {
                Space::Direct => None,
                Space::Warped(map) => Some(map.clone()),
            },
        })
    }
}

#[pymethods]
impl Iterate {
    /// The corners of the map's box in the warped space, each (3,) m; none without a map.
    #[getter]
    fn warped_box(&self) -> Option<([f64; 3], [f64; 3])> {
        let map = self.map.as_ref()?;
        let (lower, size) = (map.origin(), map.size());
        Some((lower, std::array::from_fn(|d| lower[d] + size[d])))
    }

    /// Points (…, 3) m of the warped space in ambient space. Without a map they are the same.
    fn ambient(&self, py: Python<'_>, points: Numbers) -> PyResult<Py<PyArrayDyn<f64>>> {
        let (shape, points) = values(&points);
        if shape.last() != Some(&3) {
            return Err(InputError::new_err(format!("points of shape {shape:?}: expected (…, 3), m")));
        }
        let place = |p: &[f64; 3]| self.map.as_ref().map_or(*p, |map| map.position(*p));
        let found = points.as_chunks::<3>().0.iter().flat_map(place).collect();
        array(py, &shape, &[], found)
    }
}
