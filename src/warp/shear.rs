//! The simplest map onto the ground: φ(x̄) = (x̄, ȳ, z̄ + h(x̄, ȳ)). Injective for any h, far from conformal on slopes.

use super::WarpMap;
use super::axis::Axis;
use super::bottom::Bottom;
use crate::Result;
use crate::heightfield::Heightfield;
use crate::scenario::MapSpec;

impl WarpMap {
    /// The shear over the terrain's rectangle; h enters by its L² projection onto the splines of the bottom face.
    ///
    /// # Errors
    /// When `spec` makes no grid (cells, thickness).
    pub fn shear(field: &Heightfield, spec: &MapSpec) -> Result<WarpMap> {
        let extent = field.extent();
        let mut map = WarpMap::flat(extent, spec)?;
        let ([nx, ny, nz], [width, length, _]) = (map.cells(), map.cell());
        let (x, y) = (Axis { cells: nx, cell: width }, Axis { cells: ny, cell: length });
        let bottom = Bottom::new(&x, &y);
        let heights: Vec<f64> = bottom
            .positions()
            .map(|[s, t]| field.height(extent[0] + s * width, extent[2] + t * length))
            .collect();
        let mut face = bottom.project(&heights);
        bottom.to_control_points(&mut face);
        for (column, h) in map.control_points_mut().chunks_exact_mut(nz + 3).zip(&face) {
            for point in column {
                point[2] += h;
            }
        }
        Ok(map)
    }
}
