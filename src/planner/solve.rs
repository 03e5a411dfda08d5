//! From a scenario to a motion: guess, NLP, Ipopt, and what to try when the plain solve fails.

use std::ops::ControlFlow;
use std::sync::Arc;
use std::time::{Duration, Instant};

use super::continuation;
use super::guess;
use super::iterate::Iterate;
use super::leg_update::{LEVER, LegUpdate};
use super::legs::{self, BodyMotion, FINE};
use super::motion::{Motion, Seconds};
use super::options;
use super::problem::{Choice, GaitProblem};
use super::reassign::pressed_footholds;
use super::stage::Stage;
use super::stopping::StoppingRule;
use super::task::Task;
use super::violation;
use crate::constraints::joint_speed::JOINT_SPEED;
use crate::constraints::joint_torque::JOINT_TORQUE;
use crate::constraints::margins;
use crate::heightfield::Heightfield;
use crate::ipopt::{self, IterationRecord, LinearSolver, Multipliers, NlpProblem, Status};
use crate::nlp::{LegTerms, Model};
use crate::scenario::{Effort, Formulation, GivenMotion, Hessian};
use crate::warp::WarpMap;
use crate::{Error, Result};

/// Fraction of the iterations that the plain solve may take when a continuation may follow.
const PLAIN_FRACTION: f64 = 0.5;
/// Fraction of these iterations that a solve at once may take, when another one may follow that leaves the joints to the end.
const AT_ONCE_FRACTION: f64 = 0.6;
/// Largest violation of the joints' rows at a guess from which everything is solved at once: that of a joint at twice its speed limit.
const HURRIED: f64 = 2.0 - margins::JOINT_SPEED;
/// Solves with another estimate of what the legs' mass adds, at most.
const LEG_ROUNDS: usize = 6;

/// An iteration, for progress displays.
#[derive(Clone, Debug)]
pub struct Progress<'a> {
    /// What is being solved.
    pub stage: Stage,
    /// The iteration, counted over all stages.
    pub iteration: usize,
    /// The iteration as Ipopt reports it.
    pub record: &'a IterationRecord,
    /// The motion there, for those who watch; none while limits give.
    pub iterate: Option<Iterate<'a>>,
}

/// What a solve needs from its caller while it runs.
pub trait Host {
    /// Called at every iteration; may ask to stop.
    fn on_iteration(&mut self, progress: &Progress) -> ControlFlow<()>;

    /// Builds the map over the ground of a continuation; none when the user asked to stop.
    ///
    /// # Errors
    /// Those of building a map.
    fn build_map(&mut self, ground: &Heightfield) -> Result<Option<WarpMap>>;
}

/// Plans a motion, without looking for a reason if none is found: the plain solve first. If it finds no feasible point and the scenario allows
/// it, a continuation follows, in which the terrain grows out of the plane in steps, each solved from the one before; over ground with edges,
/// a second solve that leaves the joints to the end. A motion that the scenario gives is solved from at once; if that fails, what follows
/// forgets it.
///
/// # Errors
/// For a start from which the feet cannot reach the ground. That no motion is found is not an error: see [`Motion::solved`].
pub fn attempt(task: &Task, host: &mut dyn Host) -> Result<Motion> {
    let solver = &task.scenario.solver;
    let steps = continuation::steps(task);
    let over_edges = task.surfaces.have_edges();
    let is_given = task.guess.is_some();
    let fraction = if steps == 0 && !over_edges && !is_given { 1.0 } else { PLAIN_FRACTION };
    let budget = (solver.max_iterations as f64 * fraction) as usize;
    let mut solve = Solve::new(task, host);
    let first = if over_edges || is_given { solve.at_once(budget)? } else { solve.plain(budget)? };
    let first = solve.with_leg_mass(first)?;
    if first.feasible || first.interrupted {
        return Ok(solve.finish(first));
    }
    solve.given = None;
    let (how, second) = match (over_edges, steps) {
        (false, 0) if is_given => {
            ("also from another guess than guess.file", Some(solve.joints_last(solver.max_iterations)?))
        }
        (true, _) => (
            "also in a second attempt, which leaves the joints to the end",
            Some(solve.joints_last(solver.max_iterations)?),
        ),
        (false, steps) => ("also with a continuation", solve.continuation(steps)?),
    };
    let second = second.map(|second| solve.with_leg_mass(second)).transpose()?;
    let end = match second {
        None => first,
        Some(second) if second.feasible && second.stage.is_whole() => second,
        // Why nothing was found shows best in the solve that was not made easier.
        Some(second) => StageEnd {
            status: format!("{}; {how}: {}", first.status, second.status),
            interrupted: second.interrupted,
            ..first
        },
    };
    Ok(solve.finish(end))
}

/// Goes on after a motion that will not do: solves once more, from the guess or the motion that the task gives. Iterations and times count on.
///
/// # Errors
/// Those of [`attempt`].
pub fn attempt_again(task: &Task, host: &mut dyn Host, before: &Motion) -> Result<Motion> {
    let budget = before.iterations + (task.scenario.solver.max_iterations as f64 * PLAIN_FRACTION) as usize;
    let mut solve = Solve::new(task, host);
    solve.iterations = before.iterations;
    solve.history.clone_from(&before.history);
    solve.seconds = before.seconds;
    let spent = Duration::try_from_secs_f64(before.seconds.total).unwrap_or_default();
    solve.start = solve.start.checked_sub(spent).unwrap_or(solve.start);
    let end = solve.at_once(budget)?;
    let end = solve.with_leg_mass(end)?;
    Ok(solve.finish(end))
}

/// Where a stage starts.
#[derive(Clone, Debug, PartialEq)]
enum Start {
    /// At the guess.
    Guess,
    /// At a point that obeys all constraints, or did before some were added or the terrain grew.
    Feasible,
    /// At the solution of nearly the same problem, with its multipliers and barrier parameter.
    Warm(Multipliers, f64),
}

/// How a stage ended.
struct StageEnd {
    stage: Stage,
    problem: GaitProblem,
    x: Vec<f64>,
    /// At x, and the barrier parameter μ there.
    multipliers: Multipliers,
    mu: f64,
    feasible: bool,
    interrupted: bool,
    status: String,
}

/// What all stages of a solve have in common.
struct Solve<'a> {
    task: &'a Task<'a>,
    /// The motion to start from; none any more once a solve from it has failed.
    given: Option<&'a GivenMotion>,
    host: &'a mut dyn Host,
    start: Instant,
    history: Vec<IterationRecord>,
    iterations: usize,
    /// The user asked to stop between stages.
    interrupted: bool,
    linear_solver: LinearSolver,
    seconds: Seconds,
}

impl<'a> Solve<'a> {
    fn new(task: &'a Task, host: &'a mut dyn Host) -> Self {
        Self {
            task,
            given: task.guess,
            host,
            start: Instant::now(),
            history: Vec::new(),
            iterations: 0,
            interrupted: false,
            linear_solver: task.scenario.solver.linear_solver,
            seconds: Seconds::default(),
        }
    }

    fn guess(&mut self, model: &Model) -> Result<Vec<f64>> {
        let start = Instant::now();
        let x = guess::guess(self.task.scenario, model, self.given)?;
        self.seconds.guess += start.elapsed().as_secs_f64();
        Ok(x)
    }

    /// Solves from the guess, until there are `budget` iterations in all: everything at once, unless joints are far too fast there, or that
    /// fails.
    ///
    /// A feasible point without joints and costs is a wild motion, from which it takes a quarter more iterations (docs/results.md).
    fn plain(&mut self, budget: usize) -> Result<StageEnd> {
        let mut whole = self.whole()?;
        if !has_joints(&whole.model) {
            return self.run(whole, Stage::Whole, Start::Guess, budget);
        }
        if !is_hurried(&mut whole) {
            let most = (budget as f64 * AT_ONCE_FRACTION) as usize;
            let end = self.run(whole, Stage::Whole, Start::Guess, most)?;
            if end.feasible || end.interrupted {
                return Ok(end);
            }
        }
        self.joints_last(budget)
    }

    /// Solves from the guess, until there are `budget` iterations in all.
    ///
    /// Over ground with edges the guess is good, because the footholds and the timing of the base were chosen. So is a motion that is given.
    fn at_once(&mut self, budget: usize) -> Result<StageEnd> {
        let start = if self.given.is_some() { Start::Feasible } else { Start::Guess };
        let whole = self.whole()?;
        self.run(whole, Stage::Whole, start, budget.saturating_sub(self.iterations))
    }

    /// The whole problem, to be started from the guess.
    fn whole(&mut self) -> Result<GaitProblem> {
        let mut model = self.task.model()?;
        let x = self.guess(&model)?;
        model.leg_terms = self.leg_terms(&model, &x).unwrap_or_default();
        Ok(self.problem(Stage::Whole, model, x))
    }

    /// Solves from the guess, until there are `budget` iterations in all.
    ///
    /// Where legs are described, the first stage finds a feasible point without their joints, whose speeds and torques may be
    /// arbitrary at the guess. Out of the pit this takes a third of the iterations of solving everything at once, and converges
    /// where that does not (docs/results.md).
    fn joints_last(&mut self, budget: usize) -> Result<StageEnd> {
        let mut model = self.task.model()?;
        let (mut x, mut start) = (self.guess(&model)?, Start::Guess);
        model.leg_terms = self.leg_terms(&model, &x).unwrap_or_default();
        if has_joints(&model) {
            let mut rough = model.clone();
            rough.legs.fill(None);
            let left = budget.saturating_sub(self.iterations);
            let rough = self.stage(Stage::WithoutJoints, rough, x, start, left)?;
            if !rough.feasible || rough.interrupted {
                return Ok(rough);
            }
            (x, start) = (rough.x, Start::Feasible);
            model.leg_terms = self.leg_terms(&model, &x).unwrap_or_default();
        }
        let left = budget.saturating_sub(self.iterations);
        self.stage(Stage::Whole, model, x, start, left)
    }

    /// Solves with the terrain at 1/n, 2/n, … of its height, each to a feasible point from the last, the whole one with the
    /// costs. None when no iterations are left, or the user asked to stop, before the first of them.
    fn continuation(&mut self, steps: u32) -> Result<Option<StageEnd>> {
        let scenario = self.task.scenario;
        let mut last: Option<StageEnd> = None;
        let mut from: Option<Vec<f64>> = None;
        for step in 1..=steps {
            let left = scenario.solver.max_iterations.saturating_sub(self.iterations);
            if left == 0 || last.as_ref().is_some_and(|end| end.interrupted) {
                break;
            }
            let stage = Stage::Continuation { step, steps };
            let mut build_map = |ground: &Heightfield| self.host.build_map(ground);
            let Some(mut model) = continuation::model(self.task, stage, &mut build_map)? else {
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

    /// Solves again with what the legs' mass adds to the laws along the last motion, until that no longer changes.
    fn with_leg_mass(&mut self, mut end: StageEnd) -> Result<StageEnd> {
        for round in 1.. {
            let left = self.task.scenario.solver.max_iterations.saturating_sub(self.iterations);
            if !end.feasible || end.interrupted {
                break;
            }
            let Some(terms) = self.leg_terms(&end.problem.model, &end.x) else { break };
            let change = end.problem.leg_torque_change(&end.x, &terms);
            if change.is_within(1.0) {
                break;
            }
            if round > LEG_ROUNDS || left == 0 {
                let percent = 100.0 * change.rms / LEVER;
                end.status = format!(
                    "{}; the torques of the legs' mass have not converged, by {percent:.2} % of m g · 0.3 m",
                    end.status
                );
                break;
            }
            let mut model = (*end.problem.model).clone();
            model.leg_terms = terms;
            let start = Start::Warm(end.multipliers, end.mu);
            let status = end.status;
            end = self.stage(Stage::LegMass { round }, model, end.x, start, left)?;
            if end.feasible && !end.interrupted {
                // It ends at the first feasible point, because it starts at the solution of nearly the same problem.
                end.status = status;
            }
        }
        Ok(end)
    }

    /// What the legs' mass adds along the motion x; none for massless legs.
    fn leg_terms(&mut self, model: &Model, x: &[f64]) -> Option<LegTerms> {
        let start = Instant::now();
        let terms = legs::terms(model, x, self.task.scenario.physics.law);
        self.seconds.evaluation += start.elapsed().as_secs_f64();
        terms
    }

    /// Solves from x with at most `budget` iterations.
    fn stage(
        &mut self,
        stage: Stage,
        model: Model,
        x: Vec<f64>,
        start: Start,
        budget: usize,
    ) -> Result<StageEnd> {
        let problem = self.problem(stage, model, x);
        self.run(problem, stage, start, budget)
    }

    /// What a stage demands of its end.
    fn effort(&self, stage: Stage) -> Effort {
        if stage.is_whole() { self.task.scenario.solver.effort } else { Effort::Feasible }
    }

    /// Whether a stage has costs, and where its second derivatives come from.
    fn kind(&self, stage: Stage) -> (bool, Hessian) {
        let scenario = self.task.scenario;
        let with_costs = self.effort(stage) != Effort::Feasible && scenario.motion.smoothness != [0.0, 0.0];
        let usual = if with_costs { Hessian::Exact } else { Hessian::LimitedMemory };
        (with_costs, scenario.solver.hessian.unwrap_or(usual))
    }

    /// The problem of a stage, to be started from x.
    fn problem(&self, stage: Stage, model: Model, x: Vec<f64>) -> GaitProblem {
        let scenario = self.task.scenario;
        let (with_costs, hessian) = self.kind(stage);
        let exact = hessian == Hessian::Exact;
        let mut problem = GaitProblem::new(scenario, model, x, Choice { with_costs, exact_hessian: exact });
        // A round is the same problem again; an approximated Hessian takes other terms for curvature.
        if exact
            && stage.is_whole()
            && !matches!(stage, Stage::LegMass { .. })
            && problem.model.body.is_some()
        {
            problem.leg_update = Some(LegUpdate::new(scenario.physics.law));
        }
        problem
    }

    /// Solves the problem of a stage with at most `budget` iterations.
    fn run(
        &mut self,
        mut problem: GaitProblem,
        stage: Stage,
        start: Start,
        budget: usize,
    ) -> Result<StageEnd> {
        let scenario = self.task.scenario;
        let tolerance = scenario.solver.tolerance;
        let (with_costs, hessian) = self.kind(stage);
        let centered =
            (&start, hessian, scenario.formulation()) == (&Start::Guess, Hessian::Exact, Formulation::Warped);
        let mut options = options::of(&scenario.solver, hessian, centered, budget);
        if let Start::Warm(multipliers, mu) = start {
            problem.multipliers = Some(multipliers);
            options = options::warm(options, mu);
        }

        let is_round = matches!(stage, Stage::LegMass { .. });
        let rule_effort = if is_round { Effort::Feasible } else { self.effort(stage) };
        let mut rule =
            StoppingRule::new(rule_effort, with_costs, tolerance).telling(&problem, problem.settled.clone());
        let mut stopped = false;
        let (history, host, model) = (&mut self.history, &mut *self.host, problem.model.clone());
        let (before, seconds_before) = (self.iterations, self.start.elapsed().as_secs_f64());
        let solution = ipopt::solve(&mut problem, &options, &mut |record, x| {
            let iteration = record.iteration + before;
            let row =
                IterationRecord { iteration, seconds: record.seconds + seconds_before, ..record.clone() };
            match history.last_mut() {
                // A later stage starts at the point where the one before it ended, but more may be asked of it.
                Some(last) if record.iteration == 0 => {
                    *last = IterationRecord { seconds: last.seconds, ..row }
                }
                _ => {
                    history.push(row);
                    let iterate = Some(Iterate { model: &model, x });
                    if host.on_iteration(&Progress { stage, iteration, record, iterate }).is_break() {
                        stopped = true;
                        return ControlFlow::Break(());
                    }
                }
            }
            rule.observe(record, x)
        })
        .map_err(|error| Error::Internal(error.to_string()))?;
        let updated = problem.leg_update.take().is_some();
        self.linear_solver = solution.linear_solver;
        self.iterations += solution.history.last().map_or(0, |r| r.iteration);
        self.seconds.evaluation += solution.evaluation_seconds;
        self.seconds.linear_solver += solution.total_seconds - solution.evaluation_seconds;

        let multipliers = Multipliers {
            constraint: solution.constraint_multipliers,
            lower: solution.lower_multipliers,
            upper: solution.upper_multipliers,
        };
        let mu = solution.history.last().map_or(f64::NAN, |record| record.mu);
        let interrupted = stopped || solution.status == Status::Interrupted;
        let satisfied = rule.is_satisfied();
        let last_feasible = violation::is_feasible(&mut problem, &solution.x, tolerance);
        // With the terms of the last iterate, one before it may not be feasible.
        let x = if updated && last_feasible {
            solution.x
        } else {
            rule.best(solution.x, solution.objective, last_feasible)
        };
        let feasible = violation::is_feasible(&mut problem, &x, tolerance);
        let status = status(solution.status, feasible, satisfied, with_costs);
        Ok(StageEnd { stage, problem, x, multipliers, mu, feasible, interrupted, status })
    }

    fn finish(mut self, mut end: StageEnd) -> Motion {
        end.interrupted |= self.interrupted;
        let violations = violation::table(&mut end.problem, &end.x);
        let pressed = pressed_footholds(&end.problem, &end.multipliers);
        self.seconds.total = self.start.elapsed().as_secs_f64();
        // Plans are sampled from the motion as it is, at the switches that were found.
        let mut model = Arc::unwrap_or_clone(end.problem.model);
        model.layout.freeze(&end.x);
        let mut body = BodyMotion::new(&model, &end.x, FINE);
        let settled = body.as_mut().and_then(|body| body.settle(&end.x));
        if settled.is_none() {
            body = BodyMotion::new(&model, &end.x, FINE);
        }
        let legs = body.map(|body| body.samples(&end.x));
        if let Some((layout, x)) = settled {
            (model.layout, end.x) = (layout, x);
        }
        Motion {
            solved: end.feasible && !end.interrupted,
            interrupted: end.interrupted,
            status: end.status,
            explanation: None,
            pressed,
            legs,
            model,
            x: end.x,
            iterations: self.iterations,
            violations,
            history: self.history,
            linear_solver: self.linear_solver,
            seconds: self.seconds,
        }
    }
}

/// Whether the robot's file describes a leg.
fn has_joints(model: &Model) -> bool {
    model.legs.iter().any(Option::is_some)
}

/// Whether joints are far too fast or too weak at the point that a problem is started from.
fn is_hurried(problem: &mut GaitProblem) -> bool {
    let mut x = vec![0.0; problem.num_variables()];
    problem.initial_point(&mut x);
    let rows = [JOINT_SPEED, JOINT_TORQUE];
    let violations = violation::table(problem, &x);
    violations.iter().any(|block| rows.contains(&block.block.as_str()) && block.largest > HURRIED)
}

/// How a stage ended, in words.
fn status(status: Status, feasible: bool, satisfied: bool, with_costs: bool) -> String {
    match status {
        Status::StoppedByCallback if satisfied && with_costs => {
            "feasible, and the cost no longer decreases".to_string()
        }
        Status::StoppedByCallback if satisfied => "feasible".to_string(),
        Status::StoppedByCallback => Status::Interrupted.to_string(),
        status if feasible => format!("feasible ({status})"),
        status => status.to_string(),
    }
}
