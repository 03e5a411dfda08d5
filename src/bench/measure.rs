//! Computes and measures a case. This runs in a process of its own, started by the sweep.

use std::ops::ControlFlow;
use std::path::Path;
use std::time::Instant;

use super::case::Work;
use super::clock::CpuClock;
use super::measured::{Cpu, Evaluation, MapMeasured, Measured, MotionMeasured, finite};
use crate::ipopt::NlpProblem;
use crate::pipeline::{self, BuiltMap, Event, Planned, Prepared, Step};
use crate::plan::CheckRow;
use crate::planner::violation::BlockViolation;
use crate::planner::{GaitProblem, Stage};
use crate::scenario::{self, LoadedScenario};
use crate::warp::{Order, WarpMap};
use crate::{Error, Result, files};

/// Timed evaluations of each function, of which the median counts.
const REPEATS: usize = 31;
/// By how much the last variable moves before each of them, so that nothing is reused from the evaluation before.
const NUDGE: f64 = 1e-6;
/// Points along each axis at which the map's error on the ground is kept, for Fig. 4.
const GROUND_POINTS: usize = 60;

/// Computes a case and writes the result as JSON; `plan` and `result` are the files to write.
///
/// # Errors
/// Those of the pipeline, and for files that cannot be written.
pub fn run_to_file(work: Work, scenario: &Path, plan: &Path, result: &Path) -> Result<()> {
    let measured = run(work, scenario, plan)?;
    let json = serde_json::to_vec(&measured).map_err(|e| Error::Internal(format!("result: {e}")))?;
    files::write_atomically(result, &json)
}

/// Computes a case from its scenario file and writes its plan, if it has one.
fn run(work: Work, scenario: &Path, plan: &Path) -> Result<Measured> {
    let stopwatch = Stopwatch::start();
    let loaded = scenario::load(scenario, &[])?;
    match work {
        Work::Map => map_alone(&loaded, stopwatch),
        Work::Plan | Work::Track | Work::Speed => motion(work, &loaded, plan, stopwatch),
    }
}

/// Plans a motion and, for `speed`, times the functions of its NLP.
fn motion(work: Work, loaded: &LoadedScenario, plan: &Path, stopwatch: Stopwatch) -> Result<Measured> {
    let mut recorder = Recorder { stopwatch, iterations: Vec::new() };
    let planned = pipeline::run(loaded, false, &mut |event| {
        recorder.observe(event);
        ControlFlow::Continue(())
    })?;
    let planned = planned.ok_or_else(interrupted)?;
    planned.plan.write(plan)?;
    let Recorder { stopwatch, iterations } = recorder;
    let cpu = stopwatch.stop();

    let mut motion = motion_measured(&planned, &iterations, loaded.scenario.solver.tolerance);
    if work == Work::Speed {
        let map = planned.map.as_ref().map(|built| &built.map);
        motion.evaluation = Some(evaluation(&mut planned.prepared.task(loaded, map).problem()?));
    }
    let map = planned.map.map(|BuiltMap { report, cached, .. }| MapMeasured {
        cached,
        report,
        ground_errors: Vec::new(),
    });
    Ok(Measured { motion: Some(motion), map, track: None, cpu })
}

/// Builds a map without the cache, which would hide how long that takes.
fn map_alone(loaded: &LoadedScenario, mut stopwatch: Stopwatch) -> Result<Measured> {
    let mut silent = |_: &Event| ControlFlow::Continue(());
    let prepared = Prepared::new(loaded, &mut silent)?;
    stopwatch.begin(Step::Map);
    let built = pipeline::build_map(&prepared.surfaces.posture, &loaded.scenario.map, false, &mut silent)?;
    let BuiltMap { map, report, cached } = built.ok_or_else(interrupted)?;
    let cpu = stopwatch.stop();
    let map = MapMeasured { cached, report, ground_errors: ground_errors(&map) };
    Ok(Measured { motion: None, map: Some(map), track: None, cpu })
}

/// Nothing raises an interrupt in the process of a case: the sweep kills it instead.
fn interrupted() -> Error {
    Error::Internal("the case was interrupted".into())
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

    /// Ends the current step and begins `step`.
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

/// Keeps what a case needs of the pipeline's events.
struct Recorder {
    stopwatch: Stopwatch,
    /// Stage and violation of every iteration.
    iterations: Vec<(Stage, f64)>,
}

impl Recorder {
    fn observe(&mut self, event: &Event) {
        match event {
            Event::Step(step) => self.stopwatch.begin(*step),
            Event::Iteration(at) => self.iterations.push((at.stage, at.record.violation)),
            Event::Note(_) | Event::Map(_) => {}
        }
    }
}

fn motion_measured(planned: &Planned, iterations: &[(Stage, f64)], tolerance: f64) -> MotionMeasured {
    let (motion, check) = (&planned.motion, &planned.check);
    let worst = motion.violations.iter().max_by(|a, b| a.largest.total_cmp(&b.largest));
    let rows = check.rows.iter().cloned();
    MotionMeasured {
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
        worst_block: worst.map_or(String::new(), |worst| worst.block.clone()),
        worst_place: worst.map_or(String::new(), place),
        history: motion.history.iter().map(|record| finite(record.violation)).collect(),
        checks: rows.map(|row| CheckRow { value: finite(row.value), ..row }).collect(),
        seconds: motion.seconds,
        evaluation: None,
    }
}

/// Foot, time and base position of the largest violation of a constraint.
fn place(worst: &BlockViolation) -> String {
    let foot = worst.foot.as_ref().map_or(String::new(), |foot| format!("{foot} at "));
    let [x, y] = worst.place;
    format!("{foot}{:.3} s, base at ({x:.2}, {y:.2}) m", worst.time)
}

/// The conformal error 1 − σ_min/σ_max on the ground, where σ are the singular values of J, as in Fig. 4.
fn ground_errors(map: &WarpMap) -> Vec<[f64; 3]> {
    let (origin, size) = (map.origin(), map.size());
    let at = |d: usize, i: usize| origin[d] + size[d] * (i as f64 + 0.5) / GROUND_POINTS as f64;
    let points = (0..GROUND_POINTS).flat_map(|i| (0..GROUND_POINTS).map(move |j| (i, j)));
    points
        .map(|(i, j)| {
            let jet = map.jet([at(0, i), at(1, j), origin[2]], Order::First);
            let jacobian = nalgebra::Matrix3::from_fn(|r, c| jet.jacobian[r][c]);
            let values = jacobian.singular_values();
            [jet.position[0], jet.position[1], 1.0 - values.min() / values.max()]
        })
        .collect()
}

/// Times the functions of an NLP near its initial point, with all multipliers 1.
fn evaluation(problem: &mut GaitProblem) -> Evaluation {
    let size = problem.size();
    let [n, m, entries, hessian_entries] = size;
    let mut x = vec![0.0; n];
    problem.initial_point(&mut x);
    let multipliers = vec![1.0; m];
    let (mut g, mut jacobian, mut hessian) = (vec![0.0; m], vec![0.0; entries], vec![0.0; hessian_entries]);
    let mut timed = |work: &mut dyn FnMut(&mut GaitProblem, &[f64])| {
        let mut once = || {
            x[n - 1] += NUDGE;
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
}
