//! The plan file: what is written is what is read, and what is broken is refused by name.

use std::io::{Read, Write};
use std::path::{Path, PathBuf};

use crate::common;
use warpgait::files::npz::NpzWriter;
use warpgait::plan::{Plan, WarpedBase, WarpedSamples};
use warpgait::warp::MapGrid;

fn full_plan() -> Plan {
    let mut plan = common::standing();
    let n = plan.t.len();
    plan.warped = Some(WarpedSamples {
        base: Some(WarpedBase { position: plan.base_position.clone(), euler: vec![[0.1, 0.2, 0.3]; n] }),
        foot_position: plan.foot_position.clone(),
        foot_force: plan.foot_force.clone(),
    });
    plan.phase_durations = vec![vec![1.0], vec![0.3, 0.2, 0.5], vec![1.0], vec![0.5, 0.5]];
    plan.ground.raw = Some(vec![0.01; plan.ground.height.len()]);
    plan.map = Some(MapGrid {
        shape: [4, 4, 5],
        control_points: (0..80).map(|i| [i as f64, 0.5, -1.0]).collect(),
        origin: [-1.0, -1.0, 0.0],
        knots: [vec![0.0, 1.0], vec![0.0, 1.0], vec![0.0, 0.5, 1.0]],
    });
    plan.meta.scenario.push_str("# µ ∂ 🐕\n");
    plan
}

fn written(folder: &Path, plan: &Plan) -> PathBuf {
    let path = folder.join("a.plan.npz");
    plan.write(&path).unwrap();
    path
}

/// Copies an archive, passing each member's bytes through `change`, which may drop it.
fn rewrite(path: &Path, change: impl Fn(&str, Vec<u8>) -> Option<Vec<u8>>) -> PathBuf {
    let mut archive = zip::ZipArchive::new(std::fs::File::open(path).unwrap()).unwrap();
    let copy = path.with_file_name("b.plan.npz");
    let mut out = zip::ZipWriter::new(std::fs::File::create(&copy).unwrap());
    for i in 0..archive.len() {
        let mut member = archive.by_index(i).unwrap();
        let name = member.name().to_owned();
        let mut bytes = Vec::new();
        member.read_to_end(&mut bytes).unwrap();
        if let Some(bytes) = change(name.trim_end_matches(".npy"), bytes) {
            out.start_file(name, zip::write::SimpleFileOptions::default()).unwrap();
            out.write_all(&bytes).unwrap();
        }
    }
    out.finish().unwrap();
    copy
}

fn refusal(path: &Path) -> String {
    Plan::read(path).expect_err("the broken plan was accepted").to_string()
}

/// The bytes of one `.npy` member that holds what `fill` writes.
fn member(folder: &Path, fill: impl Fn(&mut NpzWriter)) -> Vec<u8> {
    let path = folder.join("one.npz");
    let mut npz = NpzWriter::create(&path).unwrap();
    fill(&mut npz);
    npz.finish().unwrap();
    let mut bytes = Vec::new();
    let mut archive = zip::ZipArchive::new(std::fs::File::open(path).unwrap()).unwrap();
    archive.by_index(0).unwrap().read_to_end(&mut bytes).unwrap();
    bytes
}

#[test]
fn reads_what_it_wrote() {
    let folder = tempfile::tempdir().unwrap();
    for plan in [common::standing(), full_plan()] {
        let read = Plan::read(&written(folder.path(), &plan)).unwrap();
        assert_eq!(format!("{plan:?}"), format!("{read:?}"));
    }
    let left: Vec<_> = std::fs::read_dir(folder.path()).unwrap().map(|f| f.unwrap().file_name()).collect();
    assert_eq!(left, ["a.plan.npz"], "temporary files are left over");
}

#[test]
fn an_unsound_plan_is_not_written() {
    let folder = tempfile::tempdir().unwrap();
    let path = folder.path().join("a.plan.npz");
    let mut plan = common::standing();
    plan.foot_force[7][1] = f64::NAN;
    assert!(plan.write(&path).unwrap_err().to_string().contains("foot_force"));
    let mut plan = common::standing();
    plan.base_position.pop();
    assert!(plan.write(&path).unwrap_err().to_string().contains("base_position"));
    assert_eq!(std::fs::read_dir(folder.path()).unwrap().count(), 0);
}

#[test]
fn every_missing_member_is_named() {
    let folder = tempfile::tempdir().unwrap();
    let path = written(folder.path(), &full_plan());
    let mut archive = zip::ZipArchive::new(std::fs::File::open(&path).unwrap()).unwrap();
    let names: Vec<String> = (0..archive.len())
        .map(|i| archive.by_index(i).unwrap().name().trim_end_matches(".npy").to_owned())
        .collect();
    // Members whose absence means that the plan has no such part.
    let optional = ["warped_base_position", "heightfield_raw", "map_control_points"];
    let needed = |name: &&String| !optional.contains(&name.as_str()) && !name.starts_with("spline/");
    for name in names.iter().filter(needed) {
        let message = refusal(&rewrite(&path, |n, bytes| (n != name).then_some(bytes)));
        assert!(
            message.contains("b.plan.npz") && message.contains(&format!("`{name}`: missing")),
            "{message}"
        );
    }
}

#[test]
fn wrong_shape_dtype_and_values_are_named() {
    let folder = tempfile::tempdir().unwrap();
    let path = written(folder.path(), &full_plan());
    let replaced = |name: &str, fill: &dyn Fn(&mut NpzWriter)| {
        let bytes = member(folder.path(), fill);
        refusal(&rewrite(&path, |n, old| Some(if n == name { bytes.clone() } else { old })))
    };
    let message = replaced("base_position", &|npz| npz.add_f64("x", &[3], [0.0; 3]).unwrap());
    assert!(message.contains("`base_position`: shape (3,), expected (201, 3)"), "{message}");
    let message = replaced("foot_contact", &|npz| npz.add_f64("x", &[201, 4], [0.0; 804]).unwrap());
    assert!(message.contains("`foot_contact`: dtype <f8, expected bool"), "{message}");
    let message =
        replaced("heightfield_origin", &|npz| npz.add_f64("x", &[2], [0.0, f64::INFINITY]).unwrap());
    assert!(message.contains("`heightfield_origin`: inf at [1]"), "{message}");
    let message =
        replaced("phase_durations", &|npz| npz.add_f64("x", &[4, 2], [f64::NAN, 1.0].repeat(4)).unwrap());
    assert!(message.contains("`phase_durations`: NaN at [0, 0]"), "{message}");
    let message = replaced("meta", &|npz| npz.add_str("x", &[], &["{\"schema\": 2}".into()]).unwrap());
    assert!(message.contains("`meta`: schema 2 is newer than 1"), "{message}");
    let message = replaced("meta", &|npz| npz.add_str("x", &[], &["not json".into()]).unwrap());
    assert!(message.contains("`meta`: not a JSON object"), "{message}");
    let message = replaced("meta", &|npz| npz.add_str("x", &[], &["{\"schema\": 1}".into()]).unwrap());
    assert!(message.contains("`meta`: missing field"), "{message}");
}

#[test]
fn a_file_cut_anywhere_is_refused() {
    let folder = tempfile::tempdir().unwrap();
    let whole = std::fs::read(written(folder.path(), &full_plan())).unwrap();
    let cut = folder.path().join("cut.plan.npz");
    for keep in [0, 1, whole.len() / 10, whole.len() / 2, whole.len() - 1] {
        std::fs::write(&cut, &whole[..keep]).unwrap();
        assert!(refusal(&cut).contains("cut.plan.npz"), "{keep} bytes");
    }
    std::fs::write(&cut, b"not a zip file at all").unwrap();
    assert!(refusal(&cut).contains("not an .npz archive"));
}

#[test]
fn damaged_bytes_never_panic() {
    let folder = tempfile::tempdir().unwrap();
    let whole = std::fs::read(written(folder.path(), &full_plan())).unwrap();
    let broken = folder.path().join("broken.plan.npz");
    for at in (0..whole.len()).step_by(whole.len() / 150) {
        let mut bytes = whole.clone();
        bytes[at] ^= 0xA5;
        std::fs::write(&broken, &bytes).unwrap();
        // Some bytes (dates, attributes) carry no meaning; the others must be refused, and none may panic.
        if let Err(error) = Plan::read(&broken) {
            assert!(error.to_string().contains("broken.plan.npz"), "{error}");
        }
    }
}

#[test]
fn refuses_targets_that_cannot_be_written() {
    let folder = tempfile::tempdir().unwrap();
    let plan = common::standing();
    let message = plan.write(&folder.path().join("no/such/a.npz")).unwrap_err().to_string();
    assert!(message.contains("there is no folder"), "{message}");
    let message = plan.write(folder.path()).unwrap_err().to_string();
    assert!(message.contains("folder"), "{message}");
}
