//! The paper's tables and figures, and what goes beyond them, as sweeps of cases that are measured one by one.
//!
//! | file | holds |
//! | --- | --- |
//! | `kind`, `options` | the benches, and what a user can select |
//! | [`protocol`] | the cases of each bench, with their scenarios |
//! | `routes` | starts and goals, and the parameters of steeper terrains |
//! | [`case`], [`measured`] | a case, and its result |
//! | [`sweep`] | runs the cases that are not finished |
//! | `folder` | computes a case in a process of its own and keeps its result |
//! | `process` | waits for that process, within its time |
//! | [`measure`] | what that process computes |
//! | [`clock`] | processor time |
//! | `orphan` | ends the process of a case with its sweep |
//! | [`summary`], [`mod@verdict`] | groups of cases, and one line per case |
//! | [`tables`], `csv`, `json`, `pictures` | tables for the terminal, spreadsheets, programs, and drawings |
//! | `run` | all of the above in order |
//!
//! `cpu_…` is processor time of the case's process (user and system, `/proc/self/stat`, steps of 10 ms). Other load on the
//! machine slows it only by competing for caches and memory. Columns of wall time are named so.

pub mod case;
pub mod clock;
mod csv;
#[cfg(test)]
mod fixtures;
mod folder;
mod json;
mod kind;
pub mod measure;
pub mod measured;
mod options;
mod orphan;
mod pictures;
mod process;
pub mod protocol;
mod routes;
mod run;
pub mod summary;
pub mod sweep;
pub mod tables;
pub mod verdict;

pub use kind::Bench;
pub use options::BenchOptions;
pub use orphan::end_with;
pub use run::{BenchResults, run};
