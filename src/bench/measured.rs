//! The result of a case. These types are also the format of `cases/NAME.json`.

use serde::{Deserialize, Serialize};

use super::clock::ClockKind;
use crate::plan::CheckRow;
use crate::planner::Seconds;
use crate::replay::{Tracked, Verdict};
use crate::warp::MapReport;

/// The result of a case. Its numbers are finite, since JSON has no infinity: the largest number stands for those that are not.
#[derive(Clone, Debug, Default, PartialEq, Serialize, Deserialize)]
pub struct Measured {
    /// The motion; none for a map alone.
    pub motion: Option<MotionMeasured>,
    /// The map; none in the direct formulation.
    pub map: Option<MapMeasured>,
    /// The replay; none where no motion was replayed.
    #[serde(default)]
    pub track: Option<Tracked>,
    /// Processor time by step.
    pub cpu: Cpu,
}

impl Measured {
    /// Whether the motion is solved, passes every check and, if it was replayed, its replay; for a map alone, whether it
    /// converged without folds.
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

/// Processor time by step of the pipeline, s.
#[derive(Clone, Copy, Debug, Default, PartialEq, Serialize, Deserialize)]
pub struct Cpu {
    /// Which time this is.
    pub clock: ClockKind,
    /// Reading the scenario and sampling the terrain.
    pub terrain: f64,
    /// Building the map, or reading it from the cache.
    pub map: f64,
    /// The guess and the NLP; maps of a continuation included.
    pub solve: f64,
    /// Sampling, checking and writing the plan.
    pub check: f64,
}

/// The map of a case.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
pub struct MapMeasured {
    /// Whether it was read from the cache.
    pub cached: bool,
    /// Its quality; the `seconds` of a cached map are those of the run that built it.
    pub report: MapReport,
    /// (x, y, 1 − σ_min/σ_max) at points of the ground evenly spaced in F, m; empty unless the case is a map alone.
    pub ground_errors: Vec<[f64; 3]>,
}

/// The motion of a case.
#[derive(Clone, Debug, Default, PartialEq, Serialize, Deserialize)]
pub struct MotionMeasured {
    /// Every constraint of the NLP holds within the tolerance.
    pub solved: bool,
    /// Every check holds.
    pub passed: bool,
    /// How the solve ended.
    pub status: String,
    /// Iterations of all stages.
    pub iterations: usize,
    /// The first iteration within the tolerance on the whole terrain.
    pub first_feasible: Option<usize>,
    /// Whether the plain solve failed and a continuation followed.
    pub continuation: bool,
    /// The largest violation at the end, units of the NLP.
    pub violation: f64,
    /// The constraint with the largest violation, even where that is within the tolerance.
    pub worst_block: String,
    /// Foot, time and base position of the largest violation.
    pub worst_place: String,
    /// Largest violation by iteration.
    pub history: Vec<f64>,
    /// Values and verdicts of the checks.
    pub checks: Vec<CheckRow>,
    /// Wall time, as the solver reports it.
    pub seconds: Seconds,
    /// Time of the NLP's functions; for `speed`.
    pub evaluation: Option<Evaluation>,
}

/// Size and cost of the NLP's functions at the guess: median wall times, ms. Each includes what the functions share.
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

/// The value itself, or the largest number for one that is not finite.
pub(super) fn finite(value: f64) -> f64 {
    if value.is_finite() { value } else { f64::MAX }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn numbers_that_json_lacks_are_replaced() {
        assert_eq!(finite(f64::NAN), f64::MAX);
        let motion = MotionMeasured { violation: finite(f64::INFINITY), ..Default::default() };
        let text = serde_json::to_string(&motion).unwrap();
        assert_eq!(serde_json::from_str::<MotionMeasured>(&text).unwrap(), motion);
    }
}
