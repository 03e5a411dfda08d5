//! The guarantees of every method on small grids, and the messages where they fail.

use std::ops::ControlFlow;
use std::process::Command;

use warpgait::Error;
use warpgait::heightfield::Heightfield;
use warpgait::scenario::{MapMethod, MapScale, MapSpec};
use warpgait::warp::{MapReport, Order, WarpMap, build};

const OPTIMIZED: [MapMethod; 5] = [
    MapMethod::Mips,
    MapMethod::Arap,
    MapMethod::AcapLocalGlobal,
    MapMethod::AcapNewton,
    MapMethod::Dirichlet,
];

fn terrain(height: impl Fn(f64, f64) -> f64) -> Heightfield {
    Heightfield::from_function([-3.0, 3.0, -3.0, 3.0], 0.05, |x, y| Ok(height(x, y))).unwrap()
}

fn rippled(amplitude: f64) -> Heightfield {
    let k = std::f64::consts::TAU / 2.4;
    terrain(|x, y| amplitude * (k * x).sin() * (k * y).sin())
}

fn hilly(height: f64) -> Heightfield {
    terrain(|x, y| height * (-(x * x + y * y) / 0.72).exp())
}

fn small(method: MapMethod) -> MapSpec {
    MapSpec { method, cells: Some([24, 24, 8]), ..MapSpec::default() }
}

fn made(field: &Heightfield, spec: &MapSpec) -> (WarpMap, MapReport) {
    build(field, spec, &mut |_| ControlFlow::Continue(())).unwrap()
}

fn determinant(map: &WarpMap, at: [f64; 3]) -> f64 {
    let j = map.jet(at, Order::First).jacobian;
    nalgebra::Matrix3::from_fn(|r, c| j[r][c]).determinant()
}

/// The number of folded points on the grid of the report, counted one by one.
fn folded(map: &WarpMap) -> usize {
    let [nx, ny, nz] = map.cells().map(|n| 3 * n);
    let (origin, size) = (map.origin(), map.size());
    let mut count = 0;
    for i in 0..=nx {
        for j in 0..=ny {
            for k in 0..=nz {
                let fractions = [i as f64 / nx as f64, j as f64 / ny as f64, k as f64 / nz as f64];
                let at = std::array::from_fn(|d| origin[d] + fractions[d] * size[d]);
                count += usize::from(determinant(map, at) <= 0.0);
            }
        }
    }
    count
}

#[test]
fn every_method_keeps_the_sides_and_is_on_the_ground() {
    for (name, field) in [("ripple", rippled(0.15)), ("hill", hilly(0.5))] {
        for method in OPTIMIZED.into_iter().chain([MapMethod::Shear]) {
            let (map, report) = made(&field, &small(method));
            assert!(report.converged && report.method == method, "{name} {method:?}");
            for i in 0..=30 {
                let s = -3.0 + 0.2 * f64::from(i);
                for t in [-3.0, -1.4, 0.1, 0.8, 3.0] {
                    let p = map.position([s, t, 0.0]);
                    let miss = (p[2] - field.height(p[0], p[1])).abs();
                    assert!(
                        miss < 4e-3 && miss <= 1.2 * report.misfit_max + 1e-4,
                        "{name} {method:?}: {miss}"
                    );
                }
                for z in [0.0, 0.7, 2.0] {
                    for side in [-3.0, 3.0] {
                        assert!((map.position([side, s, z])[0] - side).abs() < 1e-9, "{name} {method:?}");
                        assert!((map.position([s, side, z])[1] - side).abs() < 1e-9, "{name} {method:?}");
                    }
                }
            }
            assert_eq!(report.inverted_points, folded(&map), "{name} {method:?}");
        }
    }
}

#[test]
fn energies_fall_where_a_method_guarantees_it() {
    for (name, field) in [("ripple", rippled(0.15)), ("hill", hilly(0.8))] {
        for method in OPTIMIZED {
            let (_, report) = made(&field, &small(method));
            let runs = &report.history;
            assert_eq!(runs.last().unwrap().cells, [24, 24, 8]);
            assert_eq!(*runs.last().unwrap().energy.last().unwrap(), report.energy);
            assert_eq!(runs.iter().map(|run| run.energy.len() - 1).sum::<usize>(), report.iterations);
            let first = &runs[0].energy;
            assert!(first.last() < first.first(), "{name} {method:?}: {first:?}");
            if method != MapMethod::AcapLocalGlobal {
                for run in runs {
                    assert!(run.energy.is_sorted_by(|a, b| a >= b), "{name} {method:?}: {:?}", run.energy);
                }
            }
        }
    }
}

#[test]
fn conformal_methods_are_better_than_the_shear_at_the_ground() {
    let field = rippled(0.15);
    let error = |spec: &MapSpec| made(&field, spec).1.conformal_ground.mean;
    let shear = error(&small(MapMethod::Shear));
    for method in [MapMethod::Mips, MapMethod::AcapLocalGlobal, MapMethod::AcapNewton, MapMethod::Arap] {
        let found = error(&small(method));
        assert!(found < 0.2 * shear, "{method:?}: {found} against {shear}");
    }
}

#[test]
fn the_scale_printed_in_the_paper_yields_a_different_map() {
    let field = rippled(0.15);
    for method in [MapMethod::AcapLocalGlobal, MapMethod::AcapNewton] {
        let (trace, report) = made(&field, &small(method));
        let printed = MapSpec { scale: MapScale::Determinant, ..small(method) };
        let (determinant, other) = made(&field, &printed);
        assert!(report.converged && other.converged, "{method:?}");
        assert!(trace != determinant, "{method:?}");
        assert!((report.conformal_ground.mean - other.conformal_ground.mean).abs() < 0.02, "{method:?}");
    }
}

#[test]
fn barriers_prevent_folds_where_other_methods_fold() {
    let field = hilly(1.0);
    for method in [MapMethod::AcapNewton, MapMethod::Mips] {
        let (map, report) = made(&field, &small(method));
        assert_eq!((report.inverted_points, folded(&map)), (0, 0), "{method:?}");
        report.ensure_injective().unwrap();
    }
    let (map, report) = made(&field, &small(MapMethod::Dirichlet));
    assert!(report.inverted_points > 0 && report.min_determinant < 0.0);
    assert_eq!(report.inverted_points, folded(&map));
    let there = determinant(&map, report.min_determinant_at);
    assert!((there - report.min_determinant).abs() < 1e-6 * there.abs(), "{there}");
    let warning = report.warnings.iter().find(|w| w.contains("folds")).unwrap();
    assert!(warning.contains("mips") && warning.contains(&report.inverted_points.to_string()), "{warning}");
    let error = report.ensure_injective().unwrap_err();
    assert!(matches!(error, Error::Input(_)) && error.to_string().contains("mips"), "{error}");
}

#[test]
fn flat_ground_needs_no_warp_by_any_method() {
    let field = terrain(|_, _| 0.2);
    for method in OPTIMIZED {
        let (map, report) = made(&field, &small(method));
        let p = map.position([0.4, -1.3, 0.6]);
        // Nothing holds the top against the barrier of `acap-newton`, which stretches space by about a thousandth.
        let slack = if method == MapMethod::AcapNewton { 2e-3 } else { 1e-9 };
        let off = (p[0] - 0.4).abs() + (p[1] + 1.3).abs() + (p[2] - 0.8).abs();
        assert!(off < slack && report.conformal_ground.max < slack, "{method:?}: {off}");
    }
}

#[test]
fn auto_uses_the_first_method_that_is_good_enough_and_reports_the_others() {
    let (map, report) = made(&rippled(0.02), &small(MapMethod::Auto));
    assert_eq!((report.method, report.rejected.len()), (MapMethod::Shear, 0));
    assert_eq!(map, made(&rippled(0.02), &small(MapMethod::Shear)).0);
    let (map, report) = made(&rippled(0.15), &small(MapMethod::Auto));
    assert_eq!(report.method, MapMethod::Mips);
    assert_eq!(report.rejected.len(), 1);
    assert_eq!(report.rejected[0].method, MapMethod::Shear);
    assert!(report.rejected[0].why.contains("conformal error"), "{}", report.rejected[0].why);
    assert_eq!(map, made(&rippled(0.15), &small(MapMethod::Mips)).0);
}

#[test]
fn cells_are_refined_where_the_bottom_misses_unless_given() {
    // A bump that 48 cells follow only to a few millimeters.
    let field = terrain(|x, y| 0.35 * (-(x * x + y * y) / 0.05).exp());
    let open = MapSpec { method: MapMethod::Shear, ..MapSpec::default() };
    let (_, given) = made(&field, &MapSpec { cells: Some(open.cells(field.extent())), ..open.clone() });
    assert!(given.cells == [48, 48, 16] && given.misfit_max > 1e-3, "{}", given.misfit_max);
    let (_, finer) = made(&field, &open);
    assert_eq!(finer.cells, [96, 96, 16]);
    assert!(finer.misfit_max < 0.3 * given.misfit_max, "{} {}", finer.misfit_max, given.misfit_max);
    assert_eq!(made(&hilly(0.3), &open).1.cells, [48, 48, 16]);
}

/// The shear shows it, so that no time is spent on a finest grid of the default cells.
#[test]
fn ground_that_only_finer_cells_resolve_gets_them_from_the_start() {
    let field = terrain(|x, y| 0.25 * (-(x * x + y * y) / 0.03).exp());
    let (_, report) = made(&field, &MapSpec::default());
    assert!(report.converged && report.inverted_points == 0 && report.misfit_max < 2e-3, "{report:?}");
    let grids: Vec<_> = report.history.iter().map(|run| run.cells).collect();
    assert_eq!(grids, [[12, 12, 8], [24, 24, 8], [48, 48, 8], [96, 96, 16]]);
    // Given cells are kept.
    let (_, report) = made(&field, &small(MapMethod::Mips));
    assert_eq!(report.cells, [24, 24, 8]);
}

#[test]
fn no_motion_is_planned_over_a_folded_map() {
    let folder = tempfile::tempdir().unwrap();
    let scenario = "schema = 1\nhorizon = 2.0\n[terrain]\nkind = \"hilly\"\nlevel = \"hard\"\n[start]\nposition = [-2.2, 0.0]\n\
        [goal]\nposition = [-1.8, 0.0]\n[map]\nmethod = \"dirichlet\"\ncells = [16, 16, 8]\n";
    std::fs::write(folder.path().join("s.toml"), scenario).unwrap();
    let run = |arguments: &[&str]| {
        let mut command = Command::new(env!("CARGO_BIN_EXE_warpgait"));
        let output = command.current_dir(folder.path()).env("WARPGAIT_CACHE", folder.path().join("cache"));
        let output = output.args(arguments).output().unwrap();
        let text = |bytes: Vec<u8>| String::from_utf8(bytes).unwrap();
        (output.status.code().unwrap(), text(output.stdout), text(output.stderr))
    };
    let (code, out, err) = run(&["solve", "s.toml", "--quiet"]);
    assert_eq!((code, out.as_str()), (2, ""), "{err}");
    assert!(err.contains("folds at") && err.contains("map.method = \"mips\""), "{err}");
    assert!(!folder.path().join("s.plan.npz").exists());
    // The map itself can be built and is reported as unsound.
    let (code, out, _) = run(&["map", "s.toml", "--json"]);
    let report: serde_json::Value = serde_json::from_str(&out).unwrap();
    assert_eq!((code, &report["sound"]), (1, &serde_json::Value::Bool(false)));
    assert!(report["report"]["inverted_points"].as_u64().unwrap() > 0);
    assert!(report["report"]["history"][0]["energy"].as_array().unwrap().len() > 1);
}
