//! The simplest map onto the ground: φ(x̄) = (x̄, ȳ, z̄ + h(x̄, ȳ)). It is injective for any h, but far from conformal on slopes.

use super::axis::MapAxis;
use super::bottom::Bottom;
use super::spline::WarpMap;
use crate::Result;
use crate::heightfield::Heightfield;
use crate::scenario::MapSpec;

/// The bottom face of the shear: the L² projection of h onto the splines over the terrain's rectangle.
pub(super) struct ShearedFace {
    bottom: Bottom,
    /// The corner of the rectangle and the size of a cell, m.
    corner: [f64; 2],
    cell: [f64; 2],
    /// h at the Gauss points, m.
    heights: Vec<f64>,
    /// Coefficients of the face, m.
    face: Vec<f64>,
}

impl ShearedFace {
    /// The face with so many cells along x and y.
    pub fn new(field: &Heightfield, [nx, ny]: [usize; 2]) -> ShearedFace {
        let [x_min, x_max, y_min, y_max] = field.extent();
        let x = MapAxis { cells: nx, cell: (x_max - x_min) / nx as f64 };
        let y = MapAxis { cells: ny, cell: (y_max - y_min) / ny as f64 };
        let mut bottom = Bottom::new(&x, &y);
        let (corner, cell) = ([x_min, y_min], [x.cell, y.cell]);
        let heights: Vec<f64> =
            bottom.positions().map(|[s, t]| field.height(x_min + s * x.cell, y_min + t * y.cell)).collect();
        let mut face = vec![0.0; x.len() * y.len()];
        bottom.project(&heights, &mut face);
        ShearedFace { bottom, corner, cell, heights, face }
    }

    /// Greatest vertical distance of the face from the terrain at the Gauss points, m.
    pub fn misfit(&mut self) -> f64 {
        let mut values = vec![0.0; self.heights.len()];
        self.bottom.values(&self.face, &mut values);
        values.iter().zip(&self.heights).map(|(v, h)| (v - h).abs()).fold(0.0, f64::max)
    }

    /// The greatest slope of the terrain at the Gauss points.
    pub fn steepest(&self, field: &Heightfield) -> f64 {
        let slope = |[s, t]: [f64; 2]| {
            let [x, y] = field.gradient(self.corner[0] + s * self.cell[0], self.corner[1] + t * self.cell[1]);
            x.hypot(y)
        };
        self.bottom.positions().map(slope).fold(0.0, f64::max)
    }
}

impl WarpMap {
    /// The shear over the terrain's rectangle.
    ///
    /// # Errors
    /// If the cells or the thickness of `spec` are not valid.
    pub fn shear(field: &Heightfield, spec: &MapSpec) -> Result<WarpMap> {
        let mut map = WarpMap::flat(field.extent(), spec)?;
        let [nx, ny, nz] = map.cells();
        let ShearedFace { mut bottom, mut face, .. } = ShearedFace::new(field, [nx, ny]);
        bottom.turn_into_control_points(&mut face);
        for (column, h) in map.control_points_mut().chunks_exact_mut(nz + 3).zip(&face) {
            for point in column {
                point[2] += h;
            }
        }
        Ok(map)
    }
}
