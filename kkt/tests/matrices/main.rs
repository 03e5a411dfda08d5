//! The tests through the public interface, in one program: each program of its own would compile faer's dense eigenvalues again.

mod common;
mod random;
mod real;
