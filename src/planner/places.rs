//! Places in the spaces of the variables.

use nalgebra::Vector3;

use crate::Result;
use crate::nlp::Model;
use crate::trajectory::space::Space;

/// A point of ambient space in a space of variables.
pub(super) fn pulled_back(space: &Space, point: &Vector3<f64>) -> Result<Vector3<f64>> {
    Ok(match space {
        Space::Direct => *point,
        Space::Warped(map) => Vector3::from(map.inverse((*point).into())?),
    })
}

/// The ground at (x, y), in the space of the variables.
pub(super) fn on_ground(model: &Model, [x, y]: [f64; 2]) -> Result<Vector3<f64>> {
    Ok(match &model.spaces.feet {
        Space::Direct => Vector3::new(x, y, model.surfaces.feet.height(x, y)),
        Space::Warped(map) => map.ground_inverse([x, y]).map(|[x, y]| Vector3::new(x, y, 0.0))?,
    })
}

/// Where a stance must be, x and y.
pub(super) fn fixed(model: &Model, foot: usize, stance: usize) -> Option<[f64; 2]> {
    let fixed = model.fixed.iter().find(|fixed| (fixed.foot, fixed.stance) == (foot, stance));
    fixed.map(|fixed| fixed.position)
}
