//! The constraints of Eq. 1–5 and Eq. 7–13, one a file, each with its first and second derivatives.
//!
//! A constraint is written in ambient quantities; see [`crate::nlp`].

pub mod base_clearance;
pub mod durations;
pub mod dynamics;
pub mod foothold_slope;
pub mod friction;
pub mod friction_conformal;
pub mod goal;
pub mod joint_speed;
pub mod joint_torque;
pub mod knee_clearance;
pub mod newton_euler;
pub mod normal_force;
pub mod reach;
pub mod stance;
pub mod swing;

use nalgebra::{Matrix3, Vector3};

use crate::heightfield::HeightJet;
use crate::nlp::curvature::Curvature;
use crate::nlp::sink::Sink;
use crate::nlp::{Model, State};

/// Where and when a row acts.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
pub struct Place {
    /// Index of the foot.
    pub foot: Option<usize>,
    /// Time in samples.
    pub sample: f64,
}

/// A named block of rows.
pub trait Constraint: Sync {
    /// Name, as users see it.
    fn name(&self) -> &'static str;
    /// Number of rows.
    fn rows(&self) -> usize;
    /// Least and greatest value of each row.
    fn bounds(&self, model: &Model, lower: &mut [f64], upper: &mut [f64]);
    /// The rows' values.
    fn values(&self, model: &Model, state: &State, out: &mut [f64]);
    /// Says ∂(row `first` + r)/∂x, the same places in the same order every time.
    fn jacobian(&self, model: &Model, state: &State, first: usize, sink: &mut Sink);
    /// Says the second derivatives of Σ multiplier · row in the ambient quantities pulled back, and adds the weights of the
    /// ambient quantities' own second derivatives to `curvature`.
    fn hessian(
        &self,
        model: &Model,
        state: &State,
        multipliers: &[f64],
        curvature: &mut Curvature,
        sink: &mut Sink,
    );
    /// Where and when a row acts.
    fn place(&self, row: usize) -> Place;
}

/// Second derivative of the height as a form in the ambient position.
pub(crate) fn height_form(ground: &HeightJet) -> Matrix3<f64> {
    let [xx, xy, yy] = ground.d2;
    Matrix3::new(xx, xy, 0.0, xy, yy, 0.0, 0.0, 0.0, 0.0)
}

/// (zᵀq − h(q)) n_z, the distance of q to the tangent plane of the ground below it, with its gradient and Hessian in q.
pub(crate) fn distance(q: &Vector3<f64>, ground: &HeightJet) -> (f64, Vector3<f64>, Matrix3<f64>) {
    let normal = Normal::new(ground);
    let (gap, nz) = (q.z - ground.h, normal.n.z);
    let by_gap = Vector3::new(-ground.d1[0], -ground.d1[1], 1.0);
    let by_nz = Vector3::new(normal.first[0].z, normal.first[1].z, 0.0);
    let form = by_gap * by_nz.transpose() + by_nz * by_gap.transpose() - height_form(ground) * nz
        + normal.curvature(&Vector3::z()) * gap;
    (gap * nz, by_gap * nz + by_nz * gap, form)
}

/// Unit normal of the ground with its first (x, y) and second (xx, xy, yy) derivatives.
#[derive(Clone, Copy, Debug)]
pub(crate) struct Normal {
    pub n: Vector3<f64>,
    pub first: [Vector3<f64>; 2],
    pub second: [Vector3<f64>; 3],
}

impl Normal {
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
