//! Which space the variables of base and feet live in, by formulation.

use std::sync::Arc;

use super::space::Space;
use crate::scenario::Formulation;
use crate::warp::WarpMap;
use crate::{Error, Result};

/// The spaces of a formulation.
///
/// | formulation | base | feet and forces |
/// | --- | --- | --- |
/// | `direct` (Eq. 1) | ambient | ambient |
/// | `warped` (Eq. 7) | F | F |
/// | `hybrid` | ambient | F |
///
/// With the base in ambient space its acceleration is linear between samples exactly, as the forces are, and Newton's law
/// holds between them; with the feet in F the ground is flat for them.
#[derive(Clone, Debug)]
pub struct Spaces {
    /// Of (p̄, θ̄).
    pub base: Space,
    /// Of p̄_i and f̄_i.
    pub feet: Space,
}

impl Spaces {
    /// The spaces of a formulation; `map` is needed for all but the direct one.
    ///
    /// # Errors
    /// When the map is missing.
    pub fn of(formulation: Formulation, map: Option<Arc<WarpMap>>) -> Result<Self> {
        let warped = || {
            let map = map
                .clone()
                .ok_or_else(|| Error::input(format!("formulation = \"{formulation}\" needs a map")))?;
            Ok::<_, Error>(Space::Warped(map))
        };
        Ok(match formulation {
            Formulation::Direct => Self { base: Space::Direct, feet: Space::Direct },
            Formulation::Warped => Self { base: warped()?, feet: warped()? },
            Formulation::Hybrid => Self { base: Space::Direct, feet: warped()? },
        })
    }

    /// φ, where there is one.
    pub fn map(&self) -> Option<&WarpMap> {
        match &self.feet {
            Space::Direct => None,
            Space::Warped(map) => Some(map),
        }
    }
}
