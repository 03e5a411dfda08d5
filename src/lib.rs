//! Gait trajectory optimization for legged robots on rough ground, in a space warped flat.
//!
//! A scenario (terrain, robot, start, goal, gait) becomes a plan: where the base and the feet are and which forces the
//! ground exerts, at every instant of a motion that obeys the laws of mechanics and contact. The method is that of Pan,
//! Chen, Fang, Bretl, Gao and Wu, *Environment Warped Gait Trajectory Optimization for Complex Terrains* (RA-L 2022);
//! equation numbers in this documentation are the paper's. `docs/method.md` lists what was corrected.
//!
//! # The problem
//!
//! The robot is one rigid body with mass m and inertia I, and massless legs that end in feet i. The terrain is
//! z = h(x, y). Find p, R, pᵢ, fᵢ over t ∈ [0, T] that minimize a measure of roughness and obey, at all t,
//!
//! ```text
//! m p̈ = Σᵢ fᵢ + m g                                                    Newton   (Eq. 2)
//! d/dt (R I Rᵀ ω) = Σᵢ (pᵢ − p) × fᵢ                                   Euler    (Eq. 2)
//!
//! foot i stands:   zᵀpᵢ = h(pᵢ),  ṗᵢ = 0                               contact  (Eq. 3)
//!                  ‖(1 − n nᵀ) fᵢ‖ ≤ ν nᵀfᵢ,  n normal to the ground   friction (Eq. 5)
//! foot i swings:   zᵀpᵢ ≥ h(pᵢ),  fᵢ = 0                               no touch (Eq. 3)
//!
//! Rᵀ(pᵢ − p) ∈ 𝓡ᵢ                                                      reach    (Eq. 4)
//! p_x, p_y at T are the goal; the start is given, at rest
//! ```
//!
//! and limits of force, slope and clearance. The gait determines which foot stands when.
//!
//! The *direct* formulation takes splines of p, θ (Euler angles of R), pᵢ and fᵢ as its variables. The *warped* one takes
//! splines in a space F in which the ground is the plane z̄ = 0, and pushes them forward by a map φ: F → A with
//! Jacobian J:
//!
//! ```text
//! p = φ(p̄)    R = 𝒫(J(p̄)) R(θ̄)    pᵢ = φ(p̄ᵢ)    fᵢ = J(p̄ᵢ) f̄ᵢ        𝒫(J): the rotation nearest to J  (Eq. 12, 13)
//! ```
//!
//! A straight line in F follows the ground in A, and only the map knows the shape of the ground. Everything after the
//! push-forward is the same code for both, so that a difference between the two is a difference of formulation.
//!
//! # Data flow
//!
//! Data passes through the modules in this order, which is also the order to read them in.
//!
//! | module | takes | gives |
//! | --- | --- | --- |
//! | [`input`] | TOML files | their values with the line of every key |
//! | [`scenario`], [`robot`] | TOML files | plain data, or an error that names line, key and what is allowed |
//! | [`terrain`] | `[terrain]`, images, arrays | heights on a grid: holes filled, smoothed, with the error of the fit |
//! | [`heightfield`] | heights | h as a C² spline with derivatives |
//! | [`warp`] | h | φ as a tri-cubic B-spline whose bottom is the terrain, with a report of its quality |
//! | [`trajectory`] | the gait | which variables there are, and every sample as a linear combination of them |
//! | [`nlp`] | variables | the ambient nodes, and the language in which constraints and costs are written |
//! | [`constraints`], [`costs`] | ambient nodes | rows and terms, with first and second derivatives |
//! | [`planner`] | all of these | one sparse nonlinear program, its guess, and what to try when it does not converge |
//! | [`ipopt`] | a nonlinear program | its solution |
//! | [`plan`] | the motion | samples at ten times the rate, exact splines and provenance in one `.npz` file |
//! | [`check`] | a plan file alone | every law again, by independent code, between the samples too |
//! | [`report`] | plan, checks | tables and drawings |
//! | [`leg`] | a contact point in the base frame | joint angles, the knee, the torques that a force requires |
//! | [`pipeline`] | a scenario | all of the above in order |
//! | [`bench`](mod@bench) | the paper's protocol | its tables and figures, and speed |
//! | [`replay`] | a report of the Python package | its verdict |
//! | [`cli`] | arguments | exit codes |
//! | [`program`] | | how the program is run once more |
//! | [`files`], [`digest`] | | files read within bounds, and written whole or not at all; `.npz` archives, SHA-256 |
//!
//! # Notation
//!
//! | letter | in code | meaning, shape, unit |
//! | --- | --- | --- |
//! | φ | [`warp::WarpMap`] | F → A, R³ → R³, m |
//! | ψ | `control_points` | of φ, (Nx+3, Ny+3, Nz+3, 3), m |
//! | J, ∂J | `jacobian`, `jacobian_derivative` | of φ, (3, 3), (3, 3, 3) |
//! | 𝒫 | `project_to_rotation` | (3, 3) → SO(3), Eq. 12 |
//! | h, n | `height`, `normal` | of the ground; m, unit vector |
//! | p, θ, R | `base_position`, `base_euler`, `base_rotation` | center of mass, m; ZYX Euler angles, rad; body to world |
//! | pᵢ, fᵢ | `foot_position`, `foot_force` | m; N, of the ground on the robot |
//! | x̄ | `warped_…` | the same thing in F |
//! | T, Δt | `horizon`, `time_step` | s |
//! | ν | `friction` | coefficient, 1 |
//! | m, I, g | `mass`, `inertia`, `gravity` | kg; about the center of mass in the base frame, kg m²; m/s² |
//!
//! World frame: x forward, y left, z up, SI units. Inside the nonlinear program forces are in m g and torques in
//! m g · 1 m, so that one tolerance suits every row.

pub mod bench;
mod bspline;
pub mod check;
pub mod cli;
pub mod constraints;
pub mod costs;
pub mod digest;
pub mod error;
pub mod files;
pub mod heightfield;
pub mod input;
pub mod ipopt;
pub mod leg;
pub mod nlp;
pub mod pipeline;
pub mod plan;
pub mod planner;
pub mod program;
pub mod replay;
pub mod report;
pub mod robot;
pub mod scenario;
pub mod terrain;
pub mod trajectory;
mod visible;
pub mod warp;

pub use error::{Error, Result};
