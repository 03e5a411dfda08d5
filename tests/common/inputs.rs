//! Small files of ground in many formats, for the tests of what they are taken for.

use std::fs;
use std::path::Path;

use warpgait::files::npy::Header;
use warpgait::scenario;
use warpgait::terrain::{Ground, build};

/// The ground of a scenario whose `[terrain]` has these lines, from line 6 on.
pub fn try_ground(text: &str, folder: &Path) -> warpgait::Result<Ground> {
    let text = format!(
        "[start]\nposition = [0, 0]\n[goal]\nposition = [0, 0]\n[terrain]\nkind = \"heightmap\"\n{text}\n"
    );
    let loaded = scenario::load_text("s.toml", &text, folder, &[])?;
    build(&loaded.scenario, &loaded.robot, folder).map_err(|e| loaded.locate(e))
}

pub fn ground(text: &str, folder: &Path) -> Ground {
    try_ground(text, folder).unwrap_or_else(|e| panic!("{text}: {e}"))
}

/// Refusal of a file with this name and content.
pub fn refusal(name: &str, content: &[u8], keys: &str) -> String {
    let folder = tempfile::tempdir().unwrap();
    fs::write(folder.path().join(name), content).unwrap();
    match try_ground(&format!("file = \"{name}\"\n{keys}"), folder.path()) {
        Err(error) => {
            let message = error.to_string();
            assert!(message.starts_with("s.toml:") && !message.contains('\n'), "{message}");
            message
        }
        Ok(_) => panic!("{name} with {keys} was accepted"),
    }
}

pub fn assert_refused(name: &str, content: &[u8], keys: &str, parts: &[&str]) {
    let message = refusal(name, content, keys);
    for part in parts {
        assert!(message.contains(part), "`{part}` is missing in: {message}");
    }
}

/// Ground that is the same from no other side: 7 cells along x, 5 along y, 0.02 m apart, around (0, 0).
pub const COLUMNS: usize = 7;
pub const ROWS: usize = 5;
pub const SPACING: f64 = 0.02;

pub fn height(column: usize, row: usize) -> f64 {
    0.01 * column as f64 + 0.001 * (row * row) as f64
}

/// Row by row from the least y, as a plan has it.
pub fn heights() -> Vec<f64> {
    (0..COLUMNS * ROWS).map(|k| height(k % COLUMNS, k / COLUMNS)).collect()
}

/// Element [i, j] of the array of a layout, with its shape.
pub fn stored(layout: &str) -> ([usize; 2], Vec<f64>) {
    let shape = if matches!(layout, "x-y" | "grid-map") { [COLUMNS, ROWS] } else { [ROWS, COLUMNS] };
    let at = |i: usize, j: usize| match layout {
        "picture" => height(j, ROWS - 1 - i),
        "y-up" => height(j, i),
        "x-y" => height(i, j),
        "grid-map" => height(COLUMNS - 1 - i, ROWS - 1 - j),
        _ => panic!("{layout}"),
    };
    (shape, (0..COLUMNS * ROWS).map(|k| at(k / shape[1], k % shape[1])).collect())
}

pub fn npy<T>(dtype: &str, shape: &[usize], values: &[T], bytes: impl Fn(&T) -> Vec<u8>) -> Vec<u8> {
    let shape = shape.iter().map(|&n| n as u64).collect();
    let header = Header { dtype: dtype.into(), fortran_order: false, shape };
    [header.write().unwrap(), values.iter().flat_map(bytes).collect()].concat()
}

pub fn floats(shape: &[usize], values: &[f64]) -> Vec<u8> {
    npy("<f8", shape, values, |v| v.to_le_bytes().to_vec())
}

/// The raw ground is `heights()` around `center`, to a tolerance; NaN in what is expected is left out.
pub fn assert_is_the_ground(ground: &Ground, center: [f64; 2], tolerance: f64) {
    let grid = ground.field.grid();
    assert_eq!([grid.columns, grid.rows], [COLUMNS, ROWS]);
    let corner = [center[0] - 3.0 * SPACING, center[1] - 2.0 * SPACING];
    for axis in 0..2 {
        assert!((grid.origin[axis] - corner[axis]).abs() < 1e-12, "{:?} is not {corner:?}", grid.origin);
        assert!((grid.spacing[axis] - SPACING).abs() < 1e-12);
    }
    for (k, (found, expected)) in ground.raw.as_ref().unwrap().iter().zip(heights()).enumerate() {
        assert!((found - expected).abs() <= tolerance, "cell {k}: {found}, expected {expected}");
    }
}

/// A PNG with the chunks that are given.
pub fn png(
    color: png::ColorType,
    depth: png::BitDepth,
    [columns, rows]: [u32; 2],
    palette: Option<&[u8]>,
    data: &[u8],
) -> Vec<u8> {
    let mut bytes = Vec::new();
    let mut encoder = png::Encoder::new(&mut bytes, columns, rows);
    encoder.set_color(color);
    encoder.set_depth(depth);
    if let Some(palette) = palette {
        encoder.set_palette(palette.to_vec());
    }
    encoder.write_header().unwrap().write_image_data(data).unwrap();
    bytes
}

pub fn crc32(bytes: &[u8]) -> u32 {
    !bytes.iter().fold(!0_u32, |crc, byte| {
        (0..8).fold(crc ^ u32::from(*byte), |c, _| if c & 1 == 1 { (c >> 1) ^ 0xEDB8_8320 } else { c >> 1 })
    })
}
