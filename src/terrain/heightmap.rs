//! `kind = "heightmap"`: reads a file of heights in one of the [formats](super::formats) and places it in the world.

use std::path::Path;

use serde::Serialize;

use super::file::read_file;
use super::formats::{self, Input};
use super::ground::Ground;
use super::raster::{Raster, Values};
use super::scan::{self, Scan};
use super::{placing, suspect};
use crate::digest::sha256_hex;
use crate::error::{Error, Result};
use crate::scenario::Footholds;
use crate::scenario::terrain::HeightmapSpec;

/// Heights as measured, in the world, and what their file was taken for.
pub struct Heightmap {
    /// The heights, NaN where there is no data.
    pub scan: Scan,
    /// What the file was taken for.
    pub source: Source,
    /// Name as given in the scenario and SHA-256 (hexadecimal) of each file read.
    pub inputs: Vec<(String, String)>,
}

/// What a file of heights was taken for.
#[derive(Clone, Debug, Serialize)]
pub struct Source {
    /// Its name, as given.
    pub file: String,
    /// Its format, with an article.
    pub format: &'static str,
    /// The type of a value in the file.
    pub value_type: String,
    /// Which way its indices run.
    pub layout: &'static str,
    /// How many cells there are along its first and second index.
    pub shape: [usize; 2],
    /// Height of one unit of the file's values, m.
    pub unit: f64,
    /// Cells without data.
    pub unknown: usize,
    /// What a user should know.
    pub notes: Vec<String>,
}

/// Reads the file of a heightmap.
///
/// # Errors
/// [`Error::Key`] for files that cannot be read or decoded, missing keys, and heights that cannot be meant.
pub fn read(spec: &HeightmapSpec, base_dir: &Path) -> Result<Heightmap> {
    let name = &spec.file;
    let located = |e: Error| match e {
        Error::Key { .. } => e,
        other => Error::key("terrain.file", format!("{name:?}: {other}")),
    };
    let path = base_dir.join(name);
    let bytes = read_file(&path).map_err(located)?;
    let input = Input { bytes: &bytes, path: &path, member: spec.member.as_deref(), spacing: spec.spacing };
    let format = formats::recognize(&input).map_err(located)?;
    let mut raster = (format.decode)(&input).map_err(located)?;
    raster.drop_no_data(spec.no_data.as_ref().map_or(&[][..], |numbers| numbers.as_slice()));
    let Scale { zero, unit, base } = scale(&raster, spec, format.name)?;
    let shape = [raster.rows, raster.columns];
    let layout = spec.layout.unwrap_or(raster.layout);
    let value_type = std::mem::take(&mut raster.value_type);
    let mut inputs = vec![(name.clone(), sha256_hex(&bytes))];
    inputs.extend(raster.inputs.drain(..).map(|(path, sum)| {
        let relative = Path::new(&path).strip_prefix(base_dir).map(|path| path.display().to_string());
        (relative.unwrap_or(path), sum)
    }));

    let (grid, placing) = placing::grid(&raster, spec, layout, format.name)?;
    let [x_min, x_max, y_min, y_max] = grid.extent();
    let diagonal = (x_max - x_min).hypot(y_max - y_min);
    let suspicion = suspect::check(&raster.values, unit, diagonal).map_err(located)?;
    for value in &mut raster.values {
        *value = (*value - zero) * unit + base;
    }
    let (scan, squared) = placing::scan(&raster, layout, &grid).map_err(located)?;
    let source = Source {
        file: name.clone(),
        format: format.name,
        value_type,
        layout: layout.name(),
        shape,
        unit,
        unknown: scan.heights.iter().filter(|h| h.is_nan()).count(),
        notes: raster.notes.into_iter().chain(placing).chain(squared).chain(suspicion).collect(),
    };
    Ok(Heightmap { scan, source, inputs })
}

/// The ground of a heightmap that was read, for a robot of a size.
///
/// # Errors
/// [`Error::Key`] for heights that cannot be turned into a heightfield.
pub fn ground(
    kind: &'static str,
    spec: &HeightmapSpec,
    footholds: Footholds,
    size: f64,
    heightmap: &Heightmap,
) -> Result<Ground> {
    let Heightmap { scan, source, inputs } = heightmap;
    if let Some(what) = spec.excess_of_smoothing(scan.grid.spacing[0]) {
        return Err(Error::key("terrain.smoothing", what));
    }
    let mut ground = scan::ground(kind, spec, footholds, size, scan)?;
    ground.inputs.extend(inputs.iter().cloned());
    ground.report.notes.splice(0..0, source.notes.iter().cloned());
    Ok(ground)
}

/// From values to heights: `(value - zero) * unit + base`.
struct Scale {
    zero: f64,
    /// Height of one unit of the values, m.
    unit: f64,
    /// m.
    base: f64,
}

fn scale(raster: &Raster, spec: &HeightmapSpec, format: &str) -> Result<Scale> {
    let needed = |what: &str| {
        let refusal = || Error::key("terrain.height_scale", format!("missing; {format} needs it: {what}"));
        spec.height_scale.ok_or_else(refusal)
    };
    let factor = spec.height_scale.unwrap_or(1.0);
    let unit = match raster.meaning {
        Values::Meters => factor,
        Values::Mapped { zero, unit, base } => {
            return Ok(Scale { zero, unit: factor * unit, base: factor * base });
        }
        Values::Levels { white } => needed("the height in m from black to white")? / white,
        Values::Normalized => {
            let height = needed("the height in m from the least to the greatest value")?;
            let (zero, span) = raster.least_and_span();
            return Ok(Scale { zero, unit: height / span, base: 0.0 });
        }
        Values::Integers => {
            let (low, high) = super::raster::range(&raster.values);
            needed(&format!(
                "of {}, with values from {low} to {high}, the height in m of one unit",
                raster.value_type
            ))?
        }
    };
    Ok(Scale { zero: 0.0, unit, base: 0.0 })
}
