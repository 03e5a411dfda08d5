//! Measured heights before they are interpolated: filling holes and smoothing.
//!
//! A raster is `heights[row * columns + column]` with NaN where nothing was measured.

use crate::error::{Error, Result};

/// Filled cells count this much in the smoothing, measured ones 1.
const FILLED_WEIGHT: f64 = 0.25;
/// The kernel is cut off at this many standard deviations.
const KERNEL_REACH: f64 = 3.0;
/// A hole counts as filled when a sweep moves no height by more than this share of the height range.
const FILL_TOLERANCE: f64 = 1e-6;
/// Sweeps after which an enormous hole is smooth enough anyway.
const FILL_SWEEPS: usize = 5000;

/// Replaces every NaN by a membrane stretched over the borders of its hole (Laplace's equation; free at the raster's
/// own border) and returns how many there were.
///
/// # Errors
/// When nothing at all was measured.
pub fn fill_holes(columns: usize, heights: &mut [f64]) -> Result<usize> {
    let holes = heights.iter().filter(|h| h.is_nan()).count();
    if holes == heights.len() {
        return Err(Error::input("there is no height in it: every cell is without data"));
    }
    if holes > 0 {
        let (low, high) = range(heights);
        fill_level(columns, heights, FILL_TOLERANCE * (high - low));
    }
    Ok(holes)
}

/// Least and greatest height, NaN left out.
pub fn range(heights: &[f64]) -> (f64, f64) {
    heights
        .iter()
        .filter(|h| !h.is_nan())
        .fold((f64::INFINITY, f64::NEG_INFINITY), |(low, high), h| (low.min(*h), high.max(*h)))
}

/// Solves on a raster of half the resolution first: its solution, interpolated, is where the sweeps start here.
fn fill_level(columns: usize, heights: &mut [f64], tolerance: f64) {
    let rows = heights.len() / columns;
    let holes: Vec<usize> = (0..heights.len()).filter(|&i| heights[i].is_nan()).collect();
    if holes.is_empty() {
        return;
    }
    let (half_columns, mut half) = halved(columns, rows, heights);
    // Every coarse cell sees at least one fine cell, so the recursion ends when a level has no holes.
    fill_level(half_columns, &mut half, tolerance);
    let omega = over_relaxation(columns, rows, heights);
    for &i in &holes {
        heights[i] = half_at(half_columns, &half, i % columns, i / columns);
    }
    for _ in 0..FILL_SWEEPS {
        let mut largest = 0.0_f64;
        for &i in &holes {
            let (column, row) = (i % columns, i / columns);
            let (mut sum, mut count) = (0.0, 0.0);
            let mut add = |there: bool, j: usize| {
                if there {
                    sum += heights[j];
                    count += 1.0;
                }
            };
            add(column > 0, i.wrapping_sub(1));
            add(column + 1 < columns, i + 1);
            add(row > 0, i.wrapping_sub(columns));
            add(row + 1 < rows, i + columns);
            let change = omega * (sum / count - heights[i]);
            heights[i] += change;
            largest = largest.max(change.abs());
        }
        if largest <= tolerance {
            break;
        }
    }
}

/// The best factor of successive over-relaxation for a hole as wide as the widest here, 2/(1 + sin(π/width)).
fn over_relaxation(columns: usize, rows: usize, heights: &[f64]) -> f64 {
    let longest = |lines: usize, length: usize, at: &dyn Fn(usize, usize) -> usize| {
        let mut longest = 0;
        for line in 0..lines {
            let mut run = 0;
            for k in 0..length {
                run = if heights[at(line, k)].is_nan() { run + 1 } else { 0 };
                longest = longest.max(run);
            }
        }
        longest
    };
    let along_x = longest(rows, columns, &|row, k| row * columns + k);
    let along_y = longest(columns, rows, &|column, k| k * columns + column);
    2.0 / (1.0 + (std::f64::consts::PI / (along_x.min(along_y) + 1) as f64).sin())
}

/// Means of 2×2 cells, as far as they were measured, and their number of columns.
fn halved(columns: usize, rows: usize, heights: &[f64]) -> (usize, Vec<f64>) {
    let (half_columns, half_rows) = (columns.div_ceil(2), rows.div_ceil(2));
    let mut half = Vec::with_capacity(half_columns * half_rows);
    for row in 0..half_rows {
        for column in 0..half_columns {
            let (mut sum, mut count) = (0.0, 0.0);
            for r in 2 * row..(2 * row + 2).min(rows) {
                for c in 2 * column..(2 * column + 2).min(columns) {
                    let h = heights[r * columns + c];
                    if !h.is_nan() {
                        sum += h;
                        count += 1.0;
                    }
                }
            }
            half.push(sum / count); // NaN when nothing was measured
        }
    }
    (half_columns, half)
}

/// The halved raster, bilinear, at a cell of the full one.
fn half_at(half_columns: usize, half: &[f64], column: usize, row: usize) -> f64 {
    let half_rows = half.len() / half_columns;
    // The centre of coarse cell k is at 2k + ½ in fine cells.
    let place = |k: usize, count: usize| ((k as f64 - 0.5) / 2.0).clamp(0.0, (count - 1) as f64);
    bilinear(half_columns, half, place(column, half_columns), place(row, half_rows))
}

/// The raster, bilinear, at a place given in columns and rows; clamped to the raster.
pub fn bilinear(columns: usize, heights: &[f64], column: f64, row: f64) -> f64 {
    let rows = heights.len() / columns;
    let (column, row) = (column.clamp(0.0, (columns - 1) as f64), row.clamp(0.0, (rows - 1) as f64));
    let (c, r) = (column as usize, row as usize);
    let (c_next, r_next) = ((c + 1).min(columns - 1), (r + 1).min(rows - 1));
    let (s, t) = (column - c as f64, row - r as f64);
    let along_x = |r: usize| heights[r * columns + c] * (1.0 - s) + heights[r * columns + c_next] * s;
    along_x(r) * (1.0 - t) + along_x(r_next) * t
}

/// Smooths by a local plane under a Gaussian of standard deviation `width` (in cells): at each cell, the value there
/// of the plane that fits the heights around best, weighted by the Gaussian and, where `filled`, by ¼. Unlike a plain
/// Gaussian average it leaves slopes alone up to the raster's border. A width below ¼ cell changes nothing.
///
/// `heights` must be free of NaN; `filled` has the same shape.
pub fn smooth(columns: usize, heights: &[f64], filled: &[bool], width: f64) -> Vec<f64> {
    /// Rows smoothed at a time, to keep the moments of few rows in memory.
    const BAND: usize = 64;
    let rows = heights.len() / columns;
    if width < 0.25 {
        return heights.to_vec();
    }
    let reach = (KERNEL_REACH * width).ceil() as usize;
    let kernel: Vec<f64> =
        (0..=2 * reach).map(|k| (-0.5 * ((k as f64 - reach as f64) / width).powi(2)).exp()).collect();
    let mut result = Vec::with_capacity(heights.len());
    for band in (0..rows).step_by(BAND) {
        let first = band.saturating_sub(reach);
        let last = (band + BAND + reach).min(rows);
        let moments: Vec<[f64; 5]> = (first * columns..last * columns)
            .map(|i| row_moments(columns, heights, filled, &kernel, i))
            .collect();
        for row in band..(band + BAND).min(rows) {
            for column in 0..columns {
                let mut s = [0.0; 9];
                for r in row.saturating_sub(reach)..(row + reach + 1).min(rows) {
                    let dy = r as f64 - row as f64;
                    let k = kernel[r + reach - row];
                    let [m, mx, mxx, z, zx] = moments[(r - first) * columns + column];
                    let terms = [m, mx, m * dy, mxx, mx * dy, m * dy * dy, z, zx, z * dy];
                    for (sum, term) in s.iter_mut().zip(terms) {
                        *sum += k * term;
                    }
                }
                result.push(plane_value(s));
            }
        }
    }
    result
}

/// Σ w, Σ w dx, Σ w dx², Σ w z, Σ w z dx along the row through cell i, with dx in cells from it.
fn row_moments(columns: usize, heights: &[f64], filled: &[bool], kernel: &[f64], i: usize) -> [f64; 5] {
    let reach = kernel.len() / 2;
    let column = i % columns;
    let start = i - column;
    let mut sums = [0.0; 5];
    for c in column.saturating_sub(reach)..(column + reach + 1).min(columns) {
        let dx = c as f64 - column as f64;
        let w = kernel[c + reach - column] * if filled[start + c] { FILLED_WEIGHT } else { 1.0 };
        let z = heights[start + c];
        for (sum, term) in sums.iter_mut().zip([1.0, dx, dx * dx, z, z * dx]) {
            *sum += w * term;
        }
    }
    sums
}

/// a of the weighted least-squares plane a + b dx + c dy, from Σw·(1, x, y, x², xy, y², z, zx, zy): eliminating b and c
/// from the normal equations leaves a = (Σz − p Σzx − q Σzy)/(Σ1 − p Σx − q Σy) with [Σx² Σxy; Σxy Σy²](p, q) = (Σx, Σy).
fn plane_value([s, sx, sy, sxx, sxy, syy, z, zx, zy]: [f64; 9]) -> f64 {
    let det = sxx * syy - sxy * sxy;
    let p = (syy * sx - sxy * sy) / det;
    let q = (sxx * sy - sxy * sx) / det;
    (z - p * zx - q * zy) / (s - p * sx - q * sy)
}

#[cfg(test)]
mod tests {
    use super::*;

    fn raster(columns: usize, rows: usize, f: impl Fn(f64, f64) -> f64) -> Vec<f64> {
        (0..columns * rows).map(|i| f((i % columns) as f64, (i / columns) as f64)).collect()
    }

    #[test]
    fn holes_in_a_plane_are_filled_with_the_plane() {
        let plane = raster(60, 45, |x, y| 0.02 * x - 0.05 * y + 1.0);
        let mut holed = plane.clone();
        let mut count = 0;
        for row in 5..40 {
            for column in 10..50 {
                // A big hole with an island, and a scattering of single cells.
                if !(20..25).contains(&row) || !(30..33).contains(&column) {
                    holed[row * 60 + column] = f64::NAN;
                    count += 1;
                }
            }
        }
        holed[3] = f64::NAN; // at the border the membrane is free: no plane there, but finite
        assert_eq!(fill_holes(60, &mut holed).unwrap(), count + 1);
        for (i, (a, b)) in holed.iter().zip(&plane).enumerate().filter(|(i, _)| *i != 3) {
            assert!((a - b).abs() < 1e-5, "{i}: {a} against {b}");
        }
        assert!((holed[3] - plane[3]).abs() < 0.03);
    }

    #[test]
    fn filled_holes_are_harmonic_and_stay_between_their_borders() {
        let mut heights = raster(40, 40, |x, y| (0.3 * x).sin() + (0.2 * y).cos());
        let holes: Vec<usize> =
            (0..1600).filter(|i| (i % 40 > 8 && i % 40 < 30) && (i / 40 > 12 && i / 40 < 33)).collect();
        holes.iter().for_each(|&i| heights[i] = f64::NAN);
        let (low, high) = range(&heights);
        fill_holes(40, &mut heights).unwrap();
        for i in holes {
            let mean = (heights[i - 1] + heights[i + 1] + heights[i - 40] + heights[i + 40]) / 4.0;
            assert!((heights[i] - mean).abs() < 1e-5);
            assert!(heights[i] > low && heights[i] < high);
        }
    }

    #[test]
    fn a_raster_without_data_is_refused() {
        assert!(fill_holes(4, &mut [f64::NAN; 16]).is_err());
        let mut one = [f64::NAN; 16];
        one[5] = 0.7;
        assert_eq!(fill_holes(4, &mut one).unwrap(), 15);
        assert!(one.iter().all(|h| (h - 0.7).abs() < 1e-12));
    }

    #[test]
    fn smoothing_leaves_planes_alone_up_to_the_border_and_beside_holes() {
        let plane = raster(150, 70, |x, y| 0.03 * x + 0.01 * y);
        let filled: Vec<bool> = (0..plane.len()).map(|i| i % 7 == 0 || i % 150 > 100).collect();
        for width in [0.3, 1.5, 6.0] {
            for (a, b) in smooth(150, &plane, &filled, width).iter().zip(&plane) {
                assert!((a - b).abs() < 1e-10);
            }
        }
    }

    #[test]
    fn smoothing_is_a_gaussian_average_inside() {
        let mut spike = vec![0.0; 41 * 41];
        spike[20 * 41 + 20] = 1.0;
        let smoothed = smooth(41, &spike, &[false; 41 * 41], 2.0);
        let sum: f64 = (-6..=6).map(|k| (-0.125 * (k * k) as f64).exp()).sum();
        for (column, row) in [(20, 20), (22, 20), (17, 24)] {
            let (dx, dy) = (column as f64 - 20.0, row as f64 - 20.0);
            let expected = (-0.125 * (dx * dx + dy * dy)).exp() / (sum * sum);
            assert!((smoothed[row * 41 + column] - expected).abs() < 1e-14);
        }
    }

    #[test]
    fn too_little_smoothing_changes_nothing() {
        let heights = raster(8, 8, |x, y| x * y % 3.0);
        assert_eq!(smooth(8, &heights, &[false; 64], 0.2), heights);
    }
}
