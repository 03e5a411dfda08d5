//! Eq. 2, the centroidal law itself, at every sample.
//!
//! ```text
//!   Σ_i f_i + m g                 = m p̈
//!   Σ_i (p_i − p) × f_i           = R (I ω̇ + ω × I ω) + λ,   ω, ω̇ in the base frame
//!   ω = (φ̇ − ψ̇ sin θ,  θ̇ cos φ + ψ̇ cos θ sin φ,  −θ̇ sin φ + ψ̇ cos θ cos φ)
//! ```
//!
//! with ZYX Euler angles (roll φ, pitch θ, yaw ψ). It needs second derivatives of position and orientation in time. In F
//! those of 𝒫(J) involve third derivatives of φ, which jump from cell to cell, so this law is for the direct formulation only.
//! Forces and p̈ are both linear between samples there: if Newton's law holds at the samples, it holds everywhere.
//!
//! λ is what the legs' own mass adds ([`crate::nlp::leg_terms`]): a known function of time, zero for massless legs.
//!
//! The rate of the angular momentum depends on nine numbers; dual numbers give its derivatives.
//!
//! Rows: 6 a sample, force then torque about the center of mass, world frame, in m g and m g · 1 m.

use nalgebra::{Matrix3, SMatrix, SVector, Vector3};
use num_dual::{DualNum, hessian, jacobian};

use super::dynamics::Dynamics;
use crate::nlp::Model;
use crate::nlp::curvature::NodeCurvature;
use crate::nlp::model::GRAVITY;
use crate::nlp::sink::Sink;
use crate::nlp::state::State;
use crate::nlp::term::{Constraint, RowPlace};
use crate::trajectory::LinearNode;

/// (roll, pitch, yaw), their rates and second derivatives.
type Turn = SVector<f64, 9>;

/// Newton's and Euler's law at every sample, in ambient space.
#[derive(Clone, Debug)]
pub struct NewtonEuler {
    /// The left-hand sides: forces with gravity, and torques.
    wrench: Dynamics,
    /// I, kg m², base frame.
    inertia: Matrix3<f64>,
}

impl NewtonEuler {
    /// At every sample of a model.
    pub fn new(model: &Model) -> Self {
        Self {
            wrench: Dynamics::wrench(model.layout.intervals),
            inertia: Matrix3::identity() * model.second_moment.trace() - model.second_moment,
        }
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
}

impl Constraint for NewtonEuler {
    fn name(&self) -> &'static str {
        "Newton-Euler"
    }

    fn rows(&self) -> usize {
        self.wrench.rows()
    }

    fn bounds(&self, model: &Model, lower: &mut [f64], upper: &mut [f64]) {
        self.wrench.bounds(model, lower, upper);
    }

    fn values(&self, model: &Model, state: &State, out: &mut [f64]) {
        self.wrench.values(model, state, out);
        for (k, row) in out.as_chunks_mut::<6>().0.iter_mut().enumerate() {
            let rate = self.rate(model.mass, &Self::turn(state, k));
            for c in 0..3 {
                row[c] -= state.base_motion[k][2][c] / GRAVITY;
                row[3 + c] -= rate[c];
            }
        }
    }

    fn jacobian(&self, model: &Model, state: &State, first: usize, sink: &mut Sink) {
        self.wrench.jacobian(model, state, first, sink);
        for k in 0..=model.layout.intervals {
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

    fn hessian(
        &self,
        model: &Model,
        state: &State,
        multipliers: &[f64],
        curvature: &mut NodeCurvature,
        sink: &mut Sink,
    ) {
        self.wrench.hessian(model, state, multipliers, curvature, sink);
        for (k, lambda) in multipliers.as_chunks::<6>().0.iter().enumerate() {
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

    fn place(&self, row: usize) -> RowPlace {
        self.wrench.place(row)
    }
}
