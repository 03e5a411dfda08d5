//! Legs with mass: what their mass adds to the laws follows the iterates, and the laws hold at the end.

use std::ops::ControlFlow;

use warpgait::check::check;
use warpgait::heightfield::Heightfield;
use warpgait::pipeline::Prepared;
use warpgait::plan::Plan;
use warpgait::plan::sampled::Provenance;
use warpgait::planner::{Host, Progress, Stage, attempt};
use warpgait::scenario::load_text;
use warpgait::warp::WarpMap;

/// Remembers the stages.
struct Watcher(Vec<Stage>);

impl Host for Watcher {
    fn on_iteration(&mut self, progress: &Progress) -> ControlFlow<()> {
        self.0.push(progress.stage);
        ControlFlow::Continue(())
    }

    fn build_map(&mut self, _: &Heightfield) -> warpgait::Result<Option<WarpMap>> {
        unreachable!("there is no continuation")
    }
}

#[test]
fn what_the_legs_mass_adds_is_settled_when_the_first_solve_ends() {
    let text = "horizon = 5.0\nformulation = \"direct\"\n[robot]\nname = \"anymal_c\"\n\
                [terrain]\nkind = \"rippled\"\nlevel = \"easy\"\nextent = [-1.5, 2.0, -1.5, 1.5]\n\
                [start]\nposition = [0.0, 0.0]\n[goal]\nposition = [0.6, 0.1]\n[physics]\nlegs = \"massive\"\n";
    let loaded = load_text("scenario", text, ".".as_ref(), &[]).expect("a scenario");
    let prepared = Prepared::new(&loaded, &mut |_| ControlFlow::Continue(())).expect("a ground");
    let mut watcher = Watcher(Vec::new());
    let motion = attempt(&prepared.task(&loaded, None), &mut watcher).expect("a motion");
    assert!(motion.solved, "{}", motion.status);
    assert!(watcher.0.contains(&Stage::Whole));
    assert!(!watcher.0.iter().any(|stage| matches!(stage, Stage::LegMass { .. })), "{:?}", watcher.0);
    let provenance = Provenance { loaded: &loaded, ground: &prepared.ground, map_seconds: 0.0 };
    let report = check(&Plan::from_motion(&motion, &provenance)).expect("a sound plan");
    let failed: Vec<_> = report.rows.iter().filter(|row| !row.passed).map(|row| &row.name).collect();
    assert!(failed.is_empty(), "{failed:?}");
}
