//! What the legs' own mass adds to the laws, as functions of time that are known at every point of a solve.
//!
//! The base's position is the center of mass of the whole robot, so Newton's law has no such term. The trunk is where the center of mass
//! has moved away from: its point that is the center of mass at the nominal stance lies at p − R s. So what is fixed to the trunk sees a
//! foot at r = Rᵀ(p_i − p) + s. Euler's law gets the rate of the angular momentum that a rigid body does not have, and a joint bears the
//! weight and the inertia of the links below it. They are computed from a motion in `crate::planner::legs`, and updated from the iterates of a
//! solve in `crate::planner::leg_update`.
//!
//! Most of that momentum is due to the swinging feet, and varies with their accelerations. So Euler's law has, beside the known torque, the
//! term A (r_k−1 − 2 r_k + r_k+1) for each of them with a constant matrix A; what is known is the rest. It hardly changes from one solve to the
//! next.

use nalgebra::{Matrix3, Vector3};

use crate::leg::chain::ByJoint;
use crate::trajectory::Instant;

/// How the row of Euler's law at a sample depends on the acceleration of a swinging foot.
#[derive(Clone, Debug, PartialEq)]
pub struct FootInertia {
    /// k.
    pub sample: usize,
    /// i.
    pub foot: usize,
    /// A: the torque, world frame, m g · 1 m, is A (r_k−1 − 2 r_k + r_k+1).
    pub form: Matrix3<f64>,
}

impl FootInertia {
    /// The samples at which the row sees the foot, with their weights.
    pub fn stencil(&self) -> [(usize, f64); 3] {
        [(self.sample - 1, 1.0), (self.sample, -2.0), (self.sample + 1, 1.0)]
    }
}

/// Known functions of time; all zero for massless legs.
#[derive(Clone, Debug, Default, PartialEq)]
pub struct LegTerms {
    /// s at each sample, base frame, m.
    pub shift: Vec<Vector3<f64>>,
    /// s halfway from each sample to the next.
    pub shift_between: Vec<Vector3<f64>>,
    /// By sample: the rate of the angular momentum that a rigid body does not have, as the rows of Euler's law weight it; world frame,
    /// m g · 1 m.
    pub torque: Vec<Vector3<f64>>,
    /// The part of that torque which follows the swinging feet, in the order of the rows; `torque` is without it.
    pub inertia: Vec<FootInertia>,
    /// `joint_torque[foot][k]`: what each joint bears at a sample without any force at the foot, N m.
    pub joint_torque: Vec<Vec<ByJoint<f64>>>,
}

impl LegTerms {
    /// s at an instant, base frame, m.
    pub fn shift(&self, at: impl Into<Instant>) -> Vector3<f64> {
        let (values, k) = match at.into() {
            Instant::Sample(k) => (&self.shift, k),
            Instant::Between(k) => (&self.shift_between, k),
        };
        values.get(k).copied().unwrap_or_default()
    }

    /// The torque at sample k, world frame, m g · 1 m.
    pub fn torque(&self, k: usize) -> Vector3<f64> {
        self.torque.get(k).copied().unwrap_or_default()
    }

    /// The torques of a leg's joints at sample k, N m; none for massless legs.
    pub fn joint_torque(&self, foot: usize, k: usize) -> &[f64] {
        self.joint_torque.get(foot).and_then(|leg| leg.get(k)).map_or(&[], |torques| torques.as_slice())
    }
}
