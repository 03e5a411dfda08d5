//! The language in which constraints and costs are written.
//!
//! ```text
//! x ──linear──▶ nodes in the space of the variables ──φ, 𝒫──▶ ambient nodes ──constraints, costs──▶ g(x), f(x)
//!              (trajectory::layout)                           (state)         (crate::constraints, crate::costs)
//! ```
//!
//! A constraint sees ambient quantities alone; which space the variables live in changes only how the nodes are pushed
//! forward. So the two formulations differ in nothing else.
//!
//! | file | holds |
//! | --- | --- |
//! | [`model`] | what stays the same during a solve |
//! | [`leg_terms`] | part of it: what the legs' own mass adds |
//! | [`tighter`] | part of it: by how much limits are tighter, after they were missed between the samples |
//! | [`start`] | part of it: a given state at the start |
//! | [`state`] | the ambient nodes at the present x |
//! | [`term`] | what a constraint and a cost have to provide |
//! | [`sink`] | where they put their derivatives |
//! | [`tangent`] | how ambient vectors change with the variables |
//! | [`curvature`], [`local_forms`] | second derivatives, accumulated over all terms before they are scattered |
//! | [`foot_in_base`], [`contact_force`], [`ground_normal`] | quantities that several of them are functions of |

pub mod contact_force;
pub mod curvature;
pub mod cycle;
pub mod foot_in_base;
pub mod ground_normal;
pub mod leg_terms;
pub mod local_forms;
pub mod model;
pub mod sink;
pub mod start;
pub mod state;
pub mod tangent;
pub mod term;
pub mod tighter;

pub use cycle::Cycle;
pub use leg_terms::LegTerms;
pub use model::Model;
pub use start::Start;
pub use state::State;
pub use term::{Constraint, Cost};
pub use tighter::Tighter;
