//! Meshes as ground: seen from above, with holes and what overhangs hide.

use std::fs;

use crate::common::files::*;
use crate::common::inputs::*;

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
    let mut far = vertices.clone();
    far[0] = [400.0, 300.0, 0.0];
    let parts = ["a mesh of 398.0", "rays from above meet no face; perhaps a vertex is far away"];
    assert_refused("a.obj", &obj(&far, &faces), "spacing = 0.5", &parts);
    assert_refused("a.obj", &obj(&far, &faces), "spacing = 0.16", &["are too many: at most 4000000 in all"]);
    assert_refused("a.obj", b"v 0 0 0\nv 1 0 0\nv 0 1 0\nf 1 2 4\n", &keys, &["not a valid OBJ file"]);
    assert_refused("a.obj", b"v 0 0 0\nv 1 0 0\n", &keys, &["a mesh without faces"]);
    assert_refused("a.obj", &obj(&vertices, &faces), "spacing = 1.0", &["given 1", "too few"]);
}

/// A box from `low` to `high`: vertices and faces that look outward.
fn solid(low: [f64; 3], high: [f64; 3]) -> Mesh {
    let corner = |k: usize| [0, 1, 2].map(|axis| if k >> axis & 1 == 1 { high[axis] } else { low[axis] });
    let quads = [[0, 2, 3, 1], [4, 5, 7, 6], [0, 1, 5, 4], [2, 6, 7, 3], [0, 4, 6, 2], [1, 3, 7, 5]];
    let faces = quads.into_iter().flat_map(|[a, b, c, d]| [[a, b, c], [a, c, d]]);
    ((0..8).map(corner).collect(), faces.collect())
}

fn joined(parts: &[Mesh]) -> Vec<u8> {
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
    let beside = |(mut vertices, faces): Mesh, x: f64| {
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

#[test]
fn concave_faces_cover_only_their_inside() {
    let keys = "spacing = 0.1";
    let corners = [
        [-2.0, -1.0],
        [-0.35, -1.0],
        [-0.35, 0.9],
        [0.35, 0.9],
        [0.35, -1.0],
        [2.0, -1.0],
        [2.0, 1.0],
        [-2.0, 1.0],
    ];
    let vertices =
        |prefix: &str| corners.iter().map(|[x, y]| format!("{prefix}{x} {y} 0\n")).collect::<String>();
    let obj = |face: &str| format!("{}f {face}\n", vertices("v "));
    let ply = format!(
        "ply\nformat ascii 1.0\nelement vertex 8\nproperty double x\nproperty double y\nproperty double z\nelement face 1\n\
         property list uchar int vertex_indices\nend_header\n{}8 0 1 2 3 4 5 6 7\n",
        vertices("")
    );
    // 7 columns and 19 rows of the notch, whatever corner the face begins with and whichever way it looks.
    for (name, text) in [
        ("a.obj", obj("1 2 3 4 5 6 7 8")),
        ("a.obj", obj("4 5 6 7 8 1 2 3")),
        ("a.obj", obj("8 7 6 5 4 3 2 1")),
        ("a.ply", ply),
    ] {
        assert_eq!(ground_of(name, text.as_bytes(), keys).report.holes_filled, 7 * 19, "{name}: {text}");
    }
    assert_refused("a.obj", obj("1 3 7 4 2 5 8 6").as_bytes(), keys, &["face 1 crosses itself"]);
    let millimeters = b"v 0 0 0\nv 900000 0 0\nv 0 900000 0\nf 1 2 3\n";
    assert_refused("a.obj", millimeters, keys, &["if the mesh is in millimeters"]);
    let stack = format!("v 0 0 0\nv 190 0 0\nv 0 190 0\n{}", "f 1 2 3\n".repeat(900));
    assert_refused("a.obj", stack.as_bytes(), keys, &["too many faces above each other"]);
}
