//! The smooth terrains of the paper's Fig. 3, as formulas with three levels of steepness.

use crate::error::{Error, Result};
use crate::scenario::{Level, TerrainKind, TerrainSpec};

/// One of the terrains with its parameters, in metres; ρ² = x² + y².
#[derive(Clone, Copy, Debug, PartialEq)]
pub enum Analytic {
    /// h = 0.
    Flat,
    /// h = A sin(kx) sin(ky), k = 2π/wavelength.
    Rippled {
        /// A, m.
        amplitude: f64,
        /// 2π/k, m.
        wavelength: f64,
    },
    /// h = s β softplus((ρ₀ − √(ρ² + ε²))/β).
    Conic {
        /// s.
        slope: f64,
        /// ρ₀, m.
        radius: f64,
        /// ε, m.
        tip: f64,
        /// β, m.
        foot: f64,
    },
    /// h = H exp(−ρ²/(2w²)).
    Hilly {
        /// H, m.
        height: f64,
        /// w, m.
        width: f64,
    },
    /// h = −D/2 (1 − tanh((ρ² − ρ₀²)/(2ρ₀δ))).
    Pit {
        /// D, m.
        depth: f64,
        /// ρ₀, m.
        radius: f64,
        /// δ, m.
        edge: f64,
    },
}

/// Heights and slopes: which values make sense.
const SIZE: [f64; 2] = [-20.0, 20.0];
/// Lengths that divide.
const LENGTH: [f64; 2] = [0.01, 1000.0];

impl Analytic {
    /// The terrain of a kind: the parameters of its `level` (default medium), those given by name instead.
    ///
    /// # Errors
    /// For parameters out of range. (That each parameter belongs to the kind is checked by [`super::build`].)
    pub fn new(spec: &TerrainSpec) -> Result<Self> {
        let level = spec.level.unwrap_or_default();
        let parameter = |name: &str, given: Option<f64>, [easy, medium, hard]: [f64; 3], range: [f64; 2]| {
            let value = given.unwrap_or(match level {
                Level::Easy => easy,
                Level::Medium => medium,
                Level::Hard => hard,
            });
            super::in_range(name, value, range)
        };
        Ok(match spec.kind {
            TerrainKind::Flat => Self::Flat,
            TerrainKind::Rippled => Self::Rippled {
                amplitude: parameter("amplitude", spec.amplitude, [0.08, 0.15, 0.25], SIZE)?,
                wavelength: parameter("wavelength", spec.wavelength, [2.4; 3], LENGTH)?,
            },
            TerrainKind::Conic => Self::Conic {
                slope: parameter("slope", spec.slope, [0.3, 0.5, 0.7], SIZE)?,
                radius: parameter("radius", spec.radius, [2.2; 3], LENGTH)?,
                tip: parameter("tip", spec.tip, [0.4, 0.3, 0.2], LENGTH)?,
                foot: parameter("foot", spec.foot, [0.15, 0.12, 0.10], LENGTH)?,
            },
            TerrainKind::Hilly => Self::Hilly {
                height: parameter("height", spec.height, [0.6, 1.0, 1.5], SIZE)?,
                width: parameter("width", spec.width, [0.6; 3], LENGTH)?,
            },
            TerrainKind::Pit => Self::Pit {
                depth: parameter("depth", spec.depth, [0.4, 0.6, 0.9], SIZE)?,
                radius: parameter("radius", spec.radius, [1.2; 3], LENGTH)?,
                edge: parameter("edge", spec.edge, [0.20, 0.15, 0.10], LENGTH)?,
            },
            TerrainKind::Formula | TerrainKind::Heightmap | TerrainKind::Mesh => {
                return Err(Error::Internal(format!("{:?} is not an analytic terrain", spec.kind)));
            }
        })
    }

    /// h(x, y), m.
    pub fn height(&self, x: f64, y: f64) -> f64 {
        let q = x * x + y * y;
        match *self {
            Self::Flat => 0.0,
            Self::Rippled { amplitude, wavelength } => {
                let k = std::f64::consts::TAU / wavelength;
                amplitude * (k * x).sin() * (k * y).sin()
            }
            Self::Conic { slope, radius, tip, foot } => {
                slope * foot * softplus((radius - (q + tip * tip).sqrt()) / foot)
            }
            Self::Hilly { height, width } => height * (-0.5 * q / (width * width)).exp(),
            Self::Pit { depth, radius, edge } => {
                -0.5 * depth * (1.0 - ((q - radius * radius) / (2.0 * radius * edge)).tanh())
            }
        }
    }
}

/// ln(1 + eᵘ) without overflow.
fn softplus(u: f64) -> f64 {
    u.max(0.0) + (-u.abs()).exp().ln_1p()
}
