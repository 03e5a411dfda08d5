//! The simplest map onto the ground: φ(x̄) = (x̄, ȳ, z̄ + h(x̄, ȳ)). It is injective for any h, but far from conformal on slopes.

use super::axis::MapAxis;
use super::bottom::Bottom;
use super::spline::WarpMap;
use crate::Result;
use crate::heightfield::Heightfield;
use crate::scenario::MapSpec;

impl WarpMap {
    /// The shear over the terrain's rectangle, with the L² projection of h onto the splines of the bottom face.
    ///
    /// # Errors
    /// If the cells or the thickness of `spec` are not valid.
    pub fn shear(field: &Heightfield, spec: &MapSpec) -> Result<WarpMap> {
        let extent = field.extent();
        let mut map = WarpMap::flat(extent, spec)?;
        let ([nx, ny, nz], [width, length, _]) = (map.cells(), map.cell());
        let (x, y) = (MapAxis { cells: nx, cell: width }, MapAxis { cells: ny, cell: length });
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
