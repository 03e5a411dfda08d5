//! Fills the holes of measured ground: each with a membrane stretched over its rim.

use arrayvec::ArrayVec;

use super::raster::{bilinear, range};
use crate::error::{Error, Result};

/// A hole counts as filled when a sweep moves no height by more than this fraction of the height range.
const FILL_TOLERANCE: f64 = 1e-6;
/// Limit on the sweeps …
const FILL_SWEEPS: usize = 5000;
/// … and on their cells. A huge hole is smooth enough by then, since coarser levels start it well.
const FILL_WORK: usize = 40_000_000;

/// Replaces each NaN by the solution of Laplace's equation over its hole (free at the border of the raster) and returns
/// how many there were.
///
/// # Errors
/// If nothing at all was measured.
pub fn fill_holes(columns: usize, heights: &mut [f64]) -> Result<usize> {
    let holes = heights.iter().filter(|h| h.is_nan()).count();
    if holes == heights.len() {
        return Err(Error::input("it has no heights: every cell is without data"));
    }
    if holes > 0 {
        let (low, high) = range(heights);
        fill_level(columns, heights, FILL_TOLERANCE * (high - low));
    }
    Ok(holes)
}

/// Solves on a raster of half the resolution first; the sweeps here start from that solution, interpolated.
fn fill_level(columns: usize, heights: &mut [f64], tolerance: f64) {
    let rows = heights.len() / columns;
    let holes: Vec<usize> = (0..heights.len()).filter(|&i| heights[i].is_nan()).collect();
    if holes.is_empty() {
        return;
    }
    let (half_columns, mut half) = halved(columns, rows, heights);
    // A coarse cell has data if any of its fine cells has, so holes shrink until some level has none.
    fill_level(half_columns, &mut half, tolerance);
    let omega = over_relaxation(columns, rows, heights);
    for &i in &holes {
        heights[i] = half_at(half_columns, &half, i % columns, i / columns);
    }
    let inner = |i: usize| {
        let (column, row) = (i % columns, i / columns);
        column > 0 && column + 1 < columns && row > 0 && row + 1 < rows
    };
    let holes: Vec<(usize, bool)> = holes.into_iter().map(|i| (i, inner(i))).collect();
    for _ in 0..FILL_SWEEPS.min(FILL_WORK.div_ceil(holes.len())) {
        let mut largest = 0.0_f64;
        for &(i, inner) in &holes {
            let mean = match inner {
                true => {
                    0.25 * (heights[i - 1] + heights[i + 1] + heights[i - columns] + heights[i + columns])
                }
                false => mean_around(columns, heights, i),
            };
            let change = omega * (mean - heights[i]);
            heights[i] += change;
            largest = largest.max(change.abs());
        }
        if largest <= tolerance {
            break;
        }
    }
}

/// The mean of a cell's neighbors, as far as it has them.
fn mean_around(columns: usize, heights: &[f64], i: usize) -> f64 {
    let (column, row) = (i % columns, i / columns);
    let mut neighbors = ArrayVec::<f64, 4>::new();
    let mut add = |there: bool, j: usize| {
        if there {
            neighbors.push(heights[j]);
        }
    };
    add(column > 0, i.wrapping_sub(1));
    add(column + 1 < columns, i + 1);
    add(row > 0, i.wrapping_sub(columns));
    add(i + columns < heights.len(), i + columns);
    neighbors.iter().sum::<f64>() / neighbors.len() as f64
}

/// The optimal factor of successive over-relaxation for the widest hole, 2/(1 + sin(π/width)).
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

/// Means over the measured ones of each 2×2 cells, and the number of columns of the result.
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

/// The halved raster, interpolated at a cell of the full one.
fn half_at(half_columns: usize, half: &[f64], column: usize, row: usize) -> f64 {
    let half_rows = half.len() / half_columns;
    // The center of coarse cell k is at 2k + ½ in fine cells.
    let place = |k: usize, count: usize| ((k as f64 - 0.5) / 2.0).clamp(0.0, (count - 1) as f64);
    bilinear(half_columns, half, place(column, half_columns), place(row, half_rows))
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
        holed[3] = f64::NAN; // at the border the membrane is free, so it deviates from the plane there
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
}
