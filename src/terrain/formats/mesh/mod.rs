//! Triangle meshes (OBJ, STL, PLY), z up, in m: heights by vertical rays from above.

mod obj;
mod ply;
mod polygon;
mod rays;
mod stl;
mod triangles;

use super::input::Input;
use crate::error::{Error, Result};
use crate::terrain::raster::{Raster, Values, check_size};
use triangles::Triangles;

pub use obj::is_obj;
pub use ply::SIGNATURE as PLY_SIGNATURE;
pub use stl::is_stl;

/// More rays than this are refused.
const MOST_RAYS: u64 = 4_000_000;
/// A mesh with a larger fraction of rays that meet no face is refused: a vertex far away makes the grid.
const MOST_MISSED: f64 = 0.99;
/// Rays times the triangles that they meet; more would take over about 5 s.
const MOST_HITS: f64 = 2e7;
/// Meshes from this size on are perhaps in millimeters, m.
const LARGE: f64 = 100.0;

/// Decodes an OBJ file.
///
/// # Errors
/// Those of the reader and of [`heights`].
pub fn obj(input: &Input) -> Result<Raster> {
    heights(obj::triangles(input.bytes)?, input)
}

/// Decodes an STL file, binary or in text.
///
/// # Errors
/// Those of the reader and of [`heights`].
pub fn stl(input: &Input) -> Result<Raster> {
    heights(stl::triangles(input.bytes)?, input)
}

/// Decodes a PLY file, binary or in text.
///
/// # Errors
/// Those of the reader and of [`heights`].
pub fn ply(input: &Input) -> Result<Raster> {
    heights(ply::triangles(input.bytes)?, input)
}

/// The heights of the highest surfaces over a grid of `terrain.spacing` that starts at the mesh's least x and y.
fn heights(triangles: Triangles, input: &Input) -> Result<Raster> {
    if triangles.is_empty() {
        return Err(Error::input("a mesh without faces"));
    }
    if triangles.iter().flatten().flatten().any(|v| !v.is_finite()) {
        return Err(Error::input("a mesh with a vertex that is not finite"));
    }
    let bounds: [[f64; 2]; 3] = std::array::from_fn(|axis| {
        let along = || triangles.iter().flatten().map(|vertex| vertex[axis]);
        [along().fold(f64::INFINITY, f64::min), along().fold(f64::NEG_INFINITY, f64::max)]
    });
    let [x, y, z] = bounds.map(|[low, high]| high - low);
    let size = format!("a mesh of {x:.3} x {y:.3} x {z:.3} m along x, y, z (z is up)");
    let Some(spacing) = input.spacing else {
        let what =
            format!("missing; {size} needs it: the distance between neighboring rays in m, such as 0.02");
        return Err(Error::key("terrain.spacing", what));
    };
    // A remainder of less than a cell is left out.
    let count = |length: f64| (length / spacing + rays::SEAM).floor().min(1e12) as u64 + 1;
    let (columns, rows) = (count(x), count(y));
    let refuse = |what: &dyn std::fmt::Display| {
        let unit = if x.max(y) > LARGE { "; if the mesh is in millimeters, bring it to meters" } else { "" };
        Error::key("terrain.spacing", format!("given {spacing}: {size}: {what}{unit}"))
    };
    check_size(columns, rows).map_err(|e| refuse(&e))?;
    if columns * rows > MOST_RAYS {
        return Err(refuse(&format!(
            "{columns} x {rows} rays are too many: at most {MOST_RAYS} in all; give a larger one, or scale the mesh to meters if it is in millimeters"
        )));
    }
    let grid = rays::Rays {
        corner: [bounds[0][0], bounds[1][0]],
        spacing,
        columns: columns as usize,
        rows: rows as usize,
    };
    if grid.work(&triangles) > MOST_HITS {
        return Err(refuse(
            &"too many faces above each other for so many rays; give a larger one, or simplify the mesh",
        ));
    }
    let seen = grid.cast(&triangles);
    let missed = seen.heights.iter().filter(|h| h.is_nan()).count();
    if missed as f64 > MOST_MISSED * seen.heights.len() as f64 {
        let what = format!(
            "{size}: {missed} of {} rays from above meet no face; perhaps a vertex is far away from the others",
            seen.heights.len()
        );
        return Err(Error::input(what));
    }
    let mut raster = Raster::new(
        grid.columns,
        grid.rows,
        seen.heights,
        Values::Meters,
        format!("{} triangles", triangles.len()),
    );
    raster.layout = crate::scenario::terrain::Layout::YUp;
    raster.spacing = Some([spacing; 2]);
    raster.corner = Some(grid.corner);
    raster.notes = seen.notes;
    Ok(raster)
}
