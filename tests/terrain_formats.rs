//! Every format of heightmaps: the same ground from each, places told by the file, and refusals.

use std::fs;

use crate::common::files::*;
use crate::common::inputs::*;
use proptest::prelude::*;
use warpgait::heightfield::Grid;

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
    let Grid { rows, columns, origin, spacing } = *first.field.grid();
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
    let wide = format!("{}\n", vec!["-0.125"; 1000].join(",")).repeat(4);
    assert_eq!(ground_of("f", wide.as_bytes(), &keys).report.height_range, [-0.125, -0.125]);
    let named = "a,b,c,d\n1,2,3,4\n1,2,,4\n1,nan,3,4\n1,2,3,4\n".to_owned();
    assert_eq!(ground_of("a.csv", named.as_bytes(), &keys).report.holes_filled, 2);
    for (text, part) in [
        ("1 2 3 4\n1 2 3\n", "line 2: 3 numbers, but 4 in the first row"),
        ("1 2 3 4\n1 2 x 4\n", "line 2, field 3: \"x\" is no number"),
        ("0,5;1,5;2,5;3,5\n", "line 1, field 1: \"0,5\" is no number; decimals must have a point"),
        ("1,2,3,0x10\n", "line 1, field 4: \"0x10\" is no number"),
        ("1,2,3,4\n\n1,2,3,4\n", "line 2: an empty line between rows"),
        ("1 2 3 4\n1 2 inf 4\n", "line 2: inf is no height"),
        ("0 0 1\n0 1 2\n0 2 3\n0 3 3\n", "a list of points"),
        ("1 2 3 4\n1 2 3 4\n1 2 3 4\n", "4 x 3 cells are too few"),
    ] {
        assert_refused("a.txt", text.as_bytes(), &keys, &[part]);
    }
}

#[test]
fn empty_fields_of_text_are_cells_without_data() {
    let keys = "spacing = 0.02";
    // Rows and columns without data, at every side and inside.
    let rows = ["\t\t\t\t\t", "\t1\t2\t3\t\t", "\t\t\t\t\t", "\t4\t5\t6\t\t", "\t7\t8\t9\t\t"];
    let expected: Vec<f64> = [[7, 8, 9], [4, 5, 6], [0; 3], [1, 2, 3], [0; 3]]
        .into_iter()
        .flat_map(|row| [0, row[0], row[1], row[2], 0, 0])
        .map(|v| if v == 0 { f64::NAN } else { f64::from(v) * 0.01 })
        .collect();
    for separator in ["\t", ",", ";"] {
        let text = format!("{}\n\n", rows.join("\n").replace('\t', separator));
        let found = ground_of("a.tsv", text.as_bytes(), &format!("{keys}\nheight_scale = 0.01"));
        assert_eq!([found.field.grid().columns, found.field.grid().rows], [6, 5]);
        assert_eq!(found.report.holes_filled, expected.iter().filter(|v| v.is_nan()).count());
        for (raw, v) in found.raw.unwrap().iter().zip(&expected).filter(|(_, v)| !v.is_nan()) {
            assert!((raw - v).abs() < 1e-12, "{raw} {v}");
        }
    }
    // A separator at the end of every row, and of some only.
    let found =
        ground_of("a.csv", "1,2,3,4,\n".repeat(4).as_bytes(), &format!("{keys}\nheight_scale = 0.01"));
    assert_eq!((found.field.grid().columns, has_note(&found, "end of every row")), (4, true));
    let some = "1,2,3,4,\n".repeat(3) + "1,2,3,4,5\n";
    assert_eq!(
        ground_of("a.csv", some.as_bytes(), &format!("{keys}\nheight_scale = 0.01")).field.grid().columns,
        5
    );
    assert_refused("a.csv", b"\xff\xfe1\0,\0", keys, &["text in UTF-16"]);
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
        (head(String::new()).replace("NROWS 5", "NROWS x"), "line 2, field 2: \"x\" is no number"),
        (
            head(String::new()).replace("CELLSIZE 0.02", "CELLSIZE 30"),
            "the file tells 30 m, but allowed are 0.001 to 10",
        ),
    ] {
        assert_refused("a.asc", text.as_bytes(), "", &[part]);
    }
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

    // Rows from the least y; and what is mirrored, in other units, or perhaps upside down.
    let (_, upward) = stored("y-up");
    let upward: Vec<u8> = upward.iter().flat_map(|v| (*v as f32).to_le_bytes()).collect();
    let [x, y] = CORNER.map(|c| c - 0.5 * SPACING);
    let turned = |a: f64, e: f64| [a, 0.0, 0.0, x, 0.0, e, 0.0, y, 0.0, 0.0, 0.0, 0.0, 0.0, 0.0, 0.0, 1.0];
    let with = |tag: (u16, u16, Vec<u8>)| {
        let mut tags = gray_tags(32, 3);
        tags.retain(|(number, ..)| *number != tag.0);
        tags.push(tag);
        tiff(&tags, &upward)
    };
    let found = ground_of("a.tif", &with((34264, 12, doubles(&turned(SPACING, SPACING)))), "");
    assert_is_the_ground(&found, [2.0, 1.0], 1e-7);
    let unit = |key: u16| (34735, 3, [1, 1, 0, 1, key, 0, 1, 9002].map(u16::to_le_bytes).concat());
    for (tag, part) in [
        ((34264, 12, doubles(&turned(-SPACING, SPACING))), "columns run against x"),
        ((33550, 12, doubles(&[SPACING, -SPACING, 0.0])), "negative pixel scale"),
        (unit(3076), "coordinates in unit 9002, feet"),
        (unit(4099), "heights in unit 9002, feet"),
        ((274, 3, short(4)), "orientation 4"),
        ((262, 3, short(0)), "WhiteIsZero"),
    ] {
        assert_refused("a.tif", &with(tag), &keys, &[part]);
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
    // What stands for no data is given as stored, and does not count for the least and the greatest.
    let mut marked = values.clone();
    marked[8] = -9999.1;
    let keys_marked = format!("{keys}\nheight_scale = {}\nno_data = -9999.1", HIGH - LOW);
    let found = ground_of("a.bin", &hfield(ROWS as i32, COLUMNS as i32, &marked), &keys_marked);
    assert_eq!(found.report.holes_filled, 1);
    assert!((found.report.height_range[1] - HIGH).abs() < 1e-7, "{:?}", found.report.height_range);

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
    let plain = model(&elevation, "");
    let with = |more: &str| plain.replace("<asset>", &format!("{more}<asset>"));
    for (more, part) in [
        ("<include file=\"a.xml\"/>", "includes \"a.xml\""),
        ("<default><geom euler=\"0 0 90\"/></default>", "a default gives its geom euler"),
        ("<default><geom hfield=\"g\"/></default>", "a default gives geoms an hfield"),
    ] {
        assert_refused("m.xml", with(more).as_bytes(), "", &[part]);
    }
    let class = "<default><default class=\"t\"><geom pos=\"1 0 0\"/></default></default>";
    ground_of("m.xml", with(class).as_bytes(), "");
    let moved = with(class)
        .replace("hfield=\"g\" pos=\"1 1 0\"", "hfield=\"g\"")
        .replace("<body ", "<body childclass=\"t\" ");
    assert_refused("m.xml", moved.as_bytes(), "", &["a default gives its geom pos"]);
    let copied =
        plain.replace("<body ", "<replicate count=\"2\"><body ").replace("</body>", "</body></replicate>");
    assert_refused("m.xml", copied.as_bytes(), "", &["inside a replicate"]);
    let more = plain
        .replace("<worldbody>", "<worldbody><geom size=\"1\"/><body><freejoint/><geom size=\"1\"/></body>");
    assert!(has_note(&ground_of("m.xml", more.as_bytes(), ""), "1 other geoms of the model"));
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
