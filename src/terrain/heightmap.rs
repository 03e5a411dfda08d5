//! `kind = "heightmap"`: reads a file of heights in one of the [`FORMATS`] and places it in the world.

use std::fs;
use std::path::Path;

use super::ground::Ground;
use super::raster::Raster;
use super::scan::{self, Scan};
use super::{image, npy};
use crate::digest::sha256_hex;
use crate::error::{Error, Result};
use crate::heightfield::Grid;
use crate::scenario::Footholds;
use crate::scenario::terrain::HeightmapSpec;

/// Larger files are refused unread, bytes.
const MAX_FILE: u64 = 512 << 20;

/// A file format of heightmaps.
struct Format {
    /// In messages.
    name: &'static str,
    /// The first bytes of every such file.
    signature: &'static [u8],
    /// Decodes a file.
    decode: fn(&[u8]) -> Result<Raster>,
    /// `terrain.height_scale` where the scenario gives none; none if the format needs it.
    height_scale: Option<f64>,
}

/// The file formats. A new one is a reader in a file of its own, which returns a [`Raster`], and an entry here.
const FORMATS: [Format; 2] = [
    Format { name: "a PNG image", signature: image::SIGNATURE, decode: image::decode, height_scale: None },
    Format { name: "an .npy array", signature: npy::SIGNATURE, decode: npy::decode, height_scale: Some(1.0) },
];

/// The ground of a heightmap.
///
/// # Errors
/// [`Error::Key`] for files that cannot be read, decoded, or turned into a heightfield.
pub fn ground(
    kind: &'static str,
    spec: &HeightmapSpec,
    footholds: Footholds,
    base_dir: &Path,
) -> Result<Ground> {
    let name = &spec.file;
    let refuse = |what: &dyn std::fmt::Display| Error::key("terrain.file", format!("{name:?}: {what}"));
    let bytes = read(&base_dir.join(name)).map_err(|what| refuse(&what))?;
    let Some(format) = FORMATS.iter().find(|format| bytes.starts_with(format.signature)) else {
        let names: Vec<&str> = FORMATS.iter().map(|format| format.name).collect();
        return Err(refuse(&format!("not a format that can be read: {}", names.join(", "))));
    };
    let Some(scale) = spec.height_scale.or(format.height_scale) else {
        let what = format!("missing; {} needs it: the height in m from black to white", format.name);
        return Err(Error::key("terrain.height_scale", what));
    };
    let Raster { columns, rows, values } = (format.decode)(&bytes).map_err(|e| refuse(&e))?;

    let half = |count: usize| 0.5 * spec.spacing * (count - 1) as f64;
    let grid = Grid {
        origin: [spec.origin[0] - half(columns), spec.origin[1] - half(rows)],
        spacing: [spec.spacing; 2],
        columns,
        rows,
    };
    // Flipped: the first row of the file has the largest y.
    let heights: Vec<f64> = values.chunks_exact(columns).rev().flatten().map(|v| v * scale).collect();
    let mut ground = scan::ground(kind, spec, footholds, Scan { grid, heights })?;
    ground.inputs.push((name.clone(), sha256_hex(&bytes)));
    Ok(ground)
}

/// The content of a file, or why it cannot be read.
fn read(path: &Path) -> std::result::Result<Vec<u8>, String> {
    let complain = |what: &dyn std::fmt::Display| {
        format!("{what} (looked for {}; relative paths start at the scenario's folder)", path.display())
    };
    let about = fs::metadata(path).map_err(|e| complain(&e))?;
    if !about.is_file() {
        return Err(complain(&"not a file"));
    }
    if about.len() > MAX_FILE {
        return Err(complain(&format!("{} bytes are too many; at most {MAX_FILE}", about.len())));
    }
    fs::read(path).map_err(|e| complain(&e))
}
