//! The quality of a map, measured on grids finer than the one it was built on.

use std::ops::RangeInclusive;

use serde::{Deserialize, Serialize};

use super::assembly::Assembly;
use super::axis::{MapAxis, Rule};
use super::problem::coefficients_of;
use super::spline::{Order, WarpMap};
use crate::heightfield::Heightfield;
use crate::scenario::MapMethod;
use crate::{Error, Result};

/// How a map was built, and its quality.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
pub struct MapReport {
    /// The method that built it.
    pub method: MapMethod,
    /// Maps that `map.method = "auto"` built before it and rejected.
    pub rejected: Vec<RejectedMap>,
    /// Cells along x, y, z.
    pub cells: [usize; 3],
    /// Whether the optimizer converged on the finest grid (true for methods without an optimizer).
    pub converged: bool,
    /// Iterations on all grids.
    pub iterations: usize,
    /// Evaluations of the energy on all grids.
    pub evaluations: usize,
    /// Wall time, s.
    pub seconds: f64,
    /// The energy at the end, m³ (0 for methods without an optimizer).
    pub energy: f64,
    /// The energy by iteration for each run of the optimizer, coarse grids first.
    pub history: Vec<EnergyHistory>,
    /// Greatest vertical distance of the bottom face from the terrain, m.
    pub misfit_max: f64,
    /// Root mean square of that distance, m.
    pub misfit_rms: f64,
    /// Least determinant of J at points a third of a cell apart.
    pub min_determinant: f64,
    /// The point of F with the least determinant, m.
    pub min_determinant_at: [f64; 3],
    /// Number of these points whose determinant is not positive: the map is folded there.
    pub inverted_points: usize,
    /// Conformal error 1 − σ_min/σ_max at the ground, weighted by the area of the terrain.
    pub conformal_ground: Distribution,
    /// The same up to 0.5 m above the ground, weighted by volume.
    pub conformal_near_ground: Distribution,
    /// The same 0.4 to 0.6 m above the ground, at the height of a torso.
    pub conformal_torso: Distribution,
    /// Angle between J z and the terrain's normal, degrees, weighted by area. (Eq. 9 treats them as equal.)
    pub normal_angle: Distribution,
    /// Least and greatest local scale det^⅓ at the ground.
    pub scale: [f64; 2],
    /// Messages for the user.
    pub warnings: Vec<String>,
}

/// A map that `map.method = "auto"` rejected.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
pub struct RejectedMap {
    /// The method that built it.
    pub method: MapMethod,
    /// The reason, in words.
    pub why: String,
}

/// The energy during one run of the optimizer.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
pub struct EnergyHistory {
    /// Cells of the grid.
    pub cells: [usize; 3],
    /// The energy at the start and after each iteration, m³.
    pub energy: Vec<f64>,
}

/// A weighted distribution.
#[derive(Clone, Copy, Debug, Default, PartialEq, Serialize, Deserialize)]
pub struct Distribution {
    /// Mean.
    pub mean: f64,
    /// Median.
    pub median: f64,
    /// 95th percentile.
    pub p95: f64,
    /// Greatest.
    pub max: f64,
}

impl Distribution {
    /// The distribution of (value, weight) pairs; all zero if there are none.
    fn of(mut samples: Vec<[f64; 2]>) -> Distribution {
        samples.sort_by(|a, b| a[0].total_cmp(&b[0]));
        let total: f64 = samples.iter().map(|s| s[1]).sum();
        let Some(last) = samples.last() else {
            return Distribution::default();
        };
        let quantile = |fraction: f64| {
            let mut sum = 0.0;
            let reached = |s: &&[f64; 2]| {
                sum += s[1];
                sum >= fraction * total
            };
            samples.iter().find(reached).unwrap_or(last)[0]
        };
        let mean = samples.iter().map(|s| s[0] * s[1]).sum::<f64>() / total.max(f64::MIN_POSITIVE);
        Distribution { mean, median: quantile(0.5), p95: quantile(0.95), max: last[0] }
    }
}

/// Points per cell at which the ground is measured, along each axis.
const GROUND_DENSITY: usize = 3;
/// Points per cell at which the space above the ground is measured, along each axis.
const VOLUME_DENSITY: usize = 2;
/// Heights above the ground that count as near it: up to this, m.
const NEAR_GROUND: f64 = 0.5;
/// Heights above the ground of a torso, m.
const TORSO: RangeInclusive<f64> = 0.4..=0.6;
/// Misfit of the bottom face that causes a warning, m.
const MISFIT_WARNING: f64 = 2e-3;
/// Mean conformal error at the ground that causes a warning.
const CONFORMAL_WARNING: f64 = 0.10;
/// Greatest mean conformal error at the ground that `map.method = "auto"` accepts.
const GOOD_CONFORMAL: f64 = 0.05;
/// Greatest misfit of the bottom face that `map.method = "auto"` accepts, m.
const GOOD_MISFIT: f64 = 1e-3;

impl MapReport {
    /// Measures a map against its terrain. The caller fills in how it was built.
    pub(super) fn measure(map: &WarpMap, field: &Heightfield, method: MapMethod) -> MapReport {
        let (cells, cell, origin) = (map.cells(), map.cell(), map.origin());
        let axes: [MapAxis; 3] = std::array::from_fn(|d| MapAxis { cells: cells[d], cell: cell[d] });
        let mut fine = Assembly::new(axes, Rule::Thirds, |_| 1.0, 1.0);
        let (min_determinant, inverted_points, at) = fine.determinants(&coefficients_of(map, &axes));
        let mut report = MapReport {
            method,
            rejected: Vec::new(),
            cells,
            converged: true,
            iterations: 0,
            evaluations: 0,
            seconds: 0.0,
            energy: 0.0,
            history: Vec::new(),
            misfit_max: 0.0,
            misfit_rms: 0.0,
            min_determinant,
            min_determinant_at: std::array::from_fn(|d| origin[d] + at[d] * cell[d]),
            inverted_points,
            conformal_ground: Distribution::default(),
            conformal_near_ground: Distribution::default(),
            conformal_torso: Distribution::default(),
            normal_angle: Distribution::default(),
            scale: [f64::INFINITY, 0.0],
            warnings: Vec::new(),
        };
        report.measure_ground(map, field);
        report.measure_above(map, field);
        report.warn();
        report
    }

    /// Why `map.method = "auto"` rejects this map; none for a map that is good enough: injective, converged, with a mean conformal
    /// error of at most [`GOOD_CONFORMAL`] at the ground and a misfit of at most [`GOOD_MISFIT`].
    pub(super) fn shortfall(&self) -> Option<String> {
        let mean = self.conformal_ground.mean;
        if self.inverted_points > 0 {
            Some(format!("folded at {} points", self.inverted_points))
        } else if !self.converged {
            Some("the optimizer did not converge".into())
        } else if mean > GOOD_CONFORMAL {
            let (mean, most) = (100.0 * mean, 100.0 * GOOD_CONFORMAL);
            Some(format!("mean conformal error at the ground {mean:.1} %, more than {most:.0} %"))
        } else if self.misfit_max > GOOD_MISFIT {
            let (misfit, most) = (1e3 * self.misfit_max, 1e3 * GOOD_MISFIT);
            Some(format!("the bottom misses the terrain by up to {misfit:.1} mm, more than {most:.0} mm"))
        } else {
            None
        }
    }

    /// Rejects a map that is unusable for planning.
    ///
    /// # Errors
    /// If the map is folded. Then several points of F map to one point of A, and heights above the ground have the wrong sign.
    pub fn ensure_injective(&self) -> Result<()> {
        match self.inverted_points {
            0 => Ok(()),
            _ => Err(Error::input(format!("no motion can be planned over this map: {}", self.folded()))),
        }
    }

    /// Where the map is folded and what the user can do.
    fn folded(&self) -> String {
        let [x, y, z] = self.min_determinant_at;
        let remedy = match self.method {
            MapMethod::Dirichlet | MapMethod::Arap | MapMethod::AcapLocalGlobal => {
                "the energy of this method does not prevent folding on steep ground; use map.method = \"mips\" or \"acap-newton\", which do, or formulation = \"direct\", which needs no map"
            }
            _ => {
                "use formulation = \"direct\", which needs no map, more cells (map.cells), or smoother terrain"
            }
        };
        let count = self.inverted_points;
        format!("it folds at {count} points, worst near x̄ {x:.2}, ȳ {y:.2}, z̄ {z:.2} m; {remedy}")
    }

    /// Misfit, conformal errors, normals and scales at the ground.
    fn measure_ground(&mut self, map: &WarpMap, field: &Heightfield) {
        let [nx, ny, _] = self.cells.map(|n| GROUND_DENSITY * n);
        let (mut errors, mut angles) = (Vec::new(), Vec::new());
        let mut squares = 0.0;
        for i in 0..=nx {
            for j in 0..=ny {
                let local = Local::at(map, [i as f64 / nx as f64, j as f64 / ny as f64, 0.0]);
                let [x, y, z] = local.position;
                let misfit = z - field.height(x, y);
                self.misfit_max = self.misfit_max.max(misfit.abs());
                squares += misfit * misfit;
                let normal = field.normal(x, y);
                let up = [0, 1, 2].map(|c| local.jacobian[c][2]);
                let dot = |a: [f64; 3], b: [f64; 3]| a[0] * b[0] + a[1] * b[1] + a[2] * b[2];
                let cosine = dot(up, normal) / dot(up, up).sqrt();
                errors.push([local.conformal_error, local.area]);
                angles.push([cosine.clamp(-1.0, 1.0).acos().to_degrees(), local.area]);
                let scale = local.determinant.max(0.0).cbrt();
                self.scale = [self.scale[0].min(scale), self.scale[1].max(scale)];
            }
        }
        self.misfit_rms = (squares / errors.len() as f64).sqrt();
        self.conformal_ground = Distribution::of(errors);
        self.normal_angle = Distribution::of(angles);
    }

    /// Conformal errors above the ground.
    fn measure_above(&mut self, map: &WarpMap, field: &Heightfield) {
        let [nx, ny, nz] = self.cells.map(|n| VOLUME_DENSITY * n);
        let (mut near, mut torso) = (Vec::new(), Vec::new());
        for i in 0..=nx {
            for j in 0..=ny {
                for k in 0..=nz {
                    let fractions = [i as f64 / nx as f64, j as f64 / ny as f64, k as f64 / nz as f64];
                    let local = Local::at(map, fractions);
                    let [x, y, z] = local.position;
                    let clearance = z - field.height(x, y);
                    if clearance > *TORSO.end() {
                        break;
                    }
                    let sample = [local.conformal_error, local.determinant.abs()];
                    if clearance <= NEAR_GROUND {
                        near.push(sample);
                    }
                    if clearance >= *TORSO.start() {
                        torso.push(sample);
                    }
                }
            }
        }
        self.conformal_near_ground = Distribution::of(near);
        self.conformal_torso = Distribution::of(torso);
    }

    /// Adds the warnings that the measurements call for.
    fn warn(&mut self) {
        if self.inverted_points > 0 {
            self.warnings.push(format!("motions planned over this map would be wrong: {}", self.folded()));
        }
        if self.misfit_max > MISFIT_WARNING {
            self.warnings.push(format!(
                "the map's bottom misses the terrain by up to {:.1} mm ({:.1} mm rms); use more cells (map.cells) or smooth the terrain",
                1e3 * self.misfit_max,
                1e3 * self.misfit_rms
            ));
        }
        if self.conformal_ground.mean > CONFORMAL_WARNING {
            self.warnings.push(format!(
                "the mean conformal error at the ground is {:.0} %: the conformal friction cone would be inaccurate; keep contact.cone = \"exact\"",
                100.0 * self.conformal_ground.mean
            ));
        }
    }
}

/// The map at one point.
struct Local {
    position: [f64; 3],
    jacobian: [[f64; 3]; 3],
    determinant: f64,
    /// The area element of the surface z̄ = const.
    area: f64,
    /// 1 − σ_min/σ_max, or 1 where the map is folded.
    conformal_error: f64,
}

impl Local {
    /// The map at a point of the box, given as fractions of its size.
    fn at(map: &WarpMap, fractions: [f64; 3]) -> Local {
        let (origin, size) = (map.origin(), map.size());
        let jet = map.jet(std::array::from_fn(|d| origin[d] + fractions[d] * size[d]), Order::First);
        let j = nalgebra::Matrix3::from_fn(|r, c| jet.jacobian[r][c]);
        let determinant = j.determinant();
        let squares = (j.transpose() * j).symmetric_eigenvalues();
        let ratio = (squares.min().max(0.0) / squares.max()).sqrt();
        Local {
            position: jet.position,
            jacobian: jet.jacobian,
            determinant,
            area: j.column(0).cross(&j.column(1)).norm(),
            conformal_error: if determinant > 0.0 { 1.0 - ratio } else { 1.0 },
        }
    }
}
