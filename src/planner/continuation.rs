//! When the plain solve fails: the terrain grows out of the plane in steps, each solved from the one before.

use std::sync::Arc;

use super::stage::Stage;
use super::task::Task;
use crate::Result;
use crate::heightfield::Heightfield;
use crate::nlp::Model;
use crate::scenario::{Continuation, ContinuationMode, Formulation};
use crate::terrain::Surfaces;
use crate::trajectory::Spaces;
use crate::warp::WarpMap;

/// Steps of a continuation with `solver.continuation = "auto"`.
const CONTINUATION_STEPS: u32 = 3;
/// Ground whose heights differ by less than this is level, m.
const LEVEL: f64 = 1e-6;

/// Steps of a continuation for a task; 0 where there is none.
pub(super) fn steps(task: &Task) -> u32 {
    match task.scenario.solver.continuation {
        _ if is_level(&task.surfaces.posture) => 0,
        // Patches of a lower ground are not those of the whole one, nor is a given start on it.
        _ if task.surfaces.have_edges() || task.scenario.start.state.is_some() => 0,
        Continuation::Mode(ContinuationMode::Off) => 0,
        Continuation::Mode(ContinuationMode::Auto) => CONTINUATION_STEPS,
        Continuation::Steps(n) => n,
    }
}

/// Whether nothing could grow in a continuation.
fn is_level(ground: &Heightfield) -> bool {
    let heights = ground.samples();
    heights.iter().all(|h| (h - heights[0]).abs() < LEVEL)
}

/// The model of a stage of a continuation, whose map `build_map` builds; none when the user asked to stop while it did.
pub(super) fn model(
    task: &Task,
    stage: Stage,
    build_map: &mut dyn FnMut(&Heightfield) -> Result<Option<WarpMap>>,
) -> Result<Option<Model>> {
    if stage.is_whole() {
        return task.model().map(Some);
    }
    let Task { scenario, robot, steps, surfaces, .. } = *task;
    let ground = Arc::new(scaled(&surfaces.posture, stage.height_fraction())?);
    let map = match scenario.formulation() {
        Formulation::Direct => None,
        Formulation::Warped | Formulation::Hybrid => match build_map(&ground)? {
            Some(map) => Some(Arc::new(map)),
            None => return Ok(None),
        },
    };
    let spaces = Spaces::of(scenario.formulation(), map)?;
    let kept = surfaces.clone();
    let lower = Surfaces { keep_out: kept.keep_out, bends: kept.bends, ..Surfaces::one(ground) };
    let model = Model::new(scenario, robot, &steps.gait, lower, spaces);
    task.completed(model).map(Some)
}

/// The ground with all heights times `fraction`.
fn scaled(ground: &Heightfield, fraction: f64) -> Result<Heightfield> {
    let heights: Vec<f64> = ground.samples().iter().map(|h| h * fraction).collect();
    let grid = ground.grid();
    Heightfield::interpolate(grid.origin, grid.spacing, grid.columns, grid.rows, &heights)
}
