//! The motion as splines: which foot stands when, and how every sampled quantity depends linearly on the variables.
//!
//! Everything here is the same for both formulations. Whether a node is a point of F or of ambient space is decided in
//! [`crate::nlp::state`].

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

pub use gait::Gait;
pub use instant::Instant;
pub use layout::Layout;
pub use node::LinearNode;
pub use phase::{Stance, Swing};
pub use spaces::Spaces;
