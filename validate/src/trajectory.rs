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

/// The base at times of shape (…), in the world frame.
#[pyclass(frozen, get_all, module = "warpgait")]
pub struct BaseMotion {
    /// (…, 3) center of mass, m.
    position: Py<PyArrayDyn<f64>>,
    /// (…, 4) body to world, unit, with the same sign as the nearest sample of the plan.
    quaternion_wxyz: Py<PyArrayDyn<f64>>,
    /// (…, 3) m/s.
    linear_velocity: Py<PyArrayDyn<f64>>,
    /// (…, 3) m/s².
    linear_acceleration: Py<PyArrayDyn<f64>>,
    /// (…, 3) rad/s, world.
    angular_velocity: Py<PyArrayDyn<f64>>,
    /// (…, 3) rad/s², world.
    angular_acceleration: Py<PyArrayDyn<f64>>,
}

/// All feet at times of shape (…), in the world frame, in the order of `Trajectory.foot_names`.
#[pyclass(frozen, get_all, module = "warpgait")]
pub struct FeetMotion {
    /// (…, E, 3) contact points, m.
    position: Py<PyArrayDyn<f64>>,
    /// (…, E, 3) m/s.
    velocity: Py<PyArrayDyn<f64>>,
    /// (…, E, 3) m/s².
    acceleration: Py<PyArrayDyn<f64>>,
    /// (…, E, 3) of the ground on the robot, N.
    force: Py<PyArrayDyn<f64>>,
    /// (…, E) in stance; a foot that lifts off or touches down at exactly this time counts as in stance.
    contact: Py<PyArrayDyn<bool>>,
    /// (…, E, 3) unit normal of the terrain under the foot.
    normal: Py<PyArrayDyn<f64>>,
}

/// A plan as the optimized splines: exact at any time, not interpolated between samples.
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

    /// The quaternion of the plan's sample nearest to a time; quaternions between the samples get its sign.
    fn quaternion_near(&self, t: f64) -> [f64; 4] {
        let last = self.plan.base_quaternion_wxyz.len() - 1;
        let n = (t / self.motion.duration() * last as f64).round() as usize;
        self.plan.base_quaternion_wxyz[n.min(last)]
    }
}

#[pymethods]
impl Trajectory {
    /// The horizon, s.
    #[getter]
    fn duration(&self) -> f64 {
        self.motion.duration()
    }

    /// (N,) times of the plan's own samples, s.
    #[getter]
    fn t<'py>(&self, py: Python<'py>) -> Bound<'py, PyArray1<f64>> {
        PyArray1::from_slice(py, &self.plan.t)
    }

    /// The E feet in order.
    #[getter]
    fn foot_names<'py>(&self, py: Python<'py>) -> PyResult<Bound<'py, PyTuple>> {
        PyTuple::new(py, &self.plan.foot_names)
    }

    /// The ground that the plan was made for.
    #[getter]
    fn terrain(&self) -> Terrain {
        Terrain(self.ground.clone())
    }

    /// Every constraint of the nonlinear program holds.
    #[getter]
    fn solved(&self) -> bool {
        self.plan.meta.solver.success
    }

    /// Every check in the plan holds. The checks compute each law again from the samples alone.
    #[getter]
    fn passed(&self) -> bool {
        self.plan.meta.checks.iter().all(|row| row.passed)
    }

    /// The plan's member `meta`: scenario, robot, limits, solver, checks, inputs.
    #[getter]
    fn meta<'py>(&self, py: Python<'py>) -> PyResult<Bound<'py, PyAny>> {
        let text =
            serde_json::to_string(&self.plan.meta).map_err(|e| PyRuntimeError::new_err(e.to_string()))?;
        py.import("json")?.call_method1("loads", (text,))
    }

    /// The base at times t in s, of any shape (…); a time outside 0…`duration` is refused.
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

    /// The feet and their forces at times t in s, of any shape (…).
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

    /// Write the plan file, `NAME.plan.npz`.
    fn save(&self, py: Python<'_>, path: PathBuf) -> PyResult<()> {
        py.detach(|| self.plan.write(&path)).map_err(exception)
    }

    fn __repr__(&self) -> String {
        let meta = &self.plan.meta;
        let verdict = if meta.solver.success { "solved" } else { "not solved" };
        format!("<warpgait.Trajectory {} {} s, {verdict}>", meta.robot.name, self.motion.duration())
    }
}

/// Read a plan file. A damaged file, or one without splines, is refused with file, member and reason.
#[pyfunction]
pub fn load(py: Python<'_>, path: PathBuf) -> PyResult<Trajectory> {
    let named = |error| match error {
        Error::Input(what) => Error::Input(format!("{}: {what}", path.display())),
        other => other,
    };
    py.detach(|| Plan::read(&path).and_then(|plan| Trajectory::new(plan).map_err(named))).map_err(exception)
}
