//! From a scenario to a checked plan: terrain → map → NLP → plan → check. What `warpgait solve` and Python's
//! `warpgait.solve` both do.

use std::ops::ControlFlow;
use std::sync::Arc;
use std::time::Instant;

use crate::Result;
use crate::check::{CheckReport, check};
use crate::heightfield::Heightfield;
use crate::ipopt::{INTERRUPT, NlpProblem};
use crate::nlp::derivatives::{self, DerivativeError};
use crate::nlp::model::gait;
use crate::nlp::solve::{self as nlp, Motion};
use crate::plan::Plan;
use crate::plan::sampled::Provenance;
use crate::scenario::{Formulation, LoadedScenario, MapSpec};
use crate::terrain::{self, GroundReport};
use crate::warp::{self, MapProgress, MapReport, WarpMap};

/// So many variables are moved in a check of the derivatives.
const DERIVATIVE_VARIABLES: usize = 200;

/// What is going on, for people who wait.
#[derive(Clone, Debug)]
pub enum Event<'a> {
    /// A stage begins that tells nothing more.
    Stage(&'a str),
    /// Something worth keeping.
    Note(&'a str),
    /// An iteration of the map.
    Map(MapProgress),
    /// An iteration of the NLP.
    Iteration(nlp::Progress<'a>),
}

/// Called at every event; may ask to stop, which is heard at the iterations.
pub type Observer<'a> = dyn FnMut(&Event) -> ControlFlow<()> + 'a;

/// A map and how it came about.
pub struct Built {
    /// φ
    pub map: WarpMap,
    /// Its quality.
    pub report: MapReport,
    /// It was taken from the cache.
    pub cached: bool,
}

/// All that came out of a scenario.
pub struct Outcome {
    /// The plan, with what the check said.
    pub plan: Plan,
    /// What it was sampled from.
    pub motion: Motion,
    /// The check in full.
    pub check: CheckReport,
    /// How the terrain came about.
    pub ground: GroundReport,
    /// The map, in the warped formulation.
    pub map: Option<Built>,
    /// Derivatives against differences, when asked for.
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
) -> Result<Option<Outcome>> {
    let scenario = &loaded.scenario;
    let robot = &loaded.robot;
    // Refused now and not after the map.
    gait(scenario, robot).map_err(|e| loaded.locate(e))?;

    // Whoever wishes to stop is asked again at the first iteration.
    let _ = observer(&Event::Stage("terrain"));
    let mut ground = terrain::build(&scenario.terrain, &loaded.base_dir).map_err(|e| loaded.locate(e))?;
    loaded.ensure_inside(ground.field.extent())?;
    for note in &ground.report.notes {
        let _ = observer(&Event::Note(&format!("terrain: {note}")));
    }
    let inputs = ground.inputs.drain(..).chain(loaded.inputs.iter().cloned()).collect();

    let start = Instant::now();
    let map = match scenario.formulation {
        Formulation::Direct => None,
        Formulation::Warped => match build_map(&ground.field, &scenario.map, true, observer)? {
            Some(built) => {
                built.report.ensure_injective()?;
                built.tell(observer);
                Some(built)
            }
            None => return Ok(None),
        },
    };
    let map_seconds = start.elapsed().as_secs_f64();
    let warp = map.as_ref().map(|built| &built.map);
    let field = Arc::new(ground.field.clone());

    let derivatives = match check_derivatives {
        true => {
            let _ = observer(&Event::Stage("derivatives"));
            let mut problem = nlp::problem(scenario, robot, &field, warp)?;
            Some(compare_derivatives(&mut problem))
        }
        false => None,
    };
    let motion =
        nlp::solve(scenario, robot, &field, warp, &mut |at| observer(&Event::Iteration(at.clone())))?;
    let _ = observer(&Event::Stage("plan"));
    let text = &loaded.effective_text;
    let provenance = Provenance { scenario, text, robot, ground: &ground, inputs, map_seconds };
    let mut plan = Plan::from_motion(&motion, &provenance);
    let check = check(&plan)?;
    plan.meta.checks = check.rows.clone();
    Ok(Some(Outcome { plan, motion, check, ground: ground.report, map, derivatives }))
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
) -> Result<Option<Built>> {
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
    Ok(Some(Built { map, report, cached }))
}

impl Built {
    /// Tells what a user should know about the map.
    pub fn tell(&self, observer: &mut Observer) {
        for warning in &self.report.warnings {
            let _ = observer(&Event::Note(&format!("map: {warning}")));
        }
    }
}

/// At the guess, in directions spread over all variables.
fn compare_derivatives(problem: &mut crate::nlp::Problem) -> Vec<DerivativeError> {
    let n = problem.num_variables();
    let mut x = vec![0.0; n];
    problem.initial_point(&mut x);
    let variables: Vec<usize> = (0..n).step_by(n.div_ceil(DERIVATIVE_VARIABLES).max(1)).collect();
    derivatives::check(problem, &x, &variables)
}
