//! The nonlinear program: nodes → constraints and costs → Ipopt.
//!
//! ```text
//! x ──linear──▶ nodes in the space of the variables ──φ, 𝒫──▶ ambient nodes ──constraints, costs──▶ g(x), f(x)
//!              (trajectory::layout)                           (nlp::state)     (constraints, costs)
//! ```
//!
//! A constraint sees ambient quantities alone; which space the variables live in changes only how the nodes are pushed
//! forward. So the two formulations differ in nothing else.

pub mod curvature;
pub mod derivatives;
pub mod guess;
pub mod model;
pub mod problem;
mod share;
pub mod sink;
pub mod solve;
pub mod state;
pub mod tangent;
pub mod violation;

pub use model::Model;
pub use problem::Problem;
pub use state::State;
