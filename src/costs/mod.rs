//! The costs, E(c) in Eq. 1 and 7, one a file, each with its first and second derivatives.
//!
//! All are sums of squares and dimensionless: the weights carry the units.

pub mod base_acceleration;
pub mod force_rate;
pub mod force_share;
pub mod posture;
pub mod swing_acceleration;
