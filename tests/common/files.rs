//! Files of ground in many formats, made by hand.

use std::fs;

use warpgait::files::npz::NpzWriter;

use super::inputs::*;

/// A file with this content in a folder of its own, and the ground that it is.
pub fn ground_of(name: &str, content: &[u8], keys: &str) -> warpgait::terrain::Ground {
    let folder = tempfile::tempdir().unwrap();
    fs::write(folder.path().join(name), content).unwrap();
    ground(&format!("file = \"{name}\"\n{keys}"), folder.path())
}

pub fn has_note(ground: &warpgait::terrain::Ground, part: &str) -> bool {
    ground.report.notes.iter().any(|note| note.contains(part))
}

/// An archive with these members.
pub fn npz(members: &[(&str, &[usize], &[f64])], layout: Option<&str>) -> Vec<u8> {
    let folder = tempfile::tempdir().unwrap();
    let path = folder.path().join("a.npz");
    let mut npz = NpzWriter::create(&path).unwrap();
    for (name, shape, values) in members {
        npz.add_f64(name, shape, values.iter().copied()).unwrap();
    }
    if let Some(layout) = layout {
        npz.add_str("layout", &[], &[layout.to_owned()]).unwrap();
    }
    npz.finish().unwrap();
    fs::read(path).unwrap()
}

pub const CORNER: [f64; 2] = [2.0 - 3.0 * SPACING, 1.0 - 2.0 * SPACING];

/// A TIFF file of one strip, little endian: its tags with type, count and value, and the samples.
pub fn tiff(tags: &[(u16, u16, Vec<u8>)], samples: &[u8]) -> Vec<u8> {
    let mut tags = tags.to_vec();
    let long = |v: usize| (v as u32).to_le_bytes().to_vec();
    tags.push((273, 4, long(0)));
    tags.push((279, 4, long(samples.len())));
    tags.sort();
    let width = |kind: u16| match kind {
        3 => 2,
        4 => 4,
        12 => 8,
        _ => 1,
    };
    let mut bytes = b"II*\0\x08\0\0\0".to_vec();
    bytes.extend((tags.len() as u16).to_le_bytes());
    let after = 8 + 2 + 12 * tags.len() + 4;
    let outside: usize = tags.iter().map(|(.., v)| if v.len() > 4 { v.len() } else { 0 }).sum();
    let mut at = after;
    let mut values = Vec::new();
    for (tag, kind, value) in &tags {
        let value = if *tag == 273 { long(after + outside) } else { value.clone() };
        bytes.extend(tag.to_le_bytes());
        bytes.extend(kind.to_le_bytes());
        bytes.extend(((value.len() / width(*kind)) as u32).to_le_bytes());
        if value.len() > 4 {
            bytes.extend((at as u32).to_le_bytes());
            at += value.len();
            values.extend(value);
        } else {
            bytes.extend(value.iter().copied().chain([0; 4]).take(4));
        }
    }
    bytes.extend([0; 4]);
    [bytes, values, samples.to_vec()].concat()
}

pub fn short(v: u16) -> Vec<u8> {
    v.to_le_bytes().to_vec()
}

pub fn doubles(values: &[f64]) -> Vec<u8> {
    values.iter().flat_map(|v| v.to_le_bytes()).collect()
}

/// The tags of a gray image of `COLUMNS` x `ROWS`; 1 are unsigned, 2 signed integers, 3 floats.
pub fn gray_tags(bits: u16, format: u16) -> Vec<(u16, u16, Vec<u8>)> {
    vec![
        (256, 3, short(COLUMNS as u16)),
        (257, 3, short(ROWS as u16)),
        (258, 3, short(bits)),
        (259, 3, short(1)),
        (262, 3, short(1)),
        (277, 3, short(1)),
        (278, 3, short(ROWS as u16)),
        (339, 3, short(format)),
    ]
}

/// MuJoCo's binary file.
pub fn hfield(rows: i32, columns: i32, values: &[f64]) -> Vec<u8> {
    let head = [rows.to_le_bytes(), columns.to_le_bytes()].concat();
    [head, values.iter().flat_map(|v| (*v as f32).to_le_bytes()).collect()].concat()
}

/// Vertices, and faces of the vertices with these numbers, from 0.
pub type Mesh = (Vec<[f64; 3]>, Vec<[usize; 3]>);

/// Vertices and faces (from 0) of the ground as a mesh whose vertices are its cells.
pub fn mesh() -> Mesh {
    let vertex = |k: usize| {
        let (i, j) = (k % COLUMNS, k / COLUMNS);
        [CORNER[0] + SPACING * i as f64, CORNER[1] + SPACING * j as f64, height(i, j)]
    };
    let faces = (0..COLUMNS - 1).flat_map(|i| (0..ROWS - 1).map(move |j| j * COLUMNS + i));
    let faces = faces.flat_map(|k| [[k, k + 1, k + COLUMNS], [k + 1, k + COLUMNS + 1, k + COLUMNS]]);
    ((0..COLUMNS * ROWS).map(vertex).collect(), faces.collect())
}

pub fn obj(vertices: &[[f64; 3]], faces: &[[usize; 3]]) -> Vec<u8> {
    let mut text = String::from("# a mesh\nmtllib none.mtl\no ground\n");
    for [x, y, z] in vertices {
        text += &format!("v {x} {y} {z}\n");
    }
    for [a, b, c] in faces {
        text += &format!("f {}/1/1 {}/1 {}\n", a + 1, b + 1, c + 1).replace("/1/1", "").replace("/1", "");
    }
    text.into_bytes()
}

pub fn stl(vertices: &[[f64; 3]], faces: &[[usize; 3]]) -> Vec<u8> {
    // A comment as that of a file in text, as some programs write it.
    let mut bytes = b"solid".to_vec();
    bytes.resize(80, b' ');
    bytes.extend((faces.len() as u32).to_le_bytes());
    for face in faces {
        bytes.extend([0; 12]);
        bytes.extend(face.iter().flat_map(|i| vertices[*i]).flat_map(|v| (v as f32).to_le_bytes()));
        bytes.extend([0; 2]);
    }
    bytes
}

pub fn stl_text(vertices: &[[f64; 3]], faces: &[[usize; 3]]) -> Vec<u8> {
    let mut text = String::from("solid ground\n");
    for face in faces {
        text += "facet normal 0 0 1\nouter loop\n";
        for [x, y, z] in face.map(|i| vertices[i]) {
            text += &format!("vertex {x} {y} {z}\n");
        }
        text += "endloop\nendfacet\n";
    }
    (text + "endsolid ground\n").into_bytes()
}

pub fn ply(vertices: &[[f64; 3]], faces: &[[usize; 3]], format: &str) -> Vec<u8> {
    let mut bytes = format!(
        "ply\nformat {format} 1.0\ncomment ground\nelement vertex {}\nproperty double x\nproperty double y\nproperty double z\nproperty uchar red\n\
         element face {}\nproperty list uchar int vertex_indices\nend_header\n",
        vertices.len(),
        faces.len()
    )
    .into_bytes();
    for [x, y, z] in vertices {
        match format {
            "ascii" => bytes.extend(format!("{x} {y} {z} 7\n").bytes()),
            "binary_little_endian" => bytes.extend([x, y, z].iter().flat_map(|v| v.to_le_bytes()).chain([7])),
            _ => bytes.extend([x, y, z].iter().flat_map(|v| v.to_be_bytes()).chain([7])),
        }
    }
    for face in faces {
        let [a, b, c] = face;
        let indices = face.map(|i| i as i32);
        match format {
            "ascii" => bytes.extend(format!("3 {a} {b} {c}\n").bytes()),
            "binary_little_endian" => {
                bytes.extend([3].into_iter().chain(indices.into_iter().flat_map(i32::to_le_bytes)))
            }
            _ => bytes.extend([3].into_iter().chain(indices.into_iter().flat_map(i32::to_be_bytes))),
        }
    }
    bytes
}

/// One small valid file of each format, with the keys that it needs.
pub fn samples() -> Vec<(&'static str, Vec<u8>)> {
    let (shape, values) = stored("picture");
    let (vertices, faces) = mesh();
    let levels: Vec<u8> = (0..35).collect();
    let float: Vec<u8> = values.iter().flat_map(|v| (*v as f32).to_le_bytes()).collect();
    let line = |separator: &str| {
        let row = |row: &[f64]| row.iter().map(f64::to_string).collect::<Vec<_>>().join(separator);
        values.chunks(COLUMNS).map(row).collect::<Vec<_>>().join("\n")
    };
    let xml = format!(
        "<mujoco><asset><hfield name=\"g\" size=\"1 1 1 1\" nrow=\"5\" ncol=\"7\" elevation=\"{}\"/></asset><worldbody><geom hfield=\"g\"/></worldbody></mujoco>",
        line(" ").replace('\n', " ")
    );
    vec![
        ("a.png", png(png::ColorType::Grayscale, png::BitDepth::Eight, [7, 5], None, &levels)),
        (
            "b.png",
            png(png::ColorType::Indexed, png::BitDepth::Four, [7, 5], Some(&[0, 0, 0, 9, 9, 9]), &[0x10; 20]),
        ),
        ("a.tif", tiff(&gray_tags(32, 3), &float)),
        ("a.npy", floats(&shape, &values)),
        ("a.npz", npz(&[("a", &shape, &values), ("spacing", &[], &[0.02])], Some("y-up"))),
        ("a.csv", line(",").into_bytes()),
        ("a.asc", format!("ncols 7\nnrows 5\ncellsize 0.02\n{}", line(" ")).into_bytes()),
        ("a.xml", xml.into_bytes()),
        ("a.bin", hfield(5, 7, &values)),
        ("a.obj", obj(&vertices, &faces)),
        ("a.stl", stl(&vertices, &faces)),
        ("b.stl", stl_text(&vertices, &faces)),
        ("a.ply", ply(&vertices, &faces, "ascii")),
        ("b.ply", ply(&vertices, &faces, "binary_little_endian")),
    ]
}
