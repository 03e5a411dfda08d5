//! One case: what is computed in the process of its own, and what comes back from it.

use std::collections::BTreeMap;
use std::ops::ControlFlow;
use std::path::Path;
use std::sync::Arc;
use std::time::Instant;

use serde::{Deserialize, Serialize};

use super::clock::{ClockKind, CpuClock};
use crate::check::check;
use crate::heightfield::Heightfield;
use crate::ipopt::NlpProblem;
use crate::nlp::solve as nlp;
use crate::plan::sampled::Provenance;
use crate::plan::{CheckRow, Plan, Seconds};
use crate::replay::{Tracked, Verdict};
use crate::scenario::{self, Formulation};
use crate::terrain;
use crate::warp::{self, MapReport, Order, WarpMap};
use crate::{Error, Result};

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
    /// Why there are none.
    pub check_error: Option<String>,
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
    let mut clock = CpuClock::start();
    let mut cpu = Cpu { clock: clock.kind(), ..Cpu::default() };
    let loaded = scenario::load(scenario, &[])?;
    let asked = &loaded.scenario;
    let ground = terrain::build(&asked.terrain, &loaded.base_dir).map_err(|e| loaded.locate(e))?;
    loaded.ensure_inside(ground.field.extent())?;
    cpu.terrain = clock.lap();

    let start = Instant::now();
    let built = match (work, asked.formulation) {
        (Work::Plan | Work::Track | Work::Speed, Formulation::Direct) => None,
        // A map that is to be measured is built, whatever the cache holds.
        (Work::Map, _) => Some(build_map(&ground.field, &asked.map, false)?),
        _ => {
            let built = build_map(&ground.field, &asked.map, true)?;
            built.1.ensure_injective()?;
            Some(built)
        }
    };
    let map_seconds = start.elapsed().as_secs_f64();
    cpu.map = clock.lap();
    let map = built.as_ref().map(|(map, report, cached)| MapMeasured {
        cached: *cached,
        report: report.clone(),
        ground_errors: if work == Work::Map { ground_errors(map) } else { Vec::new() },
    });
    if work == Work::Map {
        return Ok(Measured { motion: None, map, track: None, cpu });
    }
    let warp = built.as_ref().map(|(map, _, _)| map);
    let field = Arc::new(ground.field.clone());
    clock.lap();

    let mut stages: Vec<(bool, f64)> = Vec::new();
    let mut continuation = false;
    let motion = nlp::solve(asked, &loaded.robot, &field, warp, &mut |at| {
        continuation |= at.stage != "solve";
        // The steps of a continuation before its last one are on gentler ground.
        let whole = at.stage == "solve" || at.stage.ends_with(" 100 %");
        stages.push((whole, at.record.violation));
        ControlFlow::Continue(())
    })?;
    cpu.solve = clock.lap();
    let provenance = Provenance {
        scenario: asked,
        text: &loaded.effective_text,
        robot: &loaded.robot,
        ground: &ground,
        inputs: BTreeMap::new(),
        map_seconds,
    };
    let mut made = Plan::from_motion(&motion, &provenance);
    let (checks, check_error) = match check(&made) {
        Ok(found) => (found.rows, None),
        Err(error) => (Vec::new(), Some(error.to_string())),
    };
    made.meta.checks = checks.clone();
    // A plan with numbers that are not finite cannot be written; `check_error` says so.
    if check_error.is_none() {
        made.write(plan)?;
    }
    cpu.check = clock.lap();

    let tolerance = asked.solver.tolerance;
    let worst = motion.violations.iter().max_by(|a, b| a.largest.total_cmp(&b.largest));
    let evaluation = match work {
        Work::Speed => Some(evaluation(&mut nlp::problem(asked, &loaded.robot, &field, warp)?)),
        _ => None,
    };
    let motion = MotionMeasured {
        solved: motion.solved,
        passed: check_error.is_none() && checks.iter().all(|row| row.passed),
        status: motion.status.clone(),
        iterations: motion.iterations,
        first_feasible: stages
            .iter()
            .zip(&motion.history)
            .find(|((whole, violation), _)| *whole && *violation <= tolerance)
            .map(|(_, record)| record.iteration),
        continuation,
        violation: finite(motion.max_violation()),
        worst_block: worst.map_or(String::new(), |w| w.block.clone()),
        worst_place: worst.map_or(String::new(), |w| {
            let foot = w.foot.as_ref().map_or(String::new(), |foot| format!("{foot} at "));
            format!("{foot}{:.3} s, base at ({:.2}, {:.2}) m", w.time, w.place[0], w.place[1])
        }),
        history: motion.history.iter().map(|record| finite(record.violation)).collect(),
        checks: checks.into_iter().map(|row| CheckRow { value: finite(row.value), ..row }).collect(),
        check_error,
        seconds: motion.seconds,
        evaluation,
    };
    Ok(Measured { motion: Some(motion), map, track: None, cpu })
}

fn build_map(
    field: &Heightfield,
    spec: &scenario::MapSpec,
    with_cache: bool,
) -> Result<(WarpMap, MapReport, bool)> {
    let folder = if with_cache { warp::default_cache_dir() } else { None };
    warp::build_cached(field, spec, folder.as_deref(), &mut |_| ControlFlow::Continue(()))
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
fn evaluation(problem: &mut crate::nlp::Problem) -> Evaluation {
    let size = nlp::size(problem);
    let [n, m, entries, hessian_entries] = size;
    let mut x = vec![0.0; n];
    problem.initial_point(&mut x);
    let multipliers = vec![1.0; m];
    let (mut g, mut jacobian, mut hessian) = (vec![0.0; m], vec![0.0; entries], vec![0.0; hessian_entries]);
    // What the functions share is computed once for a point: each time the point must be another.
    let mut timed = |work: &mut dyn FnMut(&mut crate::nlp::Problem, &[f64])| {
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
    crate::plan::npz::write_atomically(result, &json)
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
