//! φ as a tri-cubic uniform B-spline, and its derivatives (Section IV-A):
//!
//!   φ(x̄) = Σ_ijk ψ_ijk B_i(s₀) B_j(s₁) B_k(s₂),   s_d = (x̄_d − origin_d) / cell_d

use std::ops::RangeInclusive;

use super::basis::axis_weights;
use super::jet::{SECOND, THIRD, WarpJet, derivative_index};
use crate::scenario::MapSpec;
use crate::{Error, Result};

/// The highest derivatives to compute.
#[derive(Clone, Copy, Debug, PartialEq, Eq, PartialOrd, Ord)]
pub enum Order {
    /// φ and J.
    First,
    /// Those and ∂J.
    Second,
    /// Those and ∂²J.
    Third,
}

/// The warp map in its stored form.
#[derive(Clone, Debug)]
pub struct MapGrid {
    /// (Nx+3, Ny+3, Nz+3)
    pub shape: [usize; 3],
    /// ψ, (shape, 3) in C order, m.
    pub control_points: Vec<[f64; 3]>,
    /// Corner of the box in F, m.
    pub origin: [f64; 3],
    /// Knots of each axis, m.
    pub knots: [Vec<f64>; 3],
}

/// φ: F → A on a box of cells, extended beyond the box (C²) by translating its faces outward.
///
/// F is measured in meters, too: the box stands on the terrain's rectangle, and its bottom, z̄ = 0, is the ground.
#[derive(Clone, Debug, PartialEq)]
pub struct WarpMap {
    cells: [usize; 3],
    origin: [f64; 3],
    cell: [f64; 3],
    /// ψ, (Nx+3, Ny+3, Nz+3) in C order, so that the four points needed along z are contiguous.
    control_points: Vec<[f64; 3]>,
}

impl WarpMap {
    /// φ(x̄) = x̄ over the rectangle [x_min, x_max, y_min, y_max], m.
    ///
    /// # Errors
    /// If the rectangle, or the cells or the thickness of `spec`, are not valid.
    pub fn flat(extent: [f64; 4], spec: &MapSpec) -> Result<WarpMap> {
        let (cells, origin, size) = checked_box(extent, spec)?;
        let cell: [f64; 3] = std::array::from_fn(|d| size[d] / cells[d] as f64);
        let points = cells.map(|n| n + 3);
        let mut control_points = Vec::with_capacity(points.iter().product());
        // The Greville points of a uniform cubic spline: linear functions are reproduced exactly.
        let greville = |d: usize, i: usize| origin[d] + (i as f64 - 1.0) * cell[d];
        for i in 0..points[0] {
            for j in 0..points[1] {
                for k in 0..points[2] {
                    control_points.push([greville(0, i), greville(1, j), greville(2, k)]);
                }
            }
        }
        Ok(WarpMap { cells, origin, cell, control_points })
    }

    /// A map from its parts, with (Nx+3)(Ny+3)(Nz+3) control points.
    pub(super) fn new(
        cells: [usize; 3],
        origin: [f64; 3],
        cell: [f64; 3],
        control_points: Vec<[f64; 3]>,
    ) -> WarpMap {
        debug_assert_eq!(control_points.len(), cells.iter().map(|n| n + 3).product::<usize>());
        WarpMap { cells, origin, cell, control_points }
    }

    /// Number of cells along x, y, z.
    pub fn cells(&self) -> [usize; 3] {
        self.cells
    }

    /// The corner of the box with the smallest coordinates, in F, m.
    pub fn origin(&self) -> [f64; 3] {
        self.origin
    }

    /// Size of a cell along x, y, z, m.
    pub fn cell(&self) -> [f64; 3] {
        self.cell
    }

    /// Size of the box, m.
    pub fn size(&self) -> [f64; 3] {
        std::array::from_fn(|d| self.cell[d] * self.cells[d] as f64)
    }

    /// ψ, (Nx+3, Ny+3, Nz+3) in C order, m.
    pub fn control_points(&self) -> &[[f64; 3]] {
        &self.control_points
    }

    /// ψ, to change it in place.
    pub(super) fn control_points_mut(&mut self) -> &mut [[f64; 3]] {
        &mut self.control_points
    }

    /// φ(x̄), m. Defined everywhere.
    pub fn position(&self, x: [f64; 3]) -> [f64; 3] {
        self.derivatives::<1>(x).position
    }

    /// φ and its derivatives at x̄ up to `order`; entries above it are zero. Defined everywhere.
    pub fn jet(&self, x: [f64; 3], order: Order) -> WarpJet {
        match order {
            Order::First => self.derivatives::<2>(x),
            Order::Second => self.derivatives::<3>(x),
            Order::Third => self.derivatives::<4>(x),
        }
    }

    /// All derivatives below the M-th, one axis at a time (sum factorization): 16 runs of 4 points are contracted along x, the
    /// result along y, and the result of that along z.
    fn derivatives<const M: usize>(&self, x: [f64; 3]) -> WarpJet {
        let [wx, wy, wz] =
            [0, 1, 2].map(|d| axis_weights::<M>((x[d] - self.origin[d]) / self.cell[d], self.cells[d]));
        let (ny, nz) = (self.cells[1] + 3, self.cells[2] + 3);
        let mut along_x = [[[0.0; 12]; 4]; M];
        for i in 0..4 {
            for j in 0..4 {
                let start = ((wx.first + i) * ny + wy.first + j) * nz + wz.first;
                let run = self.control_points[start..start + 4].as_flattened();
                for a in 0..M {
                    for (sum, value) in along_x[a][j].iter_mut().zip(run) {
                        *sum += wx.weight[a][i] * value;
                    }
                }
            }
        }
        let per_cell: [f64; 3] = std::array::from_fn(|d| 1.0 / self.cell[d]);
        let mut jet = WarpJet::ZERO;
        let mut scale_x = 1.0;
        for a in 0..M {
            let mut scale_xy = scale_x;
            for b in 0..M - a {
                let mut run = [0.0; 12];
                for j in 0..4 {
                    for l in 0..12 {
                        run[l] += wy.weight[b][j] * along_x[a][j][l];
                    }
                }
                let mut scale = scale_xy;
                for c in 0..M - a - b {
                    let w = &wz.weight[c];
                    let index = derivative_index(b, c);
                    for e in 0..3 {
                        let value = w[0] * run[e] + w[1] * run[3 + e] + w[2] * run[6 + e] + w[3] * run[9 + e];
                        match a + b + c {
                            0 => jet.position[e] = value,
                            1 => jet.jacobian[e][index] = scale * value,
                            2 => jet.second[e][index] = scale * value,
                            _ => jet.third[e][index] = scale * value,
                        }
                    }
                    scale *= per_cell[2];
                }
                scale_xy *= per_cell[1];
            }
            scale_x *= per_cell[0];
        }
        for (d, shift) in [wx.shift, wy.shift, wz.shift].into_iter().enumerate() {
            jet.position[d] += self.cell[d] * shift[0];
            if M > 1 {
                jet.jacobian[d][d] += shift[1];
            }
            if M > 2 {
                jet.second[d][SECOND[d][d]] += shift[2] * per_cell[d];
            }
            if M > 3 {
                jet.third[d][THIRD[d][d][d]] += shift[3] * per_cell[d] * per_cell[d];
            }
        }
        jet
    }

    /// The map as stored in a plan: ψ with the N + 7 knots of each axis.
    pub fn to_grid(&self) -> MapGrid {
        MapGrid {
            shape: self.cells.map(|n| n + 3),
            control_points: self.control_points.clone(),
            origin: self.origin,
            knots: std::array::from_fn(|d| {
                (0..self.cells[d] + 7).map(|i| self.origin[d] + (i as f64 - 3.0) * self.cell[d]).collect()
            }),
        }
    }

    /// The map from its stored form.
    ///
    /// # Errors
    /// If shape, knots and control points are inconsistent, the knots are not uniform, or a value is not finite.
    pub fn from_grid(grid: &MapGrid) -> Result<WarpMap> {
        let cell = [grid.cell_size(0)?, grid.cell_size(1)?, grid.cell_size(2)?];
        let points: usize = grid.shape.iter().product();
        if grid.control_points.len() != points {
            return Err(invalid(format!(
                "{} control points where the shape {:?} requires {points}",
                grid.control_points.len(),
                grid.shape
            )));
        }
        if let Some(i) = grid.control_points.iter().position(|p| p.iter().any(|v| !v.is_finite())) {
            return Err(invalid(format!("control point {i} is not finite")));
        }
        Ok(WarpMap::new(grid.shape.map(|n| n - 3), grid.origin, cell, grid.control_points.clone()))
    }
}

/// Greatest deviation of a stored knot from a uniform grid, in cells.
const KNOT_TOLERANCE: f64 = 1e-6;

impl MapGrid {
    /// Size of the cells along axis d, m; checks the axis.
    fn cell_size(&self, d: usize) -> Result<f64> {
        let (knots, points) = (&self.knots[d], self.shape[d]);
        let axis = ["x", "y", "z"][d];
        if points < 4 {
            return Err(invalid(format!("{points} control points along {axis}, but at least 4 are needed")));
        }
        if knots.len() != points + 4 {
            return Err(invalid(format!(
                "{} knots along {axis} for {points} control points; there must be 4 more knots than points",
                knots.len()
            )));
        }
        let cells = points - 3;
        let size = (knots[3 + cells] - knots[3]) / cells as f64;
        if !(size > 0.0 && size.is_finite()) {
            return Err(invalid(format!("the knots along {axis} do not increase")));
        }
        for (i, knot) in knots.iter().enumerate() {
            let uniform = self.origin[d] + (i as f64 - 3.0) * size;
            let deviation = (knot - uniform).abs();
            if deviation > KNOT_TOLERANCE * size || deviation.is_nan() {
                return Err(invalid(format!(
                    "knot {i} along {axis} is at {knot} m where uniform knots from the origin have one at {uniform} m"
                )));
            }
        }
        Ok(size)
    }
}

/// The error for a stored map that cannot be used.
fn invalid(what: String) -> Error {
    Error::input(format!("warp map: {what}; write the plan again"))
}

/// These take about a gigabyte in the optimizer.
const MAX_CELLS: usize = 1_000_000;
/// Cells along one axis.
const CELLS: RangeInclusive<usize> = 4..=512;

/// Cells, origin and size of the box over a rectangle, checked.
pub(super) fn checked_box(extent: [f64; 4], spec: &MapSpec) -> Result<([usize; 3], [f64; 3], [f64; 3])> {
    let [x_min, x_max, y_min, y_max] = extent;
    let size = [x_max - x_min, y_max - y_min, spec.thickness];
    if !size.iter().all(|s| s.is_finite() && *s > 0.0) {
        return Err(Error::input(format!(
            "the box of the warp map must have a positive size, not {} × {} × {} m (terrain extent, map.thickness)",
            size[0], size[1], size[2]
        )));
    }
    let grid = spec.cells(extent);
    if let Some(n) = grid.iter().find(|n| !CELLS.contains(n)) {
        let (least, most) = (CELLS.start(), CELLS.end());
        return Err(Error::input(format!("map.cells = {grid:?}: {n} is not between {least} and {most}")));
    }
    let cells: usize = grid.iter().product();
    if cells > MAX_CELLS {
        return Err(Error::input(format!(
            "map.cells = {grid:?} makes {cells} cells; more than {MAX_CELLS} would need gigabytes of memory"
        )));
    }
    Ok((grid, [x_min, y_min, 0.0], size))
}
