//! One case: what is computed in the process of its own, and what comes back from it.

use std::ops::ControlFlow;
use std::path::Path;
use std::time::Instant;

use serde::{Deserialize, Serialize};

use super::clock::{ClockKind, CpuClock};
use crate::ipopt::NlpProblem;
use crate::pipeline::{self, Event, Planned, Prepared, Step};
use crate::plan::CheckRow;
use crate::planner::{GaitProblem, Seconds, Stage};
use crate::replay::{Tracked, Verdict};
use crate::scenario::{self, LoadedScenario};
use crate::warp::{MapReport, Order, WarpMap};
use crate::{Error, Result, files};

/// Each evaluation is timed so many times; the median counts.
const REPEATS: usize = 31;
/// Points along each axis at which the map's error on the ground is kept, for Fig. 4.
const GROUND_POINTS: usize = 60;

/// What is computed.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Work {
    /// A plan.
    Plan,
    /// A plan, and its replay on the full robot.
    Track,
    /// A plan, and how long the evaluations of its NLP take.
    Speed,
    /// A map.
    Map,
}

impl Work {
    /// All of them.
    pub const ALL: [Work; 4] = [Work::Plan, Work::Track, Work::Speed, Work::Map];

    /// As on the command line of the process.
    pub fn name(self) -> &'static str {
        match self {
            Work::Plan => "plan",
            Work::Track => "track",
            Work::Speed => "speed",
            Work::Map => "map",
        }
    }
}

/// What was measured. Numbers are finite: what is not is the greatest number, since JSON knows no infinity.
#[derive(Clone, Debug, Default, PartialEq, Serialize, Deserialize)]
pub struct Measured {
    /// The motion; none for a map alone.
    pub motion: Option<MotionMeasured>,
    /// The map; none for the direct formulation.
    pub map: Option<MapMeasured>,
    /// The replay; none where there is no motion to replay.
    #[serde(default)]
    pub track: Option<Tracked>,
    /// Where the processor time went.
    pub cpu: Cpu,
}

impl Measured {
    /// A motion that is solved and passes every check, and its replay where it was replayed; a map alone that converged and is nowhere folded.
    pub fn is_good(&self) -> bool {
        match (&self.motion, &self.map) {
            (Some(motion), _) => {
                let walked = self.track.as_ref().is_none_or(|track| track.verdict == Verdict::Pass);
                motion.solved && motion.passed && walked
            }
            (None, Some(map)) => map.report.converged && map.report.inverted_points == 0,
            (None, None) => false,
        }
    }
}

/// Processor time by stage, s.
#[derive(Clone, Copy, Debug, Default, PartialEq, Serialize, Deserialize)]
pub struct Cpu {
    /// What was counted.
    pub clock: ClockKind,
    /// Reading the scenario, sampling the terrain.
    pub terrain: f64,
    /// Building the map, or reading it where it was built before.
    pub map: f64,
    /// The guess and the NLP; maps of a continuation included.
    pub solve: f64,
    /// Sampling the plan, checking and writing it.
    pub check: f64,
}

/// A map as it came out.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
pub struct MapMeasured {
    /// Read, not built.
    pub cached: bool,
    /// What it is like; `seconds` are those of the day when it was built.
    pub report: MapReport,
    /// (x, y, 1 − σ_min/σ_max) at points of the ground evenly spaced in F, m; for maps alone.
    pub ground_errors: Vec<[f64; 3]>,
}

/// A motion as it came out.
#[derive(Clone, Debug, Default, PartialEq, Serialize, Deserialize)]
pub struct MotionMeasured {
    /// Every constraint of the NLP holds to the tolerance.
    pub solved: bool,
    /// Every check holds.
    pub passed: bool,
    /// In words.
    pub status: String,
    /// All iterations.
    pub iterations: usize,
    /// The first iteration that met the tolerance on the whole terrain.
    pub first_feasible: Option<usize>,
    /// Whether the plain solve failed and the terrain was grown in steps.
    pub continuation: bool,
    /// The largest violation at the end, units of the NLP.
    pub violation: f64,
    /// The block where it is; where nothing is violated, the one that comes nearest is named all the same.
    pub worst_block: String,
    /// … its foot, time and place of the base, in words.
    pub worst_place: String,
    /// Largest violation by iteration.
    pub history: Vec<f64>,
    /// Laws and verdicts.
    pub checks: Vec<CheckRow>,
    /// Wall time by the solver's own account.
    pub seconds: Seconds,
    /// How long evaluations take; for `speed`.
    pub evaluation: Option<Evaluation>,
}

/// Size and cost of the NLP's functions at the guess: median wall times, ms, each with what the functions share.
#[derive(Clone, Copy, Debug, Default, PartialEq, Serialize, Deserialize)]
pub struct Evaluation {
    /// Variables, constraints, entries of the Jacobian and of the Hessian.
    pub size: [usize; 4],
    /// Constraints.
    pub constraints: f64,
    /// Jacobian.
    pub jacobian: f64,
    /// Hessian of the Lagrangian.
    pub hessian: f64,
}

/// Computes a case from its scenario file; `plan` is where its plan goes.
pub fn run(work: Work, scenario: &Path, plan: &Path) -> Result<Measured> {
    let mut stopwatch = Stopwatch::start();
    let loaded = scenario::load(scenario, &[])?;
    if work == Work::Map {
        return map_alone(&loaded, stopwatch);
    }
    let mut watch = Watch { stopwatch: &mut stopwatch, iterations: Vec::new() };
    let planned = pipeline::run(&loaded, false, &mut |event| {
        watch.observe(event);
        ControlFlow::Continue(())
    })?;
    let iterations = watch.iterations;
    let planned = planned.ok_or_else(|| Error::Internal("interrupted".into()))?;
    planned.plan.write(plan)?;
    let cpu = stopwatch.stop();

    let mut motion = MotionMeasured::of(&planned, &iterations, loaded.scenario.solver.tolerance);
    if work == Work::Speed {
        let map = planned.map.as_ref().map(|built| &built.map);
        motion.evaluation = Some(evaluation(&mut planned.prepared.task(&loaded, map).problem()?));
    }
    let map = planned.map.map(|built| MapMeasured {
        cached: built.cached,
        report: built.report,
        ground_errors: Vec::new(),
    });
    Ok(Measured { motion: Some(motion), map, track: None, cpu })
}

/// A map that is to be measured is built, whatever the cache holds.
fn map_alone(loaded: &LoadedScenario, mut stopwatch: Stopwatch) -> Result<Measured> {
    let mut silent = |_: &Event| ControlFlow::Continue(());
    let prepared = Prepared::new(loaded, &mut silent)?;
    stopwatch.begin(Step::Map);
    let built = pipeline::build_map(&prepared.surface, &loaded.scenario.map, false, &mut silent)?;
    let built = built.ok_or_else(|| Error::Internal("interrupted".into()))?;
    let cpu = stopwatch.stop();
    let map =
        MapMeasured { cached: built.cached, ground_errors: ground_errors(&built.map), report: built.report };
    Ok(Measured { motion: None, map: Some(map), track: None, cpu })
}

/// Processor time by step of the pipeline.
struct Stopwatch {
    clock: CpuClock,
    step: Step,
    cpu: Cpu,
}

impl Stopwatch {
    fn start() -> Self {
        let clock = CpuClock::start();
        let cpu = Cpu { clock: clock.kind(), ..Cpu::default() };
        Self { clock, step: Step::Terrain, cpu }
    }

    /// Time from here on belongs to this step.
    fn begin(&mut self, step: Step) {
        let lap = self.clock.lap();
        match self.step {
            Step::Terrain => self.cpu.terrain += lap,
            Step::Map => self.cpu.map += lap,
            Step::Derivatives | Step::Solve => self.cpu.solve += lap,
            Step::Plan => self.cpu.check += lap,
        }
        self.step = step;
    }

    fn stop(mut self) -> Cpu {
        self.begin(self.step);
        self.cpu
    }
}

/// What a case keeps of the events of a pipeline.
struct Watch<'a> {
    stopwatch: &'a mut Stopwatch,
    /// Stage and violation of every iteration.
    iterations: Vec<(Stage, f64)>,
}

impl Watch<'_> {
    fn observe(&mut self, event: &Event) {
        match event {
            Event::Step(step) => self.stopwatch.begin(*step),
            Event::Iteration(at) => self.iterations.push((at.stage, at.record.violation)),
            Event::Note(_) | Event::Map(_) => {}
        }
    }
}

impl MotionMeasured {
    fn of(planned: &Planned, iterations: &[(Stage, f64)], tolerance: f64) -> Self {
        let (motion, check) = (&planned.motion, &planned.check);
        let worst = motion.violations.iter().max_by(|a, b| a.largest.total_cmp(&b.largest));
        let rows = check.rows.iter().cloned();
        Self {
            solved: motion.solved,
            passed: check.passed,
            status: motion.status.clone(),
            iterations: motion.iterations,
            // The other stages are on gentler ground, or lack some of the constraints.
            first_feasible: iterations
                .iter()
                .zip(&motion.history)
                .find(|((stage, violation), _)| stage.is_whole() && *violation <= tolerance)
                .map(|(_, record)| record.iteration),
            continuation: iterations.iter().any(|(stage, _)| stage.is_continuation()),
            violation: finite(motion.max_violation()),
            worst_block: worst.map_or(String::new(), |w| w.block.clone()),
            worst_place: worst.map_or(String::new(), |w| {
                let foot = w.foot.as_ref().map_or(String::new(), |foot| format!("{foot} at "));
                format!("{foot}{:.3} s, base at ({:.2}, {:.2}) m", w.time, w.place[0], w.place[1])
            }),
            history: motion.history.iter().map(|record| finite(record.violation)).collect(),
            checks: rows.map(|row| CheckRow { value: finite(row.value), ..row }).collect(),
            seconds: motion.seconds,
            evaluation: None,
        }
    }
}

fn finite(value: f64) -> f64 {
    if value.is_finite() { value } else { f64::MAX }
}

/// The relative difference of the greatest and the least singular value of J on the ground, as in Fig. 4.
fn ground_errors(map: &WarpMap) -> Vec<[f64; 3]> {
    let (origin, size) = (map.origin(), map.size());
    let place = |d: usize, i: usize| origin[d] + size[d] * (i as f64 + 0.5) / GROUND_POINTS as f64;
    let points = (0..GROUND_POINTS).flat_map(|i| (0..GROUND_POINTS).map(move |j| (i, j)));
    points
        .map(|(i, j)| {
            let jet = map.jet([place(0, i), place(1, j), origin[2]], Order::First);
            let jacobian = nalgebra::Matrix3::from_fn(|r, c| jet.jacobian[r][c]);
            let values = jacobian.singular_values();
            [jet.position[0], jet.position[1], 1.0 - values.min() / values.max()]
        })
        .collect()
}

/// Times the functions of an NLP at its start, multipliers all 1.
fn evaluation(problem: &mut GaitProblem) -> Evaluation {
    let size = problem.size();
    let [n, m, entries, hessian_entries] = size;
    let mut x = vec![0.0; n];
    problem.initial_point(&mut x);
    let multipliers = vec![1.0; m];
    let (mut g, mut jacobian, mut hessian) = (vec![0.0; m], vec![0.0; entries], vec![0.0; hessian_entries]);
    // What the functions share is computed once for a point: each time the point must be another.
    let mut timed = |work: &mut dyn FnMut(&mut GaitProblem, &[f64])| {
        let mut once = || {
            x[n - 1] += 1e-6;
            let start = Instant::now();
            work(problem, &x);
            1e3 * start.elapsed().as_secs_f64()
        };
        let mut times: Vec<f64> = (0..REPEATS).map(|_| once()).collect();
        times.sort_by(f64::total_cmp);
        times[REPEATS / 2]
    };
    Evaluation {
        size,
        constraints: timed(&mut |problem, x| problem.constraints(x, true, &mut g)),
        jacobian: timed(&mut |problem, x| problem.jacobian_values(x, true, &mut jacobian)),
        hessian: timed(&mut |problem, x| {
            problem.hessian_values(x, true, 1.0, &multipliers, true, &mut hessian);
        }),
    }
}

/// Computes a case and leaves the result as JSON in a file.
pub fn run_to_file(work: Work, scenario: &Path, plan: &Path, result: &Path) -> Result<()> {
    let measured = run(work, scenario, plan)?;
    let json = serde_json::to_vec(&measured).map_err(|e| Error::Internal(format!("result: {e}")))?;
    files::write_atomically(result, &json)
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_flat_map_has_no_error() {
        let spec = scenario::MapSpec { cells: Some([8, 8, 4]), ..Default::default() };
        let map = WarpMap::flat([-1.0, 1.0, -1.0, 1.0], &spec).unwrap();
        let errors = ground_errors(&map);
        assert_eq!(errors.len(), GROUND_POINTS * GROUND_POINTS);
        assert!(errors.iter().all(|[x, y, e]| x.abs() < 1.0 && y.abs() < 1.0 && e.abs() < 1e-9));
    }

    #[test]
    fn what_json_cannot_write_is_replaced() {
        assert_eq!(finite(f64::NAN), f64::MAX);
        let motion = MotionMeasured { violation: finite(f64::INFINITY), ..Default::default() };
        let text = serde_json::to_string(&motion).unwrap();
        assert_eq!(serde_json::from_str::<MotionMeasured>(&text).unwrap(), motion);
    }
}
