//! PLY, binary or in text.

use ply_rs_bw::parser::{Parser, Reader};
use ply_rs_bw::ply::{Property, PropertyAccess, PropertyAccessResult};

use super::polygon::Splitter;
use super::triangles::{MOST_TRIANGLES, Triangles, ensure_few};
use crate::error::{Error, Result};

/// The first bytes of every PLY file.
pub const SIGNATURE: &[u8] = b"ply";

/// The place of a vertex; NaN where the file tells none.
struct Vertex([f64; 3]);

impl PropertyAccess for Vertex {
    fn new() -> Self {
        Self([f64::NAN; 3])
    }

    fn set_property(&mut self, key: &str, property: Property) -> PropertyAccessResult {
        let axis = ["x", "y", "z"].iter().position(|name| *name == key);
        let value = match property {
            Property::Double(value) => Some(value),
            other => other.to_f32_lossy().map(f64::from),
        };
        match (axis, value) {
            (Some(axis), Some(value)) => self.0[axis] = value,
            _ => return PropertyAccessResult::Ignored,
        }
        PropertyAccessResult::Set
    }
}

/// The vertices of a face; −1 for what is no index.
struct Face(Vec<i64>);

impl PropertyAccess for Face {
    fn new() -> Self {
        Self(Vec::new())
    }

    fn set_property(&mut self, key: &str, property: Property) -> PropertyAccessResult {
        if !["vertex_indices", "vertex_index"].contains(&key) {
            return PropertyAccessResult::Ignored;
        }
        self.0 = match property {
            Property::ListChar(list) => list.into_iter().map(i64::from).collect(),
            Property::ListUChar(list) => list.into_iter().map(i64::from).collect(),
            Property::ListShort(list) => list.into_iter().map(i64::from).collect(),
            Property::ListUShort(list) => list.into_iter().map(i64::from).collect(),
            Property::ListInt(list) => list.into_iter().map(i64::from).collect(),
            Property::ListUInt(list) => list.into_iter().map(i64::from).collect(),
            _ => vec![-1],
        };
        PropertyAccessResult::Set
    }
}

/// What is not needed.
struct Other;

impl PropertyAccess for Other {
    fn new() -> Self {
        Self
    }
}

/// The triangles; larger faces are split.
///
/// # Errors
/// If it is damaged or too large.
pub fn triangles(bytes: &[u8]) -> Result<Triangles> {
    let complain = |what: &dyn std::fmt::Display| {
        let line = what.to_string().split_whitespace().collect::<Vec<_>>().join(" ");
        Error::input(format!("not a valid PLY file: {}", line.chars().take(200).collect::<String>()))
    };
    let mut reader = Reader::new(bytes);
    let header = Parser::<Other>::new().read_header(&mut reader).map_err(|e| complain(&e))?;
    let (mut vertices, mut faces) = (Vec::new(), Vec::new());
    for (name, element) in &header.elements {
        // Each takes a byte at least.
        if element.count > bytes.len() || (element.count > 0 && element.properties.is_empty()) {
            let what = format!("{} elements {name:?} do not fit into it", element.count);
            return Err(complain(&what));
        }
        match name.as_str() {
            "vertex" => {
                ensure_few(element.count)?;
                let parser = Parser::<Vertex>::new();
                vertices = parser
                    .read_payload_for_element(&mut reader, element, &header)
                    .map_err(|e| complain(&e))?;
            }
            "face" => {
                ensure_few(element.count)?;
                let parser = Parser::<Face>::new();
                faces = parser
                    .read_payload_for_element(&mut reader, element, &header)
                    .map_err(|e| complain(&e))?;
            }
            _ => {
                let parser = Parser::<Other>::new();
                parser.read_payload_for_element(&mut reader, element, &header).map_err(|e| complain(&e))?;
            }
        }
    }
    let mut triangles = Vec::with_capacity(faces.len().min(MOST_TRIANGLES));
    let mut splitter = Splitter::default();
    for Face(face) in &faces {
        let corner = |i: &i64| usize::try_from(*i).ok().and_then(|i| vertices.get(i)).map(|vertex| vertex.0);
        let corners: Option<Vec<[f64; 3]>> = face.iter().map(corner).collect();
        let Some(corners) = corners else {
            return Err(complain(&"a face with a vertex that does not exist"));
        };
        splitter.split(&corners, &mut triangles)?;
        ensure_few(triangles.len())?;
    }
    Ok(triangles)
}
