//! The triangles of a mesh.

use crate::error::{Error, Result};

/// Larger meshes are refused, triangles.
pub const MOST_TRIANGLES: usize = 4_000_000;
/// Corners of the triangles of a mesh, m.
pub type Triangles = Vec<[[f64; 3]; 3]>;

/// Refuses to hold more triangles.
///
/// # Errors
/// For over [`MOST_TRIANGLES`].
pub fn ensure_few(triangles: usize) -> Result<()> {
    if triangles <= MOST_TRIANGLES {
        return Ok(());
    }
    let what = format!("over {MOST_TRIANGLES} triangles are too many; simplify the mesh, or cut out a part");
    Err(Error::input(what))
}
