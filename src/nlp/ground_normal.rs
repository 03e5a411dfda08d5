//! The ground below a point: its normal n = (−h_x, −h_y, 1)/‖·‖, and the distance of the point from its tangent plane, with
//! derivatives.

use nalgebra::{Matrix3, Vector3};

use super::model::Model;
use crate::heightfield::HeightJet;

/// Second derivative of the height as a form in the ambient position.
pub fn height_form(ground: &HeightJet) -> Matrix3<f64> {
    let [xx, xy, yy] = ground.d2;
    Matrix3::new(xx, xy, 0.0, xy, yy, 0.0, 0.0, 0.0, 0.0)
}

/// How far a point is above one of the surfaces that bodies clear, with its gradient and Hessian in q: the distance to the tangent
/// plane of a smooth ground. Over edges, where n_z can be close to zero, it is the height above the surface, which is a path
/// of a ball and so contains the distance already.
pub fn clearance(model: &Model, q: &Vector3<f64>, surface: &HeightJet) -> (f64, Vector3<f64>, Matrix3<f64>) {
    if model.surfaces.have_edges() {
        let by_gap = Vector3::new(-surface.d1[0], -surface.d1[1], 1.0);
        return (q.z - surface.h, by_gap, -height_form(surface));
    }
    distance(q, surface)
}

/// (zᵀq − h(q)) n_z, the distance of q to the tangent plane of the ground below it, with its gradient and Hessian in q.
pub fn distance(q: &Vector3<f64>, ground: &HeightJet) -> (f64, Vector3<f64>, Matrix3<f64>) {
    let normal = GroundNormal::new(ground);
    let (gap, nz) = (q.z - ground.h, normal.n.z);
    let by_gap = Vector3::new(-ground.d1[0], -ground.d1[1], 1.0);
    let by_nz = Vector3::new(normal.first[0].z, normal.first[1].z, 0.0);
    let form = by_gap * by_nz.transpose() + by_nz * by_gap.transpose() - height_form(ground) * nz
        + normal.curvature(&Vector3::z()) * gap;
    (gap * nz, by_gap * nz + by_nz * gap, form)
}

/// Unit normal of the ground with its first (x, y) and second (xx, xy, yy) derivatives.
#[derive(Clone, Copy, Debug)]
pub struct GroundNormal {
    /// n.
    pub n: Vector3<f64>,
    /// ∂n/∂x, ∂n/∂y.
    pub first: [Vector3<f64>; 2],
    /// ∂²n/∂x², ∂²n/∂x∂y, ∂²n/∂y².
    pub second: [Vector3<f64>; 3],
}

impl GroundNormal {
    /// n = m/‖m‖, m = (−h_x, −h_y, 1).
    pub fn new(g: &HeightJet) -> Self {
        let m = Vector3::new(-g.d1[0], -g.d1[1], 1.0);
        let [xx, xy, yy] = g.d2;
        let [xxx, xxy, xyy, yyy] = g.d3;
        let m1 = [Vector3::new(-xx, -xy, 0.0), Vector3::new(-xy, -yy, 0.0)];
        let m2 =
            [Vector3::new(-xxx, -xxy, 0.0), Vector3::new(-xxy, -xyy, 0.0), Vector3::new(-xyy, -yyy, 0.0)];
        let l = 1.0 / m.norm();
        let n = m * l;
        let first = std::array::from_fn(|a| (m1[a] - n * n.dot(&m1[a])) * l);
        let second = std::array::from_fn(|s| {
            let (a, b) = [(0, 0), (0, 1), (1, 1)][s];
            let l_b = -l * l * n.dot(&m1[b]);
            let n_b: Vector3<f64> = first[b];
            (m1[a] - n * n.dot(&m1[a])) * l_b
                + (m2[s] - n_b * n.dot(&m1[a]) - n * (n_b.dot(&m1[a]) + n.dot(&m2[s]))) * l
        });
        Self { n, first, second }
    }

    /// f · n with its derivative with respect to the ambient position (x, y, z).
    pub fn along(&self, f: &Vector3<f64>) -> (f64, Vector3<f64>) {
        (f.dot(&self.n), Vector3::new(f.dot(&self.first[0]), f.dot(&self.first[1]), 0.0))
    }

    /// Second derivative of f · n with respect to the ambient position.
    pub fn curvature(&self, f: &Vector3<f64>) -> Matrix3<f64> {
        let [xx, xy, yy] = [0, 1, 2].map(|s| f.dot(&self.second[s]));
        Matrix3::new(xx, xy, 0.0, xy, yy, 0.0, 0.0, 0.0, 0.0)
    }

    /// ∂n/∂(x, y, z), columns.
    pub fn jacobian(&self) -> Matrix3<f64> {
        Matrix3::from_columns(&[self.first[0], self.first[1], Vector3::zeros()])
    }
}
