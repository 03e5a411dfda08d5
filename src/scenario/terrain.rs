//! `[terrain]`: the kinds of ground, and for each kind its keys, their ranges and their defaults.
//!
//! This is the only place that lists them. The JSON Schema and the error messages are derived from these types, the
//! template is tested against them, and [`crate::terrain`] builds the ground from them.

use schemars::JsonSchema;
use serde::{Deserialize, Serialize};

use super::motion::Footholds;

/// `[terrain]`: the ground, by `kind`.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize, JsonSchema)]
#[serde(tag = "kind", rename_all = "kebab-case")]
pub enum TerrainSpec {
    /// h = 0.
    Flat(FlatSpec),
    /// h = A sin(kx) sin(ky), k = 2π/wavelength.
    Rippled(RippledSpec),
    /// A smooth cone, h = s β softplus((ρ₀ − √(ρ² + ε²))/β), with ρ² = x² + y².
    Conic(ConicSpec),
    /// A Gaussian hill, h = H exp(−ρ²/(2w²)).
    Hilly(HillySpec),
    /// A round pit with a smooth edge, h = −D/2 (1 − tanh((ρ² − ρ₀²)/(2ρ₀δ))).
    Pit(PitSpec),
    /// An expression in x and y.
    Formula(FormulaSpec),
    /// Heights in a file: an image, an array, a grid, a mesh.
    Heightmap(HeightmapSpec),
}

impl TerrainSpec {
    /// The file that it names, relative to the scenario; none for a function.
    pub fn file(&self) -> Option<&str> {
        match self {
            TerrainSpec::Heightmap(spec) => Some(&spec.file),
            TerrainSpec::Flat(_)
            | TerrainSpec::Rippled(_)
            | TerrainSpec::Conic(_)
            | TerrainSpec::Hilly(_)
            | TerrainSpec::Pit(_)
            | TerrainSpec::Formula(_) => None,
        }
    }

    /// Its `kind`, as in a scenario.
    pub fn kind(&self) -> &'static str {
        match self {
            TerrainSpec::Flat(_) => "flat",
            TerrainSpec::Rippled(_) => "rippled",
            TerrainSpec::Conic(_) => "conic",
            TerrainSpec::Hilly(_) => "hilly",
            TerrainSpec::Pit(_) => "pit",
            TerrainSpec::Formula(_) => "formula",
            TerrainSpec::Heightmap(_) => "heightmap",
        }
    }

    /// x_min, x_max, y_min, y_max, m; none if it is that of the terrain's file.
    pub fn extent(&self) -> Option<[f64; 4]> {
        match self {
            TerrainSpec::Flat(FlatSpec { domain })
            | TerrainSpec::Rippled(RippledSpec { domain, .. })
            | TerrainSpec::Conic(ConicSpec { domain, .. })
            | TerrainSpec::Hilly(HillySpec { domain, .. })
            | TerrainSpec::Pit(PitSpec { domain, .. })
            | TerrainSpec::Formula(FormulaSpec { domain, .. }) => Some(domain.extent),
            TerrainSpec::Heightmap(spec) => spec.extent,
        }
    }
}

/// Where a terrain that is a function of x and y is sampled.
#[derive(Clone, Copy, Debug, PartialEq, Serialize, Deserialize, JsonSchema)]
#[serde(default)]
pub struct Domain {
    /// x_min, x_max, y_min, y_max, m.
    #[schemars(inner(range(min = -1e6, max = 1e6)))]
    pub extent: [f64; 4],
    /// Spacing of the grid on which h is sampled, m.
    #[schemars(range(min = 0.001, max = 10.0))]
    pub spacing: f64,
}

impl Default for Domain {
    fn default() -> Self {
        Self { extent: [-3.0, 3.0, -3.0, 3.0], spacing: 0.01 }
    }
}

/// How steep a terrain of the paper is. Parameters given by name override it.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq, Serialize, Deserialize, JsonSchema)]
#[serde(rename_all = "kebab-case")]
pub enum Level {
    /// Gentle.
    Easy,
    /// As in the paper, judging by its figures.
    #[default]
    Medium,
    /// Steep.
    Hard,
}

impl Level {
    /// The default of a parameter at this level.
    fn pick(self, [easy, medium, hard]: [f64; 3]) -> f64 {
        match self {
            Level::Easy => easy,
            Level::Medium => medium,
            Level::Hard => hard,
        }
    }
}

/// `kind = "flat"`.
#[derive(Clone, Debug, Default, PartialEq, Serialize, Deserialize, JsonSchema)]
#[serde(default, deny_unknown_fields)]
#[schemars(inline)]
pub struct FlatSpec {
    /// Where h is sampled.
    #[serde(flatten)]
    pub domain: Domain,
}

/// `kind = "rippled"`.
#[derive(Clone, Debug, Default, PartialEq, Serialize, Deserialize, JsonSchema)]
#[serde(default, deny_unknown_fields)]
#[schemars(inline)]
pub struct RippledSpec {
    /// How steep; parameters given by name override it.
    pub level: Level,
    /// A, m; default by level.
    #[schemars(range(min = -10.0, max = 10.0))]
    pub amplitude: Option<f64>,
    /// 2π/k, m; default by level.
    #[schemars(range(min = 0.05, max = 1000.0))]
    pub wavelength: Option<f64>,
    /// Where h is sampled.
    #[serde(flatten)]
    pub domain: Domain,
}

impl RippledSpec {
    /// A, m.
    pub fn amplitude(&self) -> f64 {
        self.amplitude.unwrap_or(self.level.pick([0.08, 0.15, 0.25]))
    }

    /// 2π/k, m.
    pub fn wavelength(&self) -> f64 {
        self.wavelength.unwrap_or(2.4)
    }
}

/// `kind = "conic"`.
#[derive(Clone, Debug, Default, PartialEq, Serialize, Deserialize, JsonSchema)]
#[serde(default, deny_unknown_fields)]
#[schemars(inline)]
pub struct ConicSpec {
    /// How steep; parameters given by name override it.
    pub level: Level,
    /// s; default by level.
    #[schemars(range(min = -10.0, max = 10.0))]
    pub slope: Option<f64>,
    /// ρ₀, m; default by level.
    #[schemars(range(min = 0.01, max = 1000.0))]
    pub radius: Option<f64>,
    /// ε, m; default by level.
    #[schemars(range(min = 0.01, max = 100.0))]
    pub tip: Option<f64>,
    /// β, m; default by level.
    #[schemars(range(min = 0.01, max = 100.0))]
    pub foot: Option<f64>,
    /// Where h is sampled.
    #[serde(flatten)]
    pub domain: Domain,
}

impl ConicSpec {
    /// s.
    pub fn slope(&self) -> f64 {
        self.slope.unwrap_or(self.level.pick([0.3, 0.5, 0.7]))
    }

    /// ρ₀, m.
    pub fn radius(&self) -> f64 {
        self.radius.unwrap_or(2.2)
    }

    /// ε, m.
    pub fn tip(&self) -> f64 {
        self.tip.unwrap_or(self.level.pick([0.4, 0.3, 0.2]))
    }

    /// β, m.
    pub fn foot(&self) -> f64 {
        self.foot.unwrap_or(self.level.pick([0.15, 0.12, 0.10]))
    }
}

/// `kind = "hilly"`.
#[derive(Clone, Debug, Default, PartialEq, Serialize, Deserialize, JsonSchema)]
#[serde(default, deny_unknown_fields)]
#[schemars(inline)]
pub struct HillySpec {
    /// How steep; parameters given by name override it.
    pub level: Level,
    /// H, m; default by level.
    #[schemars(range(min = -20.0, max = 20.0))]
    pub height: Option<f64>,
    /// w, m; default by level.
    #[schemars(range(min = 0.01, max = 1000.0))]
    pub width: Option<f64>,
    /// Where h is sampled.
    #[serde(flatten)]
    pub domain: Domain,
}

impl HillySpec {
    /// H, m.
    pub fn height(&self) -> f64 {
        self.height.unwrap_or(self.level.pick([0.6, 1.0, 1.5]))
    }

    /// w, m.
    pub fn width(&self) -> f64 {
        self.width.unwrap_or(0.6)
    }
}

/// `kind = "pit"`.
#[derive(Clone, Debug, Default, PartialEq, Serialize, Deserialize, JsonSchema)]
#[serde(default, deny_unknown_fields)]
#[schemars(inline)]
pub struct PitSpec {
    /// How steep; parameters given by name override it.
    pub level: Level,
    /// D, m; default by level.
    #[schemars(range(min = -20.0, max = 20.0))]
    pub depth: Option<f64>,
    /// ρ₀, m; default by level.
    #[schemars(range(min = 0.01, max = 1000.0))]
    pub radius: Option<f64>,
    /// δ, m; default by level.
    #[schemars(range(min = 0.01, max = 100.0))]
    pub edge: Option<f64>,
    /// Where h is sampled.
    #[serde(flatten)]
    pub domain: Domain,
}

impl PitSpec {
    /// D, m.
    pub fn depth(&self) -> f64 {
        self.depth.unwrap_or(self.level.pick([0.4, 0.6, 0.9]))
    }

    /// ρ₀, m.
    pub fn radius(&self) -> f64 {
        self.radius.unwrap_or(1.2)
    }

    /// δ, m.
    pub fn edge(&self) -> f64 {
        self.edge.unwrap_or(self.level.pick([0.20, 0.15, 0.10]))
    }
}

/// `kind = "formula"`.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize, JsonSchema)]
#[serde(deny_unknown_fields)]
#[schemars(inline)]
pub struct FormulaSpec {
    /// h(x, y), m.
    pub expression: String,
    /// Where h is sampled.
    #[serde(flatten)]
    pub domain: Domain,
}

/// Which way the indices of a heightmap a[i, j] run, i the first (the row in a file), j the second (the column).
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq, Serialize, Deserialize, JsonSchema)]
#[serde(rename_all = "kebab-case")]
pub enum Layout {
    /// As one looks at a picture: i against y, j along x; a[0, 0] has the least x and the largest y.
    #[default]
    Picture,
    /// As NumPy's `meshgrid` and MuJoCo have it: i along y, j along x; a[0, 0] has the least x and y.
    YUp,
    /// As Isaac Gym has it: i along x, j along y; a[0, 0] has the least x and y.
    XY,
    /// As ETH's `grid_map` has it: i against x, j against y; a[0, 0] has the largest x and y.
    GridMap,
}

impl Layout {
    /// Its name in a scenario.
    pub fn name(self) -> &'static str {
        match self {
            Layout::Picture => "picture",
            Layout::YUp => "y-up",
            Layout::XY => "x-y",
            Layout::GridMap => "grid-map",
        }
    }

    /// Whether the first index runs along x, so that rows and columns change places.
    pub fn first_is_x(self) -> bool {
        matches!(self, Layout::XY | Layout::GridMap)
    }
}

/// A number, or several.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize, JsonSchema)]
#[serde(untagged)]
pub enum Numbers {
    /// One.
    One(f64),
    /// Any number of them.
    Many(Vec<f64>),
}

impl Numbers {
    /// All of them.
    pub fn as_slice(&self) -> &[f64] {
        match self {
            Numbers::One(number) => std::slice::from_ref(number),
            Numbers::Many(numbers) => numbers,
        }
    }
}

/// `kind = "heightmap"`.
#[derive(Clone, Debug, Default, PartialEq, Serialize, Deserialize, JsonSchema)]
#[serde(deny_unknown_fields)]
#[schemars(inline)]
pub struct HeightmapSpec {
    /// The file, relative to the scenario; `docs/inputs.md` lists the formats.
    pub file: String,
    /// What to take from a file with several members: an array of an `.npz`, an `<hfield>` of an MJCF file. Default: the only one.
    pub member: Option<String>,
    /// Which way the indices run. Default: what the file tells; `picture` for images, `.npy` and text.
    pub layout: Option<Layout>,
    /// Distance between neighboring cells, m; default: that of the file. Required if the file tells none.
    #[schemars(range(min = 0.001, max = 10.0))]
    pub spacing: Option<f64>,
    /// Image: height from black to white, m; required. Integers: height of one unit, m; required. Floats: factor that converts to m; default 1.
    #[schemars(range(min = -1000.0, max = 1000.0))]
    pub height_scale: Option<f64>,
    /// Values, as stored in the file, that stand for no data; in addition to NaN and to what the file tells.
    pub no_data: Option<Numbers>,
    /// Standard deviation of the smoothing, m; at most 50 cells. Default with `contact.footholds = "patches"`: 0; else 1.5 cells, but
    /// at least 0.03 and at most 0.06 m.
    #[schemars(range(min = 0.0, max = 10.0))]
    pub smoothing: Option<f64>,
    /// x, y of the center of the file, m; default: what the file tells, else 0, 0.
    #[schemars(inner(range(min = -1e5, max = 1e5)))]
    pub origin: Option<[f64; 2]>,
    /// x_min, x_max, y_min, y_max of the part to use, m; default: all of the file.
    #[schemars(inner(range(min = -1e6, max = 1e6)))]
    pub extent: Option<[f64; 4]>,
}

impl HeightmapSpec {
    /// Default smoothing: this many cells, because the finest detail of a scan is noise …
    pub const SMOOTHING_CELLS: f64 = 1.5;
    /// … but at least this length, m, for a robot of ANYmal's size: a foot does not feel anything finer.
    pub const SMOOTHING_LENGTH: f64 = 0.03;
    /// … and at most this length, m, likewise, however coarse the scan: ground that is moved further under a foot is not the ground any more.
    pub const SMOOTHING_CEILING: f64 = 0.06;
    /// Smoothing over more cells than this is refused; it would take minutes.
    pub const SMOOTHING_LIMIT: f64 = 50.0;

    /// The least and the greatest default smoothing for a robot of a size, m.
    pub fn smoothing_range(size: f64) -> [f64; 2] {
        [Self::SMOOTHING_LENGTH, Self::SMOOTHING_CEILING].map(|length| size * length)
    }

    /// Standard deviation of the smoothing of cells of a spacing, m, for a robot of a size.
    pub fn smoothing(&self, footholds: Footholds, spacing: f64, size: f64) -> f64 {
        let default = match footholds {
            Footholds::Patches => 0.0,
            Footholds::Anywhere => {
                let [least, most] = Self::smoothing_range(size);
                (Self::SMOOTHING_CELLS * spacing).clamp(least, most)
            }
        };
        self.smoothing.unwrap_or(default.min(Self::SMOOTHING_LIMIT * spacing))
    }

    /// What is wrong with a smoothing that is given, for cells of a spacing.
    pub fn excess_of_smoothing(&self, spacing: f64) -> Option<String> {
        let (given, most) = (self.smoothing?, Self::SMOOTHING_LIMIT * spacing);
        let limit = Self::SMOOTHING_LIMIT;
        (given > most).then(|| {
            format!("given {given}, allowed: at most {most} m, {limit} times the spacing of the cells")
        })
    }
}
