//! From `[terrain]` of a scenario to the ground: the paper's shapes, formulas, heightmaps.
//!
//! Every kind ends as a [`Ground`]: a heightfield, and a report on how well it represents its source. To add a kind that is a
//! function of x and y, add a variant to `scenario/terrain.rs` and a line to `Shape::of`. To add a file format, add a reader
//! and an entry to `FORMATS` in `formats/mod.rs`.

mod analytic;
mod contact;
mod detour;
mod file;
mod fill;
mod formats;
mod formula;
mod function;
mod ground;
mod heightmap;
mod keep_out;
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
use crate::heightfield::Heightfield;
use crate::robot::Robot;
use crate::scenario::terrain::{Domain, HeightmapSpec};
use crate::scenario::{Scenario, TerrainSpec};
pub use contact::{ContactGround, FootNeeds};
pub use detour::Bends;
use formula::Formula;
pub use ground::{Ground, GroundReport};
pub use heightmap::{Heightmap, Source};
pub use keep_out::KeepOut;
pub use patch::Patch;
pub use scan::Scan;
pub use surfaces::Surfaces;

/// Builds the ground that a scenario specifies for its robot; its relative paths start at `base_dir`. Assumes that the ranges of
/// [`TerrainSpec`] hold, as loading a scenario ensures.
///
/// # Errors
/// [`Error::Key`](crate::Error::Key) for files that cannot be read or decoded, expressions that fail, and heights that are not
/// finite. Says what, where, and what is allowed.
pub fn build(scenario: &Scenario, robot: &Robot, base_dir: &Path) -> Result<Ground> {
    build_with_source(scenario, robot, base_dir).map(|(ground, _)| ground)
}

/// The same, with the heights as measured and what their file was taken for; none for a terrain that is a function.
///
/// # Errors
/// Those of [`build`].
pub fn build_with_source(
    scenario: &Scenario,
    robot: &Robot,
    base_dir: &Path,
) -> Result<(Ground, Option<Heightmap>)> {
    let kind = scenario.terrain.kind();
    match Shape::of(&scenario.terrain)? {
        Shape::Function(domain, h) => Ok((function::ground(kind, domain, h)?, None)),
        Shape::Heightmap(spec) => {
            let heightmap = heightmap::read(spec, base_dir)?;
            let ground = heightmap::ground(kind, spec, scenario.footholds(), robot.size(), &heightmap)?;
            Ok((ground, Some(heightmap)))
        }
    }
}

/// The heights that [`build`] finds for a terrain that is a function, without the report; none for a heightmap.
///
/// # Errors
/// Those of [`build`].
pub fn function_field(spec: &TerrainSpec) -> Result<Option<Heightfield>> {
    match Shape::of(spec)? {
        Shape::Function(domain, h) => function::field(domain, h).map(Some),
        Shape::Heightmap(_) => Ok(None),
    }
}

/// h(x, y), m.
type Function = Box<dyn Fn(f64, f64) -> Result<f64>>;

/// What a terrain is made from.
enum Shape<'a> {
    Function(&'a Domain, Function),
    Heightmap(&'a HeightmapSpec),
}

impl<'a> Shape<'a> {
    fn of(spec: &'a TerrainSpec) -> Result<Self> {
        Ok(match spec {
            TerrainSpec::Flat(flat) => Self::Function(&flat.domain, total(|_, _| 0.0)),
            TerrainSpec::Rippled(spec) => Self::Function(&spec.domain, total(analytic::rippled(spec))),
            TerrainSpec::Conic(spec) => Self::Function(&spec.domain, total(analytic::conic(spec))),
            TerrainSpec::Hilly(spec) => Self::Function(&spec.domain, total(analytic::hilly(spec))),
            TerrainSpec::Pit(spec) => Self::Function(&spec.domain, total(analytic::pit(spec))),
            TerrainSpec::Formula(spec) => {
                let formula = Formula::parse(&spec.expression)?;
                Self::Function(&spec.domain, Box::new(move |x, y| formula.height(x, y)))
            }
            TerrainSpec::Heightmap(spec) => Self::Heightmap(spec),
        })
    }
}

/// A function that never fails, in the form of one that may.
fn total(h: impl Fn(f64, f64) -> f64 + 'static) -> Function {
    Box::new(move |x, y| Ok(h(x, y)))
}
