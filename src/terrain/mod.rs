//! From `[terrain]` of a scenario to the ground: analytic shapes, formulas, heightmaps and meshes.
//!
//! Everything ends as a [`Heightfield`] with a [`GroundReport`] that says how well it renders its source.

mod analytic;
mod formula;
mod heightmap;
mod image;
mod npy;
mod scan;

use std::path::Path;

use serde::Serialize;

use crate::error::{Error, Result};
use crate::heightfield::Heightfield;
use crate::scenario::{TerrainKind, TerrainSpec};
pub use analytic::Analytic;
pub use formula::Formula;

/// x_min, x_max, y_min, y_max of a terrain that is defined everywhere, m.
const DEFAULT_EXTENT: [f64; 4] = [-3.0, 3.0, -3.0, 3.0];
/// Grid spacing of a terrain that can be evaluated anywhere, m.
const DEFAULT_SPACING: f64 = 0.01;
/// Errors of the spline above this are pointed out, m.
const NOTABLE_ERROR: f64 = 0.002;

/// The ground, as everything downstream uses it.
#[derive(Clone, Debug)]
pub struct Ground {
    /// z = h(x, y).
    pub field: Heightfield,
    /// (rows, columns) of the same grid before smoothing, holes filled, m; for heightmaps and meshes.
    pub raw: Option<Vec<f64>>,
    /// What it is and how well it renders its source.
    pub report: GroundReport,
    /// Name as given in the scenario and SHA-256 (hexadecimal) of each file read.
    pub inputs: Vec<(String, String)>,
}

/// What a ground is and how well it renders its source.
#[derive(Clone, Debug, PartialEq, Serialize)]
pub struct GroundReport {
    /// `terrain.kind`.
    pub kind: TerrainKind,
    /// Columns, rows.
    pub grid: [usize; 2],
    /// Of neighbouring nodes along x, y, m.
    pub spacing: [f64; 2],
    /// x_min, x_max, y_min, y_max, m.
    pub extent: [f64; 4],
    /// Least and greatest height, m.
    pub height_range: [f64; 2],
    /// Greatest |∇h| over the nodes and the centres of the cells.
    pub largest_slope: f64,
    /// x, y of the greatest slope, m.
    pub steepest_at: [f64; 2],
    /// Spline against source, root mean square, m: between the nodes of formulas, at the measured cells of scans (there
    /// it is what smoothing took away).
    pub fit_error_rms: f64,
    /// The same, greatest, m.
    pub fit_error_max: f64,
    /// Cells without data that were filled.
    pub holes_filled: usize,
    /// Standard deviation of the smoothing, m; 0 for none.
    pub smoothing: f64,
    /// What a user should know besides, in sentences.
    pub notes: Vec<String>,
}

/// Builds the ground that a scenario asks for; `base_dir` is where the scenario's relative paths start.
///
/// # Errors
/// [`Error::Input`] for keys that do not belong to the kind, values out of range, files that cannot be read or
/// understood, expressions that fail, heights that are not finite: each says what, where, and what would be allowed.
pub fn build(spec: &TerrainSpec, base_dir: &Path) -> Result<Ground> {
    check_keys(spec)?;
    match spec.kind {
        TerrainKind::Formula => {
            let text = required(spec, "expression", spec.expression.as_deref())?;
            let formula = Formula::parse(text)?;
            sampled(spec, |x, y| formula.height(x, y))
        }
        TerrainKind::Heightmap => heightmap::build(spec, base_dir),
        TerrainKind::Mesh => Err(Error::input(
            "terrain.kind \"mesh\" is not supported yet: render the mesh from above into a heightmap (PNG or .npy)",
        )),
        _ => {
            let shape = Analytic::new(spec)?;
            sampled(spec, |x, y| Ok(shape.height(x, y)))
        }
    }
}

/// A ground from a function that can be evaluated anywhere.
fn sampled(spec: &TerrainSpec, h: impl Fn(f64, f64) -> Result<f64>) -> Result<Ground> {
    let extent = spec.extent.unwrap_or(DEFAULT_EXTENT);
    let field = Heightfield::from_function(extent, spec.spacing.unwrap_or(DEFAULT_SPACING), &h)?;
    let mut error = FitError::default();
    let grid = *field.grid();
    for row in 0..grid.rows - 1 {
        for column in 0..grid.columns - 1 {
            let (x, y) = (grid.x(column) + 0.5 * grid.spacing[0], grid.y(row) + 0.5 * grid.spacing[1]);
            error.add(x, y, field.height(x, y) - h(x, y)?);
        }
    }
    let mut report = GroundReport::of(spec.kind, &field, &error);
    if error.max > NOTABLE_ERROR {
        report.notes.push(format!(
            "the spline misses h(x, y) by up to {:.4} m, near x = {:.3}, y = {:.3}: h has an edge there, or \
             terrain.spacing is too coarse",
            error.max, error.at[0], error.at[1]
        ));
    }
    Ok(Ground { field, raw: None, report, inputs: Vec::new() })
}

/// Differences between the spline and its source.
#[derive(Default)]
struct FitError {
    squares: f64,
    count: usize,
    max: f64,
    at: [f64; 2],
}

impl FitError {
    fn add(&mut self, x: f64, y: f64, difference: f64) {
        self.squares += difference * difference;
        self.count += 1;
        if difference.abs() > self.max {
            self.max = difference.abs();
            self.at = [x, y];
        }
    }
}

impl GroundReport {
    fn of(kind: TerrainKind, field: &Heightfield, error: &FitError) -> Self {
        let grid = field.grid();
        let (low, high) = crate::heightfield::raster::range(field.samples());
        let (mut largest_slope, mut steepest_at) = (0.0, [grid.x(0), grid.y(0)]);
        let mut look = |x: f64, y: f64| {
            let [hx, hy] = field.gradient(x, y);
            if hx.hypot(hy) > largest_slope {
                largest_slope = hx.hypot(hy);
                steepest_at = [x, y];
            }
        };
        for row in 0..grid.rows {
            for column in 0..grid.columns {
                let (x, y) = (grid.x(column), grid.y(row));
                look(x, y);
                if row + 1 < grid.rows && column + 1 < grid.columns {
                    look(x + 0.5 * grid.spacing[0], y + 0.5 * grid.spacing[1]);
                }
            }
        }
        Self {
            kind,
            grid: [grid.columns, grid.rows],
            spacing: grid.spacing,
            extent: field.extent(),
            height_range: [low, high],
            largest_slope,
            steepest_at,
            fit_error_rms: (error.squares / error.count.max(1) as f64).sqrt(),
            fit_error_max: error.max,
            holes_filled: 0,
            smoothing: 0.0,
            notes: Vec::new(),
        }
    }
}

/// The keys of `[terrain]` besides `kind` that a kind understands.
fn allowed_keys(kind: TerrainKind) -> &'static [&'static str] {
    match kind {
        TerrainKind::Flat => &["extent", "spacing"],
        TerrainKind::Rippled => &["level", "amplitude", "wavelength", "extent", "spacing"],
        TerrainKind::Conic => &["level", "slope", "radius", "tip", "foot", "extent", "spacing"],
        TerrainKind::Hilly => &["level", "height", "width", "extent", "spacing"],
        TerrainKind::Pit => &["level", "depth", "radius", "edge", "extent", "spacing"],
        TerrainKind::Formula => &["expression", "extent", "spacing"],
        TerrainKind::Heightmap => &["file", "spacing", "height_scale", "smoothing", "origin", "extent"],
        TerrainKind::Mesh => &["file", "spacing", "smoothing", "extent"],
    }
}

/// Refuses keys that the kind would ignore.
fn check_keys(spec: &TerrainSpec) -> Result<()> {
    let given = [
        ("level", spec.level.is_some()),
        ("amplitude", spec.amplitude.is_some()),
        ("wavelength", spec.wavelength.is_some()),
        ("slope", spec.slope.is_some()),
        ("radius", spec.radius.is_some()),
        ("tip", spec.tip.is_some()),
        ("foot", spec.foot.is_some()),
        ("height", spec.height.is_some()),
        ("width", spec.width.is_some()),
        ("depth", spec.depth.is_some()),
        ("edge", spec.edge.is_some()),
        ("expression", spec.expression.is_some()),
        ("file", spec.file.is_some()),
        ("spacing", spec.spacing.is_some()),
        ("height_scale", spec.height_scale.is_some()),
        ("smoothing", spec.smoothing.is_some()),
        ("origin", spec.origin.is_some()),
        ("extent", spec.extent.is_some()),
    ];
    let allowed = allowed_keys(spec.kind);
    match given.iter().find(|(key, given)| *given && !allowed.contains(key)) {
        None => Ok(()),
        Some((key, _)) => Err(Error::input(format!(
            "terrain.{key} does not belong to kind {:?}; allowed there: {}",
            kind_name(spec.kind),
            allowed.join(", ")
        ))),
    }
}

fn kind_name(kind: TerrainKind) -> String {
    format!("{kind:?}").to_lowercase()
}

/// The value of a key that its kind cannot do without.
fn required<T>(spec: &TerrainSpec, key: &str, value: Option<T>) -> Result<T> {
    value.ok_or_else(|| {
        Error::input(format!("terrain.{key} is missing: kind {:?} needs it", kind_name(spec.kind)))
    })
}

/// The value, if it is within a closed range.
fn in_range(key: &str, value: f64, [low, high]: [f64; 2]) -> Result<f64> {
    if (low..=high).contains(&value) {
        return Ok(value);
    }
    Err(Error::input(format!("terrain.{key} = {value} is out of range: between {low} and {high}")))
}
