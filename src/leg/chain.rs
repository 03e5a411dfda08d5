//! A leg as a chain of joints: where its links are for given joint angles.
//!
//! All vectors are in axes parallel to the base's at zero joint angles. R₀ = 1, o₀ = 0 is the base with its origin at the center of mass;
//! joint j at position dⱼ from the one before turns its link about the axis aⱼ by qⱼ:
//!
//! ```text
//!   oⱼ = oⱼ₋₁ + Rⱼ₋₁ dⱼ,   Rⱼ = Rⱼ₋₁ exp(qⱼ [aⱼ])
//! ```

use arrayvec::ArrayVec;
use nalgebra::{Matrix3, Vector3};

use super::jet::Scalar;

/// Joints that a leg may have.
pub const MOST_JOINTS: usize = 7;

/// A value for each joint of a leg, from the base down.
pub type ByJoint<T> = ArrayVec<T, MOST_JOINTS>;

/// A joint and the link that it moves, with all that is fixed to that link.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Joint {
    /// dⱼ, from the joint before (the first: from the center of mass), m.
    pub position: Vector3<f64>,
    /// aⱼ, a unit vector.
    pub axis: Vector3<f64>,
    /// Least and greatest angle, rad.
    pub range: [f64; 2],
    /// Greatest speed, rad/s.
    pub speed_limit: f64,
    /// Greatest torque, N m.
    pub torque_limit: f64,
    /// Of the link, kg.
    pub mass: f64,
    /// The link's center of mass from the joint, m.
    pub center: Vector3<f64>,
    /// The link's inertia about that center, kg m².
    pub inertia: Matrix3<f64>,
    /// Of the link's parts on the line from this joint to the next, m; none if they are not looked at.
    pub radius: Option<f64>,
}

impl Joint {
    /// The abduction that a leg of two joints does not have: a massless joint about x, which no plan turns on purpose.
    ///
    /// The foot of such a leg moves in a plane, and a plan keeps it there within the play of its reach box. By this joint, the leg has a
    /// posture for every place of the foot all the same.
    pub fn missing_abduction(position: Vector3<f64>) -> Self {
        Self {
            position,
            axis: Vector3::x(),
            range: [0.0; 2],
            speed_limit: f64::INFINITY,
            torque_limit: f64::INFINITY,
            mass: 0.0,
            center: Vector3::zeros(),
            inertia: Matrix3::zeros(),
            radius: None,
        }
    }
}

/// The joints of a leg from the base to the foot; of a leg of two joints, the first of three is [`Joint::missing_abduction`].
#[derive(Clone, Debug, PartialEq)]
pub struct Chain {
    /// From the base down: 3 to [`MOST_JOINTS`].
    pub joints: Vec<Joint>,
    /// The center of the foot from the last joint, m.
    pub foot: Vector3<f64>,
}

/// Where the links of a chain are: base frame, origin at the center of mass, m.
#[derive(Clone, Debug)]
pub struct Placed<T> {
    /// Rⱼ by joint, rows first.
    pub rotation: ByJoint<[[T; 3]; 3]>,
    /// oⱼ by joint.
    pub origin: ByJoint<[T; 3]>,
    /// The axis of each joint.
    pub axis: ByJoint<[T; 3]>,
}

impl Chain {
    /// Where the links are for the joint angles q, rad.
    pub fn place<T: Scalar>(&self, q: &[T]) -> Placed<T> {
        let zero = q[0] * 0.0;
        let mut turn: [[T; 3]; 3] =
            std::array::from_fn(|i| std::array::from_fn(|j| zero + f64::from(u8::from(i == j))));
        let mut at = [zero; 3];
        let mut placed = Placed { rotation: ByJoint::new(), origin: ByJoint::new(), axis: ByJoint::new() };
        for (j, (joint, angle)) in self.joints.iter().zip(q).enumerate() {
            at = sum(at, rotated(&turn, &joint.position));
            placed.axis.push(rotated(&turn, &joint.axis));
            let own = rotation(&joint.axis, *angle);
            turn = if j == 0 { own } else { product(&turn, &own) };
            placed.rotation.push(turn);
            placed.origin.push(at);
        }
        placed
    }

    /// The center of the foot for the joint angles q, base frame, m from the center of mass.
    pub fn foot<T: Scalar>(&self, q: &[T]) -> [T; 3] {
        self.place(q).point(self.joints.len() - 1, &self.foot)
    }

    /// From the second joint over all others to the center of the foot, m.
    pub fn length(&self) -> f64 {
        self.joints[1..].iter().map(|joint| joint.position.norm()).sum::<f64>() + self.foot.norm()
    }
}

impl<T: Scalar> Placed<T> {
    /// A point fixed to the link of joint j, given from that joint at zero angles, m.
    pub fn point(&self, j: usize, local: &Vector3<f64>) -> [T; 3] {
        sum(self.origin[j], rotated(&self.rotation[j], local))
    }

    /// ∂(point)/∂qⱼ, m, for a point that moves with joint j: axis × (point − oⱼ).
    pub fn moved_by(&self, j: usize, point: [T; 3]) -> [T; 3] {
        let arm: [T; 3] = std::array::from_fn(|c| point[c] - self.origin[j][c]);
        let a = self.axis[j];
        [a[1] * arm[2] - a[2] * arm[1], a[2] * arm[0] - a[0] * arm[2], a[0] * arm[1] - a[1] * arm[0]]
    }
}

/// exp(q \[axis\]) = cos q (1 − a aᵀ) + sin q \[a\] + a aᵀ.
fn rotation<T: Scalar>(axis: &Vector3<f64>, q: T) -> [[T; 3]; 3] {
    let [sin, cos] = q.sin_cos();
    let cross = axis.cross_matrix();
    std::array::from_fn(|i| {
        std::array::from_fn(|j| {
            let along = axis[i] * axis[j];
            cos * (f64::from(u8::from(i == j)) - along) + sin * cross[(i, j)] + along
        })
    })
}

fn rotated<T: Scalar>(turn: &[[T; 3]; 3], v: &Vector3<f64>) -> [T; 3] {
    turn.map(|row| row[0] * v[0] + row[1] * v[1] + row[2] * v[2])
}

fn product<T: Scalar>(a: &[[T; 3]; 3], b: &[[T; 3]; 3]) -> [[T; 3]; 3] {
    a.map(|row| std::array::from_fn(|j| row[0] * b[0][j] + row[1] * b[1][j] + row[2] * b[2][j]))
}

fn sum<T: Scalar>(a: [T; 3], b: [T; 3]) -> [T; 3] {
    std::array::from_fn(|c| a[c] + b[c])
}

#[cfg(test)]
pub(super) mod tests {
    use nalgebra::{Rotation3, Unit};

    use super::*;
    use crate::leg::jet::Jet;

    /// A leg with these axes, of no particular robot.
    pub fn leg(axes: &[[f64; 3]]) -> Chain {
        let places = [
            [0.3, -0.1, 0.05],
            [0.06, -0.08, 0.0],
            [0.02, -0.1, -0.28],
            [-0.02, 0.0, -0.3],
            [0.0, 0.02, -0.1],
            [0.03, 0.0, -0.08],
            [0.01, 0.01, -0.05],
        ];
        let joints = axes.iter().zip(places).map(|(axis, place)| Joint {
            position: place.into(),
            axis: Vector3::from(*axis).normalize(),
            range: [-3.0, 3.0],
            speed_limit: 10.0,
            torque_limit: 40.0,
            mass: 1.0,
            center: Vector3::new(0.01, 0.0, -0.1),
            inertia: Matrix3::identity() * 0.01,
            radius: None,
        });
        Chain { joints: joints.collect(), foot: Vector3::new(0.08, -0.01, -0.31) }
    }

    #[test]
    fn places_are_those_of_rotations() {
        let chain = leg(&[[1.0, 0.0, 0.0], [0.0, 1.0, 0.2], [0.1, -1.0, 0.0], [1.0, 1.0, 0.0]]);
        let q = [0.3, -0.8, 1.4, 0.2];
        let mut turn = Rotation3::identity();
        let mut at = Vector3::zeros();
        for (joint, angle) in chain.joints.iter().zip(q) {
            at += turn * joint.position;
            turn *= Rotation3::from_axis_angle(&Unit::new_normalize(joint.axis), angle);
        }
        assert!((Vector3::from(chain.foot(&q)) - (at + turn * chain.foot)).norm() < 1e-14);
    }

    #[test]
    fn derivatives_of_places_match_differences() {
        let chain = leg(&[[1.0, 0.0, 0.0], [0.0, 1.0, 0.2], [0.1, -1.0, 0.0]]);
        let q = Vector3::new(0.3, -0.8, 1.4);
        let jets = chain.foot(&Jet::variables(&q));
        let placed = chain.place::<f64>(q.as_slice());
        let step = 1e-6;
        for j in 0..3 {
            let moved = |sign: f64| {
                let mut q = q;
                q[j] += sign * step;
                Vector3::from(chain.foot::<f64>(q.as_slice()))
            };
            let expected = (moved(1.0) - moved(-1.0)) / (2.0 * step);
            let by_axis = Vector3::from(placed.moved_by(j, chain.foot(q.as_slice())));
            assert!((by_axis - expected).norm() < 1e-9);
            assert!((Vector3::from_fn(|c, _| jets[c].first[j]) - expected).norm() < 1e-9);
        }
    }
}
