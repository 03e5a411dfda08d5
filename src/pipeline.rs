//! From a scenario to a checked plan: terrain → map → NLP → plan → check. `warpgait solve`, `warpgait bench` and Python's
//! `warpgait.solve` all run this.

mod again;
mod event;

use std::ops::ControlFlow;
use std::time::Instant;

use nalgebra::Vector3;

use crate::Result;
use crate::check::{self, CheckReport};
use crate::heightfield::Heightfield;
use crate::ipopt::{INTERRUPT, NlpProblem};
use crate::nlp::Tighter;
use crate::plan::Plan;
use crate::plan::sampled::Provenance;
use crate::planner::derivatives::{self, DerivativeError};
use crate::planner::{self, GaitProblem, Host, Motion, Progress, Steps, Task};
use crate::scenario::{Formulation, LoadedScenario, MapSpec};
use crate::terrain::{self, Ground, Surfaces};
use crate::trajectory::Gait;
use crate::warp::{self, MapReport, WarpMap};
use again::{Judged, Teller};
pub use event::{Event, Observer, Step};

/// How many variables a check of the derivatives perturbs.
const DERIVATIVE_VARIABLES: usize = 200;

/// A map and how it came about.
pub struct BuiltMap {
    /// φ
    pub map: WarpMap,
    /// Its quality.
    pub report: MapReport,
    /// It was taken from the cache.
    pub cached: bool,
}

impl BuiltMap {
    /// Reports what a user should know about the map.
    pub fn report_warnings(&self, observer: &mut Observer) {
        for warning in &self.report.warnings {
            let _ = observer(&Event::Note(&format!("map: {warning}")));
        }
    }
}

/// All that a scenario names, read and built before anything is computed.
pub struct Prepared {
    /// When the feet step, and where.
    pub steps: Steps,
    /// The ground and how it came about.
    pub ground: Ground,
    /// Its surfaces, shared by all models.
    pub surfaces: Surfaces,
}

impl Prepared {
    /// Builds the gait and the terrain, and refuses what does not fit together.
    ///
    /// # Errors
    /// For input that is wrong or files that cannot be read.
    pub fn new(loaded: &LoadedScenario, observer: &mut Observer) -> Result<Self> {
        let scenario = &loaded.scenario;
        // Refused before the terrain is read.
        let usual = Gait::of(scenario, &loaded.robot).map_err(|e| loaded.locate(e))?;
        if let Some(extent) = scenario.terrain.extent() {
            loaded.ensure_inside(extent)?;
        }
        // A request to stop takes effect at the first iteration.
        let _ = observer(&Event::Step(Step::Terrain));
        let ground =
            terrain::build(scenario, &loaded.robot, &loaded.base_dir).map_err(|e| loaded.locate(e))?;
        loaded.ensure_inside(ground.field.extent())?;
        for note in &ground.report.notes {
            let _ = observer(&Event::Note(&format!("terrain: {note}")));
        }
        let surfaces = Surfaces::of(scenario, &loaded.robot, &ground).map_err(|e| loaded.locate(e))?;
        let steps = Steps::of(scenario, &loaded.robot, &surfaces).map_err(|e| loaded.locate(e))?;
        ensure_start(loaded, &surfaces, &steps.gait)?;
        if steps.gait != usual {
            let [more, fewer] = [&steps.gait, &usual].map(|gait| gait.swings.iter().map(Vec::len).max());
            let _ = observer(&Event::Note(&format!(
                "gait: {} steps of each foot instead of {}, for {} (gait.cycle sets it)",
                more.unwrap_or(0),
                fewer.unwrap_or(0),
                if surfaces.have_edges() { "better footholds" } else { "the way to the goal" }
            )));
        }
        Ok(Self { steps, ground, surfaces })
    }

    /// What the planner is given.
    pub fn task<'a>(&'a self, loaded: &'a LoadedScenario, map: Option<&'a WarpMap>) -> Task<'a> {
        let (scenario, robot) = (&loaded.scenario, &loaded.robot);
        let guess = loaded.guess.as_deref();
        Task {
            scenario,
            robot,
            steps: &self.steps,
            surfaces: &self.surfaces,
            guess,
            tighter: Tighter::default(),
            map,
        }
    }
}

/// Refuses a given start that contradicts itself or the ground.
fn ensure_start(loaded: &LoadedScenario, surfaces: &Surfaces, gait: &Gait) -> Result<()> {
    let (scenario, robot) = (&loaded.scenario, &loaded.robot);
    let nominal: Vec<Vector3<f64>> = robot.feet.iter().map(|foot| foot.nominal.into()).collect();
    let pose = planner::given_pose(scenario, &nominal, robot.size(), surfaces);
    let rows = std::array::from_fn(|i| std::array::from_fn(|j| pose.rotation[(i, j)]));
    check::ensure_start(loaded, &surfaces.feet, pose.position.into(), rows)?;
    planner::ensure_possible(loaded, gait, surfaces, &pose).map_err(|e| loaded.locate(e))
}

/// All that came out of a scenario.
pub struct Planned {
    /// What it was planned from.
    pub prepared: Prepared,
    /// The map, in all formulations but the direct one.
    pub map: Option<BuiltMap>,
    /// The plan, with the results of the check.
    pub plan: Plan,
    /// What it was sampled from.
    pub motion: Motion,
    /// The check in full.
    pub check: CheckReport,
    /// Derivatives against differences, when requested.
    pub derivatives: Option<Vec<DerivativeError>>,
}

/// Plans the motion of a scenario and checks it; none when it was stopped before there was an iterate to keep.
///
/// # Errors
/// For input that is wrong or files that cannot be read. A solve that does not converge is not an error: the plan says so.
pub fn run(
    loaded: &LoadedScenario,
    check_derivatives: bool,
    observer: &mut Observer,
) -> Result<Option<Planned>> {
    let scenario = &loaded.scenario;
    let prepared = Prepared::new(loaded, observer)?;

    let _ = observer(&Event::Step(Step::Map));
    let start = Instant::now();
    let map = match scenario.formulation() {
        Formulation::Direct => None,
        Formulation::Warped | Formulation::Hybrid => {
            match build_map(&prepared.surfaces.posture, &scenario.map, true, observer)? {
                Some(built) => {
                    built.report.ensure_injective()?;
                    built.report_warnings(observer);
                    Some(built)
                }
                None => return Ok(None),
            }
        }
    };
    let map_seconds = start.elapsed().as_secs_f64();
    let task = prepared.task(loaded, map.as_ref().map(|built| &built.map));

    let derivatives = match check_derivatives {
        true => {
            let _ = observer(&Event::Step(Step::Derivatives));
            Some(compare_derivatives(&mut task.problem()?))
        }
        false => None,
    };
    let _ = observer(&Event::Step(Step::Solve));
    let provenance = Provenance { loaded, ground: &prepared.ground, map_seconds };
    let mut host = Planning { spec: &scenario.map, observer };
    let judged = match loaded.with_massless_legs()? {
        None => again::plan_motion(&task, &mut host, &provenance),
        Some(lighter) => {
            let massless = Task { scenario: &lighter.scenario, ..task };
            let of_massless = Provenance { loaded: &lighter, ..provenance };
            again::plan_flight((&task, &provenance), (&massless, &of_massless), &mut host)
        }
    };
    let Judged { motion, plan, check } = judged.map_err(|e| loaded.locate(e))?;
    Ok(Some(Planned { prepared, map, plan, motion, check, derivatives }))
}

/// What the planner asks for while it solves.
struct Planning<'a, 'b> {
    spec: &'a MapSpec,
    observer: &'a mut Observer<'b>,
}

impl Teller for Planning<'_, '_> {
    fn say(&mut self, event: &Event) {
        let _ = (self.observer)(event);
    }
}

impl Host for Planning<'_, '_> {
    fn on_iteration(&mut self, progress: &Progress) -> ControlFlow<()> {
        (self.observer)(&Event::Iteration(progress.clone()))
    }

    fn build_map(&mut self, ground: &Heightfield) -> Result<Option<WarpMap>> {
        Ok(build_map(ground, self.spec, true, self.observer)?.map(|built| built.map))
    }
}

/// Builds the map, or takes it from the cache; none when it was stopped.
///
/// # Errors
/// Those of [`warp::build`].
pub fn build_map(
    field: &Heightfield,
    spec: &MapSpec,
    with_cache: bool,
    observer: &mut Observer,
) -> Result<Option<BuiltMap>> {
    let folder = if with_cache { warp::default_cache_dir() } else { None };
    let mut stopped = false;
    let found = warp::build_cached(field, spec, folder.as_deref(), &mut |at| {
        stopped = observer(&Event::Map(at)).is_break() || INTERRUPT.is_raised();
        if stopped { ControlFlow::Break(()) } else { ControlFlow::Continue(()) }
    });
    if stopped {
        return Ok(None);
    }
    let (map, report, cached) = found?;
    Ok(Some(BuiltMap { map, report, cached }))
}

/// At the guess, in directions spread over all variables.
fn compare_derivatives(problem: &mut GaitProblem) -> Vec<DerivativeError> {
    let n = problem.num_variables();
    let mut x = vec![0.0; n];
    problem.initial_point(&mut x);
    let variables: Vec<usize> = (0..n).step_by(n.div_ceil(DERIVATIVE_VARIABLES).max(1)).collect();
    derivatives::check(problem, &x, &variables)
}
