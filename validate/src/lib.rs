//! The native side of the Python package `warpgait`: plans evaluated exactly, the terrain, solving, and the command line.
//!
//! The documentation of each function, with shapes and units, stands here, where `help` finds it, and in `python/warpgait/_native.pyi`,
//! where editors find it. A test compares the two. Every array is new and in C order. The interpreter lock is released during computation.

mod arrays;
mod check;
mod command;
mod error;
mod iterate;
mod scenario;
mod solve;
mod terrain;
mod trajectory;

use pyo3::prelude::*;

/// `warpgait._native`
#[pyo3::pymodule]
mod _native {
    use super::*;

    #[pymodule_export]
    use super::check::check_plan;
    #[pymodule_export]
    use super::command::run_command;
    #[pymodule_export]
    use super::iterate::Iterate;
    #[pymodule_export]
    use super::scenario::{schema, terrain};
    #[pymodule_export]
    use super::solve::solve;
    #[pymodule_export]
    use super::terrain::Terrain;
    #[pymodule_export]
    use super::trajectory::{BaseMotion, FeetMotion, Trajectory, load};

    #[pymodule_init]
    fn init(module: &Bound<'_, PyModule>) -> PyResult<()> {
        warpgait::program::built_from(option_env!("WARPGAIT_COMMIT"));
        module.add("COMMIT", warpgait::program::commit())
    }
}
