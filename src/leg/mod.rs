//! The kinematics of a leg in closed form, with derivatives.

pub mod jet;
mod kinematics;

pub use kinematics::{Leg, LegPosture};
