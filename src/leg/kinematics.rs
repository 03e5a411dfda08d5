//! A leg as the planner sees it: posture, parts that could hit the ground, and limits.

use std::ops::Range;

use nalgebra::Vector3;

use super::chain::{ByJoint, Chain};
use super::jet::Scalar;
use super::planar::{Planar, PlanarPosture};
use super::serial::{Serial, SerialPosture};

/// A leg as the planner uses it: made from a [`LegSpec`](super::LegSpec). Lengths in m, base frame, origin at the center of mass.
#[derive(Clone, Debug, PartialEq)]
pub struct Leg {
    pub(super) kinematics: Kinematics,
    /// Its joints and links, where the robot's file has them.
    pub chain: Option<Chain>,
    /// Its parts that could hit the ground.
    pub shank: ShankShape,
    /// Those of the links above the shank, of a leg of more than three joints.
    pub links: Vec<LinkShape>,
    /// Of the foot, m.
    pub foot_radius: f64,
    /// Greatest speed of each joint, rad/s.
    pub speed_limit: ByJoint<f64>,
    /// Greatest torque of each joint, N m.
    pub torque_limit: ByJoint<f64>,
}

/// The part of a link that could hit the ground: a tube around the line from its joint to the next, with a ball at the joint.
#[derive(Clone, Debug, PartialEq)]
pub struct LinkShape {
    /// The joint that moves the link.
    pub joint: usize,
    /// The ends of the line, from that joint at zero joint angles, m: the point of its axis next to the next joint, and that joint.
    pub ends: [Vector3<f64>; 2],
    /// m.
    pub radius: f64,
}

/// From the place of the foot to the joint angles.
#[derive(Clone, Debug, PartialEq)]
pub(super) enum Kinematics {
    Planar(Planar),
    Serial(Serial),
}

/// The posture of a leg.
#[derive(Clone, Debug)]
pub enum LegPosture<'a, T> {
    /// Of a leg with a closed form.
    Planar(PlanarPosture<'a, T>),
    /// Of any other leg.
    Serial(SerialPosture<'a, T>),
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

    /// The closed form of a leg whose first joint is an abduction about the base's x axis.
    pub(super) fn abducting(&self) -> Option<&Planar> {
        match &self.kinematics {
            Kinematics::Planar(leg) => Some(leg).filter(|leg| leg.frame.is_none()),
            Kinematics::Serial(_) => None,
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
    pub fn posture<T: Scalar>(&self, r: [T; 3]) -> LegPosture<'_, T> {
        match &self.kinematics {
            Kinematics::Planar(leg) => LegPosture::Planar(leg.posture(r)),
            Kinematics::Serial(leg) => LegPosture::Serial(leg.posture(r)),
        }
    }

    /// The number of its joints; 3 of a leg of two, with the abduction that it does not have.
    pub fn joints(&self) -> usize {
        self.speed_limit.len()
    }

    /// The joints that move fast in a swing: all but an abduction about the base's x axis.
    pub fn swing_joints(&self) -> Range<usize> {
        usize::from(self.abducting().is_some())..self.joints()
    }
}

impl<T: Scalar> LegPosture<'_, T> {
    /// The angles of the joints as the robot's file counts them, rad. For a file without joints: HAA about x, HFE and KFE about y, all
    /// zero where the leg hangs straight down.
    pub fn joint_angles(&self) -> ByJoint<T> {
        match self {
            Self::Planar(posture) => posture.joint_angles().into_iter().collect(),
            Self::Serial(posture) => posture.joint_angles(),
        }
    }

    /// An angle for each of [`Leg::swing_joints`], rad: that of the joint, up to a constant and its sign.
    pub fn swing_angles(&self) -> ByJoint<T> {
        match self {
            Self::Planar(posture) if posture.abducts() => posture.swing_angles().into_iter().collect(),
            Self::Planar(posture) => posture.joint_angles().into_iter().collect(),
            Self::Serial(posture) => posture.joint_angles(),
        }
    }

    /// A point of the shank, base frame from the center of mass, m, in the coordinates of [`ShankShape::corner`].
    pub fn on_shank(&self, point: [f64; 2]) -> [T; 3] {
        match self {
            Self::Planar(posture) => posture.on_shank(point),
            Self::Serial(posture) => posture.on_shank(point),
        }
    }

    /// The point of the line of [`LinkShape::ends`] at a fraction of it, base frame from the center of mass, m. A leg with a closed form has
    /// no such links; for it, the knee.
    pub fn on_link(&self, link: &LinkShape, fraction: f64) -> [T; 3] {
        match self {
            Self::Planar(posture) => posture.on_shank([0.0; 2]),
            Self::Serial(posture) => {
                let [start, end] = &link.ends;
                posture.on_link(link.joint, &(start + (end - start) * fraction))
            }
        }
    }

    /// ∂r/∂q, m: the derivatives of the contact point, base frame, with respect to the joint angles, one vector for each joint. With a
    /// massless leg, a force f of the ground at the contact point, base frame, requires the torques −(∂r/∂q)ᵀ f.
    pub fn jacobian(&self) -> ByJoint<[T; 3]> {
        match self {
            Self::Planar(posture) => posture.jacobian().into_iter().collect(),
            Self::Serial(posture) => posture.jacobian(),
        }
    }
}
