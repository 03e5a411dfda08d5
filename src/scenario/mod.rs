//! The scenario: everything a user specifies, as plain data (`scenarios/*.toml`, schema 1).
//!
//! One file per group of tables; `format.rs` is the whole file. The types state keys, ranges and defaults; the
//! JSON Schema and most error messages are derived from them. `consistency.rs` refuses values that do not fit together.

mod condition_checks;
mod conditions;
mod consistency;
mod continued;
mod cyclic;
mod ends;
pub mod examples;
mod format;
mod gait;
mod gait_kind;
mod goal;
mod guess;
mod keep_out;
mod load;
mod map;
mod mask;
mod motion;
mod sagittal;
mod section;
mod sequence;
mod solver;
mod start;
mod stops;
mod template;
pub mod terrain;
#[cfg(test)]
mod tests;
mod way;

pub use crate::robot::RobotSpec;
pub use conditions::{FootholdSpec, ForceSpec, PayloadSpec, PostureSpec};
pub use format::{Formulation, Scenario, json_schema};
pub use gait::GaitSpec;
pub use gait_kind::GaitKind;
pub use goal::{CircleSpec, GoalSpec, WaypointSpec};
pub use guess::{GivenMotion, GuessSpec};
pub use keep_out::KeepOutSpec;
pub use load::{LoadedScenario, load, load_text, parse};
pub use map::{MapMethod, MapScale, MapSpec};
pub use motion::{Cone, ContactSpec, DiscretizationSpec, Footholds, Law, Legs, MotionSpec, PhysicsSpec};
pub use section::SectionSpec;
pub use sequence::section_key;
pub use solver::{Continuation, ContinuationMode, Effort, Hessian, SolverSpec};
pub use start::{StartSpec, StartState};
pub use stops::{Stop, wrapped};
pub use template::template;
pub use terrain::TerrainSpec;
