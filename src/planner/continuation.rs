//! When the plain solve fails: the terrain grows out of the plane in steps, each solved from the one before.

use std::sync::Arc;

use super::solve::{Solve, StageEnd, Start};
use super::stage::Stage;
use super::task::Task;
use crate::Result;
use crate::heightfield::Heightfield;
use crate::nlp::Model;
use crate::scenario::{Continuation, ContinuationMode, Formulation};
use crate::terrain::Surfaces;
use crate::trajectory::Spaces;

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

impl Solve<'_> {
    /// Solves with the terrain at 1/n, 2/n, … of its height, each to a feasible point from the last, the whole one with the
    /// costs. None when no iterations are left, or the user asked to stop, before the first of them.
    pub(super) fn continuation(&mut self, steps: u32) -> Result<Option<StageEnd>> {
        let scenario = self.task.scenario;
        let mut last: Option<StageEnd> = None;
        let mut from: Option<Vec<f64>> = None;
        for step in 1..=steps {
            let left = scenario.solver.max_iterations.saturating_sub(self.iterations);
            if left == 0 || last.as_ref().is_some_and(|end| end.interrupted) {
                break;
            }
            let stage = Stage::Continuation { step, steps };
            let Some(mut model) = self.scaled_model(stage)? else {
                self.interrupted = true;
                break;
            };
            let (mut x, mut start) = (self.guess(&model)?, Start::Guess);
            if let Some(from) = &from {
                // The pinned start is where this terrain has it; all else continues from the last step.
                x[6..].copy_from_slice(&from[6..]);
                start = Start::Feasible;
            }
            model.leg_terms = self.leg_terms(&model, &x).unwrap_or_default();
            let mut end = self.stage(stage, model, x, start, left)?;
            if !end.feasible && !stage.is_whole() {
                let percent = 100.0 * stage.height_fraction();
                end.status = format!("{} with the terrain at {percent:.0} % of its height", end.status);
            }
            from = Some(end.x.clone());
            last = Some(end);
        }
        Ok(last)
    }

    /// The model of a stage of a continuation; none when the user asked to stop while its map was built.
    fn scaled_model(&mut self, stage: Stage) -> Result<Option<Model>> {
        if stage.is_whole() {
            return self.task.model().map(Some);
        }
        let Task { scenario, robot, steps, surfaces, .. } = *self.task;
        let ground = Arc::new(scaled(&surfaces.posture, stage.height_fraction())?);
        let map = match scenario.formulation() {
            Formulation::Direct => None,
            Formulation::Warped | Formulation::Hybrid => match self.host.build_map(&ground)? {
                Some(map) => Some(Arc::new(map)),
                None => return Ok(None),
            },
        };
        let spaces = Spaces::of(scenario.formulation(), map)?;
        let kept = surfaces.clone();
        let lower = Surfaces { keep_out: kept.keep_out, bends: kept.bends, ..Surfaces::one(ground) };
        let model = Model::new(scenario, robot, &steps.gait, lower, spaces);
        self.task.completed(model).map(Some)
    }
}

/// The ground with all heights times `fraction`.
fn scaled(ground: &Heightfield, fraction: f64) -> Result<Heightfield> {
    let heights: Vec<f64> = ground.samples().iter().map(|h| h * fraction).collect();
    let grid = ground.grid();
    Heightfield::interpolate(grid.origin, grid.spacing, grid.columns, grid.rows, &heights)
}
