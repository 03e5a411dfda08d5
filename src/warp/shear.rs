//! The simplest map onto the ground: φ(x̄) = (x̄, ȳ, z̄ + h(x̄, ȳ)). Injective for any h, far from conformal on slopes.

use super::WarpMap;
use super::axis::Axis;
use super::bottom::Bottom;
use crate::scenario::MapSpec;
use crate::{Error, Result};

impl WarpMap {
    /// The shear over any height function on the rectangle [x_min, x_max, y_min, y_max]; h enters by its L² projection.
    ///
    /// # Errors
    /// When `spec` makes no grid, or h is not finite somewhere on the rectangle.
    pub fn shear_of(extent: [f64; 4], spec: &MapSpec, height: impl Fn(f64, f64) -> f64) -> Result<WarpMap> {
        let mut map = WarpMap::flat(extent, spec)?;
        let ([nx, ny, nz], [width, length, _]) = (map.cells(), map.cell());
        let (x, y) = (Axis { cells: nx, cell: width }, Axis { cells: ny, cell: length });
        let bottom = Bottom::new(&x, &y);
        let heights: Vec<f64> =
            bottom.positions().map(|[s, t]| height(extent[0] + s * width, extent[2] + t * length)).collect();
        if let Some(i) = heights.iter().position(|h| !h.is_finite()) {
            let [s, t] = bottom.positions().nth(i).unwrap_or_default();
            return Err(Error::input(format!(
                "the terrain's height is {} at x {:.3}, y {:.3} m; the warp map needs a finite height everywhere on its rectangle",
                heights[i],
                extent[0] + s * width,
                extent[2] + t * length
            )));
        }
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
