//! A leg as the planner sees it: posture, parts that could hit the ground, and limits.

use std::ops::Range;

use super::chain::{Chain, JOINTS};
use super::jet::Scalar;
use super::planar::{Planar, PlanarPosture};
use super::serial::{Serial, SerialPosture};

/// A leg as the planner uses it: made from a [`LegSpec`](super::LegSpec). Lengths in m, base frame, origin at the center of mass.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Leg {
    pub(super) kinematics: Kinematics,
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

/// From the place of the foot to the joint angles.
#[derive(Clone, Copy, Debug, PartialEq)]
#[expect(clippy::large_enum_variant, reason = "there are few legs")]
pub(super) enum Kinematics {
    Planar(Planar),
    Serial(Serial),
}

/// The posture of a leg.
#[derive(Clone, Copy, Debug)]
#[expect(clippy::large_enum_variant, reason = "it is used where it is made")]
pub enum LegPosture<T> {
    /// Of a leg with a closed form.
    Planar(PlanarPosture<T>),
    /// Of any other leg.
    Serial(SerialPosture<T>),
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
        match &self.kinematics {
            Kinematics::Planar(leg) => leg.shank,
            Kinematics::Serial(leg) => leg.shank,
        }
    }

    /// Whether there are joint angles for the contact point r, regardless of joint limits.
    pub fn reaches(&self, r: [f64; 3]) -> bool {
        match &self.kinematics {
            Kinematics::Planar(leg) => leg.reaches(r),
            Kinematics::Serial(leg) => leg.reaches(r),
        }
    }

    /// The posture for the contact point r, base frame from the center of mass.
    pub fn posture<T: Scalar>(&self, r: [T; 3]) -> LegPosture<T> {
        match &self.kinematics {
            Kinematics::Planar(leg) => LegPosture::Planar(leg.posture(r)),
            Kinematics::Serial(leg) => LegPosture::Serial(leg.posture(r)),
        }
    }

    /// The joints that move fast in a swing. The abduction of a leg with a closed form is slow.
    pub fn swing_joints(&self) -> Range<usize> {
        match &self.kinematics {
            Kinematics::Planar(_) => 1..JOINTS,
            Kinematics::Serial(_) => 0..JOINTS,
        }
    }
}

impl<T: Scalar> LegPosture<T> {
    /// The angles of the joints as the robot's file counts them, rad. For a file without joints: HAA about x, HFE and KFE about y, all
    /// zero where the leg hangs straight down.
    pub fn joint_angles(&self) -> [T; JOINTS] {
        match self {
            Self::Planar(posture) => posture.joint_angles(),
            Self::Serial(posture) => posture.joint_angles(),
        }
    }

    /// An angle for each of [`Leg::swing_joints`], rad: that of the joint, up to a constant and its sign.
    pub fn swing_angles(&self) -> impl Iterator<Item = T> + use<T> {
        let angles = match self {
            Self::Planar(posture) => {
                let [thigh, knee] = posture.swing_angles();
                [Some(thigh), Some(knee), None]
            }
            Self::Serial(posture) => posture.joint_angles().map(Some),
        };
        angles.into_iter().flatten()
    }

    /// A point of the shank, base frame from the center of mass, m, in the coordinates of [`ShankShape::corner`].
    pub fn on_shank(&self, point: [f64; 2]) -> [T; 3] {
        match self {
            Self::Planar(posture) => posture.on_shank(point),
            Self::Serial(posture) => posture.on_shank(point),
        }
    }

    /// ∂r/∂q, m: the derivatives of the contact point, base frame, with respect to the joint angles, one vector for each joint. With a
    /// massless leg, a force f of the ground at the contact point, base frame, requires the torques −(∂r/∂q)ᵀ f.
    pub fn jacobian(&self) -> [[T; 3]; JOINTS] {
        match self {
            Self::Planar(posture) => posture.jacobian(),
            Self::Serial(posture) => posture.jacobian(),
        }
    }
}
