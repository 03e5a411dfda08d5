//! The Ipopt layer, through its public interface, on small problems with known answers.

mod faults;
mod problems;
mod process;
mod solving;
