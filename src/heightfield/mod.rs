//! The ground z = h(x, y) as a C² bicubic B-spline, whatever terrain it came from.
//!
//! h interpolates samples on a regular grid (not-a-knot ends) and is extended beyond the grid's rectangle: curvature and
//! slope fade out there, so that h is C² and bounded on the whole plane, and constant far away. Every derivative is exactly
//! that of the function that [`Heightfield::height`] returns, inside and outside.

mod spline;

use crate::error::{Error, Result};
use spline::{Axis, Interpolation, Weights};
pub use spline::{CURVATURE_FADE, SLOPE_FADE};

/// Grids larger than this are refused: the samples alone would take more than 128 MB.
pub const MAX_SAMPLES: usize = 1 << 24;

/// Larger heights are taken for a mistake in units, m.
pub const MAX_HEIGHT: f64 = 1e4;

/// h and its derivatives up to the third order at one point.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
pub struct HeightJet {
    /// h, m.
    pub h: f64,
    /// ∂h/∂x, ∂h/∂y.
    pub d1: [f64; 2],
    /// h_xx, h_xy, h_yy, 1/m.
    pub d2: [f64; 3],
    /// h_xxx, h_xxy, h_xyy, h_yyy, 1/m² (piecewise continuous only).
    pub d3: [f64; 4],
}

/// A regular grid of nodes: node (column, row) is at `origin + [column, row] * spacing`.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Grid {
    /// x, y of node (0, 0), m.
    pub origin: [f64; 2],
    /// Distance between neighboring nodes along x, y, m.
    pub spacing: [f64; 2],
    /// Nodes along x.
    pub columns: usize,
    /// Nodes along y.
    pub rows: usize,
}

impl Grid {
    /// The coarsest grid that covers the rectangle x_min, x_max, y_min, y_max exactly, with nodes at most `spacing` apart
    /// and at least four nodes along each axis.
    ///
    /// # Errors
    /// For a degenerate or non-finite rectangle or spacing, and for more than [`MAX_SAMPLES`] nodes.
    pub fn fitted(extent: [f64; 4], spacing: f64) -> Result<Self> {
        let [x_min, x_max, y_min, y_max] = extent;
        if !extent.iter().all(|v| v.is_finite() && v.abs() <= 1e6) || x_max <= x_min || y_max <= y_min {
            return Err(Error::input(format!(
                "terrain extent {extent:?} is not a rectangle: give x_min < x_max and y_min < y_max in meters"
            )));
        }
        if !(spacing.is_finite() && spacing > 0.0) {
            return Err(Error::input(format!("grid spacing {spacing} must be a positive length in meters")));
        }
        let [width, depth] = [x_max - x_min, y_max - y_min];
        // Slightly less, so that rounding does not turn 6 m / 0.01 m into 601 intervals.
        let intervals = |length: f64| (length / spacing * (1.0 - 1e-9)).ceil().max(3.0);
        let nodes = (intervals(width) + 1.0) * (intervals(depth) + 1.0);
        if nodes > MAX_SAMPLES as f64 {
            return Err(Error::input(format!(
                "a grid of spacing {spacing} m over {width} m x {depth} m has {nodes:.3e} nodes, more than {MAX_SAMPLES}; \
                 use a spacing of at least {:.2e} m or a smaller extent",
                1.01 * (width * depth / MAX_SAMPLES as f64).sqrt()
            )));
        }
        let spacing = [width / intervals(width), depth / intervals(depth)];
        let (columns, rows) = (intervals(width) as usize + 1, intervals(depth) as usize + 1);
        // A spacing near the resolution of the coordinates would make nodes coincide.
        if (0..2).any(|k| spacing[k] < 1e-9 * extent.iter().fold(1.0_f64, |m, v| m.max(v.abs()))) {
            return Err(Error::input(format!(
                "terrain extent {extent:?} is too narrow for its distance from the origin"
            )));
        }
        Ok(Self { origin: [x_min, y_min], spacing, columns, rows })
    }

    /// The node nearest to a place, `row * columns + column`; none outside the grid.
    pub fn nearest(&self, place: [f64; 2]) -> Option<usize> {
        let at = |axis: usize, count: usize| {
            let k = ((place[axis] - self.origin[axis]) / self.spacing[axis]).round();
            (k >= 0.0 && k < count as f64).then_some(k as usize)
        };
        Some(at(1, self.rows)? * self.columns + at(0, self.columns)?)
    }

    /// x of a column, m.
    pub fn x(&self, column: usize) -> f64 {
        self.origin[0] + self.spacing[0] * column as f64
    }

    /// y of a row, m.
    pub fn y(&self, row: usize) -> f64 {
        self.origin[1] + self.spacing[1] * row as f64
    }

    /// x of the columns and y of the rows, m.
    pub fn lines(&self) -> [Vec<f64>; 2] {
        [(0..self.columns).map(|k| self.x(k)).collect(), (0..self.rows).map(|k| self.y(k)).collect()]
    }

    /// x halfway between neighboring columns, and y halfway between neighboring rows, m.
    pub fn lines_between(&self) -> [Vec<f64>; 2] {
        let [xs, ys] = self.lines();
        let between = |lines: Vec<f64>, spacing: f64| -> Vec<f64> {
            lines[..lines.len() - 1].iter().map(|at| at + 0.5 * spacing).collect()
        };
        [between(xs, self.spacing[0]), between(ys, self.spacing[1])]
    }

    /// Number of nodes.
    pub fn len(&self) -> usize {
        self.columns * self.rows
    }

    /// Whether there are no nodes.
    pub fn is_empty(&self) -> bool {
        self.len() == 0
    }

    /// x_min, x_max, y_min, y_max, m.
    pub fn extent(&self) -> [f64; 4] {
        [self.x(0), self.x(self.columns - 1), self.y(0), self.y(self.rows - 1)]
    }

    /// Values of a function of x, y at the nodes, (rows, columns), row by row. Stops at the first error.
    ///
    /// # Errors
    /// Those of the function.
    pub fn sample(&self, f: impl Fn(f64, f64) -> Result<f64>) -> Result<Vec<f64>> {
        let mut values = Vec::with_capacity(self.len());
        for row in 0..self.rows {
            for column in 0..self.columns {
                values.push(f(self.x(column), self.y(row))?);
            }
        }
        Ok(values)
    }
}

/// The ground as a function: z = h(x, y).
#[derive(Clone, Debug, PartialEq)]
pub struct Heightfield {
    grid: Grid,
    /// (rows, columns), m.
    samples: Vec<f64>,
    axes: [Axis; 2],
    /// (columns + 2, rows + 2): the four that a cell needs along y are contiguous.
    coefficients: Vec<f64>,
}

impl Heightfield {
    /// The spline through `samples[row * columns + column]` at `origin + [column, row] * spacing`.
    ///
    /// # Errors
    /// For fewer than 4 samples along an axis, a spacing that is not positive, a count that does not match, more than
    /// [`MAX_SAMPLES`] samples, and heights that are not finite or beyond [`MAX_HEIGHT`].
    pub fn interpolate(
        origin: [f64; 2],
        spacing: [f64; 2],
        columns: usize,
        rows: usize,
        samples: &[f64],
    ) -> Result<Self> {
        if columns < 4 || rows < 4 {
            return Err(Error::input(format!(
                "a height grid of {columns} x {rows} samples is too small: at least 4 x 4"
            )));
        }
        if columns.checked_mul(rows).is_none_or(|n| n > MAX_SAMPLES) {
            return Err(Error::input(format!(
                "a height grid of {columns} x {rows} samples is too large: at most {MAX_SAMPLES} in all"
            )));
        }
        if samples.len() != columns * rows {
            return Err(Error::input(format!("{} heights for a grid of {columns} x {rows}", samples.len())));
        }
        if !spacing.iter().all(|s| s.is_finite() && *s > 0.0) || !origin.iter().all(|o| o.is_finite()) {
            return Err(Error::input(format!(
                "a height grid at {origin:?} with spacing {spacing:?} m: the origin must be finite, the spacing positive"
            )));
        }
        let grid = Grid { origin, spacing, columns, rows };
        if let Some(i) = samples.iter().position(|h| h.is_nan() || h.abs() > MAX_HEIGHT) {
            let (x, y) = (grid.x(i % columns), grid.y(i / columns));
            return Err(Error::input(format!(
                "the height at x = {x:.4}, y = {y:.4} is {}: heights must be finite and within ±{MAX_HEIGHT} m",
                samples[i]
            )));
        }
        let along_y = Interpolation::new(rows).solve(columns, samples);
        let along_x = Interpolation::new(columns).solve(rows + 2, &transposed(&along_y, rows + 2, columns));
        Ok(Self {
            grid,
            samples: samples.to_vec(),
            axes: [Axis::new(origin[0], spacing[0], columns), Axis::new(origin[1], spacing[1], rows)],
            coefficients: along_x,
        })
    }

    /// The spline through h at the nodes of [`Grid::fitted`].
    ///
    /// # Errors
    /// Those of the grid, of h, and of [`Heightfield::interpolate`].
    pub fn from_function(
        extent: [f64; 4],
        spacing: f64,
        h: impl Fn(f64, f64) -> Result<f64>,
    ) -> Result<Self> {
        let grid = Grid::fitted(extent, spacing)?;
        Self::interpolate(grid.origin, grid.spacing, grid.columns, grid.rows, &grid.sample(h)?)
    }

    /// h(x, y), m.
    #[inline]
    pub fn height(&self, x: f64, y: f64) -> f64 {
        let (wx, wy) = (self.axes[0].weights::<1>(x), self.axes[1].weights::<1>(y));
        let [c] = self.contract(&wx, &wy);
        dot(&wx.weights[0], &c)
    }

    /// ∂h/∂x, ∂h/∂y.
    #[inline]
    pub fn gradient(&self, x: f64, y: f64) -> [f64; 2] {
        let (wx, wy) = (self.axes[0].weights::<2>(x), self.axes[1].weights::<2>(y));
        let [c, c_y] = self.contract(&wx, &wy);
        [dot(&wx.weights[1], &c), dot(&wx.weights[0], &c_y)]
    }

    /// h and (∂h/∂x, ∂h/∂y); costs little more than one of them.
    #[inline]
    pub fn height_and_gradient(&self, x: f64, y: f64) -> (f64, [f64; 2]) {
        let (wx, wy) = (self.axes[0].weights::<2>(x), self.axes[1].weights::<2>(y));
        let [c, c_y] = self.contract(&wx, &wy);
        (dot(&wx.weights[0], &c), [dot(&wx.weights[1], &c), dot(&wx.weights[0], &c_y)])
    }

    /// Visits all crossings of lines x = const and y = const, row by row, with x, y, h and (∂h/∂x, ∂h/∂y), which are those of
    /// [`Heightfield::height_and_gradient`]; what a line's crossings have in common is computed once.
    pub fn for_each_crossing(&self, xs: &[f64], ys: &[f64], mut visit: impl FnMut([f64; 2], f64, [f64; 2])) {
        let columns: Vec<Weights<2>> = xs.iter().map(|&x| self.axes[0].weights(x)).collect();
        let mut along = vec![[0.0; 2]; self.axes[0].count + 2];
        for &y in ys {
            let wy = self.axes[1].weights::<2>(y);
            for (sums, line) in along.iter_mut().zip(self.coefficients.chunks_exact(self.axes[1].count + 2)) {
                let line = &line[wy.first..wy.first + 4];
                *sums = wy.weights.map(|w| w[0] * line[0] + w[1] * line[1] + w[2] * line[2] + w[3] * line[3]);
            }
            for (&x, wx) in xs.iter().zip(&columns) {
                let near = &along[wx.first..wx.first + 4];
                let [c, c_y] = [0, 1].map(|order| std::array::from_fn(|i| near[i][order]));
                visit([x, y], dot(&wx.weights[0], &c), [dot(&wx.weights[1], &c), dot(&wx.weights[0], &c_y)]);
            }
        }
    }

    /// h and its derivatives up to the third order.
    #[inline]
    pub fn jet(&self, x: f64, y: f64) -> HeightJet {
        let (wx, wy) = (self.axes[0].weights::<4>(x), self.axes[1].weights::<4>(y));
        let [c, c_y, c_yy, c_yyy] = self.contract(&wx, &wy);
        let [w, w_x, w_xx, w_xxx] = &wx.weights;
        HeightJet {
            h: dot(w, &c),
            d1: [dot(w_x, &c), dot(w, &c_y)],
            d2: [dot(w_xx, &c), dot(w_x, &c_y), dot(w, &c_yy)],
            d3: [dot(w_xxx, &c), dot(w_xx, &c_y), dot(w_x, &c_yy), dot(w, &c_yyy)],
        }
    }

    /// The upward unit normal, (−h_x, −h_y, 1)/‖·‖.
    #[inline]
    pub fn normal(&self, x: f64, y: f64) -> [f64; 3] {
        let [hx, hy] = self.gradient(x, y);
        let scale = 1.0 / (1.0 + hx * hx + hy * hy).sqrt();
        [-hx * scale, -hy * scale, scale]
    }

    /// x_min, x_max, y_min, y_max of the grid, m. Beyond it, h is the extension.
    pub fn extent(&self) -> [f64; 4] {
        self.grid.extent()
    }

    /// The grid of the samples.
    pub fn grid(&self) -> &Grid {
        &self.grid
    }

    /// The interpolated heights, (rows, columns), row by row, m.
    pub fn samples(&self) -> &[f64] {
        &self.samples
    }

    /// Sums the 4×4 coefficients of a cell along y: for each derivative order in y, four values along x.
    #[inline]
    fn contract<const ORDERS: usize>(
        &self,
        wx: &Weights<ORDERS>,
        wy: &Weights<ORDERS>,
    ) -> [[f64; 4]; ORDERS] {
        let stride = self.axes[1].count + 2;
        let mut sums = [[0.0; 4]; ORDERS];
        for i in 0..4 {
            let start = (wx.first + i) * stride + wy.first;
            let line = &self.coefficients[start..start + 4];
            for order in 0..ORDERS {
                let w = &wy.weights[order];
                sums[order][i] = w[0] * line[0] + w[1] * line[1] + w[2] * line[2] + w[3] * line[3];
            }
        }
        sums
    }
}

#[inline]
fn dot(a: &[f64; 4], b: &[f64; 4]) -> f64 {
    a[0] * b[0] + a[1] * b[1] + a[2] * b[2] + a[3] * b[3]
}

/// (rows, columns) → (columns, rows), in blocks that fit the cache.
fn transposed(values: &[f64], rows: usize, columns: usize) -> Vec<f64> {
    const BLOCK: usize = 32;
    let mut result = vec![0.0; values.len()];
    for row_block in (0..rows).step_by(BLOCK) {
        for column_block in (0..columns).step_by(BLOCK) {
            for row in row_block..(row_block + BLOCK).min(rows) {
                for column in column_block..(column_block + BLOCK).min(columns) {
                    result[column * rows + row] = values[row * columns + column];
                }
            }
        }
    }
    result
}

#[cfg(test)]
mod tests;
