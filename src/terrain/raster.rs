//! Measured heights on a grid: the raster that file formats are decoded to, its limits, and its interpolation.
//!
//! Heights are stored row by row, `heights[row * columns + column]`, with NaN for cells without data.

use crate::error::{Error, Result};
use crate::heightfield::MAX_SAMPLES;
use crate::scenario::terrain::Layout;

/// Rasters with a shorter side are refused: a spline needs four samples.
const MIN_SIDE: u64 = 4;
/// Larger rasters are refused before they are decoded, cells.
const MAX_CELLS: u64 = MAX_SAMPLES as u64;

/// Heights as stored in a file, and what the file says about them.
pub struct Raster {
    /// Cells along the second index, j.
    pub columns: usize,
    /// Cells along the first index, i.
    pub rows: usize,
    /// (rows, columns), NaN = no data.
    pub values: Vec<f64>,
    /// What a value means.
    pub meaning: Values,
    /// The type of a value, in messages.
    pub value_type: String,
    /// How the file rounds values.
    pub precision: Precision,
    /// Which way i and j run, unless the scenario says otherwise.
    pub layout: Layout,
    /// Distance between neighboring cells along x and y, m, if the file tells.
    pub spacing: Option<[f64; 2]>,
    /// x, y of the cell with the least x and y, m, if the file tells.
    pub corner: Option<[f64; 2]>,
    /// Values that stand for no data, according to the file.
    pub no_data: Vec<f64>,
    /// What a user should know.
    pub notes: Vec<String>,
    /// Other files that were read: name and SHA-256 (hexadecimal).
    pub inputs: Vec<(String, String)>,
}

/// What a value of a raster means.
#[derive(Clone, Copy, Debug, PartialEq)]
pub enum Values {
    /// A height in m; `terrain.height_scale` may change the unit.
    Meters,
    /// A height in a unit that only `terrain.height_scale` tells.
    Integers,
    /// A gray level from 0; `terrain.height_scale` is the height of white.
    Levels {
        /// The greatest level.
        white: f64,
    },
    /// A number in a unit and from a zero of its own; `terrain.height_scale` is the height of the greatest above the least.
    Normalized,
    /// A number that the file itself maps to a height: `(value - zero) * unit + base`, in m.
    Mapped {
        /// The value at the height `base`.
        zero: f64,
        /// Height of one unit, m.
        unit: f64,
        /// Height of `zero`, m.
        base: f64,
    },
}

/// How a file rounds the numbers that it stores.
#[derive(Clone, Copy, Debug, PartialEq)]
pub enum Precision {
    /// Floats of 2 bytes.
    Half,
    /// Floats of 4 bytes.
    Single,
    /// Everything else.
    Exact,
}

impl Precision {
    /// The number that is stored for `v`.
    fn rounded(self, v: f64) -> f64 {
        match self {
            Self::Exact => v,
            Self::Single => f64::from(v as f32),
            Self::Half if v == 0.0 || !v.is_finite() => v,
            Self::Half => {
                // 11 significant bits, fewer below 2^-14.
                let step = 2.0_f64.powi(v.abs().log2().floor().max(-14.0) as i32 - 10);
                (v / step).round_ties_even() * step
            }
        }
    }
}

impl Raster {
    /// A raster stored like a picture, of which the file says nothing else.
    pub fn new(columns: usize, rows: usize, values: Vec<f64>, meaning: Values, value_type: String) -> Self {
        let precision = match value_type.as_str() {
            "float16" => Precision::Half,
            "float32" => Precision::Single,
            _ => Precision::Exact,
        };
        Self {
            precision,
            columns,
            rows,
            values,
            meaning,
            value_type,
            layout: Layout::Picture,
            spacing: None,
            corner: None,
            no_data: Vec::new(),
            notes: Vec::new(),
            inputs: Vec::new(),
        }
    }

    /// The least value, and how far the greatest is above it: 1 if all are the same.
    pub fn least_and_span(&self) -> (f64, f64) {
        let (low, high) = range(&self.values);
        (low, if high > low { high - low } else { 1.0 })
    }

    /// Replaces values that stand for no data, those given and those that the file tells, by NaN. They are compared as stored: a
    /// file with floats of 2 or 4 bytes holds what is nearest to the number that a user writes.
    pub fn drop_no_data(&mut self, given: &[f64]) {
        let stored = |n: &f64| self.precision.rounded(*n);
        let all: Vec<f64> = given.iter().chain(&self.no_data).flat_map(|n| [*n, stored(n)]).collect();
        for value in self.values.iter_mut().filter(|v| all.contains(v)) {
            *value = f64::NAN;
        }
    }
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
    fn numbers_are_rounded_as_floats_of_two_bytes_are() {
        for (given, stored) in [
            (-9999.0, -10000.0),
            (0.1, 0.0999755859375),
            (0.0123, 0.012298583984375),
            (4e-8, 2.0_f64.powi(-24)),
            (1.0 + 1.0 / 2048.0, 1.0),
            (0.0, 0.0),
        ] {
            assert_eq!(Precision::Half.rounded(given), stored, "{given}");
        }
        assert_eq!(Precision::Single.rounded(0.1), f64::from(0.1_f32));
    }

    #[test]
    fn the_limits_are_those_of_a_heightfield() {
        assert!(check_size(4096, 4096).is_ok() && check_size(4, 4).is_ok());
        for (columns, rows) in [(4097, 4096), (4096, 4097), (3, 4), (4, 3), (u64::MAX, u64::MAX)] {
            assert!(check_size(columns, rows).is_err(), "{columns} x {rows}");
        }
    }
}
