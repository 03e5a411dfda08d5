//! From the cells of a file to places in the world.

use super::raster::{Raster, bilinear};
use super::scan::Scan;
use crate::error::{Error, Result};
use crate::heightfield::Grid;
use crate::scenario::terrain::{HeightmapSpec, Layout};

/// Spacings that a file may tell, as `terrain.spacing` may, m.
const SPACINGS: std::ops::RangeInclusive<f64> = 0.001..=10.0;
/// Relative difference from which two spacings are not the same.
const SAME_SPACING: f64 = 1e-6;
/// Files with coordinates beyond this, such as those of a country's grid, are moved to the origin, m.
const FARTHEST: f64 = 1e5;

/// The places of the cells of a raster, where the scenario, or else the file, says; and what a user should know about them.
///
/// # Errors
/// [`Error::Key`] if neither says how far apart the cells are.
pub fn grid(
    raster: &Raster,
    spec: &HeightmapSpec,
    layout: Layout,
    format: &str,
) -> Result<(Grid, Vec<String>)> {
    let mut notes = Vec::new();
    let given = spec.spacing.map(|s| [s; 2]);
    let Some(spacing) = given.or(raster.spacing) else {
        let what = format!(
            "missing; {format} does not tell it: the distance between neighboring cells, a number from {} to {} m",
            SPACINGS.start(),
            SPACINGS.end()
        );
        return Err(Error::key("terrain.spacing", what));
    };
    if let Some(bad) = spacing.iter().find(|s| !SPACINGS.contains(s)) {
        let what = format!(
            "missing; the file tells {bad} m, but allowed are {} to {} m; give it if the file's unit is not the meter",
            SPACINGS.start(),
            SPACINGS.end()
        );
        return Err(Error::key("terrain.spacing", what));
    }
    if let (Some(given), Some(told)) = (spec.spacing, raster.spacing)
        && told.iter().any(|told| (given - told).abs() > SAME_SPACING * told)
    {
        let [x, y] = told;
        let told = if x == y { format!("{x} m") } else { format!("{x} m along x and {y} m along y") };
        notes.push(format!("terrain.spacing = {given} is used, although the file tells {told}"));
    }
    let [columns, rows] =
        if layout.first_is_x() { [raster.rows, raster.columns] } else { [raster.columns, raster.rows] };
    let half = |count: usize, spacing: f64| 0.5 * spacing * (count - 1) as f64;
    // The center stays where the file has it, also with another spacing.
    let told = raster.spacing.unwrap_or(spacing);
    let own = raster.corner.map(|[x, y]| [x + half(columns, told[0]), y + half(rows, told[1])]);
    let near = own.filter(|center| center.iter().all(|c| c.abs() <= FARTHEST));
    if let (Some([x, y]), None, None) = (own, near, spec.origin) {
        notes.push(format!(
            "the file has its center at x = {x:.2}, y = {y:.2} m; so far away, it is put at 0, 0 instead (terrain.origin \
             sets it)"
        ));
    }
    let center = spec.origin.or(near).unwrap_or([0.0; 2]);
    let grid = Grid {
        origin: [center[0] - half(columns, spacing[0]), center[1] - half(rows, spacing[1])],
        spacing,
        columns,
        rows,
    };
    Ok((grid, notes))
}

/// Heights at the nodes of their grid, made square where it is not; and a note if so.
///
/// # Errors
/// If square cells are too many.
pub fn scan(raster: &Raster, layout: Layout, grid: &Grid) -> Result<(Scan, Option<String>)> {
    let heights = arranged(&raster.values, raster.columns, layout);
    let [x, y] = grid.spacing;
    if (x - y).abs() <= SAME_SPACING * x {
        return Ok((Scan { grid: Grid { spacing: [x; 2], ..*grid }, heights }, None));
    }
    let scan = with_square_cells(grid, &heights)?;
    let note = format!("cells of {x} x {y} m were interpolated to square ones of {} m", scan.grid.spacing[0]);
    Ok((scan, Some(note)))
}

/// The values of an array a[i, j] of `columns` columns, row by row from the least y, each from the least x.
fn arranged(values: &[f64], columns: usize, layout: Layout) -> Vec<f64> {
    let rows = values.len() / columns;
    match layout {
        Layout::YUp => values.to_vec(),
        Layout::Picture => values.chunks_exact(columns).rev().flatten().copied().collect(),
        Layout::XY => (0..values.len()).map(|k| values[(k % rows) * columns + k / rows]).collect(),
        Layout::GridMap => {
            let last = values.len() - 1;
            (0..values.len()).map(|k| values[last - ((k % rows) * columns + k / rows)]).collect()
        }
    }
}

/// Bilinear interpolation on square cells of the smaller spacing, from the corner with the least x and y; what borders on no data has
/// none.
fn with_square_cells(grid: &Grid, heights: &[f64]) -> Result<Scan> {
    let spacing = grid.spacing[0].min(grid.spacing[1]);
    let [x_min, x_max, y_min, y_max] = grid.extent();
    // A remainder of less than a cell is left out.
    let count = |length: f64| (length / spacing + SAME_SPACING).floor() as usize + 1;
    let (columns, rows) = (count(x_max - x_min), count(y_max - y_min));
    super::raster::check_size(columns as u64, rows as u64)?;
    let square = Grid { origin: grid.origin, spacing: [spacing; 2], columns, rows };
    let at = |k: usize| {
        let [x, y] = [(k % columns) as f64 * spacing, (k / columns) as f64 * spacing];
        bilinear(grid.columns, heights, x / grid.spacing[0], y / grid.spacing[1])
    };
    Ok(Scan { heights: (0..columns * rows).map(at).collect(), grid: square })
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn every_layout_puts_its_first_value_where_it_says() {
        // a[i, j] of 2 x 3.
        let a = [0.0, 1.0, 2.0, 3.0, 4.0, 5.0];
        for (layout, expected) in [
            (Layout::Picture, [3.0, 4.0, 5.0, 0.0, 1.0, 2.0]),
            (Layout::YUp, [0.0, 1.0, 2.0, 3.0, 4.0, 5.0]),
            (Layout::XY, [0.0, 3.0, 1.0, 4.0, 2.0, 5.0]),
            (Layout::GridMap, [5.0, 2.0, 4.0, 1.0, 3.0, 0.0]),
        ] {
            assert_eq!(arranged(&a, 3, layout), expected, "{layout:?}");
        }
    }

    #[test]
    fn oblong_cells_become_square_ones_of_the_same_plane() {
        let grid = Grid { origin: [1.0, 2.0], spacing: [0.1, 0.25], columns: 11, rows: 5 };
        let plane = |x: f64, y: f64| 0.3 * x - 0.2 * y;
        let heights: Vec<f64> = (0..55).map(|k| plane(grid.x(k % 11), grid.y(k / 11))).collect();
        let scan = with_square_cells(&grid, &heights).unwrap();
        assert_eq!([scan.grid.columns, scan.grid.rows], [11, 11]);
        for (k, h) in scan.heights.iter().enumerate() {
            assert!((h - plane(scan.grid.x(k % 11), scan.grid.y(k / 11))).abs() < 1e-12);
        }
    }
}
