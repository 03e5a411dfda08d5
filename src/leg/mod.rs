//! The kinematics of a leg, with derivatives.

pub mod body;
pub mod chain;
pub mod jet;
mod kinematics;
mod planar;
mod serial;
mod spec;

pub use kinematics::{Leg, LegPosture, LinkShape, ShankShape};
pub use spec::{JointSpec, LegSpec};
