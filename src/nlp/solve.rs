//! From a scenario to a motion: guess, NLP, Ipopt, and what to try when the plain solve fails.

use std::ops::ControlFlow;
use std::sync::Arc;
use std::time::Instant;

use super::guess;
use super::model::Model;
use super::problem::{Choice, Problem};
use super::violation::{self, BlockViolation};
use crate::heightfield::Heightfield;
use crate::ipopt::{self, IterationRecord, LinearSolver, NlpProblem, Options, Status};
use crate::plan::Seconds;
use crate::robot::Robot;
use crate::scenario::{self, Continuation, ContinuationMode, Effort, Formulation, Hessian, Law, Scenario};
use crate::trajectory::space::Space;
use crate::warp::{self, WarpMap};
use crate::{Error, Result};

/// `effort = "smooth"` stops when this many iterations have lowered a feasible objective by less than `SMOOTH_GAIN` of it.
const SMOOTH_WINDOW: usize = 4;
/// See [`SMOOTH_WINDOW`].
const SMOOTH_GAIN: f64 = 0.02;
/// Steepness of the terrain along a continuation of n steps: 1/n, 2/n, …, 1.
const CONTINUATION_STEPS: u32 = 3;
/// Share of the iterations that the plain solve may take when a continuation may follow.
const PLAIN_SHARE: f64 = 0.5;

/// Ipopt's `sigma_min` for solves with the exact Hessian from the guess in F. Ways out of the medium pit take 37 iterations in the median with
/// Ipopt's own 10⁻⁶ and 23 with this one; with 0.1 some take as many as before, with 0.5 other terrains take more. From a feasible
/// point, with limited memory, or in the direct formulation (24 to 29 out of the pit) it costs iterations.
const LEAST_CENTERING: f64 = 0.3;

/// What is going on, for people who wait.
#[derive(Clone, Debug)]
pub struct Progress<'a> {
    /// Which stage, in words.
    pub stage: &'a str,
    /// The iteration, counted over all stages.
    pub iteration: usize,
    /// The iteration as Ipopt tells it.
    pub record: &'a IterationRecord,
}

/// Called at every iteration; may ask to stop.
pub type OnProgress<'a> = dyn FnMut(&Progress) -> ControlFlow<()> + 'a;

/// A motion, solved or not.
pub struct Motion {
    /// What it is a motion of.
    pub model: Model,
    /// The variables.
    pub x: Vec<f64>,
    /// How it went, in words.
    pub status: String,
    /// Every constraint holds to the tolerance.
    pub solved: bool,
    /// Ctrl-C, or the callback asked to stop.
    pub interrupted: bool,
    /// Iterations of all stages.
    pub iterations: usize,
    /// Largest violation by block.
    pub violations: Vec<BlockViolation>,
    /// Every iteration of every stage; seconds count from the start of the solve.
    pub history: Vec<IterationRecord>,
    /// The linear solver that Ipopt worked with, in the last stage.
    pub linear_solver: LinearSolver,
    /// Where the time went; without the map's.
    pub seconds: Seconds,
}

impl Motion {
    /// The largest violation of all blocks.
    pub fn max_violation(&self) -> f64 {
        self.violations.iter().map(|v| v.largest).fold(0.0, f64::max)
    }
}

/// Refuses what cannot be solved before anything is computed.
pub fn validate(scenario: &Scenario) -> Result<()> {
    if scenario.physics.law == Law::NewtonEuler && scenario.formulation == Formulation::Warped {
        return Err(Error::input(
            "physics.law = \"newton-euler\" needs the orientation's second derivative in time, and the map is not smooth enough for it (third derivatives of its cubic splines jump from cell to cell); use law = \"pcdm\" (the default), or formulation = \"direct\"",
        ));
    }
    Ok(linear_solver(scenario).check()?)
}

fn linear_solver(scenario: &Scenario) -> LinearSolver {
    match scenario.solver.linear_solver {
        scenario::LinearSolver::Auto => LinearSolver::Auto,
        scenario::LinearSolver::Faer => LinearSolver::Faer,
        scenario::LinearSolver::Mumps => LinearSolver::Mumps,
    }
}

/// Composes the NLP of a scenario at its guess, for checks of its derivatives.
pub fn problem(
    scenario: &Scenario,
    robot: &Robot,
    ground: &Arc<Heightfield>,
    map: Option<&WarpMap>,
) -> Result<Problem> {
    validate(scenario)?;
    let model = Model::new(scenario, robot, ground.clone(), space(scenario, map)?)?;
    let x = guess::guess(scenario, &model)?;
    Ok(Problem::new(scenario, model, x, Choice { with_costs: true, exact_hessian: true }))
}

fn space(scenario: &Scenario, map: Option<&WarpMap>) -> Result<Space> {
    match (scenario.formulation, map) {
        (Formulation::Direct, _) => Ok(Space::Direct),
        (Formulation::Warped, Some(map)) => Ok(Space::Warped(Box::new(map.clone()))),
        (Formulation::Warped, None) => Err(Error::Internal("the warped formulation needs a map".into())),
    }
}

/// Plans the motion of a scenario over the ground; `map` is needed for the warped formulation.
///
/// The plain solve first; if it finds no feasible point and the scenario allows it, a continuation: the terrain grows out
/// of the plane in steps, each solved from the last.
pub fn solve(
    scenario: &Scenario,
    robot: &Robot,
    ground: &Arc<Heightfield>,
    map: Option<&WarpMap>,
    on_progress: &mut OnProgress,
) -> Result<Motion> {
    validate(scenario)?;
    let steps = match scenario.solver.continuation {
        Continuation::Mode(ContinuationMode::Off) => 0,
        Continuation::Mode(ContinuationMode::Auto) => CONTINUATION_STEPS,
        Continuation::Steps(n) => n,
    };
    let mut run = Run::new(scenario, on_progress);
    let share = if steps == 0 { 1.0 } else { PLAIN_SHARE };
    let budget = (scenario.solver.max_iterations as f64 * share) as usize;
    let model = Model::new(scenario, robot, ground.clone(), space(scenario, map)?)?;
    let mut stage = run.plain(model, budget)?;
    if !stage.feasible && !stage.interrupted && steps > 0 {
        stage = run.continuation(robot, ground, map, steps, stage)?;
    }
    run.finish(stage)
}

/// Where a solve starts.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
enum Start {
    /// At the guess.
    Guess,
    /// At a point that obeys all constraints, or did before some were added or the terrain grew.
    Feasible,
}

/// One solve's end.
struct Stage {
    problem: Problem,
    x: Vec<f64>,
    feasible: bool,
    interrupted: bool,
    status: String,
}

/// What all stages of a solve share.
struct Run<'a, 'b> {
    scenario: &'a Scenario,
    on_progress: &'a mut OnProgress<'b>,
    start: Instant,
    history: Vec<IterationRecord>,
    iterations: usize,
    linear_solver: LinearSolver,
    seconds: Seconds,
}

impl<'a, 'b> Run<'a, 'b> {
    fn new(scenario: &'a Scenario, on_progress: &'a mut OnProgress<'b>) -> Self {
        Self {
            scenario,
            on_progress,
            start: Instant::now(),
            history: Vec::new(),
            iterations: 0,
            linear_solver: linear_solver(scenario),
            seconds: Seconds::default(),
        }
    }

    fn guess(&mut self, model: &Model) -> Result<Vec<f64>> {
        let start = Instant::now();
        let x = guess::guess(self.scenario, model)?;
        self.seconds.guess += start.elapsed().as_secs_f64();
        Ok(x)
    }

    /// Solves from the guess with at most `budget` iterations.
    ///
    /// Where legs are known, first to a feasible point without their joints, whose speeds and torques at the guess may be anything:
    /// out of the pit this takes a third of the iterations that all at once take, and ends where that does not (docs/results.md).
    fn plain(&mut self, model: Model, budget: usize) -> Result<Stage> {
        let (mut x, mut start) = (self.guess(&model)?, Start::Guess);
        if model.legs.iter().any(Option::is_some) {
            let mut rough = model.clone();
            rough.legs.fill(None);
            let rough = self.stage("without joints", rough, x, start, Effort::Feasible, budget)?;
            if !rough.feasible || rough.interrupted {
                return Ok(rough);
            }
            (x, start) = (rough.x, Start::Feasible);
        }
        let left = budget.saturating_sub(self.iterations);
        self.stage("solve", model, x, start, self.scenario.solver.effort, left)
    }

    /// Solves from x with at most `budget` iterations.
    fn stage(
        &mut self,
        name: &str,
        model: Model,
        x: Vec<f64>,
        start: Start,
        effort: Effort,
        budget: usize,
    ) -> Result<Stage> {
        let solver = &self.scenario.solver;
        let tolerance = solver.tolerance;
        let with_costs = effort != Effort::Feasible && self.scenario.motion.smoothness != [0.0, 0.0];
        let hessian =
            solver.hessian.unwrap_or(if with_costs { Hessian::Exact } else { Hessian::LimitedMemory });
        let choice = Choice { with_costs, exact_hessian: hessian == Hessian::Exact };
        let mut problem = Problem::new(self.scenario, model, x, choice);
        let centred = (start, hessian, self.scenario.formulation)
            == (Start::Guess, Hessian::Exact, Formulation::Warped);
        let options = options(hessian, centred, solver.hessian_memory, tolerance, budget)
            .linear_solver(linear_solver(self.scenario));

        let (history, on_progress) = (&mut self.history, &mut *self.on_progress);
        let (before, seconds_before) = (self.iterations, self.start.elapsed().as_secs_f64());
        let mut best: Option<(f64, Vec<f64>)> = None;
        let mut objectives: Vec<f64> = Vec::new();
        let (mut stopped, mut good_enough) = (false, false);
        let solution = ipopt::solve(&mut problem, &options, None, &mut |record, x| {
            let mut row = record.clone();
            row.iteration += before;
            row.seconds += seconds_before;
            let iteration = row.iteration;
            // A later stage starts at the point where the one before it ended, which has its row.
            if record.iteration > 0 || history.is_empty() {
                history.push(row);
                if on_progress(&Progress { stage: name, iteration, record }).is_break() {
                    stopped = true;
                    return ControlFlow::Break(());
                }
            }
            if record.violation > tolerance {
                return ControlFlow::Continue(());
            }
            if best.as_ref().is_none_or(|(objective, _)| record.objective < *objective) {
                best = Some((record.objective, x.to_vec()));
            }
            objectives.push(record.objective);
            let settled =
                |window: &[f64]| window[0] - window[SMOOTH_WINDOW - 1] < SMOOTH_GAIN * window[0].abs();
            good_enough = match effort {
                _ if !with_costs => true,
                Effort::Feasible => true,
                Effort::Smooth => objectives.windows(SMOOTH_WINDOW).last().is_some_and(settled),
                Effort::Optimal => false,
            };
            if good_enough { ControlFlow::Break(()) } else { ControlFlow::Continue(()) }
        })
        .map_err(|error| Error::Internal(error.to_string()))?;
        self.linear_solver = solution.linear_solver;
        self.iterations += solution.history.last().map_or(0, |r| r.iteration);
        self.seconds.evaluation += solution.evaluation_seconds;
        self.seconds.linear_solver += solution.total_seconds - solution.evaluation_seconds;
        let interrupted = stopped || solution.status == Status::Interrupted;

        // Ipopt's last point may be worse than one it has passed.
        let last = violation::table(&mut problem, &solution.x);
        let last_feasible = last.iter().all(|v| v.largest <= tolerance);
        let x = match best {
            Some((objective, x)) if !last_feasible || objective < solution.objective => x,
            _ => solution.x,
        };
        let feasible = violation::table(&mut problem, &x).iter().all(|v| v.largest <= tolerance);
        let status = match solution.status {
            Status::StoppedByCallback if good_enough && with_costs => {
                "feasible, and the cost has settled".to_string()
            }
            Status::StoppedByCallback if good_enough => "feasible".to_string(),
            Status::StoppedByCallback => Status::Interrupted.to_string(),
            status if feasible => format!("feasible ({status})"),
            status => status.to_string(),
        };
        Ok(Stage { problem, x, feasible, interrupted, status })
    }

    /// The terrain at 1/n, 2/n, … of its height, each solved to a feasible point from the last, the whole one with the costs.
    fn continuation(
        &mut self,
        robot: &Robot,
        ground: &Arc<Heightfield>,
        map: Option<&WarpMap>,
        steps: u32,
        failed: Stage,
    ) -> Result<Stage> {
        let mut last = failed;
        let mut from: Option<Vec<f64>> = None;
        for step in 1..=steps {
            let left = self.scenario.solver.max_iterations.saturating_sub(self.iterations);
            if left == 0 || last.interrupted {
                break;
            }
            let share = f64::from(step) / f64::from(steps);
            let whole = step == steps;
            let scaled = if whole { ground.clone() } else { Arc::new(scaled(ground, share)?) };
            let space = match map {
                Some(map) if self.scenario.formulation == Formulation::Warped => {
                    let map = if whole { map.clone() } else { map_of(&scaled, self.scenario)? };
                    Space::Warped(Box::new(map))
                }
                _ => Space::Direct,
            };
            let model = Model::new(self.scenario, robot, scaled, space)?;
            let (mut x, mut start) = (self.guess(&model)?, Start::Guess);
            if let Some(from) = &from {
                // The pinned start is where this terrain has it; all else goes on from the last step.
                x[6..].copy_from_slice(&from[6..]);
                start = Start::Feasible;
            }
            let name = format!("continuation, terrain at {:.0} %", 100.0 * share);
            let effort = if whole { self.scenario.solver.effort } else { Effort::Feasible };
            last = self.stage(&name, model, x, start, effort, left)?;
            if !last.feasible && !whole {
                last.status =
                    format!("{} with the terrain at {:.0} % of its height", last.status, 100.0 * share);
            }
            from = Some(last.x.clone());
        }
        Ok(last)
    }

    fn finish(mut self, mut stage: Stage) -> Result<Motion> {
        let violations = violation::table(&mut stage.problem, &stage.x);
        self.seconds.total = self.start.elapsed().as_secs_f64();
        // Plans are sampled from the motion as it is, at the switches that were found.
        stage.problem.model.layout.freeze(&stage.x);
        Ok(Motion {
            solved: stage.feasible && !stage.interrupted,
            interrupted: stage.interrupted,
            status: stage.status,
            model: stage.problem.model,
            x: stage.x,
            iterations: self.iterations,
            violations,
            history: self.history,
            linear_solver: self.linear_solver,
            seconds: self.seconds,
        })
    }
}

/// The ground with all heights times `share`.
fn scaled(ground: &Heightfield, share: f64) -> Result<Heightfield> {
    let heights: Vec<f64> = ground.samples().iter().map(|h| h * share).collect();
    let grid = ground.grid();
    Heightfield::interpolate(grid.origin, grid.spacing, grid.columns, grid.rows, &heights)
}

fn map_of(ground: &Heightfield, scenario: &Scenario) -> Result<WarpMap> {
    let mut go_on = |_: warp::MapProgress| ControlFlow::Continue(());
    Ok(warp::build_cached(ground, &scenario.map, warp::default_cache_dir().as_deref(), &mut go_on)?.0)
}

/// Adaptive μ (monotone takes ten times the iterations), and MUMPS with the AMD ordering (1.6 times faster than its default).
///
/// When `centred`, μ does not run ahead of the rest: where the Hessian is indefinite (the pit's edge in F) Ipopt's oracle drives it to 10⁻⁶ and
/// below while the dual infeasibility is near 1; the iterates then hug the bounds and steps are cut to a fifth, for dozens of
/// iterations. So an iteration lowers it to [`LEAST_CENTERING`] of the average complementarity at most.
fn options(hessian: Hessian, centred: bool, memory: usize, tolerance: f64, max_iterations: usize) -> Options {
    let options = if centred { Options::new().set_num("sigma_min", LEAST_CENTERING) } else { Options::new() };
    options
        .set_int("max_iter", max_iterations as i32)
        .set_str(
            "hessian_approximation",
            match hessian {
                Hessian::Exact => "exact",
                Hessian::LimitedMemory => "limited-memory",
            },
        )
        .set_int("limited_memory_max_history", memory as i32)
        .set_str("mu_strategy", "adaptive")
        .set_int("mumps_pivot_order", 0)
        .set_num("tol", tolerance)
        .set_num("constr_viol_tol", tolerance)
        .set_num("dual_inf_tol", 1e-2)
        .set_num("compl_inf_tol", 1e-3)
        .set_int("acceptable_iter", 0)
}

/// The numbers of variables, constraints and entries of the Jacobian and the Hessian.
pub fn size(problem: &Problem) -> [usize; 4] {
    [
        problem.num_variables(),
        problem.num_constraints(),
        problem.jacobian_structure().0.len(),
        problem.hessian_structure().map_or(0, |h| h.0.len()),
    ]
}
