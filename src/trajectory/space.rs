//! The space that the variables live in: F, pushed forward by φ, or ambient space itself (φ = identity).

use std::sync::Arc;

use nalgebra::{Matrix3, Vector3};

use super::rotation::{self, RotationJet};
use crate::warp::{Order, WarpMap};

/// Where the variables live.
#[derive(Clone, Debug)]
pub enum Space {
    /// The baseline: variables are ambient quantities.
    Direct,
    /// Variables are pulled back by φ (Eq. 7).
    Warped(Arc<WarpMap>),
}

/// φ at a point with its derivatives as matrices.
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

/// Index into (xx, xy, xz, yy, yz, zz).
const SECOND: [[usize; 3]; 3] = [[0, 1, 2], [1, 3, 4], [2, 4, 5]];
/// Index into (xxx, xxy, xxz, xyy, xyz, xzz, yyy, yyz, yzz, zzz).
const THIRD: [[[usize; 3]; 3]; 3] =
    [[[0, 1, 2], [1, 3, 4], [2, 4, 5]], [[1, 3, 4], [3, 6, 7], [4, 7, 8]], [[2, 4, 5], [4, 7, 8], [5, 8, 9]]];

impl Space {
    /// φ and as many of its derivatives as asked for; the rest are zero.
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
                PointJet {
                    position: Vector3::from(jet.position),
                    jacobian: Matrix3::from_fn(|c, d| jet.jacobian[c][d]),
                    first: std::array::from_fn(|e| Matrix3::from_fn(|c, d| jet.second[c][SECOND[e][d]])),
                    second: std::array::from_fn(|f| {
                        std::array::from_fn(|e| Matrix3::from_fn(|c, d| jet.third[c][THIRD[f][e][d]]))
                    }),
                }
            }
        }
    }

    /// Position and orientation of a body whose variables are (x̄, θ̄): φ(x̄) and 𝒫(J(x̄)) R(θ̄) (Eq. 13).
    ///
    /// `curved` asks for the second derivatives of the rotation as well.
    pub fn pose(&self, y: &[f64; 6], curved: bool) -> (PointJet, RotationJet<6>) {
        let point =
            self.jet(&Vector3::new(y[0], y[1], y[2]), if curved { Order::Third } else { Order::Second });
        let turn = rotation::euler(&Vector3::new(y[3], y[4], y[5]));
        let frame = match self {
            Space::Direct => RotationJet {
                rotation: Matrix3::identity(),
                first: [Vector3::zeros(); 3],
                second: [[Vector3::zeros(); 3]; 3],
            },
            Space::Warped(_) => {
                rotation::projection(&point.jacobian, &point.first, curved.then_some(&point.second))
            }
        };
        (point, rotation::compose(&frame, &turn))
    }

    /// Whether coordinate `d` of a point's variables moves component `c` of its ambient position.
    pub fn couples(&self, c: usize, d: usize) -> bool {
        c == d || self.is_warped()
    }

    /// Whether φ is not the identity.
    pub fn is_warped(&self) -> bool {
        matches!(self, Space::Warped(_))
    }
}
