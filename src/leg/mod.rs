//! The kinematics of a leg, with derivatives.

pub mod chain;
pub mod jet;
mod kinematics;
mod planar;
mod spec;

pub use kinematics::{Leg, ShankShape};
pub use planar::PlanarPosture as LegPosture;
pub use spec::{JointSpec, LegSpec};
