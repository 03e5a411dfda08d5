//! `[map]`: how the map φ is computed.

use schemars::JsonSchema;
use serde::{Deserialize, Serialize};

/// The method that computes the map.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq, Serialize, Deserialize, JsonSchema)]
#[serde(rename_all = "kebab-case")]
pub enum MapMethod {
    /// The scale-invariant energy ¼(‖J‖²/det^⅔ − 3).
    #[default]
    Mips,
    /// As conformal as possible by Algorithm 1; may fold.
    AcapLocalGlobal,
    /// The same energy with a barrier against folds, minimized by Gauss–Newton.
    AcapNewton,
    /// Laplace's equation; may fold.
    Dirichlet,
    /// As rigid as possible; may fold.
    Arap,
    /// (x, y, z + h).
    Shear,
    /// The cheapest method that is good enough.
    Auto,
}

impl MapMethod {
    /// Its name in a scenario.
    pub fn name(self) -> &'static str {
        match self {
            MapMethod::Mips => "mips",
            MapMethod::AcapLocalGlobal => "acap-local-global",
            MapMethod::AcapNewton => "acap-newton",
            MapMethod::Dirichlet => "dirichlet",
            MapMethod::Arap => "arap",
            MapMethod::Shear => "shear",
            MapMethod::Auto => "auto",
        }
    }
}

/// The scale of the scaled rotation that J is compared with in the `acap` methods.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq, Serialize, Deserialize, JsonSchema)]
#[serde(rename_all = "kebab-case")]
pub enum MapScale {
    /// tr Σ/3, the nearest.
    #[default]
    Trace,
    /// |Σ|^⅓, as in the paper.
    Determinant,
}

/// `[map]`.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize, JsonSchema)]
#[serde(deny_unknown_fields, default)]
pub struct MapSpec {
    /// The method.
    pub method: MapMethod,
    /// acap-local-global, acap-newton: the scale.
    pub scale: MapScale,
    /// Cells along x, y, z. Default: 48, 48, 16 over a square. Over an oblong, about as many cells, each about square. Twice
    /// as many along x and y where the curvature of the terrain needs them.
    #[schemars(inner(range(min = 4, max = 512)))]
    pub cells: Option<[usize; 3]>,
    /// Height of the box, m.
    #[schemars(range(min = 0.1, max = 100.0))]
    pub thickness: f64,
    /// Weight of the energy well above the ground, where the torso is, relative to its weight at the ground. More makes
    /// the map gentler there and less conformal at the ground. (dirichlet weights all heights alike; shear has no energy.)
    #[schemars(range(min = 0.001, max = 10.0))]
    pub torso_weight: f64,
}

impl Default for MapSpec {
    fn default() -> Self {
        Self {
            method: MapMethod::Mips,
            scale: MapScale::Trace,
            cells: None,
            thickness: 2.5,
            torso_weight: 0.03,
        }
    }
}

impl MapSpec {
    /// The initial number of cells over a rectangle (x_min, x_max, y_min, y_max), m.
    pub fn cells(&self, [x_min, x_max, y_min, y_max]: [f64; 4]) -> [usize; 3] {
        let oblong = ((x_max - x_min) / (y_max - y_min)).sqrt().clamp(1.0 / 6.0, 6.0);
        // Multiples of 8, so that there are coarser grids to start from.
        let along = |ratio: f64| 8 * (6.0 * ratio).round() as usize;
        self.cells.unwrap_or([along(oblong), along(1.0 / oblong), 16])
    }
}
