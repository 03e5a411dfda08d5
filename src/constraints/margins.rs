//! By how much limits are tightened in the nonlinear program, so that they hold between its samples and on the full robot, and
//! where each figure comes from. Lengths are for a robot of ANYmal's size ([`crate::robot::Robot::size`]), and are multiplied by that of others.
//!
//! Between two samples, a path with acceleration a leaves the straight line through them by up to a Δt²/8.

/// Off the reach box (Eq. 4) on each side for a standing foot, m: 0.5 mm for the body at 1.5 m/s².
pub const REACH_STANDING: f64 = 0.001;
/// Off the reach box at lift-off and touch-down, m; where these are variables, at their earliest and latest.
pub const REACH_SWITCHING: f64 = 0.009;
/// Off the reach box in swing, or where a foot may swing, m: a foot at 50 m/s².
pub const REACH_SWINGING: f64 = 0.015;
/// Most that is taken off a reach box, as a fraction of its half size: no box may vanish, not even that of a foot that moves in a plane.
pub const REACH_FRACTION: f64 = 0.5;
/// On top of `motion.base_clearance`, m: only some points of the underside have rows, and only at some samples.
pub const BASE_CLEARANCE: f64 = 0.01;
/// Between knee or shank and the ground, m: for what happens between the samples, and the ground's curvature across the shank.
pub const KNEE_CLEARANCE: f64 = 0.02;
/// Between the shank's tube and ground with edges, m: the surface for it has a margin to the sides already. The trunk moves by up to 11 mm
/// against the center of mass, and swings that follow the edges closely leave nothing for what happens between the samples.
pub const SHANK_CLEARANCE: f64 = 0.014;
/// On each side of the height over the feet in `[posture]`, m: for what happens between the samples.
pub const POSTURE_HEIGHT: f64 = 0.001;
/// The same for roll and pitch, rad.
pub const POSTURE_TILT: f64 = 0.002;
/// Fraction of a joint's speed limit that a plan uses. The rest is for what happens between samples and for what the plan
/// does not know: the legs' own mass moves the trunk relative to the center of mass.
pub const JOINT_SPEED: f64 = 0.72;
/// Fraction of a joint's torque limit that a plan uses. The rest is for what the plan does not know: the weight of the legs,
/// and the controller's corrections.
pub const JOINT_TORQUE: f64 = 0.8;
