//! The terrain under the plan, from the plan's own height grid: a C² bicubic spline through the samples, or, where the plan has
//! patches because the ground has edges, the raw samples and a bilinear surface between them.
//!
//! Written for the check alone, so that an error in the planner's heightfield cannot hide itself.

use crate::plan::GroundGrid;

/// h(x, y) on the plan's grid.
pub struct PlanGround {
    origin: [f64; 2],
    spacing: [f64; 2],
    /// B-spline coefficients, one more on every side than samples: `coefficients[row * columns + column]`.
    coefficients: Vec<f64>,
    rows: usize,
    columns: usize,
    /// Heights of the bilinear surface, if it is one: `raw[row * (columns − 2) + column]`.
    raw: Option<Vec<f64>>,
}

impl PlanGround {
    /// The bilinear surface through the raw heights.
    pub fn with_edges(grid: &GroundGrid) -> Self {
        let raw = Some(grid.raw.as_ref().unwrap_or(&grid.height).clone());
        let (rows, columns) = (grid.rows + 2, grid.columns + 2);
        Self { origin: grid.origin, spacing: grid.spacing, coefficients: Vec::new(), rows, columns, raw }
    }

    /// Fits the spline: along the rows, then along the columns.
    pub fn smooth(grid: &GroundGrid) -> Self {
        let (rows, columns) = (grid.rows + 2, grid.columns + 2);
        let mut along_x = vec![0.0; grid.rows * columns];
        for row in 0..grid.rows {
            let fitted = fit(&grid.height[row * grid.columns..(row + 1) * grid.columns]);
            along_x[row * columns..(row + 1) * columns].copy_from_slice(&fitted);
        }
        let mut coefficients = vec![0.0; rows * columns];
        for column in 0..columns {
            let line: Vec<f64> = (0..grid.rows).map(|row| along_x[row * columns + column]).collect();
            for (row, value) in fit(&line).into_iter().enumerate() {
                coefficients[row * columns + column] = value;
            }
        }
        Self { origin: grid.origin, spacing: grid.spacing, coefficients, rows, columns, raw: None }
    }

    /// x_min, x_max, y_min, y_max of the grid, m.
    pub fn extent(&self) -> [f64; 4] {
        let end = |axis: usize, n: usize| self.origin[axis] + self.spacing[axis] * (n - 3) as f64;
        [self.origin[0], end(0, self.columns), self.origin[1], end(1, self.rows)]
    }

    /// Whether a place lies on the grid.
    pub fn covers(&self, x: f64, y: f64) -> bool {
        let [x_min, x_max, y_min, y_max] = self.extent();
        let slack = 1e-9;
        x >= x_min - slack && x <= x_max + slack && y >= y_min - slack && y <= y_max + slack
    }

    /// h, m; beyond the grid the height of the nearest border.
    pub fn height(&self, x: f64, y: f64) -> f64 {
        self.evaluate(x, y).0
    }

    /// The upward unit normal (−h_x, −h_y, 1)/‖·‖.
    pub fn normal(&self, x: f64, y: f64) -> [f64; 3] {
        let (_, hx, hy) = self.evaluate(x, y);
        let scale = 1.0 / (1.0 + hx * hx + hy * hy).sqrt();
        [-hx * scale, -hy * scale, scale]
    }

    /// h, h_x, h_y.
    fn evaluate(&self, x: f64, y: f64) -> (f64, f64, f64) {
        let (column, u) = cell((x - self.origin[0]) / self.spacing[0], self.columns - 2);
        let (row, v) = cell((y - self.origin[1]) / self.spacing[1], self.rows - 2);
        if let Some(raw) = &self.raw {
            let at = |i: usize, j: usize| raw[(row + j) * (self.columns - 2) + column + i];
            let [low, high] = [0, 1].map(|j| at(0, j) * (1.0 - u) + at(1, j) * u);
            let hx = (at(1, 0) - at(0, 0)) * (1.0 - v) + (at(1, 1) - at(0, 1)) * v;
            return (low * (1.0 - v) + high * v, hx / self.spacing[0], (high - low) / self.spacing[1]);
        }
        let (bu, du) = basis(u);
        let (bv, dv) = basis(v);
        let (mut h, mut hx, mut hy) = (0.0, 0.0, 0.0);
        for j in 0..4 {
            for i in 0..4 {
                let c = self.coefficients[(row + j) * self.columns + column + i];
                h += bv[j] * bu[i] * c;
                hx += bv[j] * du[i] * c;
                hy += dv[j] * bu[i] * c;
            }
        }
        (h, hx / self.spacing[0], hy / self.spacing[1])
    }
}

/// The cell among `samples − 1` and the place in it, clamped to the grid.
fn cell(at: f64, samples: usize) -> (usize, f64) {
    let at = at.clamp(0.0, (samples - 1) as f64);
    let index = (at as usize).min(samples - 2);
    (index, at - index as f64)
}

/// The four uniform cubic B-splines on a cell, and their derivatives.
fn basis(u: f64) -> ([f64; 4], [f64; 4]) {
    let w = 1.0 - u;
    (
        [
            w * w * w / 6.0,
            (4.0 - 6.0 * u * u + 3.0 * u * u * u) / 6.0,
            (4.0 - 6.0 * w * w + 3.0 * w * w * w) / 6.0,
            u * u * u / 6.0,
        ],
        [-w * w / 2.0, (3.0 * u - 4.0) * u / 2.0, (4.0 - 3.0 * w) * w / 2.0, u * u / 2.0],
    )
}

/// Coefficients c₋₁ … cₙ of the cubic spline through n samples: (cᵢ₋₁ + 4cᵢ + cᵢ₊₁)/6 = sᵢ. At the ends the third
/// derivative is continuous across the second node (not-a-knot); with fewer than four samples the ends are straight.
fn fit(samples: &[f64]) -> Vec<f64> {
    let n = samples.len();
    // Known values of the outermost coefficients that samples lie on.
    let (first, last) = if n >= 4 {
        let end = |a: f64, b: f64, c: f64| (8.0 * b - a - c) / 6.0;
        (end(samples[0], samples[1], samples[2]), end(samples[n - 1], samples[n - 2], samples[n - 3]))
    } else {
        (samples[0], samples[n - 1])
    };
    // With not-a-knot, c₁ and cₙ₋₂ are known; else c₀ and cₙ₋₁ (straight ends: the coefficient is the sample).
    let (low, high) = if n >= 4 { (1, n - 2) } else { (0, n - 1) };
    let mut c = vec![0.0; n + 2];
    c[low + 1] = first;
    c[high + 1] = last;
    let mut pivot = vec![0.0; n + 2];
    for i in low + 1..high {
        let (above, before) = (pivot[i], c[i]);
        pivot[i + 1] = 1.0 / (4.0 - above);
        c[i + 1] = (6.0 * samples[i] - before) * pivot[i + 1];
    }
    for i in (low + 1..high).rev() {
        c[i + 1] -= pivot[i + 1] * c[i + 2];
    }
    for i in (0..=low).rev() {
        c[i] = 6.0 * samples[i] - 4.0 * c[i + 1] - c[i + 2];
    }
    for i in high..n {
        c[i + 2] = 6.0 * samples[i] - 4.0 * c[i + 1] - c[i];
    }
    c
}

#[cfg(test)]
mod tests {
    use super::*;

    fn sampled(n: usize, spacing: f64, h: impl Fn(f64, f64) -> f64) -> GroundGrid {
        let height =
            (0..n * n).map(|i| h((i % n) as f64 * spacing - 1.0, (i / n) as f64 * spacing - 1.0)).collect();
        GroundGrid {
            rows: n,
            columns: n,
            origin: [-1.0; 2],
            spacing: [spacing; 2],
            height,
            raw: None,
            unknown: None,
        }
    }

    #[test]
    fn cubics_are_reproduced() {
        let h = |x: f64, y: f64| 0.3 + x - 0.5 * y + x * x * y - 0.2 * x * x * x * y * y * y;
        let ground = PlanGround::smooth(&sampled(9, 0.25, h));
        for (x, y) in [(-1.0, -1.0), (0.13, -0.61), (0.99, 0.37), (1.0, 1.0), (-0.97, 0.95)] {
            assert!((ground.height(x, y) - h(x, y)).abs() < 1e-12);
            let d = 1e-6;
            let (hx, hy) = ((h(x + d, y) - h(x - d, y)) / (2.0 * d), (h(x, y + d) - h(x, y - d)) / (2.0 * d));
            let n = ground.normal(x, y);
            assert!((n[0] / n[2] + hx).abs() < 1e-8 && (n[1] / n[2] + hy).abs() < 1e-8);
        }
    }

    #[test]
    fn ripples_are_met_to_a_hundredth_of_a_millimeter() {
        let h = |x: f64, y: f64| 0.25 * (2.618 * x).sin() * (2.618 * y).sin();
        let ground = PlanGround::smooth(&sampled(51, 0.04, h));
        let worst = (0..2000)
            .map(|i| (-1.0 + (i * 37 % 2000) as f64 / 1000.0, -1.0 + (i * 91 % 2000) as f64 / 1000.0))
            .map(|(x, y)| (ground.height(x, y) - h(x, y)).abs())
            .fold(0.0, f64::max);
        assert!(worst < 1e-5, "{worst}");
    }

    #[test]
    fn the_smallest_grids_are_planes() {
        let grid = GroundGrid {
            rows: 2,
            columns: 3,
            origin: [0.0; 2],
            spacing: [1.0; 2],
            height: vec![0.0, 1.0, 2.0, 1.0, 2.0, 3.0],
            raw: None,
            unknown: None,
        };
        let ground = PlanGround::smooth(&grid);
        assert!((ground.height(0.5, 0.5) - 1.0).abs() < 1e-12);
        assert!((ground.height(1.7, 0.1) - 1.8).abs() < 1e-12);
        assert!(ground.covers(2.0, 1.0) && !ground.covers(2.1, 0.5));
    }
}
