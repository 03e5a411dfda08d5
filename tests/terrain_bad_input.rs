//! Terrains that must be refused: each with one clear sentence, none with a panic.

use std::fs;
use std::path::Path;

use warpgait::terrain::{Ground, build};
use warpgait::{Error, scenario};

/// The ground of a scenario whose `[terrain]` has these lines, from line 6 on.
fn ground(text: &str, folder: &Path) -> warpgait::Result<Ground> {
    let text = format!("[start]\nposition = [0, 0]\n[goal]\nposition = [0, 0]\n[terrain]\n{text}\n");
    let loaded = scenario::load_text("s.toml", &text, folder, &[])?;
    build(&loaded.scenario, &loaded.robot, folder).map_err(|e| loaded.locate(e))
}

/// The message with which a terrain is refused; it has file and line.
fn refusal(text: &str, folder: &Path) -> String {
    match ground(text, folder) {
        Err(error @ (Error::Input(_) | Error::Value { .. })) => {
            let message = error.to_string();
            assert!(message.starts_with("s.toml:"), "{text}: no file and line: {message}");
            message
        }
        Err(other) => panic!("{text}: not an input error: {other}"),
        Ok(_) => panic!("{text}: accepted"),
    }
}

fn assert_refused(text: &str, folder: &Path, parts: &[&str]) {
    let message = refusal(text, folder);
    for part in parts {
        assert!(message.contains(part), "{text}\nsays {message:?}\nwithout {part:?}");
    }
}

const MAP: &str = "kind = \"heightmap\"\nfile = \"f\"\nspacing = 0.04\n";

/// Refusal of a heightmap whose file holds these bytes.
fn assert_file_refused(bytes: &[u8], more: &str, parts: &[&str]) {
    let folder = tempfile::tempdir().unwrap();
    fs::write(folder.path().join("f"), bytes).unwrap();
    assert_refused(&format!("{MAP}{more}"), folder.path(), parts);
}

/// Refusal of a heightmap that says nothing about its cells.
fn assert_bare_file_refused(bytes: &[u8], more: &str, parts: &[&str]) {
    let folder = tempfile::tempdir().unwrap();
    fs::write(folder.path().join("f"), bytes).unwrap();
    assert_refused(&format!("kind = \"heightmap\"\nfile = \"f\"\n{more}"), folder.path(), parts);
}

fn png(columns: u32, rows: u32, data: &[u8], color: png::ColorType) -> Vec<u8> {
    let mut bytes = Vec::new();
    let mut encoder = png::Encoder::new(&mut bytes, columns, rows);
    encoder.set_color(color);
    encoder.set_depth(png::BitDepth::Eight);
    encoder.write_header().unwrap().write_image_data(data).unwrap();
    bytes
}

fn gray(columns: u32, rows: u32) -> Vec<u8> {
    let data: Vec<u8> = (0..columns * rows).map(|i| (i % 251) as u8).collect();
    png(columns, rows, &data, png::ColorType::Grayscale)
}

/// Only the signature and header of a PNG of this size: what a decoder sees before it allocates.
fn png_header(columns: u32, rows: u32) -> Vec<u8> {
    let whole = gray(4, 4);
    let mut bytes = whole[..33].to_vec();
    bytes[16..20].copy_from_slice(&columns.to_be_bytes());
    bytes[20..24].copy_from_slice(&rows.to_be_bytes());
    let sum = crc32(&bytes[12..29]);
    bytes[29..33].copy_from_slice(&sum.to_be_bytes());
    bytes
}

fn crc32(bytes: &[u8]) -> u32 {
    !bytes.iter().fold(!0_u32, |crc, byte| {
        (0..8).fold(crc ^ u32::from(*byte), |c, _| if c & 1 == 1 { (c >> 1) ^ 0xEDB8_8320 } else { c >> 1 })
    })
}

fn npy(descr: &str, shape: &str, data: &[u8]) -> Vec<u8> {
    let header = format!("{{'descr': '{descr}', 'fortran_order': False, 'shape': {shape}, }}\n");
    let mut bytes = b"\x93NUMPY\x01\x00".to_vec();
    bytes.extend((header.len() as u16).to_le_bytes());
    bytes.extend(header.as_bytes());
    bytes.extend(data);
    bytes
}

fn floats(values: impl IntoIterator<Item = f64>) -> Vec<u8> {
    values.into_iter().flat_map(f64::to_le_bytes).collect()
}

#[test]
fn keys_of_another_kind() {
    let here = Path::new("");
    assert_refused(
        "kind = \"rippled\"\ndepth = 0.5",
        here,
        &["s.toml:7: terrain.depth: not a key of kind = \"rippled\"", "amplitude, wavelength, extent"],
    );
    assert_refused("kind = \"flat\"\nlevel = \"easy\"", here, &["terrain.level", "extent, spacing"]);
    assert_refused("kind = \"conic\"\nwidth = 1.0", here, &["slope, radius, tip, foot"]);
    assert_refused("kind = \"pit\"\nfile = \"a.png\"", here, &["terrain.file"]);
    assert_refused("kind = \"formula\"\nexpression = \"x\"\namplitude = 1.0", here, &["terrain.amplitude"]);
    assert_refused(&format!("{MAP}expression = \"x\""), here, &["terrain.expression", "height_scale"]);
}

#[test]
fn missing_keys() {
    let here = Path::new("");
    assert_refused("kind = \"formula\"", here, &["s.toml:5: terrain.expression: missing"]);
    assert_refused("kind = \"heightmap\"\nspacing = 0.1", here, &["s.toml:5: terrain.file: missing"]);
    assert_file_refused(&gray(5, 5), "", &["s.toml:5: terrain.height_scale: missing", "black to white"]);
    let parts = ["s.toml:5: terrain.spacing: missing; a PNG image does not tell it", "0.001 to 10 m"];
    assert_bare_file_refused(&gray(5, 5), "height_scale = 0.1", &parts);
    let integers = npy("<i2", "(5, 5)", &[0; 50]);
    let parts = ["s.toml:5: terrain.height_scale: missing", "of int16, with values from 0 to 0", "one unit"];
    assert_file_refused(&integers, "", &parts);
    assert_file_refused(&integers, "member = \"a\"", &["s.toml:9: terrain.member", "a NumPy array has none"]);
}

#[test]
fn values_out_of_range() {
    let here = Path::new("");
    for text in [
        "kind = \"rippled\"\nwavelength = 0.0",
        "kind = \"rippled\"\namplitude = nan",
        "kind = \"rippled\"\namplitude = inf",
        "kind = \"conic\"\nfoot = -0.1",
        "kind = \"conic\"\ntip = 0.0",
        "kind = \"hilly\"\nheight = 1e9",
        "kind = \"pit\"\nedge = 0.0",
        "kind = \"flat\"\nspacing = -0.1",
        "kind = \"flat\"\nspacing = nan",
        "kind = \"flat\"\nspacing = 1e-5",
        "kind = \"hilly\"\nextent = [0.0, nan, 0.0, 1.0]",
        "kind = \"hilly\"\nextent = [-inf, inf, 0.0, 1.0]",
        "kind = \"heightmap\"\nfile = \"f\"\nspacing = 0.0",
        "kind = \"heightmap\"\nfile = \"f\"\nspacing = nan",
        "kind = \"heightmap\"\nfile = \"f\"\nspacing = 0.1\norigin = [0.0, inf]",
        "kind = \"heightmap\"\nfile = \"f\"\nspacing = 0.1\nheight_scale = nan",
        "kind = \"heightmap\"\nfile = \"f\"\nspacing = 0.1\nheight_scale = 1e9",
        "kind = \"heightmap\"\nfile = \"f\"\nspacing = 0.1\nsmoothing = -0.1",
        "kind = \"heightmap\"\nfile = \"f\"\nspacing = 0.1\nsmoothing = 50.0",
        "kind = \"heightmap\"\nfile = \"f\"\nspacing = 0.1\nsmoothing = nan",
    ] {
        assert_refused(text, here, &["given ", "allowed: a finite number from"]);
    }
    assert_refused(&format!("{MAP}smoothing = 3.0"), here, &["terrain.smoothing: given 3", "at most 2 m"]);
}

#[test]
fn extents_and_grids() {
    let here = Path::new("");
    for extent in ["[1.0, 1.0, 0.0, 1.0]", "[1.0, -1.0, 0.0, 1.0]", "[0.0, 9.0, 0.0, 0.1]"] {
        assert_refused(
            &format!("kind = \"hilly\"\nextent = {extent}"),
            here,
            &["s.toml:7: terrain.extent: given", "each max at least 0.5 m above its min"],
        );
    }
    assert_refused(
        "kind = \"flat\"\nspacing = 0.001",
        here,
        &["s.toml:7: terrain.spacing", "nodes", "at least"],
    );
    assert_refused("kind = \"flat\"\nextent = [-1e5, 1e5, -1e5, 1e5]", here, &["nodes"]);
    let more = "height_scale = 1.0\nextent = [-9.0, 0.0, -0.4, 0.4]";
    assert_file_refused(
        &gray(19, 19),
        more,
        &["s.toml:10: terrain.extent: ", "reaches beyond", "-0.360, 0.360"],
    );
    let more = "height_scale = 1.0\nextent = [0.1, 0.0, 0.0, 0.1]";
    assert_file_refused(&gray(9, 9), more, &["terrain.extent: given"]);
}

#[test]
fn expressions() {
    let here = Path::new("");
    let cases: [(&str, &[&str]); 6] = [
        ("0.1*sin(x", &["s.toml:7: terrain.expression", "character 10", "')'"]),
        ("z + x", &["\"z\" is unknown", "x and y"]),
        ("0.1/x", &["inf", "x = 0.0000, y = -3.0000"]),
        ("sqrt(x)", &["NaN", "x = -3.0000"]),
        ("1e6*x", &["within"]),
        ("", &["ends too early"]),
    ];
    for (expression, parts) in cases {
        assert_refused(&format!("kind = \"formula\"\nexpression = \"{expression}\""), here, parts);
    }
    // Not at a node of the grid but between nodes.
    let text = "kind = \"formula\"\nexpression = \"0.01/(x - 0.125)\"\nspacing = 0.25";
    assert_refused(text, here, &["x = 0.1250"]);
}

#[test]
fn files_that_are_no_heightmaps() {
    let folder = tempfile::tempdir().unwrap();
    assert_refused(MAP, folder.path(), &["s.toml:7: terrain.file: \"f\"", "looked for", "scenario's folder"]);
    fs::create_dir(folder.path().join("f")).unwrap();
    assert_refused(MAP, folder.path(), &["not a file"]);
    let scale = "height_scale = 1.0";
    assert_file_refused(
        b"",
        scale,
        &[
            "\"f\"",
            "an empty file; these can: a PNG image (.png), a TIFF file (.tif, .tiff), a NumPy array (.npy)",
        ],
    );
    assert_file_refused(
        b"<svg/>",
        scale,
        &["not a format that can be read; these can: a PNG image (.png)", "an OBJ mesh (.obj)"],
    );
    assert_file_refused(&gray(9, 9)[..8], scale, &["not a valid PNG"]);
}

#[test]
fn broken_images_at_every_length_and_byte() {
    let whole = gray(23, 17);
    let folder = tempfile::tempdir().unwrap();
    let file = folder.path().join("f");
    let text = format!("{MAP}height_scale = 1.0");
    let data_end = whole.len() - 12; // the end chunk
    for length in (8..data_end - 4).step_by(3) {
        fs::write(&file, &whole[..length]).unwrap();
        assert!(refusal(&text, folder.path()).contains("not a valid PNG"), "{length} bytes");
    }
    for i in 8..whole.len() {
        let mut bytes = whole.clone();
        bytes[i] ^= 0x55;
        fs::write(&file, &bytes).unwrap();
        // Some bytes do not matter; none may panic.
        let _ = ground(&text, folder.path());
    }
}

#[test]
fn image_sizes_are_judged_from_the_header() {
    let scale = "height_scale = 1.0";
    assert_file_refused(&png_header(20_000, 20_000), scale, &["20000 x 20000", "too many"]);
    assert_file_refused(&png_header(u32::MAX >> 1, u32::MAX >> 1), scale, &["too many"]);
    assert_file_refused(&gray(1, 1), scale, &["1 x 1", "at least 4 x 4"]);
    assert_file_refused(&gray(100, 3), scale, &["100 x 3", "at least 4 x 4"]);
    assert_file_refused(&png_header(0, 4), scale, &["not a valid PNG"]);
}

#[test]
fn images_without_data() {
    let data = [77, 0].repeat(25);
    let bytes = png(5, 5, &data, png::ColorType::GrayscaleAlpha);
    assert_file_refused(&bytes, "height_scale = 1.0", &["\"f\"", "without data"]);
}

#[test]
fn arrays() {
    let valid = floats((0..25).map(f64::from));
    assert_file_refused(&npy("<f8", "(25,)", &valid), "", &["(25,)", "two dimensions"]);
    assert_file_refused(&npy("<f8", "(1, 5, 5)", &valid), "", &["two dimensions"]);
    assert_file_refused(&npy("<f8", "()", &valid), "", &["two dimensions"]);
    assert_file_refused(&npy("<c16", "(5, 5)", &valid.repeat(2)), "", &["c16", "floats"]);
    assert_file_refused(&npy("<U2", "(5, 5)", &valid), "", &["floats"]);
    assert_file_refused(&npy("|O", "(5, 5)", &valid), "", &["floats"]);
    assert_file_refused(&npy("<f8", "(5, 5)", &valid[..190]), "", &["not a valid .npy"]);
    assert_file_refused(&npy("<f8", "(3, 5)", &valid), "", &["at least 4 x 4"]);
    assert_file_refused(&npy("<f8", "(0, 0)", &[]), "", &["at least 4 x 4"]);
    assert_file_refused(&npy("<f8", "(20000, 20000)", &[]), "", &["too many"]);
    assert_file_refused(&npy("<f8", "(9000000000000000000, 9000000000000000000)", &[]), "", &["too many"]);
    assert_file_refused(b"\x93NUMPY\x01\x00", "", &["not a valid .npy"]);
    assert_file_refused(b"\x93NUMPY\x02\x00\xff\xff\xff\xff", "", &["not a valid .npy"]);
    assert_file_refused(&npy("<f8", "(5, 5", &valid), "", &["not a valid .npy"]);
    let with = |v: f64| npy("<f8", "(5, 5)", &floats((0..25).map(|i| if i == 13 { v } else { 0.1 })));
    assert_file_refused(&with(f64::INFINITY), "", &["element [2, 3] is inf"]);
    assert_file_refused(&with(1e5), "", &["height_scale"]);
    assert_file_refused(&with(1e300), "", &["height_scale"]);
    assert_file_refused(&with(1e300), "height_scale = 1000.0", &["height_scale"]);
    assert_file_refused(&with(f64::MAX), "height_scale = 1000.0", &["f"]);
    assert_file_refused(&npy("<f8", "(5, 5)", &floats([f64::NAN; 25])), "", &["without data"]);
    let high = floats((0..25).map(|i| 2e4 + 0.01 * f64::from(i)));
    assert_file_refused(&npy("<f8", "(5, 5)", &high), "", &["heights must be finite and within"]);
}
