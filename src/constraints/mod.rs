//! The constraints of Eq. 1–5 and Eq. 7–13, one a file, each with its first and second derivatives.
//!
//! A constraint is written in ambient quantities; see [`crate::nlp`]. What several of them use is there as well:
//! [`crate::nlp::foot_in_base`], [`crate::nlp::contact_force`], [`crate::nlp::ground_normal`]. By how much each is tightened so that it
//! holds between the samples is in [`margins`].

pub mod base_clearance;
mod body_rates;
pub mod closure;
pub mod durations;
pub mod dynamics;
pub mod feet_at_start;
pub mod fixed_foothold;
pub mod foothold_patch;
pub mod foothold_slope;
pub mod friction;
pub mod friction_conformal;
pub mod goal;
pub mod joint_speed;
pub mod joint_torque;
pub mod keep_out;
pub mod knee_clearance;
pub mod linear;
pub mod margins;
pub mod newton_euler;
pub mod normal_force;
pub mod posture;
pub mod rails;
pub mod reach;
pub mod stance;
pub mod swing;
pub mod variable_rows;
