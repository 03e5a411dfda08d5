//! From `[terrain]` of a scenario to the ground: the paper's shapes, formulas, heightmaps.
//!
//! Every kind ends as a [`Ground`]: a heightfield, and a report on how well it represents its source. To add a kind that is a
//! function of x and y, add a variant to `scenario/terrain.rs` and a line to [`build`]. To add a file format, add a reader
//! and an entry to `FORMATS` in `formats/mod.rs`.

mod analytic;
mod contact;
mod file;
mod fill;
mod formats;
mod formula;
mod function;
mod ground;
mod heightmap;
mod morphology;
mod patch;
mod placing;
mod raster;
mod scan;
mod smooth;
mod surfaces;
mod suspect;

use std::path::Path;

use crate::error::Result;
use crate::scenario::{Scenario, TerrainSpec};
pub use contact::{ContactGround, FootNeeds};
use formula::Formula;
pub use ground::{Ground, GroundReport};
pub use heightmap::{Heightmap, Source, read as read_heightmap};
pub use patch::Patch;
pub use scan::Scan;
pub use surfaces::Surfaces;

/// Builds the ground that a scenario specifies; its relative paths start at `base_dir`. Assumes that the ranges of
/// [`TerrainSpec`] hold, as loading a scenario ensures.
///
/// # Errors
/// [`Error::Key`](crate::Error::Key) for files that cannot be read or decoded, expressions that fail, and heights that are not
/// finite. Says what, where, and what is allowed.
pub fn build(scenario: &Scenario, base_dir: &Path) -> Result<Ground> {
    let kind = scenario.terrain.kind();
    match &scenario.terrain {
        TerrainSpec::Flat(flat) => function::ground(kind, &flat.domain, |_, _| Ok(0.0)),
        TerrainSpec::Rippled(rippled) => {
            function::ground(kind, &rippled.domain, total(analytic::rippled(rippled)))
        }
        TerrainSpec::Conic(conic) => function::ground(kind, &conic.domain, total(analytic::conic(conic))),
        TerrainSpec::Hilly(hilly) => function::ground(kind, &hilly.domain, total(analytic::hilly(hilly))),
        TerrainSpec::Pit(pit) => function::ground(kind, &pit.domain, total(analytic::pit(pit))),
        TerrainSpec::Formula(spec) => {
            let formula = Formula::parse(&spec.expression)?;
            function::ground(kind, &spec.domain, |x, y| formula.height(x, y))
        }
        TerrainSpec::Heightmap(heightmap) => {
            heightmap::ground(kind, heightmap, scenario.footholds(), base_dir)
        }
    }
}

/// A function that never fails, in the form of one that may.
fn total(h: impl Fn(f64, f64) -> f64) -> impl Fn(f64, f64) -> Result<f64> {
    move |x, y| Ok(h(x, y))
}
