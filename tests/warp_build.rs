//! Maps over whole terrains: their quality, their cache, and invalid specifications.

use std::ops::ControlFlow;
use std::path::Path;

use warpgait::Error;
use warpgait::heightfield::Heightfield;
use warpgait::scenario::{MapMethod, MapSpec};
use warpgait::warp::{MapProgress, MapReport, Order, WarpMap, build, build_cached};

fn keep_going(_: MapProgress) -> ControlFlow<()> {
    ControlFlow::Continue(())
}

fn terrain(height: impl Fn(f64, f64) -> f64) -> Heightfield {
    Heightfield::from_function([-3.0, 3.0, -3.0, 3.0], 0.04, |x, y| Ok(height(x, y))).unwrap()
}

fn rippled() -> Heightfield {
    let k = std::f64::consts::TAU / 2.4;
    terrain(|x, y| 0.15 * (k * x).sin() * (k * y).sin())
}

fn hilly(height: f64) -> Heightfield {
    terrain(|x, y| height * (-(x * x + y * y) / 0.72).exp())
}

fn spec(cells: [usize; 3]) -> MapSpec {
    MapSpec { cells: Some(cells), ..MapSpec::default() }
}

/// Properties of every finished map, checked by evaluating it, regardless of its report.
fn check_map(map: &WarpMap, field: &Heightfield, misfit: f64) {
    for i in 0..=60 {
        for j in 0..=60 {
            let [s, t] = [i, j].map(|n| -3.0 + 0.1 * f64::from(n));
            let p = map.position([s, t, 0.0]);
            assert!((p[2] - field.height(p[0], p[1])).abs() < misfit, "{p:?}");
            for z in [0.0, 0.3, 1.1, 2.5] {
                let j = map.jet([s, t, z], Order::First).jacobian;
                let det = nalgebra::Matrix3::from_fn(|r, c| j[r][c]).determinant();
                assert!(det > 0.0, "folded at {s} {t} {z}");
            }
        }
        // The side faces stay in their planes.
        let s = -3.0 + 0.1 * f64::from(i);
        for z in [0.0, 0.7, 2.0] {
            for side in [-3.0, 3.0] {
                assert!((map.position([side, s, z])[0] - side).abs() < 1e-9);
                assert!((map.position([s, side, z])[1] - side).abs() < 1e-9);
            }
        }
    }
}

#[test]
fn the_map_of_the_medium_ripple_is_nearly_conformal() {
    let field = rippled();
    let (map, report) = build(&field, &MapSpec::default(), &mut keep_going).unwrap();
    assert!(report.converged && report.inverted_points == 0 && report.warnings.is_empty());
    assert!(report.conformal_ground.mean < 0.040, "{report:?}");
    assert!(report.misfit_max < 1e-4, "{report:?}");
    assert!(report.min_determinant > 0.8 && report.normal_angle.max < 1.0);
    check_map(&map, &field, 1e-4);
    // The conformal error of the shear is several times larger.
    let shear = MapSpec { method: MapMethod::Shear, ..MapSpec::default() };
    let (map, sheared) = build(&field, &shear, &mut keep_going).unwrap();
    assert!(sheared.conformal_ground.mean > 4.0 * report.conformal_ground.mean);
    assert!((sheared.min_determinant - 1.0).abs() < 1e-9);
    check_map(&map, &field, 1e-4);
}

#[test]
fn the_map_of_a_medium_hill_is_accurate_to_a_millimeter() {
    let field = hilly(1.0);
    let (map, report) = build(&field, &MapSpec::default(), &mut keep_going).unwrap();
    assert!(report.converged && report.inverted_points == 0);
    assert!(report.conformal_ground.mean < 0.027 && report.misfit_max < 1e-3, "{report:?}");
    check_map(&map, &field, 1e-3);
}

/// Without a second attempt with more weight above the ground, this one would fold at the top of the box.
#[test]
fn a_peak_of_slope_three_is_not_folded() {
    let field = hilly(3.0);
    let (map, report) = build(&field, &spec([24, 24, 8]), &mut keep_going).unwrap();
    assert!(report.inverted_points == 0, "{report:?}");
    assert!(report.conformal_ground.mean < 0.12, "{report:?}");
    check_map(&map, &field, 0.2);
}

#[test]
fn more_weight_at_the_torso_makes_the_map_gentler_there() {
    let field = hilly(1.0);
    let made = |torso_weight| {
        build(&field, &MapSpec { torso_weight, ..spec([24, 24, 8]) }, &mut keep_going).unwrap().1
    };
    let (light, heavy) = (made(0.03), made(0.3));
    assert!(heavy.conformal_torso.mean < light.conformal_torso.mean);
    assert!(heavy.conformal_ground.mean > light.conformal_ground.mean);
}

#[test]
fn cells_over_oblong_ground_are_nearly_square() {
    let cells = |extent| MapSpec::default().cells(extent);
    assert_eq!(cells([-3.0, 3.0, -3.0, 3.0]), [48, 48, 16]);
    assert_eq!(cells([0.0, 2.0, 0.0, 16.0]), [16, 136, 16]);
    assert_eq!(cells([0.0, 1000.0, 0.0, 1.0]), [288, 8, 16]);
}

#[test]
fn flat_ground_needs_no_warp() {
    let field = terrain(|_, _| 0.2);
    let (map, report) = build(&field, &spec([16, 12, 8]), &mut keep_going).unwrap();
    assert_eq!(report.iterations, 0);
    let p = map.position([0.4, -1.3, 0.6]);
    assert!((p[0] - 0.4).abs() + (p[1] + 1.3).abs() + (p[2] - 0.8).abs() < 1e-9, "{p:?}");
    assert!(report.conformal_ground.max < 1e-9);
}

#[test]
fn a_cliff_is_not_folded() {
    // Slope 7.5 is more than the cells can follow at once, so the ground grows in steps.
    let field = terrain(|x, y| -0.45 * (1.0 - ((x * x + y * y - 1.44) / (2.4 * 0.06)).tanh()));
    let (map, report) = build(&field, &spec([32, 32, 8]), &mut keep_going).unwrap();
    assert_eq!(report.inverted_points, 0, "{report:?}");
    assert!(report.warnings.iter().any(|w| w.contains("misses the terrain")), "{report:?}");
    check_map(&map, &field, 0.06);
}

#[test]
fn odd_numbers_of_cells_and_oblong_terrains_work() {
    let field =
        Heightfield::from_function([0.0, 4.0, -1.0, 1.5], 0.05, |x, y| Ok(0.1 * (2.0 * x).sin() + 0.05 * y))
            .unwrap();
    let (map, report) = build(&field, &spec([25, 17, 9]), &mut keep_going).unwrap();
    assert!(report.converged && report.inverted_points == 0 && report.misfit_max < 1e-3, "{report:?}");
    let back = map.inverse(map.position([2.2, 0.4, 0.5])).unwrap();
    assert!((back[0] - 2.2).abs() + (back[1] - 0.4).abs() + (back[2] - 0.5).abs() < 1e-9);
}

#[test]
fn the_reported_energy_falls_and_progress_may_stop_the_optimizer() {
    let mut seen: Vec<MapProgress> = Vec::new();
    build(&rippled(), &spec([24, 24, 8]), &mut |p| {
        seen.push(p);
        ControlFlow::Continue(())
    })
    .unwrap();
    for pair in seen.windows(2) {
        assert!(pair[0].cells != pair[1].cells || pair[1].energy <= pair[0].energy);
    }
    let last = seen.last().unwrap();
    assert!(last.cells == [24, 24, 8] && last.decrement <= last.tolerance);
    let stopped = build(&rippled(), &spec([24, 24, 8]), &mut |_| ControlFlow::Break(()));
    assert!(stopped.unwrap_err().to_string().contains("stopped"));
}

#[test]
fn invalid_grids_are_rejected() {
    for bad in [
        spec([2, 48, 16]),
        spec([48, 48, 100_000]),
        spec([512, 512, 512]),
        MapSpec { thickness: -1.0, ..MapSpec::default() },
        MapSpec { thickness: f64::NAN, ..MapSpec::default() },
    ] {
        assert!(matches!(build(&rippled(), &bad, &mut keep_going), Err(Error::Input(_))), "{bad:?}");
    }
}

fn cached(field: &Heightfield, spec: &MapSpec, dir: &Path) -> (WarpMap, MapReport, bool) {
    build_cached(field, spec, Some(dir), &mut keep_going).unwrap()
}

#[test]
fn the_cache_key_covers_all_inputs_and_damaged_files_are_replaced() {
    let dir = tempfile::tempdir().unwrap();
    let small = spec([12, 12, 8]);
    let (map, report, hit) = cached(&rippled(), &small, dir.path());
    assert!(!hit);
    let (again, same, hit) = cached(&rippled(), &small, dir.path());
    assert!(hit && again == map);
    assert_eq!((same.method, same.iterations), (report.method, report.iterations));
    assert!((same.conformal_ground.mean - report.conformal_ground.mean).abs() < 1e-12);
    // A different terrain; a different specification.
    assert!(!cached(&hilly(0.3), &small, dir.path()).2);
    assert!(!cached(&rippled(), &spec([12, 12, 9]), dir.path()).2);
    // Maps are built again if their files are damaged.
    let files: Vec<_> = std::fs::read_dir(dir.path()).unwrap().map(|e| e.unwrap().path()).collect();
    assert_eq!(files.len(), 3, "{files:?}");
    for file in &files {
        let mut bytes = std::fs::read(file).unwrap();
        let at = bytes.len() - 100;
        bytes[at] ^= 1;
        std::fs::write(file, bytes).unwrap();
    }
    assert!(!cached(&rippled(), &small, dir.path()).2);
    let (restored, _, hit) = cached(&rippled(), &small, dir.path());
    assert!(hit && restored == map);
    for file in &files {
        std::fs::write(file, b"{}\nshort").unwrap();
    }
    assert!(!cached(&rippled(), &small, dir.path()).2);
}

#[test]
fn an_unwritable_cache_causes_only_a_warning() {
    let dir = tempfile::tempdir().unwrap();
    let file = dir.path().join("file");
    std::fs::write(&file, b"").unwrap();
    let (_, report, hit) = cached(&rippled(), &spec([12, 12, 8]), &file);
    assert!(!hit && report.warnings.iter().any(|w| w.contains("cache")), "{report:?}");
}
