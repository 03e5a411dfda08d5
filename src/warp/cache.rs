//! A cache of maps on disk.
//!
//! A cache file consists of the SHA-256 hash of all that follows, on a line; a report, one line of JSON; and the control points as
//! little-endian doubles. Its name is the hash of everything that a map depends on: the terrain's samples, the specification and
//! [`SOLVER_VERSION`].

use std::ops::ControlFlow;
use std::path::{Path, PathBuf};

use sha2::{Digest, Sha256};

use super::build::{MapProgress, build};
use super::report::MapReport;
use super::spline::WarpMap;
use crate::heightfield::Heightfield;
use crate::scenario::MapSpec;
use crate::{Error, Result, digest, files};

/// Increase this with every change that yields a different map of the same terrain.
const SOLVER_VERSION: u32 = 6;

/// `$WARPGAIT_CACHE`, or else `$XDG_CACHE_HOME/warpgait`, or else `~/.cache/warpgait`; none if none of these variables is set.
pub fn default_cache_dir() -> Option<PathBuf> {
    let from = |name: &str| std::env::var_os(name).filter(|v| !v.is_empty()).map(PathBuf::from);
    from("WARPGAIT_CACHE")
        .or_else(|| from("XDG_CACHE_HOME").map(|d| d.join("warpgait")))
        .or_else(|| from("HOME").map(|d| d.join(".cache").join("warpgait")))
}

/// Reads the map from `cache_dir`, or builds it with [`build`] and stores it there. The last value returned tells whether it came
/// from the cache.
///
/// A damaged cache file is replaced. If the cache cannot be written, the report has a warning.
///
/// # Errors
/// Those of [`build`].
pub fn build_cached(
    field: &Heightfield,
    spec: &MapSpec,
    cache_dir: Option<&Path>,
    progress: &mut dyn FnMut(MapProgress) -> ControlFlow<()>,
) -> Result<(WarpMap, MapReport, bool)> {
    let Some(directory) = cache_dir else {
        let (map, report) = build(field, spec, progress)?;
        return Ok((map, report, false));
    };
    let path = directory.join(format!("{}.warpmap", key(field, spec)));
    if let Some((map, report)) = read(&path, field, spec) {
        return Ok((map, report, true));
    }
    let (map, mut report) = build(field, spec, progress)?;
    if let Err(error) = write(&path, &map, &report) {
        report.warnings.push(format!("the map could not be stored in the cache ({error})"));
    }
    Ok((map, report, false))
}

/// The hash of everything that a map depends on.
fn key(field: &Heightfield, spec: &MapSpec) -> String {
    let mut hash = Sha256::new();
    hash.update(SOLVER_VERSION.to_le_bytes());
    hash.update(format!("{spec:?}"));
    let grid = field.grid();
    for n in [grid.columns, grid.rows] {
        hash.update((n as u64).to_le_bytes());
    }
    for v in grid.origin.iter().chain(&grid.spacing).chain(field.samples()) {
        hash.update(v.to_le_bytes());
    }
    digest::hex(&hash.finalize())
}

/// The map in a cache file; none if the file is missing or damaged.
fn read(path: &Path, field: &Heightfield, spec: &MapSpec) -> Option<(WarpMap, MapReport)> {
    let bytes = files::read(path, files::MAX_FILE).ok()?;
    let (checksum, content) = line(&bytes)?;
    if digest::sha256_hex(content).as_bytes() != checksum {
        return None;
    }
    let (report, payload) = line(content)?;
    let report: MapReport = serde_json::from_slice(report).ok()?;
    // If the specification leaves the grid open, the one built may be finer than the default. Its size must fit before it is allocated.
    let points =
        report.cells.iter().try_fold(1, |n, cells| cells.checked_add(3).and_then(|c| c.checked_mul(n)));
    if points.and_then(|n: usize| n.checked_mul(size_of::<[f64; 3]>())) != Some(payload.len()) {
        return None;
    }
    let spec = MapSpec { cells: Some(report.cells), ..spec.clone() };
    let mut map = WarpMap::flat(field.extent(), &spec).ok()?;
    let points = map.control_points_mut();
    if payload.len() != size_of_val(points) {
        return None;
    }
    let values = payload.as_chunks::<8>().0.iter().map(|b| f64::from_le_bytes(*b));
    for (target, value) in points.as_flattened_mut().iter_mut().zip(values) {
        *target = value;
    }
    Some((map, report))
}

/// The first line, and what follows.
fn line(bytes: &[u8]) -> Option<(&[u8], &[u8])> {
    let end = bytes.iter().position(|b| *b == b'\n')?;
    Some((&bytes[..end], &bytes[end + 1..]))
}

fn write(path: &Path, map: &WarpMap, report: &MapReport) -> Result<()> {
    let mut content = serde_json::to_vec(report).map_err(|e| Error::Internal(format!("map report: {e}")))?;
    content.push(b'\n');
    content.extend(map.control_points().as_flattened().iter().flat_map(|v| v.to_le_bytes()));
    let checksum = format!("{}\n", digest::sha256_hex(&content));
    let directory = path.parent().unwrap_or(Path::new("."));
    std::fs::create_dir_all(directory).map_err(|e| Error::io(directory, e))?;
    files::write_atomically(path, &[checksum.as_bytes(), &content].concat())
}
