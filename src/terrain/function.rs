//! Ground from a function h(x, y) that can be evaluated anywhere.

use super::ground::{FitError, Ground, GroundReport};
use crate::error::{Error, Result};
use crate::heightfield::{Grid, Heightfield};
use crate::scenario::terrain::Domain;

/// A larger error of the spline is worth a note, m.
const NOTABLE_ERROR: f64 = 0.002;

/// Samples h over its domain, and compares the spline with h between the samples.
///
/// # Errors
/// [`Error::Key`] for a domain with too many nodes and for heights that a spline cannot have; and those of h.
pub fn ground(kind: &'static str, domain: &Domain, h: impl Fn(f64, f64) -> Result<f64>) -> Result<Ground> {
    let field = field(domain, &h)?;
    let grid = field.grid();
    let [xs, ys] = grid.lines_between();
    let (mut error, mut failed) = (FitError::default(), None);
    field.for_each_crossing(&xs, &ys, |[x, y], height, _| match h(x, y) {
        Ok(expected) => error.add(x, y, height - expected),
        Err(e) => failed = failed.take().or(Some(e)),
    });
    if let Some(failed) = failed {
        return Err(failed);
    }
    let mut report = GroundReport::of(kind, &field, &error);
    if error.max > NOTABLE_ERROR {
        report.notes.push(format!(
            "the spline misses h(x, y) by up to {:.4} m, near x = {:.3}, y = {:.3}: h has an edge there, or \
             terrain.spacing is too coarse",
            error.max, error.at[0], error.at[1]
        ));
    }
    Ok(Ground { field, raw: None, unknown: None, report, inputs: Vec::new() })
}

/// Samples h over its domain.
///
/// # Errors
/// Those of [`ground`].
pub fn field(domain: &Domain, h: impl Fn(f64, f64) -> Result<f64>) -> Result<Heightfield> {
    let grid = Grid::fitted(domain.extent, domain.spacing).map_err(|e| Error::key("terrain.spacing", e))?;
    let samples = grid.sample(&h)?;
    Heightfield::interpolate(grid.origin, grid.spacing, grid.columns, grid.rows, &samples)
        .map_err(|e| Error::key("terrain", e))
}
