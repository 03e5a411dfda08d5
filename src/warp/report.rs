//! What a map is like, measured on grids finer than the one it was made on.

use serde::{Deserialize, Serialize};

use super::assembly::Assembly;
use super::axis::{Axis, Rule};
use super::problem::coefficients_of;
use super::{Order, WarpMap};
use crate::heightfield::Heightfield;
use crate::scenario::MapMethod;
use crate::{Error, Result};

/// How the map was made and what it is like.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
pub struct MapReport {
    /// Which method made it.
    pub method: MapMethod,
    /// What was tried before it, with `map.method = "auto"`.
    pub rejected: Vec<RejectedMap>,
    /// Cells along x, y, z.
    pub cells: [usize; 3],
    /// The optimizer met its stopping rule on the finest grid (always, for methods without an optimizer).
    pub converged: bool,
    /// Iterations, all grids together.
    pub iterations: usize,
    /// Evaluations of the energy, all grids together.
    pub evaluations: usize,
    /// Wall time, s.
    pub seconds: f64,
    /// The energy minimized, at the end, m³ (0 for methods that minimize none).
    pub energy: f64,
    /// The energy by iteration, one entry for each run of the optimizer, coarse grids first.
    pub history: Vec<EnergyHistory>,
    /// Greatest distance in z of the bottom face from the terrain, m.
    pub misfit_max: f64,
    /// Root of the mean square of it, m.
    pub misfit_rms: f64,
    /// Least determinant of J, at three points a cell and axis.
    pub min_determinant: f64,
    /// The point of F where it is, m.
    pub min_determinant_at: [f64; 3],
    /// How many of these points have a determinant that is not positive: the map is folded there.
    pub inverted_points: usize,
    /// Conformal error 1 − σ_min/σ_max at the ground, weighted by area of the terrain.
    pub conformal_ground: Distribution,
    /// The same up to 0.5 m above the ground, weighted by volume.
    pub conformal_near_ground: Distribution,
    /// The same 0.4 to 0.6 m above the ground, where torsos are.
    pub conformal_torso: Distribution,
    /// Angle between J z and the terrain's normal, degrees, weighted by area (Eq. 9 takes one for the other).
    pub normal_angle: Distribution,
    /// Least and greatest local scale det^⅓ at the ground.
    pub scale: [f64; 2],
    /// What a user should know, in words.
    pub warnings: Vec<String>,
}

/// A map that was not good enough.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
pub struct RejectedMap {
    /// Which method made it.
    pub method: MapMethod,
    /// In words.
    pub why: String,
}

/// How the energy fell in one run of the optimizer.
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
    /// Of (value, weight) pairs; zero for none.
    fn of(mut samples: Vec<[f64; 2]>) -> Distribution {
        samples.sort_by(|a, b| a[0].total_cmp(&b[0]));
        let total: f64 = samples.iter().map(|s| s[1]).sum();
        let Some(last) = samples.last() else {
            return Distribution::default();
        };
        let quantile = |share: f64| {
            let mut sum = 0.0;
            let reached = |s: &&[f64; 2]| {
                sum += s[1];
                sum >= share * total
            };
            samples.iter().find(reached).unwrap_or(last)[0]
        };
        let mean = samples.iter().map(|s| s[0] * s[1]).sum::<f64>() / total.max(f64::MIN_POSITIVE);
        Distribution { mean, median: quantile(0.5), p95: quantile(0.95), max: last[0] }
    }
}

/// Points a cell, along each axis of the bottom face.
const GROUND_DENSITY: usize = 3;
/// Misfit of the bottom face that is worth a warning, m.
const MISFIT_WARNING: f64 = 2e-3;
/// Mean conformal error at the ground that is worth a warning.
const CONFORMAL_WARNING: f64 = 0.10;
/// Mean conformal error at the ground that `map.method = "auto"` accepts.
const GOOD_CONFORMAL: f64 = 0.05;
/// Misfit of the bottom face that it accepts, m.
const GOOD_MISFIT: f64 = 1e-3;

impl MapReport {
    /// Measures a map against its terrain. How it was made is for the caller to fill in.
    pub(super) fn measure(map: &WarpMap, field: &Heightfield, method: MapMethod) -> MapReport {
        let (cells, cell, origin) = (map.cells(), map.cell(), map.origin());
        let axes: [Axis; 3] = std::array::from_fn(|d| Axis { cells: cells[d], cell: cell[d] });
        let fine = Assembly::new(axes, Rule::Thirds, |_| 1.0, 1.0);
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

    /// Why `map.method = "auto"` would look further; none for a map that is good enough: injective, converged, with a mean
    /// conformal error at the ground below 5 % and a bottom within 1 mm of the terrain.
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

    /// Refuses a map that no motion can be planned over.
    ///
    /// # Errors
    /// When it is folded: one place of the ground would have several counterparts, and distances a wrong sign.
    pub fn ensure_injective(&self) -> Result<()> {
        match self.inverted_points {
            0 => Ok(()),
            _ => Err(Error::input(format!("no motion can be planned over this map: {}", self.folded()))),
        }
    }

    /// Where it is folded, and what would serve.
    fn folded(&self) -> String {
        let [x, y, z] = self.min_determinant_at;
        let serve = match self.method {
            MapMethod::Dirichlet | MapMethod::Arap | MapMethod::AcapLocalGlobal => {
                "nothing keeps the energy of this method from folding on steep ground; use map.method = \"mips\" or \"acap-newton\", whose energies forbid it, or smooth the terrain"
            }
            _ => "smooth the terrain or use more cells (map.cells)",
        };
        let count = self.inverted_points;
        format!("it folds at {count} points, worst near x̄ {x:.2}, ȳ {y:.2}, z̄ {z:.2} m; {serve}")
    }

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

    fn measure_above(&mut self, map: &WarpMap, field: &Heightfield) {
        let [nx, ny, nz] = self.cells.map(|n| 2 * n);
        let (mut near, mut torso) = (Vec::new(), Vec::new());
        for i in 0..=nx {
            for j in 0..=ny {
                for k in 0..=nz {
                    let at = [i as f64 / nx as f64, j as f64 / ny as f64, k as f64 / nz as f64];
                    let local = Local::at(map, at);
                    let [x, y, z] = local.position;
                    let clearance = z - field.height(x, y);
                    if clearance > 0.6 {
                        break;
                    }
                    let sample = [local.conformal_error, local.determinant.abs()];
                    if clearance <= 0.5 {
                        near.push(sample);
                    }
                    if clearance >= 0.4 {
                        torso.push(sample);
                    }
                }
            }
        }
        self.conformal_near_ground = Distribution::of(near);
        self.conformal_torso = Distribution::of(torso);
    }

    fn warn(&mut self) {
        if self.inverted_points > 0 {
            self.warnings.push(format!("motions over this map would be wrong: {}", self.folded()));
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
                "mean conformal error at the ground is {:.0} %: the conformal friction cone would be off; keep contact.cone = \"exact\"",
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
    /// Of the surface z̄ = const.
    area: f64,
    /// 1 − σ_min/σ_max, 1 where the map is folded.
    conformal_error: f64,
}

impl Local {
    /// At a point given in shares of the box.
    fn at(map: &WarpMap, share: [f64; 3]) -> Local {
        let (origin, size) = (map.origin(), map.size());
        let jet = map.jet(std::array::from_fn(|d| origin[d] + share[d] * size[d]), Order::First);
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
