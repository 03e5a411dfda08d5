//! What those who wait for a plan are told.

use std::fmt;
use std::ops::ControlFlow;

use crate::planner::Progress;
use crate::warp::MapProgress;

/// A step of the pipeline.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Step {
    /// Reading robot and terrain.
    Terrain,
    /// Building the map, or reading it from the cache.
    Map,
    /// Comparing derivatives with differences.
    Derivatives,
    /// Solving the NLP.
    Solve,
    /// Sampling and checking the plan.
    Plan,
}

impl fmt::Display for Step {
    fn fmt(&self, f: &mut fmt::Formatter) -> fmt::Result {
        f.write_str(match self {
            Self::Terrain => "terrain",
            Self::Map => "map",
            Self::Derivatives => "derivatives",
            Self::Solve => "solve",
            Self::Plan => "plan",
        })
    }
}

/// Progress, for people who wait.
#[derive(Clone, Debug)]
pub enum Event<'a> {
    /// A step begins.
    Step(Step),
    /// A remark that stays on the screen.
    Note(&'a str),
    /// An iteration of the map.
    Map(MapProgress),
    /// An iteration of the NLP.
    Iteration(Progress<'a>),
}

/// Called at every event; may ask to stop, which takes effect at the next iteration.
pub type Observer<'a> = dyn FnMut(&Event) -> ControlFlow<()> + 'a;
