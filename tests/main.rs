//! The tests through the public interface, in one program: each program of its own would link the whole library again.
//!
//! `cargo test --release --test suite terrain::` runs those of `terrain.rs`. Ipopt's are a program apart, for it starts itself again.

mod architecture;
mod bench;
mod chains;
mod check;
mod claims;
mod cli;
mod common;
mod conditions;
mod cyclic;
mod derivatives;
mod durations;
mod edges;
mod ends;
mod exact;
mod gaits;
mod guess;
mod leg_mass;
mod measured_ground;
mod motions;
mod outputs;
mod plan;
mod sheet;
mod terrain;
mod terrain_bad_input;
mod terrain_command;
mod terrain_formats;
mod terrain_inputs;
mod terrain_meshes;
mod warp_build;
mod warp_methods;
mod warp_spline;

#[test]
fn every_file_is_part_of_the_program() {
    let declared = include_str!("main.rs");
    for entry in std::fs::read_dir("tests").unwrap() {
        let path = entry.unwrap().path();
        if path.extension().is_some_and(|extension| extension == "rs") && !path.ends_with("main.rs") {
            let line = format!("mod {};", path.file_stem().unwrap().to_str().unwrap());
            assert!(declared.lines().any(|declaration| declaration == line), "tests/main.rs has no `{line}`");
        }
    }
}
