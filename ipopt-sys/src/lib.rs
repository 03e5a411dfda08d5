//! Raw bindings to Ipopt's C interface (`IpStdCInterface.h`), generated at build time from the header that is
//! installed. Versions 3.11 to 3.14; the types are called [`Number`], [`Index`], [`Int`] and [`Bool`] in all of them.
//!
//! Ipopt with MUMPS is not re-entrant: one solve at a time per process. The safe layer is `warpgait::ipopt`.

#![allow(non_camel_case_types, non_snake_case, non_upper_case_globals)]
#![allow(missing_docs, clippy::all)]

include!(concat!(env!("OUT_DIR"), "/bindings.rs"));

/// Ipopt's "yes": C `int` 1 in 3.11, C `bool` true in 3.14.
pub const TRUE: Bool = true as Bool;

/// Ipopt's "no".
pub const FALSE: Bool = false as Bool;

/// Whether Ipopt said "yes".
#[must_use]
pub fn is_true(value: Bool) -> bool {
    value != FALSE
}
