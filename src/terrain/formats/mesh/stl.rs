//! STL, binary or in text.

use std::io::Cursor;

use super::triangles::{Triangles, ensure_few};
use crate::error::{Error, Result};
use crate::terrain::formats::input::Input;

/// Bytes before the triangles of a binary file: a comment, and how many they are.
const HEADER: usize = 84;
/// Bytes of a triangle in a binary file.
const TRIANGLE: usize = 50;

/// How many triangles a binary file has; none if its length is not what its header tells.
fn count(bytes: &[u8]) -> Option<usize> {
    let header = bytes.get(HEADER - 4..HEADER)?;
    let count = u32::from_le_bytes(header.try_into().ok()?) as usize;
    (count.checked_mul(TRIANGLE)?.checked_add(HEADER)? == bytes.len()).then_some(count)
}

/// Whether a file is an STL file, judged by its length, its first word, or its name.
pub fn is_stl(input: &Input) -> bool {
    count(input.bytes).is_some() || input.bytes.starts_with(b"solid") || input.ends_in("stl")
}

/// The triangles.
///
/// # Errors
/// If it is damaged or too large.
pub fn triangles(bytes: &[u8]) -> Result<Triangles> {
    let complain = |e: std::io::Error| {
        Error::input(format!("not a valid STL file: {}", e.to_string().replace('\n', " ")))
    };
    let (binary, mut content) = (count(bytes), bytes.to_vec());
    match binary {
        Some(count) => {
            ensure_few(count)?;
            // A comment may begin like a file in text.
            content[0] = 0;
        }
        None if bytes.starts_with(b"solid") => {}
        None => return Err(Error::input("not a valid STL file: its length is not what its header tells")),
    }
    let mut source = Cursor::new(content);
    let reader = stl_io::create_stl_reader(&mut source).map_err(complain)?;
    let mut triangles = Vec::new();
    for triangle in reader {
        let corners = triangle.map_err(complain)?.vertices;
        triangles.push(corners.map(|corner| [0, 1, 2].map(|axis| f64::from(corner[axis]))));
        ensure_few(triangles.len())?;
    }
    Ok(triangles)
}
