//! Mutated files for every reader: none may panic, take longer than 5 s, or take more than 500 MB.
//!
//! By default a few thousand inputs, the same every time. A long run, and one that begins elsewhere:
//!
//! ```text
//! WARPGAIT_FUZZ=100000 cargo test --release --workspace --test fuzz
//! WARPGAIT_FUZZ=100000 WARPGAIT_FUZZ_FIRST=100000 cargo test --release --workspace --test fuzz -- plan
//! ```
//!
//! Inputs that fail are kept in `target/fuzz`. `validate/tests/test_fuzz.py` does the same for the plan reader in Python.

mod guard;
mod mutate;
mod seeds;

use std::ops::ControlFlow;
use std::path::Path;

use guard::Guard;
use mutate::Random;
use warpgait::check::{CheckLimits, check};
use warpgait::heightfield::Heightfield;
use warpgait::plan::Plan;
use warpgait::scenario::{self, GivenMotion, MapSpec};
use warpgait::{digest, terrain, warp};

/// Runs `read` on every input that `make` makes in a folder of its own.
fn fuzz(
    reader: &'static str,
    make: impl Fn(&mut Random) -> Vec<u8>,
    read: impl Fn(&Path, &[u8]) + std::panic::RefUnwindSafe,
) {
    let from_environment = |name: &str| std::env::var(name).ok().map(|n| n.parse::<u64>().expect("a number"));
    let count = from_environment("WARPGAIT_FUZZ").unwrap_or(2000);
    let first = from_environment("WARPGAIT_FUZZ_FIRST").unwrap_or(0);
    let folder = tempfile::tempdir().unwrap();
    let mut guard = Guard::of(reader);
    for number in first..first + count {
        let input = make(&mut Random::new(reader, number));
        guard.watch(number, &input, || read(folder.path(), &input));
    }
    guard.finish();
}

/// Writes an input to a file that a reader then opens.
fn file(folder: &Path, name: &str, input: &[u8]) {
    std::fs::write(folder.join(name), input).unwrap();
}

#[test]
fn scenario() {
    let seeds = seeds::scenarios();
    fuzz(
        "scenario",
        |random| mutate::bytes(random, &seeds),
        |folder, input| {
            file(folder, "s.toml", input);
            let _ = scenario::load(&folder.join("s.toml"), &[]);
        },
    );
}

#[test]
fn overrides() {
    let seeds = seeds::overrides();
    fuzz(
        "overrides",
        |random| mutate::bytes(random, &seeds),
        |folder, input| {
            let assignment = String::from_utf8_lossy(input).into_owned();
            let _ = scenario::load_text("s.toml", seeds::FLAT, folder, &[assignment]);
        },
    );
}

#[test]
fn robot() {
    let seeds = seeds::robots();
    fuzz(
        "robot",
        |random| mutate::bytes(random, &seeds),
        |folder, input| {
            file(folder, "r.toml", input);
            let _ = scenario::load_text("s.toml", seeds::FLAT, folder, &["robot.file=\"r.toml\"".into()]);
        },
    );
}

#[test]
fn guess() {
    let seeds = seeds::motions();
    fuzz(
        "guess",
        |random| mutate::bytes(random, &seeds),
        |folder, input| {
            file(folder, "m.csv", input);
            let _ = GivenMotion::read(&folder.join("m.csv"), &["L", "R"], 1.0);
        },
    );
}

#[test]
fn mask() {
    let seeds = seeds::heights();
    fuzz(
        "mask",
        |random| mutate::bytes(random, &seeds),
        |folder, input| {
            file(folder, "mask", input);
            let _ =
                scenario::load_text("s.toml", seeds::FLAT, folder, &["keep_out=[{mask=\"mask\"}]".into()]);
        },
    );
}

#[test]
fn limits() {
    fuzz(
        "limits",
        |random| mutate::bytes(random, &[b"friction = 1.0\nnewton_max = 3\nreach = 1e-3\n".to_vec()]),
        |folder, input| {
            file(folder, "l.toml", input);
            let _ = CheckLimits::new(false).read(&folder.join("l.toml"));
        },
    );
}

#[test]
fn formula() {
    let seeds = seeds::formulas();
    fuzz(
        "formula",
        |random| mutate::bytes(random, &seeds),
        |folder, input| {
            let text = toml::Value::String(String::from_utf8_lossy(input).into_owned());
            let overrides = [
                "terrain.kind=formula".into(),
                format!("terrain.expression={text}"),
                "terrain.spacing=0.5".into(),
            ];
            if let Ok(loaded) = scenario::load_text("s.toml", seeds::GROUND, folder, &overrides) {
                let _ = terrain::build(&loaded.scenario, &loaded.robot, folder);
            }
        },
    );
}

/// Every format of heights; the file's bytes tell which.
#[test]
fn heights() {
    let seeds = seeds::heights();
    fuzz(
        "heights",
        |random| {
            let input = mutate::bytes(random, &seeds);
            if random.below(4) > 0 { mutate::with_png_checksums(input) } else { input }
        },
        |folder, input| {
            file(folder, "f", input);
            let overrides = [
                "terrain.kind=heightmap",
                "terrain.file=f",
                "terrain.spacing=0.02",
                "terrain.height_scale=0.5",
            ];
            let loaded =
                scenario::load_text("s.toml", seeds::GROUND, folder, &overrides.map(String::from)).unwrap();
            let _ = terrain::build(&loaded.scenario, &loaded.robot, folder);
        },
    );
}

#[test]
fn plan() {
    let seeds = seeds::plans();
    fuzz(
        "plan",
        |random| match random.below(4) {
            0 => mutate::bytes(
                random,
                &seeds.iter().map(|members| mutate::zipped(members)).collect::<Vec<_>>(),
            ),
            _ => mutate::zipped(&mutate::members(random, &seeds)),
        },
        |folder, input| {
            file(folder, "p.plan.npz", input);
            if let Ok(plan) = Plan::read(&folder.join("p.plan.npz")) {
                let _ = check(&plan);
            }
        },
    );
}

/// A damaged map is not read, and would be built again.
#[test]
fn cache() {
    let field = Heightfield::from_function([-1.0, 1.0, -1.0, 1.0], 0.5, |_, _| Ok(0.0)).unwrap();
    let spec = MapSpec { cells: Some([4, 4, 4]), ..MapSpec::default() };
    let folder = tempfile::tempdir().unwrap();
    warp::build_cached(&field, &spec, Some(folder.path()), &mut |_| ControlFlow::Continue(())).unwrap();
    let entry = std::fs::read_dir(folder.path()).unwrap().next().unwrap().unwrap();
    let (name, seed) = (entry.file_name(), std::fs::read(entry.path()).unwrap());
    let after_checksum = 1 + seed.iter().position(|b| *b == b'\n').unwrap();
    fuzz(
        "cache",
        |random| match random.below(4) {
            0 => mutate::bytes(random, std::slice::from_ref(&seed)),
            _ => {
                let content = mutate::bytes(random, &[seed[after_checksum..].to_vec()]);
                [format!("{}\n", digest::sha256_hex(&content)).as_bytes(), &content].concat()
            }
        },
        |folder, input| {
            std::fs::write(folder.join(&name), input).unwrap();
            let _ = warp::build_cached(&field, &spec, Some(folder), &mut |_| ControlFlow::Break(()));
        },
    );
}
