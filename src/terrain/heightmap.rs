//! `kind = "heightmap"`: a PNG image or an `.npy` array of heights.

use std::fs;
use std::path::Path;

use sha2::{Digest, Sha256};

use super::scan::{self, Scan};
use super::{Ground, image, in_range, npy, required};
use crate::error::{Error, Result};
use crate::heightfield::Grid;
use crate::scenario::TerrainSpec;

/// Larger files are refused unread, bytes.
const MAX_FILE: u64 = 512 << 20;
/// Larger rasters are refused before they are decoded, cells.
pub const MAX_CELLS: u64 = 16_000_000;
/// Smaller rasters carry no spline.
pub const MIN_SIDE: u64 = 4;

/// Values as they lie in a file: row 0 first, which is the largest y; NaN = no data.
pub struct Raster {
    pub columns: usize,
    pub rows: usize,
    pub values: Vec<f64>,
}

/// The ground of a heightmap.
pub fn build(spec: &TerrainSpec, base_dir: &Path) -> Result<Ground> {
    let name = required(spec, "file", spec.file.as_deref())?;
    let spacing = in_range("spacing", required(spec, "spacing", spec.spacing)?, [1e-4, 10.0])?;
    let origin = spec.origin.unwrap_or_default();
    for coordinate in origin {
        in_range("origin", coordinate, [-1e5, 1e5])?;
    }
    let bytes = read(&base_dir.join(name), name)?;
    let is_image = bytes.starts_with(image::SIGNATURE);
    let scale = match spec.height_scale {
        Some(scale) => in_range("height_scale", scale, [-1000.0, 1000.0])?,
        None if is_image => {
            return Err(Error::input(
                "terrain.height_scale is missing: an image needs it, the height in metres from black to white",
            ));
        }
        None => 1.0,
    };
    let raster = if is_image {
        image::decode(&bytes)
    } else if bytes.starts_with(npy::SIGNATURE) {
        npy::decode(&bytes)
    } else {
        Err(Error::input("this is neither a PNG image nor an .npy array"))
    }
    .map_err(|e| Error::input(format!("terrain.file {name:?}: {e}")))?;

    let Raster { columns, rows, values } = raster;
    let half = |count: usize| 0.5 * spacing * (count - 1) as f64;
    let grid = Grid {
        origin: [origin[0] - half(columns), origin[1] - half(rows)],
        spacing: [spacing; 2],
        columns,
        rows,
    };
    // Upside down: the file's first row is the largest y.
    let heights: Vec<f64> = values.chunks_exact(columns).rev().flatten().map(|v| v * scale).collect();
    let mut ground = scan::ground(spec, &format!("terrain.file {name:?}"), Scan { grid, heights })?;
    ground.inputs.push((name.into(), hex(&Sha256::digest(&bytes))));
    Ok(ground)
}

fn read(path: &Path, name: &str) -> Result<Vec<u8>> {
    let complain = |what: String| {
        Error::input(format!(
            "terrain.file {name:?}: {what} (looked for {}; relative paths start at the scenario's folder)",
            path.display()
        ))
    };
    let about = fs::metadata(path).map_err(|e| complain(e.to_string()))?;
    if !about.is_file() {
        return Err(complain("this is not a file".into()));
    }
    if about.len() > MAX_FILE {
        return Err(complain(format!("{} bytes are too many; at most {MAX_FILE}", about.len())));
    }
    fs::read(path).map_err(|e| complain(e.to_string()))
}

/// Refuses rasters that are too small or too large, from their header alone.
pub fn check_size(columns: u64, rows: u64) -> Result<()> {
    if columns < MIN_SIDE || rows < MIN_SIDE {
        return Err(Error::input(format!(
            "{columns} x {rows} cells are too few: at least {MIN_SIDE} x {MIN_SIDE}"
        )));
    }
    if columns.checked_mul(rows).is_none_or(|cells| cells > MAX_CELLS) {
        return Err(Error::input(format!(
            "{columns} x {rows} cells are too many: at most {MAX_CELLS} in all; reduce its resolution or cut out a part"
        )));
    }
    Ok(())
}

fn hex(bytes: &[u8]) -> String {
    bytes.iter().map(|byte| format!("{byte:02x}")).collect()
}
