//! A raster as a ball feels it: which heights the ball can have, and averages over discs.

use crate::heightfield::Grid;

/// The Gaussian is cut off at this many standard deviations.
const KERNEL_REACH: f64 = 3.0;

/// Columns, rows and squared distance, m², from one cell to another.
pub type Offset = (isize, isize, f64);

/// The cells within a distance of one cell, as offsets of column and row, with their squared distances, m².
pub fn disc(grid: &Grid, radius: f64) -> Vec<Offset> {
    let reach = grid.spacing.map(|s| (radius / s + 1e-6) as isize);
    let mut offsets = Vec::new();
    for row in -reach[1]..=reach[1] {
        for column in -reach[0]..=reach[0] {
            let (x, y) = (column as f64 * grid.spacing[0], row as f64 * grid.spacing[1]);
            let square = x * x + y * y;
            if square <= (radius + 1e-9) * (radius + 1e-9) {
                offsets.push((column, row, square));
            }
        }
    }
    offsets
}

/// A raster with its outermost cells repeated outward as far as some offsets reach, so that every cell has a neighbor at each of them.
/// What is done with neighbors goes through the raster row by row and offset by offset, which the compiler turns into vector instructions.
pub struct Bordered<T> {
    values: Vec<T>,
    /// Cells that are added at each side along x and y.
    reach: [usize; 2],
    columns: usize,
}

impl<T: Copy> Bordered<T> {
    /// Repeats the border of a raster by rows.
    pub fn new(grid: &Grid, values: &[T], offsets: &[Offset]) -> Self {
        let reach = offsets
            .iter()
            .fold([0, 0], |[x, y], &(u, v, _)| [x.max(u.unsigned_abs()), y.max(v.unsigned_abs())]);
        let mut bordered = Vec::with_capacity((grid.columns + 2 * reach[0]) * (grid.rows + 2 * reach[1]));
        for row in 0..grid.rows + 2 * reach[1] {
            let row = row.saturating_sub(reach[1]).min(grid.rows - 1);
            let row = &values[row * grid.columns..(row + 1) * grid.columns];
            bordered.extend(std::iter::repeat_n(row[0], reach[0]));
            bordered.extend_from_slice(row);
            bordered.extend(std::iter::repeat_n(row[grid.columns - 1], reach[0]));
        }
        Self { values: bordered, reach, columns: grid.columns }
    }

    /// The neighbors of a row's cells at an offset.
    pub fn neighbors(&self, row: usize, &(u, v, _): &Offset) -> &[T] {
        let row = (row + self.reach[1]).wrapping_add_signed(v);
        let start = row * (self.columns + 2 * self.reach[0]) + self.reach[0].wrapping_add_signed(u);
        &self.values[start..start + self.columns]
    }
}

/// Combines each cell's initial value with its neighbors, in the order of the offsets, which are numbered.
fn combined<T: Copy, R: Copy>(
    grid: &Grid,
    values: &[T],
    offsets: &[Offset],
    initial: R,
    combine: impl Fn(R, usize, T) -> R,
) -> Vec<R> {
    let bordered = Bordered::new(grid, values, offsets);
    let mut results = vec![initial; grid.len()];
    for (row, results) in results.chunks_exact_mut(grid.columns).enumerate() {
        for (n, offset) in offsets.iter().enumerate() {
            for (result, value) in results.iter_mut().zip(bordered.neighbors(row, offset)) {
                *result = combine(*result, n, *value);
            }
        }
    }
    results
}

/// The lowest height, m, that the bottom of a ball of this radius can have over each cell without entering the ground:
/// max over d of h(x + d) + √(R² − d²) − R.
pub fn rolled_over(grid: &Grid, heights: &[f64], radius: f64) -> Vec<f64> {
    let offsets = disc(grid, radius);
    let cap: Vec<f64> = offsets.iter().map(|o| (radius * radius - o.2).max(0.0).sqrt() - radius).collect();
    combined(grid, heights, &offsets, f64::NEG_INFINITY, |highest, n, h| highest.max(h + cap[n]))
}

/// The heights with all that is narrower than `width` m, along x or y, and lower than its surroundings filled: the greatest height
/// within half of the width, then the least of these (a morphological closing by a square).
pub fn closed(grid: &Grid, heights: &[f64], width: f64) -> Vec<f64> {
    let reach = grid.spacing.map(|spacing| (0.5 * width / spacing) as isize);
    let lines: [Vec<Offset>; 2] = [
        (-reach[0]..=reach[0]).map(|k| (k, 0, 0.0)).collect(),
        (-reach[1]..=reach[1]).map(|k| (0, k, 0.0)).collect(),
    ];
    let highest = lines.iter().fold(heights.to_vec(), |heights, line| {
        combined(grid, &heights, line, f64::NEG_INFINITY, |highest, _, h| highest.max(h))
    });
    lines.iter().fold(highest, |heights, line| {
        combined(grid, &heights, line, f64::INFINITY, |lowest, _, h| lowest.min(h))
    })
}

/// The cells of a set that a disc within the set can cover (a morphological opening): without what is narrower than the disc.
pub fn opened(grid: &Grid, set: &[bool], radius: f64) -> Vec<bool> {
    let middles = combined(grid, set, &disc(grid, radius), true, |all, _, inside| all & inside);
    widened(grid, &middles, radius)
}

/// The cells within a distance of a set.
pub fn widened(grid: &Grid, set: &[bool], radius: f64) -> Vec<bool> {
    combined(grid, set, &disc(grid, radius), false, |any, _, inside| any | inside)
}

/// How many cells of a set are at the offsets from each cell.
pub fn counted(grid: &Grid, set: &[bool], offsets: &[Offset]) -> Vec<u32> {
    combined(grid, set, offsets, 0, |count, _, inside| count + u32::from(inside))
}

/// The average under a Gaussian of this standard deviation, m; beyond the border the outermost cells are repeated.
pub fn averaged(grid: &Grid, heights: &[f64], deviation: f64) -> Vec<f64> {
    let kernel = |spacing: f64| -> Vec<f64> {
        let reach = (KERNEL_REACH * deviation / spacing).ceil() as isize;
        let weights: Vec<f64> =
            (-reach..=reach).map(|k| (-0.5 * (k as f64 * spacing / deviation).powi(2)).exp()).collect();
        let sum: f64 = weights.iter().sum();
        weights.iter().map(|w| w / sum).collect()
    };
    let along_x = convolved(grid, heights, &kernel(grid.spacing[0]), [1, 0]);
    convolved(grid, &along_x, &kernel(grid.spacing[1]), [0, 1])
}

fn convolved(grid: &Grid, heights: &[f64], kernel: &[f64], axis: [isize; 2]) -> Vec<f64> {
    let reach = kernel.len() as isize / 2;
    let offsets: Vec<_> = (-reach..=reach).map(|k| (k * axis[0], k * axis[1], 0.0)).collect();
    combined(grid, heights, &offsets, 0.0, |sum, n, h| sum + kernel[n] * h)
}

#[cfg(test)]
mod tests {
    use super::*;

    const GRID: Grid = Grid { origin: [0.0, 0.0], spacing: [0.01, 0.01], columns: 60, rows: 40 };

    fn raster(h: impl Fn(f64, f64) -> f64) -> Vec<f64> {
        GRID.sample(|x, y| Ok(h(x, y))).expect("heights")
    }

    #[test]
    fn a_ball_touches_an_edge_with_its_side() {
        let radius = 0.05;
        let rolled = rolled_over(&GRID, &raster(|x, _| if x >= 0.3 - 1e-9 { 0.2 } else { 0.0 }), radius);
        for column in 0..60 {
            let before_edge = 0.3 - 0.01 * column as f64;
            let expected = if before_edge <= 1e-9 {
                0.2
            } else if before_edge <= radius + 1e-9 {
                0.2 + (radius * radius - before_edge * before_edge).max(0.0).sqrt() - radius
            } else {
                0.0
            };
            assert!((rolled[20 * 60 + column] - expected).abs() < 1e-6, "column {column}");
        }
    }

    #[test]
    fn narrow_gaps_are_filled_and_steps_stay() {
        let gap = |width: f64| {
            closed(&GRID, &raster(|x, _| if (x - 0.3).abs() < 0.5 * width { -0.4 } else { 0.0 }), 0.1)
        };
        assert!(gap(0.08).iter().all(|h| *h == 0.0));
        assert!(gap(0.15).iter().any(|h| *h < -0.3));
        let step = raster(|x, _| if x > 0.3 { 0.2 } else { 0.0 });
        assert_eq!(closed(&GRID, &step, 0.1), step);
    }

    #[test]
    fn small_holes_are_left_out_and_wide_ones_keep_their_size() {
        let hole = |width: f64| -> Vec<bool> {
            raster(|x, y| if (x - 0.3).abs().max((y - 0.2).abs()) < 0.5 * width { 1.0 } else { 0.0 })
                .iter()
                .map(|h| *h > 0.0)
                .collect()
        };
        let count = |set: &[bool]| set.iter().filter(|inside| **inside).count();
        assert_eq!(count(&opened(&GRID, &hole(0.05), 0.03)), 0);
        let wide = hole(0.15);
        let opened = opened(&GRID, &wide, 0.03);
        // Only its corners are rounded.
        assert!(opened.iter().zip(&wide).all(|(o, w)| *w || !*o));
        assert!(count(&opened) > count(&wide) - 4 * 9 && count(&opened) < count(&wide));
        assert_eq!(count(&widened(&GRID, &hole(0.005), 0.01)), 5);
    }

    #[test]
    fn averages_keep_planes_inside_and_the_sum_of_a_spike() {
        let plane = raster(|x, y| 0.3 * x - 0.2 * y);
        let smooth = averaged(&GRID, &plane, 0.02);
        for (row, column) in [(20, 30), (12, 14), (25, 45)] {
            assert!((smooth[row * 60 + column] - plane[row * 60 + column]).abs() < 1e-12);
        }
        let mut spike = vec![0.0; GRID.len()];
        spike[20 * 60 + 30] = 1.0;
        let smooth = averaged(&GRID, &spike, 0.02);
        assert!((smooth.iter().sum::<f64>() - 1.0).abs() < 1e-9);
        assert!((smooth[20 * 60 + 32] / smooth[20 * 60 + 30] - (-0.5_f64).exp()).abs() < 1e-9);
    }
}
