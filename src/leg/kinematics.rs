//! A leg as the planner sees it: posture, parts that could hit the ground, and limits.

use super::chain::Chain;
use super::jet::Scalar;
use super::planar::{Planar, PlanarPosture};

/// A leg as the planner uses it: made from a [`LegSpec`](super::LegSpec). Lengths in m, base frame, origin at the center of mass.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Leg {
    pub(super) kinematics: Planar,
    /// Its joints and links, where the robot's file has them.
    pub chain: Option<Chain>,
    /// Its parts that could hit the ground.
    pub shank: ShankShape,
    /// Of the foot, m.
    pub foot_radius: f64,
    /// Greatest speed of each joint, rad/s.
    pub speed_limit: [f64; 3],
    /// Greatest torque of each joint, N m.
    pub torque_limit: [f64; 3],
}

/// The parts of a shank that could hit the ground, in the plane of the shank from the knee: along the line to the center of the foot, and
/// across it toward the outside of the bend; m.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct ShankShape {
    /// Of the parts around the last joint's axis.
    pub knee_radius: f64,
    /// The outermost corner.
    pub corner: [f64; 2],
    /// The upper end of the axis of the tube, which leads to the center of the foot.
    pub tube: [f64; 2],
    /// Of the tube.
    pub tube_radius: f64,
}

impl Leg {
    /// From the knee to the center of the foot in the plane of the shank, m.
    pub fn shank_length(&self) -> f64 {
        self.kinematics.shank
    }

    /// Whether there are joint angles for the contact point r, regardless of joint limits.
    pub fn reaches(&self, r: [f64; 3]) -> bool {
        self.kinematics.reaches(r)
    }

    /// The posture for the contact point r, base frame from the center of mass.
    pub fn posture<T: Scalar>(&self, r: [T; 3]) -> PlanarPosture<T> {
        self.kinematics.posture(r)
    }
}
