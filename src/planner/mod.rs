//! The nonlinear program of a scenario, composed and solved.
//!
//! | file | holds |
//! | --- | --- |
//! | [`problem`] | which variables, bounds, constraints and costs there are, and their sparse derivatives |
//! | `bounds` | the bounds of the variables |
//! | `cyclic` | whether the ground repeats itself under a cyclic motion |
//! | `way` | the line of the base from start to goal, with headings |
//! | `base_path` | where the base is guessed to be at each time |
//! | `places` | points of the ground, and of ambient space, in the variables |
//! | `pace` | when it is where on its way, if it travels steadily |
//! | `footholds` | which patch each stance gets, where feet may stand on patches only |
//! | `foothold_search` | the search for them |
//! | `steps` | how many steps a motion takes over edges, and where |
//! | `retiming` | when the guessed base is where, so that the feet reach their patches |
//! | `travel` | whether the goal is within range at all |
//! | `start`, `hurry` | the given state at the start; what no forces go with |
//! | `legs` | what the legs' own mass adds to the laws, from a motion |
//! | `leg_update` | the same from the iterates of a solve, while it runs |
//! | [`mod@guess`], `follow` | where a solve starts; where the scenario gives a motion to start from |
//! | `task` | what is to be planned, as a model and as a program |
//! | [`mod@solve`] | the sequence of stages, and one stage |
//! | `continuation` | when the plain solve fails: the terrain grows out of the plane |
//! | `reassign` | when that fails over patches: other patches, or other numbers of steps |
//! | `elastic`, `why` | when no motion is found: which limits would have to give |
//! | `friction_margin` | the same: what a smaller margin of friction would do |
//! | [`iterate`] | the motion at an iteration, for those who watch |
//! | [`stage`] | which stages there are |
//! | `stopping` | when a stage has done what its effort demands |
//! | `options` | the options given to Ipopt |
//! | [`motion`] | what a solve returns |
//! | [`violation`] | which constraint is violated most, where and when |
//! | [`derivatives`] | analytic derivatives against differences |
//! | `threads` | the evaluation, split between two threads |

mod base_path;
mod bounds;
mod continuation;
mod cyclic;
pub mod derivatives;
mod elastic;
mod follow;
mod foothold_search;
mod footholds;
mod friction_margin;
pub mod guess;
mod hurry;
pub mod iterate;
mod leg_update;
pub mod legs;
pub mod motion;
mod options;
mod pace;
mod places;
pub mod problem;
mod reassign;
mod retiming;
pub mod solve;
pub mod stage;
mod standing;
mod start;
mod steps;
mod stopping;
mod task;
mod threads;
mod travel;
pub mod violation;
mod way;
mod why;

pub use elastic::{Explanation, Shortfall};
pub use hurry::ensure_possible;
pub use iterate::{Iterate, IterateSamples};
pub use legs::{FINE, LegMotion};
pub use motion::{Motion, Seconds, Trouble};
pub use problem::GaitProblem;
pub use reassign::{Reassignment, reassignments};
pub use solve::{Host, Progress, attempt, attempt_again};
pub use stage::Stage;
pub use start::given_pose;
pub use steps::Steps;
pub use task::Task;

use crate::Result;

/// Says why no motion was found, if that is so: in [`Motion::explanation`], and in the status whether a smaller `contact.friction_margin` would
/// do.
///
/// # Errors
/// Those of [`attempt`].
pub fn explain(task: &Task, host: &mut dyn Host, motion: &mut Motion) -> Result<()> {
    why::explain(task, host, motion)?;
    friction_margin::advise(task, host, motion)
}
