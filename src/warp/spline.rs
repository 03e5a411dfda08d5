//! φ as a tri-cubic uniform B-spline, and its derivatives.
//!
//!   φ(x̄) = Σ_ijk ψ_ijk B_i(s₀) B_j(s₁) B_k(s₂),   s_d = (x̄_d − origin_d) / cell_d   (Section IV-A)

use super::WarpJet;
use super::basis::axis_weights;
use crate::scenario::MapSpec;
use crate::{Error, Result};

/// How many derivatives to compute.
#[derive(Clone, Copy, Debug, PartialEq, Eq, PartialOrd, Ord)]
pub enum Order {
    /// φ and J.
    First,
    /// And ∂J.
    Second,
    /// And ∂²J.
    Third,
}

/// The warp map as stored.
#[derive(Clone, Debug)]
pub struct MapGrid {
    /// (Nx+3, Ny+3, Nz+3)
    pub shape: [usize; 3],
    /// (shape, 3) in C order, m.
    pub control_points: Vec<[f64; 3]>,
    /// Corner of the box in F, m.
    pub origin: [f64; 3],
    /// Knots by axis, m.
    pub knots: [Vec<f64>; 3],
}

/// φ: F → A on a box of cells, continued outside (C²) by moving its faces outwards.
///
/// F is measured in metres as well: the box stands over the terrain's rectangle, its bottom at z̄ = 0 is the ground.
#[derive(Clone, Debug, PartialEq)]
pub struct WarpMap {
    cells: [usize; 3],
    origin: [f64; 3],
    cell: [f64; 3],
    /// ψ, (Nx+3, Ny+3, Nz+3) in C order, so that the four points touched along z are one contiguous run.
    control_points: Vec<[f64; 3]>,
}

impl WarpMap {
    /// φ(x̄) = x̄ over the rectangle [x_min, x_max, y_min, y_max].
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

    /// A map from its parts; (Nx+3)(Ny+3)(Nz+3) control points.
    pub(super) fn new(
        cells: [usize; 3],
        origin: [f64; 3],
        cell: [f64; 3],
        control_points: Vec<[f64; 3]>,
    ) -> WarpMap {
        debug_assert_eq!(control_points.len(), cells.iter().map(|n| n + 3).product::<usize>());
        WarpMap { cells, origin, cell, control_points }
    }

    /// Cells along x, y, z.
    pub fn cells(&self) -> [usize; 3] {
        self.cells
    }

    /// The corner of the box with the least coordinates, in F, m.
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

    /// ψ, to be changed in place.
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

    /// All derivatives below the M-th, axis by axis (sum factorization): 16 runs of 4 points are contracted along x, the
    /// result along y, and that along z.
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
        let mut jet = WarpJet {
            position: [0.0; 3],
            jacobian: [[0.0; 3]; 3],
            second: [[0.0; 6]; 3],
            third: [[0.0; 10]; 3],
        };
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
                    // Place among the derivatives of this order, as in `derivative_slot`.
                    let slot = (b + c) * (b + c + 1) / 2 + c;
                    for e in 0..3 {
                        let value = w[0] * run[e] + w[1] * run[3 + e] + w[2] * run[6 + e] + w[3] * run[9 + e];
                        match a + b + c {
                            0 => jet.position[e] = value,
                            1 => jet.jacobian[e][slot] = scale * value,
                            2 => jet.second[e][slot] = scale * value,
                            _ => jet.third[e][slot] = scale * value,
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
                jet.second[d][[0, 3, 5][d]] += shift[2] * per_cell[d];
            }
            if M > 3 {
                jet.third[d][[0, 6, 9][d]] += shift[3] * per_cell[d] * per_cell[d];
            }
        }
        jet
    }

    /// (1 − a) φ + a φ', for continuation from one map to another on the same grid.
    ///
    /// # Errors
    /// When the two maps stand on different grids.
    pub fn blend(&self, other: &WarpMap, a: f64) -> Result<WarpMap> {
        if self.cells != other.cells || self.origin != other.origin || self.cell != other.cell {
            return Err(Error::input(format!(
                "two warp maps can be blended only on the same grid, but one has {:?} cells from {:?}, the other {:?} from {:?}; build both with the same extent, cells and thickness",
                self.cells, self.origin, other.cells, other.origin
            )));
        }
        let mix = |p: &[f64; 3], q: &[f64; 3]| std::array::from_fn(|c| (1.0 - a) * p[c] + a * q[c]);
        let control_points =
            self.control_points.iter().zip(&other.control_points).map(|(p, q)| mix(p, q)).collect();
        Ok(WarpMap { control_points, ..self.clone() })
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
    /// When shape, knots and control points do not fit together, the knots are not uniform, or a value is not finite.
    pub fn from_grid(grid: &MapGrid) -> Result<WarpMap> {
        let wrong = |what: String| Err(Error::input(format!("warp map: {what}; write the plan again")));
        let mut cell = [0.0; 3];
        for d in 0..3 {
            let knots = &grid.knots[d];
            let axis = ["x", "y", "z"][d];
            if grid.shape[d] < 4 {
                return wrong(format!(
                    "{} control points along {axis}, at least 4 are needed",
                    grid.shape[d]
                ));
            }
            if knots.len() != grid.shape[d] + 4 {
                return wrong(format!(
                    "{} knots along {axis} for {} control points, expected 4 more than these",
                    knots.len(),
                    grid.shape[d]
                ));
            }
            let cells = grid.shape[d] - 3;
            cell[d] = (knots[3 + cells] - knots[3]) / cells as f64;
            if !(cell[d] > 0.0 && cell[d].is_finite()) {
                return wrong(format!("the knots along {axis} do not increase"));
            }
            let expected = |i: usize| grid.origin[d] + (i as f64 - 3.0) * cell[d];
            if let Some(i) = (0..knots.len()).find(|&i| {
                let off = (knots[i] - expected(i)).abs();
                off > 1e-6 * cell[d] || off.is_nan()
            }) {
                return wrong(format!(
                    "knot {i} along {axis} is {} m where uniform knots from the origin have {} m",
                    knots[i],
                    expected(i)
                ));
            }
        }
        let points: usize = grid.shape.iter().product();
        if grid.control_points.len() != points {
            return wrong(format!(
                "{} control points, the shape {:?} asks for {points}",
                grid.control_points.len(),
                grid.shape
            ));
        }
        if let Some(i) = grid.control_points.iter().position(|p| p.iter().any(|v| !v.is_finite())) {
            return wrong(format!("control point {i} is not finite"));
        }
        Ok(WarpMap {
            cells: grid.shape.map(|n| n - 3),
            origin: grid.origin,
            cell,
            control_points: grid.control_points.clone(),
        })
    }
}

/// About a gigabyte in the optimizer.
const MAX_CELLS: usize = 1_000_000;

/// Cells, origin and size of the box over a rectangle.
fn checked_box(extent: [f64; 4], spec: &MapSpec) -> Result<([usize; 3], [f64; 3], [f64; 3])> {
    let [x_min, x_max, y_min, y_max] = extent;
    let size = [x_max - x_min, y_max - y_min, spec.thickness];
    if !size.iter().all(|s| s.is_finite() && *s > 0.0) {
        return Err(Error::input(format!(
            "the warp map needs a box of positive size, not {} × {} × {} m (terrain extent, map.thickness)",
            size[0], size[1], size[2]
        )));
    }
    let grid = spec.cells(extent);
    if let Some(n) = grid.iter().find(|n| !(4..=512).contains(*n)) {
        return Err(Error::input(format!("map.cells = {:?}: {n} is not between 4 and 512", grid)));
    }
    let cells: usize = grid.iter().product();
    if cells > MAX_CELLS {
        return Err(Error::input(format!(
            "map.cells = {:?} makes {cells} cells; more than {MAX_CELLS} would need gigabytes of memory",
            grid
        )));
    }
    Ok((grid, [x_min, y_min, 0.0], size))
}
