//! Measured heights on a grid: the raster that file formats are decoded to, its limits, and its interpolation.
//!
//! Heights are stored row by row, `heights[row * columns + column]`, with NaN for cells without data.

use crate::error::{Error, Result};
use crate::heightfield::MAX_SAMPLES;

/// Rasters with a shorter side are refused: a spline needs four samples.
const MIN_SIDE: u64 = 4;
/// Larger rasters are refused before they are decoded, cells.
const MAX_CELLS: u64 = MAX_SAMPLES as u64;

/// Values as stored in a file: row 0, the first, has the largest y; NaN = no data.
pub struct Raster {
    /// Cells along x.
    pub columns: usize,
    /// Cells along y.
    pub rows: usize,
    /// (rows, columns)
    pub values: Vec<f64>,
}

/// Refuses rasters that are too small or too large, from their header alone.
///
/// # Errors
/// For fewer than 4 cells along an axis, and for more than [`MAX_SAMPLES`] in all.
pub fn check_size(columns: u64, rows: u64) -> Result<()> {
    if columns < MIN_SIDE || rows < MIN_SIDE {
        return Err(Error::input(format!(
            "{columns} x {rows} cells are too few: at least {MIN_SIDE} x {MIN_SIDE}"
        )));
    }
    if columns.checked_mul(rows).is_none_or(|cells| cells > MAX_CELLS) {
        return Err(Error::input(format!(
            "{columns} x {rows} cells are too many: at most {MAX_CELLS} in all; reduce the resolution or cut out a part"
        )));
    }
    Ok(())
}

/// Least and greatest height, ignoring NaN.
pub fn range(heights: &[f64]) -> (f64, f64) {
    heights
        .iter()
        .filter(|h| !h.is_nan())
        .fold((f64::INFINITY, f64::NEG_INFINITY), |(low, high), h| (low.min(*h), high.max(*h)))
}

/// Bilinear interpolation at a position in columns and rows, clamped to the raster.
pub fn bilinear(columns: usize, heights: &[f64], column: f64, row: f64) -> f64 {
    let rows = heights.len() / columns;
    let (column, row) = (column.clamp(0.0, (columns - 1) as f64), row.clamp(0.0, (rows - 1) as f64));
    let (c, r) = (column as usize, row as usize);
    let (c_next, r_next) = ((c + 1).min(columns - 1), (r + 1).min(rows - 1));
    let (s, t) = (column - c as f64, row - r as f64);
    let along_x = |r: usize| heights[r * columns + c] * (1.0 - s) + heights[r * columns + c_next] * s;
    along_x(r) * (1.0 - t) + along_x(r_next) * t
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn the_limits_are_those_of_a_heightfield() {
        assert!(check_size(4096, 4096).is_ok() && check_size(4, 4).is_ok());
        for (columns, rows) in [(4097, 4096), (4096, 4097), (3, 4), (4, 3), (u64::MAX, u64::MAX)] {
            assert!(check_size(columns, rows).is_err(), "{columns} x {rows}");
        }
    }
}
