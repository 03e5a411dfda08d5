//! Linear algebra of an interior-point method: symmetric indefinite KKT matrices, factored with their exact inertia.
//!
//! In each iteration, an interior-point method solves a system with the matrix
//!
//! ```text
//!       x      s     y_c     y_d
//!   ┌                               ┐
//!   │  H + Σ          J_cᵀ    J_dᵀ  │   x: variables, n
//!   │        Σ_s               −I   │   s: slacks of the inequalities, m_d
//!   │  J_c          −δ_c            │   y_c: multipliers of the equations, m_c
//!   │  J_d   −I              −δ_d   │   y_d: multipliers of the inequalities, m_d
//!   └                               ┘
//! ```
//!
//! [`Layout`] gives the sizes of its blocks. [`Kkt`] does four things with it:
//!
//! 1. **Condensing** (`condense`): a slack and its multiplier form a 2×2 pivot that touches nothing but the row of J_d. All of
//!    these are eliminated first, which leaves a matrix of order n + m_c.
//! 2. **Factorization** (`ldlt`): LDLᵀ in approximate minimum degree order, without a search for pivots. That needs a small static
//!    regularization of the multipliers, so M = LDLᵀ is close to K but not equal to it.
//! 3. **Certificate** (`kkt`): M has as many negative eigenvalues as D. K has as many, too, if iterative refinement converges
//!    for every right-hand side, that is, if the spectral radius of I − M⁻¹K is below one: no eigenvalue of M + t (K − M) can then
//!    cross zero as t goes from 0 to 1. This is tested with a random vector. If it does not shrink, K counts as singular.
//! 4. **Refinement** (`kkt`): solutions are corrected by their residual in K until it is small; the remaining residual is returned.
//!
//! The pattern is analyzed once; a factorization or solve allocates nothing.

mod condense;
mod kkt;
mod ldlt;
mod symmetric;

pub use kkt::{Error, Factored, Kkt, Layout, Statistics};
