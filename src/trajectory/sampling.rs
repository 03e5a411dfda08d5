//! The motion at any time, in ambient space, with exact velocities and accelerations.

use nalgebra::{Matrix3, Rotation3, UnitQuaternion, Vector3};

use super::layout::Layout;
use super::rotation::RotationJet;
use super::space::{PointJet, Space};
use crate::warp::Order;

/// The base at one time, world frame.
#[derive(Clone, Copy, Debug)]
pub struct BaseMotion {
    /// p, m.
    pub position: Vector3<f64>,
    /// R, base to world.
    pub rotation: Matrix3<f64>,
    /// ṗ, m/s.
    pub velocity: Vector3<f64>,
    /// p̈, m/s².
    pub acceleration: Vector3<f64>,
    /// ω, rad/s, world.
    pub angular_velocity: Vector3<f64>,
    /// ω̇, rad/s², world.
    pub angular_acceleration: Vector3<f64>,
    /// (p̄, θ̄).
    pub variables: [f64; 6],
}

impl BaseMotion {
    /// R as a unit quaternion w, x, y, z. Of the two that represent R, the one closer to `near`.
    pub fn quaternion_wxyz(&self, near: [f64; 4]) -> [f64; 4] {
        let q = UnitQuaternion::from_rotation_matrix(&Rotation3::from_matrix_unchecked(self.rotation));
        let q = [q.w, q.i, q.j, q.k];
        let dot: f64 = q.iter().zip(&near).map(|(a, b)| a * b).sum();
        if dot < 0.0 { q.map(|v| -v) } else { q }
    }
}

/// A foot at one time, world frame.
#[derive(Clone, Copy, Debug)]
pub struct FootMotion {
    /// p_i, m.
    pub position: Vector3<f64>,
    /// ṗ_i, m/s.
    pub velocity: Vector3<f64>,
    /// p̈_i, m/s².
    pub acceleration: Vector3<f64>,
    /// f_i = J f̄_i, in the unit of the variables (m g).
    pub force: Vector3<f64>,
    /// Whether the foot is in a stance.
    pub contact: bool,
    /// p̄_i.
    pub warped_position: Vector3<f64>,
    /// f̄_i.
    pub warped_force: Vector3<f64>,
}

/// The velocity and the acceleration of φ(x̄(t)): J x̄̇ and J x̄̈ + (∂J x̄̇) x̄̇.
fn pushed(point: &PointJet, rate: &Vector3<f64>, second: &Vector3<f64>) -> (Vector3<f64>, Vector3<f64>) {
    let jacobian_rate: Matrix3<f64> = (0..3).map(|d| point.first[d] * rate[d]).sum();
    (point.jacobian * rate, point.jacobian * second + jacobian_rate * rate)
}

/// ω = Σ w_d ẏ_d and ω̇ = Σ w_d ÿ_d + Σ ∂_e w_d ẏ_e ẏ_d.
fn angular(turn: &RotationJet<6>, rate: &[f64; 6], second: &[f64; 6]) -> (Vector3<f64>, Vector3<f64>) {
    let mut velocity = Vector3::zeros();
    let mut acceleration = Vector3::zeros();
    for d in 0..6 {
        velocity += turn.first[d] * rate[d];
        acceleration += turn.first[d] * second[d];
        for e in 0..6 {
            acceleration += turn.second[e][d] * (rate[e] * rate[d]);
        }
    }
    (velocity, acceleration)
}

/// The base at time `k` in samples.
pub fn base(layout: &Layout, space: &Space, x: &[f64], k: f64) -> BaseMotion {
    let value = |derivative: usize| layout.base_node(k, derivative).value::<6>(x);
    let (y, rate, second) = (value(0), value(1), value(2));
    let (point, turn) = space.pose(&y, true);
    let head = |v: &[f64; 6]| Vector3::new(v[0], v[1], v[2]);
    let (velocity, acceleration) = pushed(&point, &head(&rate), &head(&second));
    let (angular_velocity, angular_acceleration) = angular(&turn, &rate, &second);
    BaseMotion {
        position: point.position,
        rotation: turn.rotation,
        velocity,
        acceleration,
        angular_velocity,
        angular_acceleration,
        variables: y,
    }
}

/// A foot at time `k` in samples, with given or frozen switches. Forces are linear between samples.
pub fn foot(layout: &Layout, space: &Space, x: &[f64], foot: usize, k: f64) -> FootMotion {
    let value = |derivative: usize| Vector3::from(layout.foot_node(foot, k, derivative).value::<3>(x));
    let (y, rate, second) = (value(0), value(1), value(2));
    let point = space.jet(&y, Order::Second);
    let (velocity, acceleration) = pushed(&point, &rate, &second);
    let variables = &layout.feet[foot];
    let contact = !variables.swings.iter().any(|s| s.swing.start < k && k < s.swing.end);
    let at = |sample: usize| {
        layout.force(foot, sample).map_or_else(Vector3::zeros, |(_, node)| Vector3::from(node.value::<3>(x)))
    };
    let before = (k.max(0.0) as usize).min(layout.intervals);
    let after = (before + 1).min(layout.intervals);
    let fraction = k - before as f64;
    let warped_force =
        if contact { at(before) * (1.0 - fraction) + at(after) * fraction } else { Vector3::zeros() };
    FootMotion {
        position: point.position,
        velocity,
        acceleration,
        force: point.jacobian * warped_force,
        contact,
        warped_position: y,
        warped_force,
    }
}
