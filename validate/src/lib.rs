//! The native side of the Python package `warpgait`: plans evaluated exactly, the terrain, and solving.
//!
//! What each function does for its users, with shapes and units, is said twice, as `help` shows the one and editors the other: here and in
//! `python/warpgait/_native.pyi`; a test compares them. Every array is a new one, in C order; the interpreter lock is released while
//! there is something to compute.

mod arrays;
mod error;
mod solve;
mod terrain;
mod trajectory;

/// `warpgait._native`
#[pyo3::pymodule]
mod _native {
    #[pymodule_export]
    use super::solve::solve;
    #[pymodule_export]
    use super::terrain::Terrain;
    #[pymodule_export]
    use super::trajectory::{BaseMotion, FeetMotion, Trajectory, load};
}
