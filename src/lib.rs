//! warpgait: gait trajectory optimization for legged robots on rough ground.
//!
//! The modules, in the order in which data passes through them:
//! `scenario → terrain → heightfield → warp → trajectory → constraints → nlp → ipopt → plan → check → report`.

pub mod check;
pub mod cli;
pub mod constraints;
pub mod costs;
pub mod error;
pub mod heightfield;
pub mod ipopt;
pub mod nlp;
pub mod plan;
pub mod report;
pub mod robot;
pub mod scenario;
pub mod terrain;
pub mod trajectory;
pub mod warp;

pub use error::{Error, Result};
