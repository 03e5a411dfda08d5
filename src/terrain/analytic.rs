//! The smooth terrains of the paper's Fig. 3, as functions of x and y in m. Formulas and parameters:
//! [`crate::scenario::terrain`].

use std::f64::consts::TAU;

use crate::scenario::terrain::{ConicSpec, HillySpec, PitSpec, RippledSpec};

/// h = A sin(kx) sin(ky), k = 2π/wavelength.
pub fn rippled(spec: &RippledSpec) -> impl Fn(f64, f64) -> f64 + use<> {
    let (amplitude, k) = (spec.amplitude(), TAU / spec.wavelength());
    move |x, y| amplitude * (k * x).sin() * (k * y).sin()
}

/// h = s β softplus((ρ₀ − √(ρ² + ε²))/β), ρ² = x² + y².
pub fn conic(spec: &ConicSpec) -> impl Fn(f64, f64) -> f64 + use<> {
    let (slope, radius, tip, foot) = (spec.slope(), spec.radius(), spec.tip(), spec.foot());
    move |x, y| slope * foot * softplus((radius - (x * x + y * y + tip * tip).sqrt()) / foot)
}

/// h = H exp(−ρ²/(2w²)).
pub fn hilly(spec: &HillySpec) -> impl Fn(f64, f64) -> f64 + use<> {
    let (height, width) = (spec.height(), spec.width());
    move |x, y| height * (-0.5 * (x * x + y * y) / (width * width)).exp()
}

/// h = −D/2 (1 − tanh((ρ² − ρ₀²)/(2ρ₀δ))).
pub fn pit(spec: &PitSpec) -> impl Fn(f64, f64) -> f64 + use<> {
    let (depth, radius, edge) = (spec.depth(), spec.radius(), spec.edge());
    move |x, y| -0.5 * depth * (1.0 - ((x * x + y * y - radius * radius) / (2.0 * radius * edge)).tanh())
}

/// ln(1 + eᵘ) without overflow.
fn softplus(u: f64) -> f64 {
    u.max(0.0) + (-u.abs()).exp().ln_1p()
}
