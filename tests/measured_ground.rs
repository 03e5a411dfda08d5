//! Ground without data stays known as such: feet keep off it, the plan says where it is, and the check looks.

use std::ops::ControlFlow;
use std::path::Path;

use crate::common::{solved_in, standing};
use crate::terrain::npy;
use warpgait::check::check;
use warpgait::pipeline::Prepared;
use warpgait::plan::{GroundGrid, Plan};
use warpgait::scenario::load_text;

const COLUMNS: usize = 121;
const ROWS: usize = 61;
/// m
const SPACING: f64 = 0.025;

/// Writes a gentle slope of 3 m by 1.5 m, of which nothing is known where `hole` says so.
fn scan(folder: &Path, hole: impl Fn(f64, f64) -> bool) {
    let cell = |i: usize| {
        let (x, y) = (SPACING * (i % COLUMNS) as f64 - 1.5, 0.75 - SPACING * (i / COLUMNS) as f64);
        if hole(x, y) { f64::NAN } else { 0.05 * x }
    };
    let data: Vec<u8> = (0..COLUMNS * ROWS).flat_map(|i| cell(i).to_le_bytes()).collect();
    std::fs::write(folder.join("scan.npy"), npy("<f8", false, &format!("({ROWS}, {COLUMNS})"), &data))
        .unwrap();
}

fn scenario(contact: &str) -> String {
    format!(
        "horizon = 5.0\n[robot]\nname = \"anymal_towr\"\n[terrain]\nkind = \"heightmap\"\nfile = \"scan.npy\"\n\
         spacing = {SPACING}\n[start]\nposition = [-0.7, 0.0]\n[goal]\nposition = [0.6, 0.0]\n[contact]\n{contact}\n"
    )
}

/// The value of a law or figure; none if the plan has no such row.
fn value(plan: &Plan, law: &str) -> Option<f64> {
    let report = check(plan).unwrap();
    report.rows.iter().chain(&report.figures).find(|row| row.name == law).map(|row| row.value)
}

#[test]
fn feet_keep_off_ground_without_data() {
    let folder = tempfile::tempdir().unwrap();
    // Sensor noise, and a hole as large as a foot's reach in the way of the left feet.
    let hole = |x: f64, y: f64| (x - 0.1).hypot(y - 0.2) < 0.12;
    scan(folder.path(), |x, y| hole(x, y) || (x * 1e4) as i64 % 17 == 0 && (y * 1e4) as i64 % 5 == 0);
    let (motion, plan) = solved_in(folder.path(), &scenario(""));
    assert!(motion.solved, "{}", motion.status);
    assert_eq!(value(&plan, "unknown_ground"), Some(0.0));
    let stands_in_hole = |plan: &Plan| {
        let stances = plan.foot_position.iter().zip(&plan.foot_contact).filter(|(_, stands)| **stands);
        stances.into_iter().any(|(p, _)| hole(p[0], p[1]))
    };
    assert!(!stands_in_hole(&plan) && check(&plan).unwrap().passed);

    // The file keeps it.
    let path = folder.path().join("scan.plan.npz");
    plan.write(&path).unwrap();
    let read = Plan::read(&path).unwrap();
    assert_eq!(read.ground.unknown, plan.ground.unknown);
    assert!(read.ground.unknown.as_ref().is_some_and(|unknown| unknown.contains(&true)));

    // Where it may, a foot steps into the hole, and the plan says so.
    let (motion, plan) = solved_in(folder.path(), &scenario("on_known_ground = false"));
    assert!(motion.solved && stands_in_hole(&plan));
    assert!(value(&plan, "unknown_stances").is_some_and(|count| count >= 1.0));
    assert_eq!(value(&plan, "unknown_ground"), None);
}

#[test]
fn a_band_without_data_is_not_crossed() {
    let folder = tempfile::tempdir().unwrap();
    scan(folder.path(), |x, _| x.abs() < 0.5);
    let text = scenario("").replace("[-0.7, 0.0]", "[-0.95, 0.0]").replace("[0.6, 0.0]", "[0.95, 0.0]");
    let loaded = load_text("s.toml", &text, folder.path(), &[]).unwrap();
    let refused =
        Prepared::new(&loaded, &mut |_| ControlFlow::Continue(())).err().expect("a refusal").to_string();
    for part in ["foot ", "was not measured", "contact.on_known_ground"] {
        assert!(refused.contains(part), "{refused}");
    }
}

#[test]
fn a_start_in_a_hole_of_the_scan_is_refused() {
    let folder = tempfile::tempdir().unwrap();
    scan(folder.path(), |x, y| (x + 0.64).abs() < 0.16 && y.abs() < 0.5);
    let text = scenario("").replace("[-0.7, 0.0]", "[-0.3, 0.0]").replace("[0.6, 0.0]", "[0.9, 0.0]");
    let prepared = |text: &str| {
        let loaded = load_text("s.toml", text, folder.path(), &[]).unwrap();
        Prepared::new(&loaded, &mut |_| ControlFlow::Continue(())).map(|_| ()).map_err(|e| e.to_string())
    };
    let refused = prepared(&text).unwrap_err();
    for part in ["s.toml:9: start.position: foot ", "in its reach", "contact.on_known_ground"] {
        assert!(refused.contains(part), "{refused}");
    }
    assert_eq!(prepared(&format!("{text}on_known_ground = false\n")), Ok(()));
}

#[test]
fn the_check_counts_footholds_in_holes_that_are_wider_than_a_foot() {
    let mut plan = standing();
    // Cells of 2 cm, under feet of 6 cm.
    let (rows, columns) = (101, 201);
    plan.ground =
        GroundGrid { rows, columns, spacing: [0.02; 2], height: vec![0.0; rows * columns], ..plan.ground };
    let grid = plan.ground.clone();
    let near = |i: usize, place: [f64; 2], distance: f64| {
        let x = grid.origin[0] + grid.spacing[0] * (i % grid.columns) as f64 - place[0];
        let y = grid.origin[1] + grid.spacing[1] * (i / grid.columns) as f64 - place[1];
        x.hypot(y) < distance
    };
    let unknown = |distance: f64| -> Vec<bool> {
        (0..grid.height.len()).map(|i| near(i, [0.34, 0.19], distance)).collect()
    };
    let (small, wide) = (unknown(0.019), unknown(0.13));
    plan.ground.unknown = Some(small);
    assert_eq!(value(&plan, "unknown_ground"), Some(0.0));
    plan.ground.unknown = Some(wide);
    assert_eq!(value(&plan, "unknown_ground"), Some(1.0));
    assert!(!check(&plan).unwrap().passed);
}

#[test]
fn ground_that_smoothing_moved_under_a_foothold_is_noticed() {
    let mut plan = standing();
    plan.ground.raw = Some(vec![0.01; plan.ground.height.len()]);
    assert!(value(&plan, "ground_moved").is_some_and(|moved| (moved - 10.0).abs() < 1e-6));
    assert!(check(&plan).unwrap().passed);
    plan.ground.raw = Some(vec![0.03; plan.ground.height.len()]);
    assert!(!check(&plan).unwrap().passed);
}
