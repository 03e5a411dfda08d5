//! The rates of a rigid body's momenta, from the second derivatives of its pose in time; the right-hand sides of Eq. 2.
//!
//! ```text
//!   m p̈,   R (I ω̇ + ω × I ω),   ω, ω̇ in the base frame
//!   ω = (φ̇ − ψ̇ sin θ,  θ̇ cos φ + ψ̇ cos θ sin φ,  −θ̇ sin φ + ψ̇ cos θ cos φ)
//! ```
//!
//! with ZYX Euler angles (roll φ, pitch θ, yaw ψ). The rate of the angular momentum depends on nine numbers; dual numbers give its
//! derivatives. The base's variables are in ambient space.

use std::ops::Range;

use nalgebra::{Matrix3, SMatrix, SVector, Vector3};
use num_dual::{DualNum, hessian, jacobian};

use crate::nlp::Model;
use crate::nlp::model::GRAVITY;
use crate::nlp::sink::Sink;
use crate::nlp::state::State;
use crate::trajectory::LinearNode;

/// (roll, pitch, yaw), their rates and second derivatives.
type Turn = SVector<f64, 9>;

/// What the rates take from the rows of some samples; there are six rows a sample, from sample 0 on.
#[derive(Clone, Debug)]
pub(super) struct BodyRates {
    /// I, kg m², base frame.
    inertia: Matrix3<f64>,
    samples: Range<usize>,
}

impl BodyRates {
    /// At some samples of a model.
    pub fn new(model: &Model, samples: Range<usize>) -> Self {
        let inertia = Matrix3::identity() * model.second_moment.trace() - model.second_moment;
        Self { inertia, samples }
    }

    /// The rate of the angular momentum in m g · 1 m, world frame.
    fn rate<D: DualNum<Primitive = f64> + Copy>(&self, mass: f64, y: &SVector<D, 9>) -> [D; 3] {
        let [(sx, cx), (sy, cy), (sz, cz)] = [0, 1, 2].map(|d| y[d].sin_cos());
        let ([roll, pitch, yaw], [roll2, pitch2, yaw2]) = ([y[3], y[4], y[5]], [y[6], y[7], y[8]]);
        // ω, and its derivative in time term by term.
        let omega = [roll - yaw * sy, pitch * cx + yaw * cy * sx, yaw * cy * cx - pitch * sx];
        let rate = [
            roll2 - yaw2 * sy - yaw * pitch * cy,
            pitch2 * cx - pitch * roll * sx + yaw2 * cy * sx - yaw * pitch * sy * sx + yaw * roll * cy * cx,
            yaw2 * cy * cx - yaw * pitch * sy * cx - yaw * roll * cy * sx - pitch2 * sx - pitch * roll * cx,
        ];
        let times = |v: &[D; 3]| -> [D; 3] {
            let i = self.inertia * (1.0 / (mass * GRAVITY));
            std::array::from_fn(|r| v[0] * i[(r, 0)] + v[1] * i[(r, 1)] + v[2] * i[(r, 2)])
        };
        let (momentum, change) = (times(&omega), times(&rate));
        let [x, y, z] = std::array::from_fn(|c| {
            let (a, b) = ((c + 1) % 3, (c + 2) % 3);
            change[c] + omega[a] * momentum[b] - omega[b] * momentum[a]
        });
        // R = Rz(ψ) Ry(θ) Rx(φ), one factor at a time.
        let (y, z) = (y * cx - z * sx, y * sx + z * cx);
        let (x, z) = (x * cy + z * sy, z * cy - x * sy);
        [x * cz - y * sz, x * sz + y * cz, z]
    }

    /// The base, its velocity and its acceleration as linear combinations of variables.
    fn nodes(model: &Model, k: usize) -> [&LinearNode; 3] {
        let [velocity, acceleration] = &model.layout.base_rates[k];
        [&model.layout.base[k], velocity, acceleration]
    }

    fn turn(state: &State, k: usize) -> Turn {
        Turn::from_fn(|r, _| state.base_motion[k][r / 3][3 + r % 3])
    }

    /// Subtracts them from the rows' values.
    pub fn subtract(&self, model: &Model, state: &State, out: &mut [f64]) {
        for k in self.samples.clone() {
            let rate = self.rate(model.mass, &Self::turn(state, k));
            for c in 0..3 {
                out[6 * k + c] -= state.base_motion[k][2][c] / GRAVITY;
                out[6 * k + 3 + c] -= rate[c];
            }
        }
    }

    /// The first derivatives of what [`Self::subtract`] adds, to rows from `first` on.
    pub fn jacobian(&self, model: &Model, state: &State, first: usize, sink: &mut Sink) {
        for k in self.samples.clone() {
            let (row, nodes) = (first + 6 * k, Self::nodes(model, k));
            let rate = |y: SVector<_, 9>| Vector3::from(self.rate(model.mass, &y));
            let (_, by): (Vector3<f64>, SMatrix<f64, 3, 9>) = jacobian(rate, &Self::turn(state, k));
            for c in 0..3 {
                sink.node(row + c, nodes[2], c, -1.0 / GRAVITY);
                for r in 0..9 {
                    sink.node(row + 3 + c, nodes[r / 3], 3 + r % 3, -by[(c, r)]);
                }
            }
        }
    }

    /// The second derivatives of the rows' sum with these multipliers.
    pub fn hessian(&self, model: &Model, state: &State, multipliers: &[f64], sink: &mut Sink) {
        for k in self.samples.clone() {
            let lambda = &multipliers[6 * k..6 * k + 6];
            let nodes = Self::nodes(model, k);
            let weighed = |y: SVector<_, 9>| {
                let rate = self.rate(model.mass, &y);
                rate[0] * -lambda[3] - rate[1] * lambda[4] - rate[2] * lambda[5]
            };
            let (_, _, by): (f64, Turn, SMatrix<f64, 9, 9>) = hessian(weighed, &Self::turn(state, k));
            for r in 0..9 {
                for s in 0..=r {
                    let (a, b) = (nodes[r / 3], nodes[s / 3]);
                    if r / 3 == s / 3 {
                        sink.own(a, 3 + r % 3, 3 + s % 3, by[(r, s)]);
                    } else {
                        sink.pair((a, 3 + r % 3), (b, 3 + s % 3), by[(r, s)]);
                    }
                }
            }
        }
    }
}
