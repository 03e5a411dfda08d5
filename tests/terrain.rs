//! Terrains that must work: shapes, formulas, heightmaps in every PNG flavor and `.npy`.

use std::fs::{self, File};
use std::path::{Path, PathBuf};

use png::{BitDepth, ColorType};
use warpgait::scenario;
use warpgait::terrain::{Ground, build};

/// The ground of a scenario whose `[terrain]` has these lines, as one smooth surface.
fn ground(text: &str, folder: &Path) -> Ground {
    let whole = format!(
        "[contact]\nfootholds = \"anywhere\"\n[start]\nposition = [0, 0]\n[goal]\nposition = [0, 0]\n[terrain]\n{text}\n"
    );
    let loaded = scenario::load_text("s.toml", &whole, folder, &[]).unwrap_or_else(|e| panic!("{text}: {e}"));
    build(&loaded.scenario, &loaded.robot, folder).unwrap_or_else(|e| panic!("{text}: {e}"))
}

/// A PNG file; `palette` and `transparency` are the PLTE and tRNS chunks.
fn write_png(
    path: &Path,
    [columns, rows]: [u32; 2],
    (color, depth): (ColorType, BitDepth),
    chunks: [Option<&[u8]>; 2],
    data: &[u8],
) {
    let mut encoder = png::Encoder::new(File::create(path).unwrap(), columns, rows);
    encoder.set_color(color);
    encoder.set_depth(depth);
    if let Some(palette) = chunks[0] {
        encoder.set_palette(palette.to_vec());
    }
    if let Some(transparency) = chunks[1] {
        encoder.set_trns(transparency.to_vec());
    }
    encoder.write_header().unwrap().write_image_data(data).unwrap();
}

/// Without smoothing, so that the field equals the file at the pixels.
const PLAIN: &str =
    "kind = \"heightmap\"\nfile = \"map\"\nspacing = 0.02\nheight_scale = 2.0\nsmoothing = 0.0\n";

/// Heights (m, full scale 2 m) at the pixels of a 5 x 4 file, in the order of the file: first row first.
fn pixels(ground: &Ground) -> Vec<f64> {
    let grid = ground.field.grid();
    assert_eq!([grid.columns, grid.rows], [5, 4]);
    (0..20).map(|i| ground.field.height(grid.x(i % 5), grid.y(3 - i / 5))).collect()
}

#[test]
fn the_four_of_the_paper_have_the_slopes_of_their_table() {
    let table = [
        ("rippled", [0.21, 0.39, 0.65]),
        ("conic", [0.29, 0.49, 0.69]),
        ("hilly", [0.61, 1.01, 1.52]),
        ("pit", [1.0, 2.0, 4.5]),
    ];
    for (kind, slopes) in table {
        for (level, slope) in ["easy", "medium", "hard"].into_iter().zip(slopes) {
            let text = format!("kind = \"{kind}\"\nlevel = \"{level}\"\nspacing = 0.02");
            let report = ground(&text, Path::new("")).report;
            // The table has two digits; rippled easy and medium are .209 and .393.
            let digits = if kind == "pit" { 0.05 } else { 0.0055 };
            assert!((report.largest_slope - slope).abs() < digits, "{text}: {}", report.largest_slope);
            assert!(report.fit_error_max < 1e-4, "{text}: {:e}", report.fit_error_max);
        }
    }
}

#[test]
fn shapes_follow_their_formulas_and_named_parameters() {
    let field = ground("kind = \"rippled\"\nlevel = \"hard\"\nwavelength = 3.0", Path::new("")).field;
    let k = std::f64::consts::TAU / 3.0;
    assert!((field.height(0.31, -1.2) - 0.25 * (k * 0.31).sin() * (k * -1.2).sin()).abs() < 1e-7);
    assert!((field.gradient(0.31, -1.2)[0] - 0.25 * k * (k * 0.31).cos() * (k * -1.2).sin()).abs() < 1e-5);
    let field = ground("kind = \"conic\"", Path::new("")).field;
    let softplus = |u: f64| u.exp().ln_1p();
    let rho = (0.5_f64 * 0.5 + 1.5 * 1.5 + 0.3 * 0.3).sqrt();
    assert!((field.height(0.5, 1.5) - 0.5 * 0.12 * softplus((2.2 - rho) / 0.12)).abs() < 1e-7);
    let field = ground("kind = \"hilly\"\nheight = -0.4", Path::new("")).field;
    assert!((field.height(0.3, 0.4) + 0.4 * (-0.25_f64 / 0.72).exp()).abs() < 1e-7);
    let field = ground("kind = \"pit\"\nlevel = \"easy\"", Path::new("")).field;
    assert!((field.height(1.2, 0.0) + 0.2).abs() < 1e-7);
    assert!((field.height(0.0, 0.0) + 0.2 * (1.0 + 3.0_f64.tanh())).abs() < 1e-7);
    let flat = ground("kind = \"flat\"\nextent = [-1.0, 2.0, 0.0, 1.0]", Path::new(""));
    assert_eq!(flat.report.extent, [-1.0, 2.0, 0.0, 1.0]);
    assert_eq!(flat.report.height_range, [0.0, 0.0]);
    assert_eq!(flat.field.jet(0.3, 0.2).d1, [0.0, 0.0]);
    assert!(flat.raw.is_none() && flat.inputs.is_empty());
}

#[test]
fn the_default_grid_fits_to_micrometers() {
    let ground = ground("kind = \"pit\"\nlevel = \"hard\"", Path::new(""));
    assert_eq!(ground.report.grid, [601, 601]);
    assert_eq!(ground.report.extent, [-3.0, 3.0, -3.0, 3.0]);
    assert!(ground.report.fit_error_max < 1e-5, "{:e}", ground.report.fit_error_max);
    assert!(ground.report.fit_error_rms < 1e-6 && ground.report.fit_error_rms > 0.0);
    assert!(ground.report.notes.is_empty());
}

#[test]
fn formulas_are_fitted_and_edges_pointed_out() {
    let smooth = ground("kind = \"formula\"\nexpression = \"0.3*exp(-x^2 - y^2)\"", Path::new(""));
    assert!((smooth.field.height(0.5, 0.1) - 0.3 * (-0.26_f64).exp()).abs() < 1e-8);
    assert!(smooth.report.notes.is_empty());
    let stairs = ground("kind = \"formula\"\nexpression = \"0.1*floor(2*x)\"", Path::new(""));
    assert!(stairs.report.fit_error_max > 0.02 && stairs.report.largest_slope > 5.0);
    assert!(stairs.report.notes[0].contains("edge"), "{:?}", stairs.report.notes);
}

#[test]
fn every_flavour_of_png_is_read() {
    use BitDepth::{Eight, Four, One, Sixteen, Two};
    use ColorType::{Grayscale, GrayscaleAlpha, Indexed, Rgb, Rgba};
    let folder = tempfile::tempdir().unwrap();
    let check = |what: &str, format, chunks, data: &[u8], expected: &[f64]| {
        write_png(&folder.path().join("map"), [5, 4], format, chunks, data);
        let ground = ground(PLAIN, folder.path());
        for (i, (h, e)) in pixels(&ground).into_iter().zip(expected).enumerate() {
            assert!((h - 2.0 * e).abs() < 1e-12, "{what}, pixel {i}: {h} against {}", 2.0 * e);
        }
        assert_eq!(ground.report.holes_filled, 0, "{what}");
        assert!(ground.report.fit_error_max < 1e-12);
    };
    let gray: Vec<u8> = (0..20).map(|i| 13 * i).collect();
    let from8: Vec<f64> = gray.iter().map(|g| f64::from(*g) / 255.0).collect();
    check("gray 8", (Grayscale, Eight), [None; 2], &gray, &from8);

    let wide: Vec<u16> = (0..20).map(|i| 3277 * i + 11).collect();
    let bytes: Vec<u8> = wide.iter().flat_map(|g| g.to_be_bytes()).collect();
    let from16: Vec<f64> = wide.iter().map(|g| f64::from(*g) / 65535.0).collect();
    check("gray 16", (Grayscale, Sixteen), [None; 2], &bytes, &from16);

    let with_alpha: Vec<u8> = gray.iter().flat_map(|g| [*g, 128]).collect();
    check("gray + alpha 8", (GrayscaleAlpha, Eight), [None; 2], &with_alpha, &from8);
    let bytes: Vec<u8> = wide.iter().flat_map(|g| [g.to_be_bytes(), [128, 0]].concat()).collect();
    check("gray + alpha 16", (GrayscaleAlpha, Sixteen), [None; 2], &bytes, &from16);

    // Gray saved in color; the channels may differ by two levels.
    let color = |i: u8| [10 * i + 1, 10 * i, 10 * i + 2];
    let of_colors: Vec<f64> = (0..20).map(|i| (10.0 * f64::from(i) + 1.0) / 255.0).collect();
    let bytes: Vec<u8> = (0..20).flat_map(color).collect();
    check("color 8", (Rgb, Eight), [None; 2], &bytes, &of_colors);
    let bytes: Vec<u8> = (0..20).flat_map(|i| [color(i).as_slice(), &[255]].concat()).collect();
    check("color + alpha 8", (Rgba, Eight), [None; 2], &bytes, &of_colors);
    // v·257 in 16 bit is v/255.
    let bytes: Vec<u8> = (0..20).flat_map(color).flat_map(|v| [v, v]).collect();
    check("color 16", (Rgb, Sixteen), [None; 2], &bytes, &of_colors);
    let bytes: Vec<u8> =
        (0..20).flat_map(|i| [color(i).as_slice(), &[200]].concat()).flat_map(|v| [v, v]).collect();
    check("color + alpha 16", (Rgba, Sixteen), [None; 2], &bytes, &of_colors);

    let palette: Vec<u8> = (0..20).flat_map(color).collect();
    let indices: Vec<u8> = (0..20).collect();
    check("palette 8", (Indexed, Eight), [Some(&palette), None], &indices, &of_colors);
    // Two pixels a byte, the rows of five padded to three bytes.
    let indices: Vec<u8> = [[0x01, 0x23, 0x40]; 4].concat();
    let expected: Vec<f64> = (0..20).map(|i| of_colors[i % 5]).collect();
    check("palette 4", (Indexed, Four), [Some(&palette[..15]), None], &indices, &expected);

    let expected: Vec<f64> = (0..20).map(|i| (i % 5) as f64 / 15.0).collect();
    check("gray 4", (Grayscale, Four), [None; 2], &indices, &expected);
    let expected: Vec<f64> = (0..20).map(|i| [0.0, 1.0 / 3.0, 2.0 / 3.0, 1.0, 0.0][i % 5]).collect();
    check("gray 2", (Grayscale, Two), [None; 2], &[[0b0001_1011, 0]; 4].concat(), &expected);
    let expected: Vec<f64> = (0..20).map(|i| [1.0, 0.0, 1.0, 1.0, 0.0][i % 5]).collect();
    check("gray 1", (Grayscale, One), [None; 2], &[0b1011_0000; 4], &expected);
}

#[test]
fn transparent_pixels_are_holes_in_every_flavour() {
    use BitDepth::{Eight, Sixteen};
    use ColorType::{Grayscale, GrayscaleAlpha, Indexed, Rgba};
    let folder = tempfile::tempdir().unwrap();
    let hole = 7;
    let gray = |i: usize| if i == hole { 250 } else { 100 };
    let alpha = |i: usize| if i == hole { 127 } else { 128 };
    let all = 0..20_usize;
    type Case = (&'static str, (ColorType, BitDepth), [Option<&'static [u8]>; 2], Vec<u8>);
    let cases: [Case; 5] = [
        (
            "gray + alpha",
            (GrayscaleAlpha, Eight),
            [None; 2],
            all.clone().flat_map(|i| [gray(i), alpha(i)]).collect(),
        ),
        (
            "color + alpha",
            (Rgba, Eight),
            [None; 2],
            all.clone().flat_map(|i| [gray(i), gray(i), gray(i), alpha(i)]).collect(),
        ),
        (
            "gray + alpha 16",
            (GrayscaleAlpha, Sixteen),
            [None; 2],
            all.clone().flat_map(|i| [gray(i), gray(i), alpha(i), 7]).collect(),
        ),
        (
            "palette with transparency",
            (Indexed, Eight),
            [Some(&[100, 100, 100, 250, 250, 250]), Some(&[128, 127])],
            all.clone().map(|i| u8::from(i == hole)).collect(),
        ),
        ("a transparent gray", (Grayscale, Eight), [None, Some(&[0, 250])], all.clone().map(gray).collect()),
    ];
    for (what, format, chunks, data) in cases {
        write_png(&folder.path().join("map"), [5, 4], format, chunks, &data);
        let ground = ground(PLAIN, folder.path());
        assert_eq!(ground.report.holes_filled, 1, "{what}");
        assert!(ground.report.notes.iter().any(|n| n.contains("no data")), "{what}");
        for h in pixels(&ground) {
            assert!((h - 200.0 / 255.0).abs() < 1e-9, "{what}: {h}");
        }
    }
}

#[test]
fn the_first_row_of_an_image_is_the_largest_y_and_its_origin_is_the_center() {
    let folder = tempfile::tempdir().unwrap();
    let mut data = [0; 6 * 4];
    data[0] = 255; // top left: smallest x, largest y
    write_png(&folder.path().join("map"), [6, 4], (ColorType::Grayscale, BitDepth::Eight), [None; 2], &data);
    let ground = ground(&format!("{PLAIN}origin = [1.0, -2.0]"), folder.path());
    let [x_min, x_max, y_min, y_max] = ground.report.extent;
    let expected = [0.95, 1.05, -2.03, -1.97];
    for (a, b) in ground.report.extent.into_iter().zip(expected) {
        assert!((a - b).abs() < 1e-12);
    }
    assert!((ground.field.height(x_min, y_max) - 2.0).abs() < 1e-12);
    for (x, y) in [(x_min, y_min), (x_max, y_min), (x_max, y_max)] {
        assert!(ground.field.height(x, y).abs() < 1e-12);
    }
}

/// An `.npy` file of version 1.0, written by hand.
pub fn npy(descr: &str, fortran: bool, shape: &str, data: &[u8]) -> Vec<u8> {
    let order = if fortran { "True" } else { "False" };
    let mut header = format!("{{'descr': '{descr}', 'fortran_order': {order}, 'shape': {shape}, }}");
    header += &" ".repeat(64 - (10 + header.len() + 1) % 64);
    header.push('\n');
    let mut bytes = b"\x93NUMPY\x01\x00".to_vec();
    bytes.extend((header.len() as u16).to_le_bytes());
    bytes.extend(header.as_bytes());
    bytes.extend(data);
    bytes
}

#[test]
fn arrays_are_read_in_every_type_and_order() {
    let folder = tempfile::tempdir().unwrap();
    let file = folder.path().join("map");
    let value = |i: usize| ((i * 7) % 20) as i32;
    // Element [row, column] of the 4 x 5 array at its place in Fortran's order.
    let fortran = |k: usize| value((k % 4) * 5 + k / 4);
    let all = 0..20_usize;
    let files = [
        npy(
            "<f8",
            false,
            "(4, 5)",
            &all.clone().flat_map(|i| (0.1 * f64::from(value(i))).to_le_bytes()).collect::<Vec<_>>(),
        ),
        npy(
            ">f4",
            false,
            "(4, 5)",
            &all.clone().flat_map(|i| (0.1 * value(i) as f32).to_be_bytes()).collect::<Vec<_>>(),
        ),
        npy(
            "<f8",
            true,
            "(4, 5)",
            &all.clone().flat_map(|i| (0.1 * f64::from(fortran(i))).to_le_bytes()).collect::<Vec<_>>(),
        ),
        npy("|u1", false, "(4, 5)", &all.clone().map(|i| value(i) as u8).collect::<Vec<_>>()),
        npy(
            "<i2",
            false,
            "(4, 5)",
            &all.clone().flat_map(|i| (value(i) as i16).to_le_bytes()).collect::<Vec<_>>(),
        ),
        npy(
            "<u4",
            true,
            "(4, 5)",
            &all.clone().flat_map(|i| (fortran(i) as u32).to_le_bytes()).collect::<Vec<_>>(),
        ),
    ];
    for (k, bytes) in files.iter().enumerate() {
        fs::write(&file, bytes).unwrap();
        // Tenths of meters in the floats, units in the integers.
        let text = PLAIN.replace("2.0", if k < 3 { "1.0" } else { "0.1" });
        for (i, h) in pixels(&ground(&text, folder.path())).into_iter().enumerate() {
            assert!((h - 0.1 * f64::from(value(i))).abs() < 1e-6, "file {k}, element {i}: {h}");
        }
        // Floats need no scale.
        if k < 3 {
            let meters = ground(&PLAIN.replace("height_scale = 2.0\n", ""), folder.path());
            assert!((pixels(&meters)[3] - 0.1 * f64::from(value(3))).abs() < 1e-6);
        }
    }
}

#[test]
fn arrays_keep_slopes_fill_nan_and_crop() {
    let folder = tempfile::tempdir().unwrap();
    let (columns, rows, spacing) = (51, 41, 0.04);
    let data: Vec<u8> = (0..columns * rows)
        .map(|i| {
            let (x, y) = ((i % columns) as f64 * spacing, (rows - 1 - i / columns) as f64 * spacing);
            let hole = (20..27).contains(&(i % columns)) && (10..15).contains(&(i / columns));
            if hole { f64::NAN } else { 0.2 * x - 0.1 * y }
        })
        .flat_map(f64::to_le_bytes)
        .collect();
    fs::write(folder.path().join("a.npy"), npy("<f8", false, "(41, 51)", &data)).unwrap();
    let text = "kind = \"heightmap\"\nfile = \"a.npy\"\nspacing = 0.04\n";
    let whole = ground(text, folder.path());
    assert_eq!(whole.report.holes_filled, 35);
    assert!((whole.report.smoothing - 0.06).abs() < 1e-12);
    assert_eq!(whole.report.grid, [101, 81]); // refined to 0.02 m
    assert!(whole.report.fit_error_max < 1e-6, "{:e}", whole.report.fit_error_max);
    assert!((whole.report.largest_slope - 0.05_f64.sqrt()).abs() < 1e-4);
    assert_eq!(whole.raw.as_ref().unwrap().len(), 101 * 81);
    assert_eq!(whole.inputs[0].0, "a.npy");
    assert_eq!(whole.inputs[0].1.len(), 64);
    let cropped = ground(&format!("{text}extent = [-0.5, 0.33, -0.2, 0.41]"), folder.path());
    for (a, b) in cropped.report.extent.into_iter().zip([-0.5, 0.33, -0.2, 0.41]) {
        assert!((a - b).abs() < 1e-12);
    }
    // Of the 7 x 5 cells without data, those with x from -0.2 to 0.04 and y from 0.24 to 0.4.
    assert_eq!(cropped.report.holes_filled, 35);
    let beside = ground(&format!("{text}extent = [0.0, 0.6, -0.6, 0.3]"), folder.path());
    assert_eq!(beside.report.holes_filled, 2 * 2);
    for (x, y) in [(-0.5, -0.2), (0.33, 0.41), (0.1, 0.1)] {
        assert!((cropped.field.height(x, y) - whole.field.height(x, y)).abs() < 1e-6);
    }
}

#[test]
fn hashes_are_those_of_the_file() {
    let folder = tempfile::tempdir().unwrap();
    let gray = [9; 20];
    write_png(&folder.path().join("map"), [5, 4], (ColorType::Grayscale, BitDepth::Eight), [None; 2], &gray);
    let sum = std::process::Command::new("sha256sum").arg(folder.path().join("map")).output();
    let Ok(output) = sum else {
        println!("skipped: no sha256sum here");
        return;
    };
    let expected = String::from_utf8(output.stdout).unwrap();
    assert_eq!(expected.split_whitespace().next().unwrap(), ground(PLAIN, folder.path()).inputs[0].1);
}

#[test]
fn the_rubble_is_walkable_ground() {
    let folder = Path::new(env!("CARGO_MANIFEST_DIR")).join("scenarios/data");
    let text = "kind = \"heightmap\"\nfile = \"rubble.png\"\nspacing = 0.035\nheight_scale = 0.40";
    let Ground { field, report, .. } = ground(text, &folder);
    println!("{report:#?}");
    let [x_min, x_max, y_min, y_max] = report.extent;
    assert!(x_max - x_min > 5.9 && y_max - y_min > 3.9);
    assert!(report.holes_filled > 1000);
    assert!(report.height_range[1] - report.height_range[0] > 0.15);
    // Rough: blocks are still there after smoothing. But no cliff.
    assert!((0.5..2.5).contains(&report.largest_slope), "{}", report.largest_slope);
    // Half a meter of flat ground at either end, on the line through the middle that a robot would take.
    for k in 0..=50 {
        for j in -10..=10 {
            for x in [x_min + 0.01 * f64::from(k), x_max - 0.01 * f64::from(k)] {
                let [hx, hy] = field.gradient(x, 0.05 * f64::from(j));
                assert!(hx.hypot(hy) < 0.15, "{x}: {hx} {hy}");
            }
        }
    }
}

#[test]
fn terrains_of_peers_are_read() {
    let root = Path::new(env!("CARGO_MANIFEST_DIR"));
    let candidates: [PathBuf; 2] = [root.join("../shared/terrains"), root.join("../../shared/terrains")];
    let Some(folder) = candidates.iter().find(|f| f.is_dir()) else {
        println!("skipped: no ../shared/terrains here");
        return;
    };
    let files = [
        ("ocs2_demo_terrain.png", 0.04, 1.0),
        ("ocs2_stepping_stones.png", 0.04, 1.0),
        ("cpd_real_stairs_125cm.png", 0.02, 1.25),
        ("cpd_slope_1m_1m_20cm.png", 0.02, 0.2),
    ];
    for (file, spacing, scale) in files {
        let text =
            format!("kind = \"heightmap\"\nfile = \"{file}\"\nspacing = {spacing}\nheight_scale = {scale}");
        let report = ground(&text, folder).report;
        println!("{file}: {report:#?}");
        assert!(report.height_range[1] - report.height_range[0] > 0.05);
        assert!(report.largest_slope > 0.1 && report.largest_slope < 40.0);
    }
}
