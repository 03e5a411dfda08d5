//! The space of the variables: F, pushed forward by φ, or the ambient space itself (φ = identity).

use std::sync::Arc;

use nalgebra::{Matrix3, Vector3};

use super::rotation::{self, RotationJet};
use crate::warp::{Order, WarpMap};

/// The space of the variables.
#[derive(Clone, Debug)]
pub enum Space {
    /// Ambient space, in the paper's baseline, Eq. 1.
    Direct,
    /// F, in the paper's method, Eq. 7: positions are φ of the variables.
    Warped(Arc<WarpMap>),
}

/// φ and its derivatives at a point, as matrices.
#[derive(Clone, Copy, Debug)]
pub struct PointJet {
    /// φ(x̄), m.
    pub position: Vector3<f64>,
    /// J.
    pub jacobian: Matrix3<f64>,
    /// `first[d]` = ∂_d J.
    pub first: [Matrix3<f64>; 3],
    /// `second[e][d]` = ∂_e ∂_d J.
    pub second: [[Matrix3<f64>; 3]; 3],
}

impl Space {
    /// φ and its derivatives up to `order`; the others are zero.
    pub fn jet(&self, x: &Vector3<f64>, order: Order) -> PointJet {
        let zero = Matrix3::zeros();
        match self {
            Space::Direct => PointJet {
                position: *x,
                jacobian: Matrix3::identity(),
                first: [zero; 3],
                second: [[zero; 3]; 3],
            },
            Space::Warped(map) => {
                let jet = map.jet([x.x, x.y, x.z], order);
                let matrix = |rows: [[f64; 3]; 3]| Matrix3::from_fn(|c, d| rows[c][d]);
                PointJet {
                    position: Vector3::from(jet.position),
                    jacobian: matrix(jet.jacobian),
                    first: std::array::from_fn(|e| matrix(jet.jacobian_derivative(e))),
                    second: std::array::from_fn(|f| {
                        std::array::from_fn(|e| matrix(jet.jacobian_second_derivative(f, e)))
                    }),
                }
            }
        }
    }

    /// Eq. 13: the position φ(x̄) and the orientation 𝒫(J(x̄)) R(θ̄) of a body with variables (x̄, θ̄).
    ///
    /// The second derivatives of the rotation are zero unless `with_second`.
    pub fn pose(&self, y: &[f64; 6], with_second: bool) -> (PointJet, RotationJet<6>) {
        let order = if with_second { Order::Third } else { Order::Second };
        let point = self.jet(&Vector3::new(y[0], y[1], y[2]), order);
        let euler = rotation::euler(&Vector3::new(y[3], y[4], y[5]));
        let frame = match self {
            Space::Direct => RotationJet {
                rotation: Matrix3::identity(),
                first: [Vector3::zeros(); 3],
                second: [[Vector3::zeros(); 3]; 3],
            },
            Space::Warped(_) => {
                rotation::projection(&point.jacobian, &point.first, with_second.then_some(&point.second))
            }
        };
        (point, rotation::compose(&frame, &euler))
    }

    /// Whether φ is not the identity.
    pub fn is_warped(&self) -> bool {
        matches!(self, Space::Warped(_))
    }
}
