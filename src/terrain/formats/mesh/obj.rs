//! Wavefront OBJ.

use std::io::Cursor;

use tobj::{LoadError, LoadOptions};

use super::polygon::Splitter;
use super::triangles::{Triangles, ensure_few};
use crate::error::{Error, Result};
use crate::terrain::formats::input::Input;

/// Whether a file is called so, or has vertices in the way of an OBJ file among its first lines.
pub fn is_obj(input: &Input) -> bool {
    let start = String::from_utf8_lossy(&input.bytes[..input.bytes.len().min(1 << 16)]);
    let vertex = |line: &str| {
        let mut words = line.split_whitespace();
        words.next() == Some("v") && words.take(3).filter(|word| word.parse::<f64>().is_ok()).count() == 3
    };
    input.ends_in("obj") || start.lines().any(vertex)
}

/// The triangles of all objects; larger faces are split. Materials are not read.
///
/// # Errors
/// For lines that are wrong, and too many triangles.
pub fn triangles(bytes: &[u8]) -> Result<Triangles> {
    // Every triangle takes at least six bytes of a face's line.
    ensure_few(bytes.iter().filter(|b| **b == b'f').count().saturating_sub(1))?;
    let options =
        LoadOptions { triangulate: false, ignore_points: true, ignore_lines: true, ..Default::default() };
    let (models, _) =
        tobj::load_obj_buf(&mut Cursor::new(bytes), &options, |_| Err(LoadError::OpenFileFailed))
            .map_err(|e| Error::input(format!("not a valid OBJ file: {e}")))?;
    let (mut triangles, mut splitter) = (Vec::new(), Splitter::default());
    for mesh in models.iter().map(|model| &model.mesh) {
        let corners = mesh.positions.as_chunks::<3>().0;
        let corner = |i: &u32| corners.get(*i as usize).copied();
        let mut indices = &mesh.indices[..];
        // Without their numbers of corners, all faces are triangles.
        let mut arities = mesh.face_arities.iter();
        while !indices.is_empty() {
            let arity = arities.next().map_or(3, |n| *n as usize).clamp(1, indices.len());
            let (face, rest) = indices.split_at(arity);
            indices = rest;
            let Some(face) = face.iter().map(corner).collect::<Option<Vec<_>>>() else {
                return Err(Error::input("not a valid OBJ file: a face with a vertex that does not exist"));
            };
            splitter.split(&face, &mut triangles)?;
        }
        ensure_few(triangles.len())?;
    }
    Ok(triangles)
}
