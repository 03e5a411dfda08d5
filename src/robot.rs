//! A robot as the centroidal model sees it: one rigid body and a reach box per foot.

use serde::{Deserialize, Serialize};

/// An axis-aligned box in the base frame, origin at the centre of mass, m.
#[derive(Clone, Copy, Debug, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct Box3 {
    /// Centre, m.
    pub center: [f64; 3],
    /// Half of the edge lengths, m.
    pub half_size: [f64; 3],
}

/// One foot.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct Foot {
    /// `LF`, `RF`, `LH`, `RH` for ANYmal.
    pub name: String,
    /// Where the foot stands at rest, base frame, m from the centre of mass.
    pub nominal: [f64; 3],
    /// The reachable box 𝓡ᵢ of Eq. 4.
    pub reach: Box3,
}

/// Mass, inertia and reach of a robot (`robots/NAME.toml`).
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct Robot {
    /// Name, as in `robots/NAME.toml`.
    pub name: String,
    /// Where the figures come from.
    pub source: String,
    /// Total mass, kg.
    pub mass: f64,
    /// Inertia about the centre of mass in the base frame at the nominal stance, kg m².
    pub inertia: [[f64; 3]; 3],
    /// The torso's box, for clearance over the ground.
    pub torso: Box3,
    /// The feet, in the order of the plan's `foot_names`.
    pub feet: Vec<Foot>,
}
