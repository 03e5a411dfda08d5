//! The ground as everything downstream uses it, and how well it represents its source.

use serde::Serialize;

use super::raster::range;
use crate::heightfield::Heightfield;

/// The ground, as everything downstream uses it.
#[derive(Clone, Debug)]
pub struct Ground {
    /// z = h(x, y).
    pub field: Heightfield,
    /// (rows, columns) of the same grid before smoothing, holes filled, m; for heightmaps.
    pub raw: Option<Vec<f64>>,
    /// (rows, columns) of the same grid: where nothing was measured; none if there is no such place.
    pub unknown: Option<Vec<bool>>,
    /// What it is and how well it represents its source.
    pub report: GroundReport,
    /// Name as given in the scenario and SHA-256 (hexadecimal) of each file read.
    pub inputs: Vec<(String, String)>,
}

/// What a ground is and how well it represents its source.
#[derive(Clone, Debug, PartialEq, Serialize)]
pub struct GroundReport {
    /// `terrain.kind`.
    pub kind: &'static str,
    /// Columns, rows.
    pub grid: [usize; 2],
    /// Distance between neighboring nodes along x, y, m.
    pub spacing: [f64; 2],
    /// x_min, x_max, y_min, y_max, m.
    pub extent: [f64; 4],
    /// Least and greatest height, m.
    pub height_range: [f64; 2],
    /// Greatest |∇h| over the nodes and the centers of the cells.
    pub largest_slope: f64,
    /// x, y of the greatest slope, m.
    pub steepest_at: [f64; 2],
    /// Root mean square of the spline's difference from its source, m. For functions it is taken between the nodes; for
    /// heightmaps at the measured cells, where it is what smoothing removed.
    pub fit_error_rms: f64,
    /// The largest such difference, m.
    pub fit_error_max: f64,
    /// Cells without data that were filled.
    pub holes_filled: usize,
    /// Standard deviation of the smoothing, m; 0 for none.
    pub smoothing: f64,
    /// What else a user should know, in sentences.
    pub notes: Vec<String>,
}

/// Differences between the spline and its source.
#[derive(Default)]
pub(super) struct FitError {
    squares: f64,
    count: usize,
    /// The largest, m.
    pub max: f64,
    /// x, y of the largest, m.
    pub at: [f64; 2],
}

impl FitError {
    pub fn add(&mut self, x: f64, y: f64, difference: f64) {
        self.squares += difference * difference;
        self.count += 1;
        if difference.abs() > self.max {
            self.max = difference.abs();
            self.at = [x, y];
        }
    }
}

impl GroundReport {
    /// The report on a field without holes, smoothing or notes.
    pub(super) fn of(kind: &'static str, field: &Heightfield, error: &FitError) -> Self {
        let grid = field.grid();
        let (low, high) = range(field.samples());
        let (mut largest_square, mut steepest_at) = (0.0, [grid.x(0), grid.y(0)]);
        for [xs, ys] in [grid.lines(), grid.lines_between()] {
            field.for_each_crossing(&xs, &ys, |place, _, [hx, hy]| {
                let square = hx * hx + hy * hy;
                if square > largest_square {
                    (largest_square, steepest_at) = (square, place);
                }
            });
        }
        Self {
            kind,
            grid: [grid.columns, grid.rows],
            spacing: grid.spacing,
            extent: field.extent(),
            height_range: [low, high],
            largest_slope: largest_square.sqrt(),
            steepest_at,
            fit_error_rms: (error.squares / error.count.max(1) as f64).sqrt(),
            fit_error_max: error.max,
            holes_filled: 0,
            smoothing: 0.0,
            notes: Vec::new(),
        }
    }
}
