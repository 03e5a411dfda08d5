//! The motion as splines: which foot stands when, and every sampled quantity as a linear combination of the variables, the c of Eq. 1
//! and the c̄ of Eq. 7.
//!
//! The two formulations differ in [`space`] alone.

pub mod base;
mod cadence;
mod cyclic;
mod footfall;
pub mod gait;
pub mod instant;
pub mod layout;
pub mod node;
pub mod phase;
pub mod rotation;
pub mod sampling;
pub mod space;
pub mod spaces;
pub mod spline;
pub mod switches;
pub mod variables;

pub use gait::Gait;
pub use instant::Instant;
pub use layout::Layout;
pub use node::LinearNode;
pub use phase::{Stance, Swing};
pub use spaces::Spaces;
