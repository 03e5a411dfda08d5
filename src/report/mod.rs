//! Results for human readers: tables for the terminal and drawings of a plan.

pub(crate) mod axes;
pub(crate) mod color;
mod ground;
mod residuals;
mod robot;
mod sheet;
pub(crate) mod svg;
pub mod table;
mod terrain;

pub use residuals::residuals;
pub use robot::robot_sheet;
pub use sheet::sheet;
pub use table::{check_counts, check_table, derivative_table, map_table, number, violation_table};
pub use terrain::{TerrainView, terrain_sheet};
