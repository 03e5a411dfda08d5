//! The `warpgait` program.
fn main() {}
