//! A plan, evaluated exactly at any time.

use std::path::PathBuf;
use std::sync::Arc;

use numpy::{PyArray1, PyArrayDyn};
use pyo3::exceptions::PyRuntimeError;
use pyo3::prelude::*;
use pyo3::types::PyTuple;
use warpgait::heightfield::Heightfield;
use warpgait::plan::Plan;
use warpgait::plan::exact::ExactMotion;
use warpgait::{Error, Result};

use crate::arrays::{Numbers, array, values};
use crate::error::exception;
use crate::terrain::Terrain;

#[pyclass(frozen, get_all, module = "warpgait")]
pub struct BaseMotion {
    position: Py<PyArrayDyn<f64>>,
    quaternion_wxyz: Py<PyArrayDyn<f64>>,
    linear_velocity: Py<PyArrayDyn<f64>>,
    linear_acceleration: Py<PyArrayDyn<f64>>,
    angular_velocity: Py<PyArrayDyn<f64>>,
    angular_acceleration: Py<PyArrayDyn<f64>>,
}

#[pyclass(frozen, get_all, module = "warpgait")]
pub struct FeetMotion {
    position: Py<PyArrayDyn<f64>>,
    velocity: Py<PyArrayDyn<f64>>,
    acceleration: Py<PyArrayDyn<f64>>,
    force: Py<PyArrayDyn<f64>>,
    contact: Py<PyArrayDyn<bool>>,
    normal: Py<PyArrayDyn<f64>>,
}

#[pyclass(frozen, module = "warpgait")]
pub struct Trajectory {
    plan: Plan,
    motion: ExactMotion,
    ground: Arc<Heightfield>,
}

impl Trajectory {
    pub fn new(plan: Plan) -> Result<Self> {
        let (motion, ground) = (plan.motion()?, Arc::new(plan.heightfield()?));
        Ok(Self { plan, motion, ground })
    }

    /// The plan's sample nearest to a time: its quaternion has the sign that those between are to have too.
    fn quaternion_near(&self, t: f64) -> [f64; 4] {
        let last = self.plan.base_quaternion_wxyz.len() - 1;
        let n = (t / self.motion.duration() * last as f64).round() as usize;
        self.plan.base_quaternion_wxyz[n.min(last)]
    }
}

#[pymethods]
impl Trajectory {
    #[getter]
    fn duration(&self) -> f64 {
        self.motion.duration()
    }

    #[getter]
    fn t<'py>(&self, py: Python<'py>) -> Bound<'py, PyArray1<f64>> {
        PyArray1::from_slice(py, &self.plan.t)
    }

    #[getter]
    fn foot_names<'py>(&self, py: Python<'py>) -> PyResult<Bound<'py, PyTuple>> {
        PyTuple::new(py, &self.plan.foot_names)
    }

    #[getter]
    fn terrain(&self) -> Terrain {
        Terrain(self.ground.clone())
    }

    #[getter]
    fn solved(&self) -> bool {
        self.plan.meta.solver.success
    }

    #[getter]
    fn passed(&self) -> bool {
        self.plan.meta.checks.iter().all(|row| row.passed)
    }

    #[getter]
    fn meta<'py>(&self, py: Python<'py>) -> PyResult<Bound<'py, PyAny>> {
        let text =
            serde_json::to_string(&self.plan.meta).map_err(|e| PyRuntimeError::new_err(e.to_string()))?;
        py.import("json")?.call_method1("loads", (text,))
    }

    fn base(&self, py: Python<'_>, t: Numbers) -> PyResult<BaseMotion> {
        let (shape, times) = values(&t);
        let found = py
            .detach(|| times.iter().map(|&t| self.motion.base(t)).collect::<Result<Vec<_>>>())
            .map_err(exception)?;
        let vectors = |of: fn(&warpgait::trajectory::sampling::BaseMotion) -> [f64; 3]| {
            array(py, &shape, &[3], found.iter().flat_map(of).collect())
        };
        let quaternions =
            found.iter().zip(&times).flat_map(|(base, &t)| base.quaternion_wxyz(self.quaternion_near(t)));
        Ok(BaseMotion {
            position: vectors(|base| base.position.into())?,
            quaternion_wxyz: array(py, &shape, &[4], quaternions.collect())?,
            linear_velocity: vectors(|base| base.velocity.into())?,
            linear_acceleration: vectors(|base| base.acceleration.into())?,
            angular_velocity: vectors(|base| base.angular_velocity.into())?,
            angular_acceleration: vectors(|base| base.angular_acceleration.into())?,
        })
    }

    fn feet(&self, py: Python<'_>, t: Numbers) -> PyResult<FeetMotion> {
        let (shape, times) = values(&t);
        let feet = self.motion.feet();
        let found = py
            .detach(|| {
                let each = times.iter().flat_map(|&t| (0..feet).map(move |i| self.motion.foot(i, t)));
                each.collect::<Result<Vec<_>>>()
            })
            .map_err(exception)?;
        let vectors = |of: fn(&warpgait::trajectory::sampling::FootMotion) -> [f64; 3]| {
            array(py, &shape, &[feet, 3], found.iter().flat_map(of).collect())
        };
        let normals = found.iter().flat_map(|foot| self.ground.normal(foot.position.x, foot.position.y));
        Ok(FeetMotion {
            position: vectors(|foot| foot.position.into())?,
            velocity: vectors(|foot| foot.velocity.into())?,
            acceleration: vectors(|foot| foot.acceleration.into())?,
            force: vectors(|foot| foot.force.into())?,
            contact: array(py, &shape, &[feet], found.iter().map(|foot| foot.contact).collect())?,
            normal: array(py, &shape, &[feet, 3], normals.collect())?,
        })
    }

    fn save(&self, py: Python<'_>, path: PathBuf) -> PyResult<()> {
        py.detach(|| self.plan.write(&path)).map_err(exception)
    }

    fn __repr__(&self) -> String {
        let meta = &self.plan.meta;
        let verdict = if meta.solver.success { "solved" } else { "not solved" };
        format!("<warpgait.Trajectory {} {} s, {verdict}>", meta.robot.name, self.motion.duration())
    }
}

#[pyfunction]
pub fn load(py: Python<'_>, path: PathBuf) -> PyResult<Trajectory> {
    let named = |error| match error {
        Error::Input(what) => Error::Input(format!("{}: {what}", path.display())),
        other => other,
    };
    py.detach(|| Plan::read(&path).and_then(|plan| Trajectory::new(plan).map_err(named))).map_err(exception)
}
