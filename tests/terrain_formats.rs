//! Every format of heightmaps: the same ground from each, places told by the file, and refusals.

use std::fs;

use crate::common::inputs::*;
use proptest::prelude::*;
use warpgait::files::npz::NpzWriter;
use warpgait::heightfield::Grid;

/// A file with this content in a folder of its own, and the ground that it is.
fn ground_of(name: &str, content: &[u8], keys: &str) -> warpgait::terrain::Ground {
    let folder = tempfile::tempdir().unwrap();
    fs::write(folder.path().join(name), content).unwrap();
    ground(&format!("file = \"{name}\"\n{keys}"), folder.path())
}

fn has_note(ground: &warpgait::terrain::Ground, part: &str) -> bool {
    ground.report.notes.iter().any(|note| note.contains(part))
}

/// An archive with these members.
fn npz(members: &[(&str, &[usize], &[f64])], layout: Option<&str>) -> Vec<u8> {
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

const CORNER: [f64; 2] = [2.0 - 3.0 * SPACING, 1.0 - 2.0 * SPACING];

#[test]
fn archives_tell_spacing_origin_and_layout() {
    for layout in ["picture", "y-up", "x-y", "grid-map"] {
        let (shape, values) = stored(layout);
        let bytes = npz(
            &[
                ("elevation", &shape, &values),
                ("resolution", &[], &[SPACING]),
                ("origin", &[2], &CORNER),
                ("more", &[3], &[0.0; 3]),
            ],
            Some(layout),
        );
        assert_is_the_ground(&ground_of("a.npz", &bytes, ""), [2.0, 1.0], 1e-15);
        let keys = "origin = [0.0, 0.0]\nspacing = 0.04";
        let other = ground_of("a.npz", &bytes, keys);
        assert!(
            has_note(&other, "terrain.spacing = 0.04 is used, although the file tells 0.02 m"),
            "{:?}",
            other.report.notes
        );
        assert!((other.report.extent[1] - 0.12).abs() < 1e-12);
    }
    let (shape, values) = stored("picture");
    let two = npz(&[("a", &shape, &values), ("b", &shape, &values)], None);
    assert_refused(
        "a.npz",
        &two,
        "",
        &["s.toml:5: terrain.member: missing", "2 arrays of two dimensions: a, b"],
    );
    assert_refused("a.npz", &two, "member = \"c\"", &["s.toml:8: terrain.member", "no \"c\"", "a, b"]);
    let keys = format!("member = \"b\"\nspacing = {SPACING}\norigin = [1.0, 0.0]");
    assert_is_the_ground(&ground_of("a.npz", &two, &keys), [1.0, 0.0], 1e-15);
    assert_refused(
        "a.npz",
        &two,
        "member = \"b\"",
        &["terrain.spacing: missing; a NumPy archive does not tell it"],
    );
    assert_refused("a.npz", &two[..two.len() / 2], "member = \"b\"", &["not an .npz archive, or truncated"]);
    let wrong = npz(&[("a", &shape, &values)], Some("upside-down"));
    assert_refused(
        "a.npz",
        &wrong,
        "spacing = 0.1",
        &["\"layout\": given \"upside-down\"", "picture, y-up, x-y, grid-map"],
    );
}

#[test]
fn the_ground_of_a_plan_is_read_back_as_it_was() {
    let folder = tempfile::tempdir().unwrap();
    let (shape, values) = stored("x-y");
    fs::write(folder.path().join("a.npy"), floats(&shape, &values)).unwrap();
    let keys = format!(
        "file = \"a.npy\"\nspacing = {SPACING}\nlayout = \"x-y\"\norigin = [3.0, -1.0]\nsmoothing = 0.02"
    );
    let first = ground(&keys, folder.path());
    let Grid { rows, columns, origin, spacing } = first.field.grid().clone();
    let raw = first.raw.clone().unwrap();
    // As a plan holds it, also saved alone.
    let members = [
        ("heightfield", &[rows, columns][..], first.field.samples()),
        ("heightfield_raw", &[rows, columns], &raw),
        ("heightfield_origin", &[2], &origin[..]),
        ("heightfield_spacing", &[2], &spacing[..]),
    ];
    let from_plan = ground_of("p.plan.npz", &npz(&members, None), "");
    let alone = format!("spacing = {SPACING}\nlayout = \"y-up\"\norigin = [3.0, -1.0]");
    let from_array = ground_of("raw.npy", &floats(&[rows, columns], &raw), &alone);
    let smooth = ground_of("p.plan.npz", &npz(&members, None), "member = \"heightfield\"");
    for (other, expected) in [(&from_plan, &raw[..]), (&from_array, &raw), (&smooth, first.field.samples())] {
        for (a, b) in other.report.extent.iter().zip(first.report.extent) {
            assert!((a - b).abs() < 1e-12);
        }
        assert_eq!(other.raw.as_ref().unwrap().len(), expected.len());
        for (a, b) in other.raw.as_ref().unwrap().iter().zip(expected) {
            assert!((a - b).abs() < 1e-12, "{a} {b}");
        }
    }
}

#[test]
fn text_grids_are_read_with_every_separator() {
    let (_, values) = stored("picture");
    let keys = format!("spacing = {SPACING}");
    for separator in [",", ", ", ";", "\t", " ", "   "] {
        let rows: Vec<String> = values
            .chunks(COLUMNS)
            .map(|row| row.iter().map(f64::to_string).collect::<Vec<_>>().join(separator))
            .collect();
        let text = format!("# heights\n\n{}\r\n", rows.join("\r\n"));
        assert_is_the_ground(&ground_of("a.csv", text.as_bytes(), &keys), [0.0; 2], 1e-15);
    }
    let named = "a,b,c,d\n1,2,3,4\n1,2,,4\n1,nan,3,4\n1,2,3,4\n".to_owned();
    assert_eq!(ground_of("a.csv", named.as_bytes(), &keys).report.holes_filled, 2);
    for (text, part) in [
        ("1 2 3 4\n1 2 3\n", "line 2: 3 numbers, but 4 in the first row"),
        ("1 2 3 4\n1 2 x 4\n", "line 2: \"x\" is no number"),
        ("0,5;1,5;2,5;3,5\n", "not a format"),
        ("1 2 3 4\n1 2 inf 4\n", "line 2: inf is no height"),
        ("0 0 1\n0 1 2\n0 2 3\n0 3 3\n", "a list of points"),
        ("1 2 3 4\n1 2 3 4\n1 2 3 4\n", "4 x 3 cells are too few"),
    ] {
        assert_refused("a.txt", text.as_bytes(), &keys, &[part]);
    }
}

#[test]
fn esri_grids_tell_their_place() {
    let (_, values) = stored("picture");
    let rows: Vec<String> = values
        .chunks(COLUMNS)
        .map(|row| row.iter().map(f64::to_string).collect::<Vec<_>>().join(" "))
        .collect();
    let body = rows.join("\n");
    let head = |place: String| {
        format!("NCOLS {COLUMNS}\nNROWS {ROWS}\n{place}\nCELLSIZE {SPACING}\nNODATA_value -9999\n{body}\n")
    };
    let corner = format!("xllcorner {}\nyllcorner {}", CORNER[0] - 0.5 * SPACING, CORNER[1] - 0.5 * SPACING);
    let center = format!("xllcenter {}\nyllcenter {}", CORNER[0], CORNER[1]);
    for place in [corner, center] {
        assert_is_the_ground(&ground_of("a.asc", head(place).as_bytes(), ""), [2.0, 1.0], 1e-15);
    }
    let far = head("xllcorner 456789\nyllcorner 5400000".into());
    let found = ground_of("a.asc", far.as_bytes(), "");
    assert_is_the_ground(&found, [0.0, 0.0], 1e-15);
    assert!(has_note(&found, "x = 456789.07, y = 5400000.05 m"), "{:?}", found.report.notes);
    let hole = head("xllcorner 0\nyllcorner 0".into()).replacen("0.021", "-9999", 1);
    assert_eq!(ground_of("a.asc", hole.as_bytes(), "").report.holes_filled, 1);
    // Cells of 4 x 2 cm become square ones of 2 cm.
    let oblong = head(String::new()).replace(&format!("CELLSIZE {SPACING}"), "dx 0.04\ndy 0.02");
    let found = ground_of("a.asc", oblong.as_bytes(), "");
    assert_eq!((found.report.grid, has_note(&found, "square")), ([13, 5], true));
    for (text, part) in [
        (head(String::new()).replace("NROWS 5", "NROWS 6"), "35 values, fewer than"),
        (head(String::new()).replace("NROWS 5", "NROWS 4"), "more values than"),
        (head(String::new()).replace("NROWS 5", "NROWS 9999999"), "too many"),
        (head(String::new()).replace("NROWS 5", "NROWS x"), "line 2: \"x\" is no number"),
        (
            head(String::new()).replace("CELLSIZE 0.02", "CELLSIZE 30"),
            "the file tells 30 m, but allowed are 0.001 to 10",
        ),
    ] {
        assert_refused("a.asc", text.as_bytes(), "", &[part]);
    }
}

/// A TIFF file of one strip, little endian: its tags with type, count and value, and the samples.
fn tiff(tags: &[(u16, u16, Vec<u8>)], samples: &[u8]) -> Vec<u8> {
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

fn short(v: u16) -> Vec<u8> {
    v.to_le_bytes().to_vec()
}

fn doubles(values: &[f64]) -> Vec<u8> {
    values.iter().flat_map(|v| v.to_le_bytes()).collect()
}

/// The tags of a gray image of `COLUMNS` x `ROWS`; 1 are unsigned, 2 signed integers, 3 floats.
fn gray_tags(bits: u16, format: u16) -> Vec<(u16, u16, Vec<u8>)> {
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

#[test]
fn tiffs_hold_floats_and_integers_with_their_place() {
    let (_, values) = stored("picture");
    let float: Vec<u8> = values.iter().flat_map(|v| (*v as f32).to_le_bytes()).collect();
    let plain = tiff(&gray_tags(32, 3), &float);
    let keys = format!("spacing = {SPACING}");
    assert_is_the_ground(&ground_of("a.tif", &plain, &keys), [0.0; 2], 1e-7);
    assert_refused("a.tif", &plain, "", &["terrain.spacing: missing; a TIFF file does not tell it"]);

    // The corner of the first cell's area, and the center of the first cell.
    let top = CORNER[1] + 4.0 * SPACING;
    let areas = [0.0, 0.0, 0.0, CORNER[0] - 0.5 * SPACING, top + 0.5 * SPACING, 0.0];
    let points = [0.0, 0.0, 0.0, CORNER[0], top, 0.0];
    let keys_of = |raster: u16, model: u16| {
        [1, 1, 0, 2, 1024, 0, 1, model, 1025, 0, 1, raster].map(u16::to_le_bytes).concat()
    };
    for (tie, raster) in [(areas, 1), (points, 2)] {
        let mut tags = gray_tags(32, 3);
        tags.push((33550, 12, doubles(&[SPACING, SPACING, 0.0])));
        tags.push((33922, 12, doubles(&tie)));
        tags.push((34735, 3, keys_of(raster, 1)));
        assert_is_the_ground(&ground_of("a.tif", &tiff(&tags, &float), ""), [2.0, 1.0], 1e-7);
        tags.pop();
        tags.push((34735, 3, keys_of(raster, 2)));
        let found = ground_of("a.tif", &tiff(&tags, &float), &keys);
        assert!(has_note(&found, "in degrees"));
    }

    let mut tags = gray_tags(16, 2);
    tags.push((42113, 2, b"-32768\0".to_vec()));
    let integers: Vec<i16> = values
        .iter()
        .enumerate()
        .map(|(i, v)| if i == 8 { -32768 } else { (v * 1e4).round() as i16 })
        .collect();
    let bytes: Vec<u8> = integers.iter().flat_map(|v| v.to_le_bytes()).collect();
    assert_refused(
        "a.tif",
        &tiff(&tags, &bytes),
        &keys,
        &["terrain.height_scale: missing; a TIFF file needs it: of int16"],
    );
    let found = ground_of("a.tif", &tiff(&tags, &bytes), &format!("{keys}\nheight_scale = 1e-4"));
    assert_eq!(found.report.holes_filled, 1);
    for length in (0..plain.len()).step_by(3) {
        refusal("a.tif", &plain[..length], &keys);
    }
}

/// MuJoCo's binary file.
fn hfield(rows: i32, columns: i32, values: &[f64]) -> Vec<u8> {
    let head = [rows.to_le_bytes(), columns.to_le_bytes()].concat();
    [head, values.iter().flat_map(|v| (*v as f32).to_le_bytes()).collect()].concat()
}

/// The least and the greatest of `heights()`, m.
const LOW: f64 = 0.0;
const HIGH: f64 = 0.076;

#[test]
fn height_fields_of_mujoco_are_normalized_as_mujoco_does() {
    let (_, upward) = stored("y-up");
    // In a unit and from a zero of its own.
    let values: Vec<f64> = upward.iter().map(|h| 3.0 + 2.0 * h).collect();
    let binary = hfield(ROWS as i32, COLUMNS as i32, &values);
    let keys = format!("spacing = {SPACING}");
    assert_refused("a.bin", &binary, &keys, &["terrain.height_scale: missing", "least to the greatest"]);
    let found = ground_of("a.bin", &binary, &format!("{keys}\nheight_scale = {}", HIGH - LOW));
    assert_is_the_ground(&found, [0.0; 2], 1e-7);

    let (_, downward) = stored("picture");
    let text: Vec<String> = downward.iter().map(|h| (3.0 + 2.0 * h).to_string()).collect();
    let levels: Vec<u8> = downward.iter().map(|h| (1000.0 * h).round() as u8 + 7).collect();
    let picture =
        png(png::ColorType::Grayscale, png::BitDepth::Eight, [COLUMNS as u32, ROWS as u32], None, &levels);
    let size = format!("size=\"{} {} {} 0.1\"", 3.0 * SPACING, 2.0 * SPACING, HIGH - LOW);
    let model = |field: &str, more: &str| {
        format!(
            "<?xml version=\"1.0\"?>\n<!-- ground --><mujoco><compiler meshdir=\"data\"/><asset><hfield name=\"g\" {size} {field}/>{more}</asset>\
             <worldbody><body pos=\"1 0 0.5\"><geom type=\"hfield\" hfield=\"g\" pos=\"1 1 0\" quat=\"1 0 0 0\"/></body></worldbody></mujoco>"
        )
    };
    let elevation = format!("nrow=\"{ROWS}\" ncol=\"{COLUMNS}\" elevation=\"{}\"", text.join(" "));
    for (field, inputs) in [("file=\"g.bin\"", 2), ("file=\"g.png\"", 2), (&elevation, 1)] {
        let folder = tempfile::tempdir().unwrap();
        fs::create_dir(folder.path().join("data")).unwrap();
        fs::write(folder.path().join("data/g.bin"), &binary).unwrap();
        fs::write(folder.path().join("data/g.png"), &picture).unwrap();
        fs::write(folder.path().join("m.xml"), model(field, "")).unwrap();
        let mut found = ground("file = \"m.xml\"", folder.path());
        assert_eq!(found.inputs.len(), inputs);
        found.raw.as_mut().unwrap().iter_mut().for_each(|h| *h -= 0.5);
        assert_is_the_ground(&found, [2.0, 1.0], 1e-7);
    }
    let turned = model(&elevation, "").replace("quat=\"1 0 0 0\"", "euler=\"0 0 90\"");
    assert_refused("m.xml", turned.as_bytes(), "", &["hfield \"g\": euler turns it"]);
    let two = model(&elevation, "<hfield name=\"h\" size=\"1 1 1 1\"/>");
    assert_refused("m.xml", two.as_bytes(), "", &["terrain.member: missing", "g, h"]);
    assert_refused("m.xml", two.as_bytes(), "member = \"i\"", &["no hfield \"i\"", "g, h"]);
    assert_refused("m.xml", two.as_bytes(), "member = \"h\"", &["hfield \"h\": nrow is missing"]);
    assert_refused("m.xml", b"<mujoco/>", "", &["a MuJoCo model without hfield"]);
    assert_refused("m.xml", b"<mujoco><a", "", &["not XML"]);
    let deep = format!("<mujoco>{}", "<a>".repeat(300_000));
    assert_refused("m.xml", deep.as_bytes(), "", &["more than 200 deep"]);
    let entities = b"<!DOCTYPE m [<!ENTITY a \"aa\"><!ENTITY b \"&a;&a;\">]><mujoco>&b;</mujoco>";
    assert_refused("m.xml", entities, "", &["not XML"]);
}

/// Vertices and faces (from 0) of the ground as a mesh whose vertices are its cells.
fn mesh() -> (Vec<[f64; 3]>, Vec<[usize; 3]>) {
    let vertex = |k: usize| {
        let (i, j) = (k % COLUMNS, k / COLUMNS);
        [CORNER[0] + SPACING * i as f64, CORNER[1] + SPACING * j as f64, height(i, j)]
    };
    let faces = (0..COLUMNS - 1).flat_map(|i| (0..ROWS - 1).map(move |j| j * COLUMNS + i));
    let faces = faces.flat_map(|k| [[k, k + 1, k + COLUMNS], [k + 1, k + COLUMNS + 1, k + COLUMNS]]);
    ((0..COLUMNS * ROWS).map(vertex).collect(), faces.collect())
}

fn obj(vertices: &[[f64; 3]], faces: &[[usize; 3]]) -> Vec<u8> {
    let mut text = String::from("# a mesh\nmtllib none.mtl\no ground\n");
    for [x, y, z] in vertices {
        text += &format!("v {x} {y} {z}\n");
    }
    for [a, b, c] in faces {
        text += &format!("f {}/1/1 {}/1 {}\n", a + 1, b + 1, c + 1).replace("/1/1", "").replace("/1", "");
    }
    text.into_bytes()
}

fn stl(vertices: &[[f64; 3]], faces: &[[usize; 3]]) -> Vec<u8> {
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

fn stl_text(vertices: &[[f64; 3]], faces: &[[usize; 3]]) -> Vec<u8> {
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

fn ply(vertices: &[[f64; 3]], faces: &[[usize; 3]], format: &str) -> Vec<u8> {
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

#[test]
fn meshes_are_seen_from_above() {
    let (vertices, faces) = mesh();
    let keys = format!("spacing = {SPACING}");
    let files = [
        ("a.obj", obj(&vertices, &faces), 1e-12),
        ("a.stl", stl(&vertices, &faces), 1e-6),
        ("a.stl", stl_text(&vertices, &faces), 1e-6),
        ("a.ply", ply(&vertices, &faces, "ascii"), 1e-12),
        ("a.ply", ply(&vertices, &faces, "binary_little_endian"), 1e-12),
        ("a.ply", ply(&vertices, &faces, "binary_big_endian"), 1e-12),
    ];
    for (name, bytes, tolerance) in &files {
        let found = ground_of(name, bytes, &format!("{keys}\norigin = [2.0, 1.0]"));
        assert_is_the_ground(&found, [2.0, 1.0], *tolerance);
        assert!(found.report.notes.is_empty(), "{:?}", found.report.notes);
        let its_own = ground_of(name, bytes, &keys);
        assert!((its_own.report.extent[0] - CORNER[0]).abs() < 1e-6);
        assert_refused(
            name,
            bytes,
            "",
            &["s.toml:5: terrain.spacing: missing; a mesh of 0.120 x 0.080 x 0.076 m"],
        );
        for length in (0..bytes.len()).step_by(13) {
            let folder = tempfile::tempdir().unwrap();
            fs::write(folder.path().join(name), &bytes[..length]).unwrap();
            let _ = try_ground(&format!("file = \"{name}\"\n{keys}"), folder.path());
        }
    }
    let inside_out: Vec<[usize; 3]> = faces.iter().map(|[a, b, c]| [*a, *c, *b]).collect();
    let found = ground_of("a.obj", &obj(&vertices, &inside_out), &keys);
    assert!(has_note(&found, "look down"), "{:?}", found.report.notes);
    let huge = b"ply\nformat binary_little_endian 1.0\nelement vertex 3000000\nend_header\n".to_vec();
    assert_refused("a.ply", &huge, &keys, &["3000000 elements \"vertex\" do not fit"]);
    assert_refused("a.obj", b"v 0 0 0\nv 1 0 0\nv 0 1 0\nf 1 2 4\n", &keys, &["not a valid OBJ file"]);
    assert_refused("a.obj", b"v 0 0 0\nv 1 0 0\n", &keys, &["a mesh without faces"]);
    assert_refused("a.obj", &obj(&vertices, &faces), "spacing = 1.0", &["given 1", "too few"]);
}

/// A box from `low` to `high`: vertices and faces that look outward.
fn solid(low: [f64; 3], high: [f64; 3]) -> (Vec<[f64; 3]>, Vec<[usize; 3]>) {
    let corner = |k: usize| [0, 1, 2].map(|axis| if k >> axis & 1 == 1 { high[axis] } else { low[axis] });
    let quads = [[0, 2, 3, 1], [4, 5, 7, 6], [0, 1, 5, 4], [2, 6, 7, 3], [0, 4, 6, 2], [1, 3, 7, 5]];
    let faces = quads.into_iter().flat_map(|[a, b, c, d]| [[a, b, c], [a, c, d]]);
    ((0..8).map(corner).collect(), faces.collect())
}

fn joined(parts: &[(Vec<[f64; 3]>, Vec<[usize; 3]>)]) -> Vec<u8> {
    let (mut vertices, mut faces) = (Vec::new(), Vec::new());
    for (v, f) in parts {
        faces.extend(f.iter().map(|face| face.map(|i| i + vertices.len())));
        vertices.extend(v);
    }
    obj(&vertices, &faces)
}

#[test]
fn only_what_a_robot_could_stand_on_is_hidden_ground() {
    let floor = solid([-1.0, -1.0, -0.1], [1.0, 1.0, 0.0]);
    let keys = "spacing = 0.05";
    for (height, hidden) in [(0.0, false), (-0.05, false), (0.3, true)] {
        // A block on the floor, sunk into it, and as the top of a table.
        let bytes = joined(&[floor.clone(), solid([-0.5, -0.5, height], [0.5, 0.5, height + 0.2])]);
        let found = ground_of("a.obj", &bytes, keys);
        let note = found.report.notes.iter().find(|note| note.contains("overhangs"));
        assert_eq!(note.is_some(), hidden, "{height}: {:?}", found.report.notes);
        assert!((found.field.height(0.0, 0.0) - height - 0.2).abs() < 1e-6);
        if let Some(note) = note {
            assert!(
                note.contains("in 400 cells (25.0 %)")
                    && note.contains("the surface at 0.500 m hides ground 0.500 m below"),
                "{note}"
            );
        }
    }
    let sheet = |z: f64, half: f64| {
        let corner =
            |k: usize| [if k & 1 == 1 { half } else { -half }, if k & 2 == 2 { half } else { -half }, z];
        ((0..4).map(corner).collect::<Vec<_>>(), vec![[0, 1, 3], [0, 3, 2]])
    };
    let found = ground_of("a.obj", &joined(&[sheet(0.0, 1.0), sheet(0.4, 0.3)]), keys);
    assert!(has_note(&found, "hides ground 0.400 m below"), "{:?}", found.report.notes);
    // Two sheets side by side leave the middle open.
    let beside = |(mut vertices, faces): (Vec<[f64; 3]>, Vec<[usize; 3]>), x: f64| {
        vertices.iter_mut().for_each(|v| v[0] += x);
        (vertices, faces)
    };
    let found =
        ground_of("a.obj", &joined(&[beside(sheet(0.0, 0.5), -0.62), beside(sheet(0.0, 0.5), 0.63)]), keys);
    assert!(
        has_note(&found, "rays from above meet no face") && found.report.holes_filled > 0,
        "{:?}",
        found.report.notes
    );
}

/// One small valid file of each format, with the keys that it needs.
fn samples() -> Vec<(&'static str, Vec<u8>)> {
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

#[test]
fn samples_are_valid() {
    for (name, bytes) in samples() {
        ground_of(name, &bytes, "spacing = 0.02\nheight_scale = 0.1\nno_data = -1.0");
    }
}

proptest! {
    #![proptest_config(ProptestConfig { cases: 300, ..Default::default() })]

    /// No bytes, and no change of a few bytes of a valid file, make a reader panic.
    #[test]
    fn no_bytes_make_a_reader_panic(
        which in 0..14_usize,
        changes in prop::collection::vec((any::<prop::sample::Index>(), any::<u8>()), 1..6),
        cut in any::<prop::sample::Index>(),
        noise in prop::collection::vec(any::<u8>(), 0..400),
        mode in 0..4,
    ) {
        let (name, mut bytes) = samples().swap_remove(which);
        match mode {
            0 => bytes = noise,
            1 => bytes.truncate(cut.index(bytes.len())),
            2 => { let at = cut.index(bytes.len()); bytes.truncate(at); bytes.extend(noise); }
            _ => for (at, value) in changes { let at = at.index(bytes.len()); bytes[at] = value; },
        }
        let folder = tempfile::tempdir().unwrap();
        fs::write(folder.path().join(name), &bytes).unwrap();
        let text = format!("file = \"{name}\"\nspacing = 0.02\nheight_scale = 0.1");
        if let Err(error) = try_ground(&text, folder.path()) {
            let message = error.to_string();
            prop_assert!(message.starts_with("s.toml:") && !message.contains('\n'), "{}", message);
        }
    }
}
