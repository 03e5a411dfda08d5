//! The shipped grounds with edges, from the scenario to the drawing.

use std::ops::ControlFlow;
use std::path::Path;

use warpgait::{pipeline, report, scenario};

/// Solves a shipped scenario, and returns its plan's stances and its drawing.
fn walked(name: &str) -> (usize, String) {
    let file = Path::new(env!("CARGO_MANIFEST_DIR")).join("scenarios").join(name);
    let loaded = scenario::load(&file, &[]).unwrap();
    let planned = pipeline::run(&loaded, false, &mut |_| ControlFlow::Continue(())).unwrap().unwrap();
    let meta = &planned.plan.meta;
    assert!(meta.solver.success, "{name}: {}", meta.solver.status);
    for check in &meta.checks {
        assert!(check.passed, "{name}: {check:?}");
    }
    let stances = planned.plan.patches.iter().map(Vec::len).sum();
    (stances, report::sheet(&planned.plan, &planned.prepared.surfaces))
}

#[test]
fn stairs_are_climbed_and_drawn_with_their_patches() {
    let (stances, drawing) = walked("stairs.toml");
    assert!(stances >= 4 * 8, "{stances} stances");
    // One polygon for each patch, and one for the ground seen from the side.
    assert_eq!(drawing.matches("<polygon").count(), stances + 1);
    for drawn in
        ["url(#hatching)", "no foot can stand here", "cleared by swinging feet", "stroke-dasharray=\"4 3\""]
    {
        assert!(drawing.contains(drawn), "{drawn}");
    }
}

#[test]
fn stepping_stones_are_crossed() {
    walked("stepping_stones.toml");
}

#[test]
fn smooth_ground_is_drawn_without_patches() {
    let (stances, drawing) = walked("flat.toml");
    assert_eq!((stances, drawing.matches("<polygon").count()), (0, 1));
    for not_drawn in ["hatching", "no foot can stand here", "cleared by swinging feet", "patch"] {
        assert!(!drawing.contains(not_drawn), "{not_drawn}");
    }
}
