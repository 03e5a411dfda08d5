//! Measured ground: a raster of heights with holes and noise becomes a smooth heightfield.

use super::{FitError, Ground, GroundReport};
use crate::error::{Error, Result};
use crate::heightfield::raster::{bilinear, fill_holes, range, smooth};
use crate::heightfield::{Grid, Heightfield, MAX_SAMPLES};
use crate::scenario::TerrainSpec;

/// Default smoothing: this many cells, because a scan's finest detail is noise …
const SMOOTHING_CELLS: f64 = 1.5;
/// … and at least this length, m: a foot does not feel less.
const SMOOTHING_LENGTH: f64 = 0.03;
/// Smoothing over more cells than this is refused (it would also take minutes).
const SMOOTHING_LIMIT: f64 = 50.0;
/// Coarser scans are refined to about this spacing, m, so that those who want a raster get a fine one.
const FINE_SPACING: f64 = 0.02;
/// Heights further apart than this are taken for a wrong `height_scale`, m.
const LARGEST_RELIEF: f64 = 1000.0;

/// Heights at the nodes of a grid, row 0 at the least y; NaN where there is no data.
pub struct Scan {
    /// Where the nodes are; the same spacing along x and y.
    pub grid: Grid,
    /// (rows, columns), m.
    pub heights: Vec<f64>,
}

/// Fills, smooths, interpolates, crops and refines, and reports what it did. `name` is the file, for messages.
pub fn ground(spec: &TerrainSpec, name: &str, scan: Scan) -> Result<Ground> {
    let Scan { grid, heights: measured } = scan;
    let spacing = grid.spacing[0];
    let extent = cropped(spec.extent, grid.extent())?;
    let smoothing = smoothing_length(spec, &grid)?;

    let mut filled = measured.clone();
    let holes_filled =
        fill_holes(grid.columns, &mut filled).map_err(|e| Error::input(format!("{name}: {e}")))?;
    let (low, high) = range(&filled);
    if high - low > LARGEST_RELIEF {
        return Err(Error::input(format!(
            "{name}: heights from {low:.3e} to {high:.3e} m; more than {LARGEST_RELIEF} m apart must be a mistake: \
             see terrain.height_scale"
        )));
    }
    let holes: Vec<bool> = measured.iter().map(|h| h.is_nan()).collect();
    let smoothed = smooth(grid.columns, &filled, &holes, smoothing / spacing);
    let whole = Heightfield::interpolate(grid.origin, grid.spacing, grid.columns, grid.rows, &smoothed)?;

    let fine = refined_spacing(extent, spacing);
    let field = if extent == grid.extent() && fine == spacing {
        whole
    } else {
        Heightfield::from_function(extent, fine, |x, y| Ok(whole.height(x, y)))?
    };
    let place = |x: f64, y: f64| ((x - grid.origin[0]) / spacing, (y - grid.origin[1]) / spacing);
    let raw = field.grid().sample(|x, y| {
        let (column, row) = place(x, y);
        Ok(bilinear(grid.columns, &filled, column, row))
    })?;

    let mut error = FitError::default();
    for (i, h) in measured.iter().enumerate().filter(|(_, h)| !h.is_nan()) {
        let (x, y) = (grid.x(i % grid.columns), grid.y(i / grid.columns));
        if (extent[0]..=extent[1]).contains(&x) && (extent[2]..=extent[3]).contains(&y) {
            error.add(x, y, field.height(x, y) - h);
        }
    }
    let mut report = GroundReport::of(spec.kind, &field, &error);
    report.holes_filled = holes_filled;
    report.smoothing = smoothing;
    report.notes = notes(spec, &grid, holes_filled, smoothing, &report);
    Ok(Ground { field, raw: Some(raw), report, inputs: Vec::new() })
}

fn notes(
    spec: &TerrainSpec,
    grid: &Grid,
    holes: usize,
    smoothing: f64,
    report: &GroundReport,
) -> Vec<String> {
    let mut notes = Vec::new();
    if spec.smoothing.is_none() {
        notes.push(format!(
            "smoothed over {smoothing:.3} m by default (the larger of {SMOOTHING_CELLS} cells and {SMOOTHING_LENGTH} m; \
             terrain.smoothing sets it); heights moved by {:.4} m rms, {:.4} m at most",
            report.fit_error_rms, report.fit_error_max
        ));
    }
    if holes > 0 {
        notes.push(format!(
            "{holes} of {} cells have no data and were filled from their surroundings ({:.1} %)",
            grid.len(),
            100.0 * holes as f64 / grid.len() as f64
        ));
    }
    if report.grid != [grid.columns, grid.rows] {
        notes.push(format!(
            "{} x {} cells of {:.4} m became {} x {} of {:.4} m by the spline",
            grid.columns, grid.rows, grid.spacing[0], report.grid[0], report.grid[1], report.spacing[0]
        ));
    }
    notes
}

/// The rectangle asked for, which must lie within that of the scan.
fn cropped(wanted: Option<[f64; 4]>, whole: [f64; 4]) -> Result<[f64; 4]> {
    let Some(wanted) = wanted else {
        return Ok(whole);
    };
    // A tenth of a millimetre is a rounding of the user's, not a wish.
    let slack = 1e-4;
    let inside = (0..4).all(|k| {
        let outwards = if k % 2 == 0 { whole[k] - wanted[k] } else { wanted[k] - whole[k] };
        outwards <= slack
    });
    if !inside {
        return Err(Error::input(format!(
            "terrain.extent {wanted:?} reaches beyond the file, which covers [{:.3}, {:.3}, {:.3}, {:.3}] (x_min, x_max, \
             y_min, y_max in metres; see terrain.spacing and terrain.origin)",
            whole[0], whole[1], whole[2], whole[3]
        )));
    }
    Ok(std::array::from_fn(|k| if k % 2 == 0 { wanted[k].max(whole[k]) } else { wanted[k].min(whole[k]) }))
}

/// The standard deviation of the smoothing, m: as given, or by default.
fn smoothing_length(spec: &TerrainSpec, grid: &Grid) -> Result<f64> {
    let spacing = grid.spacing[0];
    let Some(length) = spec.smoothing else {
        return Ok((SMOOTHING_CELLS * spacing).max(SMOOTHING_LENGTH).min(SMOOTHING_LIMIT * spacing));
    };
    super::in_range("smoothing", length, [0.0, SMOOTHING_LIMIT * spacing])
}

/// The spacing itself when it is fine enough, else the one that divides it and is closest below [`FINE_SPACING`].
fn refined_spacing([x_min, x_max, y_min, y_max]: [f64; 4], spacing: f64) -> f64 {
    if spacing <= 1.25 * FINE_SPACING {
        return spacing;
    }
    let fine = spacing / (spacing / FINE_SPACING - 1e-9).ceil();
    let nodes = ((x_max - x_min) / fine + 2.0) * ((y_max - y_min) / fine + 2.0);
    if nodes > MAX_SAMPLES as f64 { spacing } else { fine }
}
