//! Ground from a scan: a raster of heights with holes and noise becomes a smooth heightfield.

use super::fill::fill_holes;
use super::ground::{FitError, Ground, GroundReport};
use super::raster::{bilinear, range};
use super::smooth::smooth;
use crate::error::{Error, Result};
use crate::heightfield::{Grid, Heightfield, MAX_SAMPLES};
use crate::scenario::Footholds;
use crate::scenario::terrain::HeightmapSpec;

/// Coarser scans are refined to about this spacing, m, so that users of the raster get a fine one.
const FINE_SPACING: f64 = 0.02;
/// Larger differences of height are taken for a wrong `height_scale`, m.
const LARGEST_RELIEF: f64 = 1000.0;
/// `terrain.extent` may exceed the file by this, m, because users round.
const EXTENT_SLACK: f64 = 1e-4;

/// A place this close to a cell, in cells, is on it.
const ON_CELL: f64 = 1e-6;

/// Heights at the nodes of a grid, row 0 at the least y; NaN for no data.
pub struct Scan {
    /// Where the nodes are; the same spacing along x and y.
    pub grid: Grid,
    /// (rows, columns), m.
    pub heights: Vec<f64>,
}

/// Fills, smooths, interpolates, crops and refines, and reports what it did, for a robot of a size.
///
/// # Errors
/// [`Error::Key`] if nothing was measured, the heights differ too much or are too large, or the extent exceeds the scan.
pub fn ground(
    kind: &'static str,
    spec: &HeightmapSpec,
    footholds: Footholds,
    size: f64,
    scan: &Scan,
) -> Result<Ground> {
    let refuse =
        |what: &dyn std::fmt::Display| Error::key("terrain.file", format!("{:?}: {what}", spec.file));
    let Scan { grid, heights: measured } = scan;
    let grid = *grid;
    let spacing = grid.spacing[0];
    let extent = cropped(spec.extent, grid.extent())?;
    let smoothing = spec.smoothing(footholds, spacing, size);

    let mut filled = measured.clone();
    fill_holes(grid.columns, &mut filled).map_err(|e| refuse(&e))?;
    let (low, high) = range(&filled);
    if high - low > LARGEST_RELIEF {
        return Err(refuse(&format!(
            "heights from {low:.3e} to {high:.3e} m; more than {LARGEST_RELIEF} m apart must be a mistake: \
             see terrain.height_scale"
        )));
    }
    let holes: Vec<bool> = measured.iter().map(|h| h.is_nan()).collect();
    let smoothed = smooth(grid.columns, &filled, &holes, smoothing / spacing);
    let whole = Heightfield::interpolate(grid.origin, grid.spacing, grid.columns, grid.rows, &smoothed)
        .map_err(|e| refuse(&e))?;

    let flat_between = |heights: &[f64], x: f64, y: f64| {
        bilinear(grid.columns, heights, (x - grid.origin[0]) / spacing, (y - grid.origin[1]) / spacing)
    };
    let fine = refined_spacing(extent, spacing);
    let field = if extent == grid.extent() && fine == spacing {
        whole
    } else {
        Heightfield::from_function(extent, fine, |x, y| {
            Ok(match footholds {
                // A spline would ring at edges.
                Footholds::Patches => flat_between(&smoothed, x, y),
                Footholds::Anywhere => whole.height(x, y),
            })
        })
        .map_err(|e| Error::key("terrain.extent", e))?
    };
    let raw = field.grid().sample(|x, y| Ok(flat_between(&filled, x, y)))?;
    let unknown: Vec<bool> = (0..field.grid().len())
        .map(|i| {
            let (x, y) = (field.grid().x(i % field.grid().columns), field.grid().y(i / field.grid().columns));
            is_between(&grid, &holes, x, y)
        })
        .collect();

    let mut error = FitError::default();
    let (mut cells, mut holes_filled) = (0, 0);
    for (i, h) in measured.iter().enumerate() {
        let (x, y) = (grid.x(i % grid.columns), grid.y(i / grid.columns));
        if (extent[0]..=extent[1]).contains(&x) && (extent[2]..=extent[3]).contains(&y) {
            cells += 1;
            match h.is_nan() {
                true => holes_filled += 1,
                false => error.add(x, y, field.height(x, y) - h),
            }
        }
    }
    let mut report = GroundReport::of(kind, &field, &error);
    report.holes_filled = holes_filled;
    report.smoothing = smoothing;
    report.notes = notes(spec, footholds, size, &grid, cells, &report);
    let unknown = unknown.contains(&true).then_some(unknown);
    Ok(Ground { field, raw: Some(raw), unknown, report, inputs: Vec::new() })
}

/// What a user should know about a scan, of whose grid `cells` lie within the extent.
fn notes(
    spec: &HeightmapSpec,
    footholds: Footholds,
    size: f64,
    grid: &Grid,
    cells: usize,
    report: &GroundReport,
) -> Vec<String> {
    let mut notes = Vec::new();
    if spec.smoothing.is_none() && footholds == Footholds::Anywhere {
        let [least, most] = HeightmapSpec::smoothing_range(size);
        notes.push(format!(
            "smoothed over {:.3} m by default ({} cells, from {least:.3} to {most:.3} m; terrain.smoothing sets it); \
             heights moved by {:.4} m rms, {:.4} m at most",
            report.smoothing,
            HeightmapSpec::SMOOTHING_CELLS,
            report.fit_error_rms,
            report.fit_error_max
        ));
    }
    let holes = report.holes_filled;
    if holes > 0 {
        notes.push(format!(
            "{holes} of {cells} cells have no data and were filled from their surroundings ({:.1} %)",
            100.0 * holes as f64 / cells as f64
        ));
    }
    if report.grid != [grid.columns, grid.rows] {
        let cropped = if spec.extent.is_some() { "cropped and " } else { "" };
        notes.push(format!(
            "{} x {} cells of {:.4} m were {cropped}interpolated to {} x {} of {:.4} m",
            grid.columns, grid.rows, grid.spacing[0], report.grid[0], report.grid[1], report.spacing[0]
        ));
    }
    notes
}

/// Whether the height at a place is interpolated from a cell that is a hole.
fn is_between(grid: &Grid, holes: &[bool], x: f64, y: f64) -> bool {
    let cells = |at: f64, count: usize| {
        let at = at.clamp(0.0, (count - 1) as f64);
        (at + ON_CELL) as usize..=((at - ON_CELL).ceil() as usize).min(count - 1)
    };
    let columns = cells((x - grid.origin[0]) / grid.spacing[0], grid.columns);
    let mut rows = cells((y - grid.origin[1]) / grid.spacing[1], grid.rows);
    rows.any(|row| columns.clone().any(|column| holes[row * grid.columns + column]))
}

/// The rectangle to use, which must lie within that of the scan; by default it is the whole scan.
fn cropped(wanted: Option<[f64; 4]>, whole: [f64; 4]) -> Result<[f64; 4]> {
    let Some(wanted) = wanted else {
        return Ok(whole);
    };
    let inside = (0..4).all(|k| {
        let outwards = if k % 2 == 0 { whole[k] - wanted[k] } else { wanted[k] - whole[k] };
        outwards <= EXTENT_SLACK
    });
    if !inside {
        let [x_min, x_max, y_min, y_max] = whole;
        let what = format!(
            "given {wanted:?}, which reaches beyond the file; allowed: within [{x_min:.3}, {x_max:.3}, {y_min:.3}, \
             {y_max:.3}] (x_min, x_max, y_min, y_max in m; see terrain.spacing and terrain.origin)"
        );
        return Err(Error::key("terrain.extent", what));
    }
    Ok(std::array::from_fn(|k| if k % 2 == 0 { wanted[k].max(whole[k]) } else { wanted[k].min(whole[k]) }))
}

/// The spacing itself if it is fine enough, otherwise the largest whole fraction of it up to [`FINE_SPACING`].
fn refined_spacing([x_min, x_max, y_min, y_max]: [f64; 4], spacing: f64) -> f64 {
    if spacing <= 1.25 * FINE_SPACING {
        return spacing;
    }
    let fine = spacing / (spacing / FINE_SPACING - 1e-9).ceil();
    let nodes = ((x_max - x_min) / fine + 2.0) * ((y_max - y_min) / fine + 2.0);
    if nodes > MAX_SAMPLES as f64 { spacing } else { fine }
}
