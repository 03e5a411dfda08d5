//! What makes one feasible motion better than another, one cost a file, each with its first and second derivatives.
//!
//! All are sums of squares, and dimensionless: the weights carry the units.

pub mod base_acceleration;
pub mod force_rate;
pub mod posture;
pub mod swing_acceleration;

use crate::nlp::curvature::Curvature;
use crate::nlp::sink::Sink;
use crate::nlp::{Model, State};

/// A named term of the objective.
pub trait Cost: Sync {
    /// Name, as users see it.
    fn name(&self) -> &'static str;
    /// Its value.
    fn value(&self, model: &Model, state: &State, x: &[f64]) -> f64;
    /// Says its gradient as row 0.
    fn gradient(&self, model: &Model, state: &State, x: &[f64], sink: &mut Sink);
    /// Says its second derivatives times `factor`; those through ambient quantities go to `curvature`.
    fn hessian(
        &self,
        model: &Model,
        state: &State,
        x: &[f64],
        factor: f64,
        curvature: &mut Curvature,
        sink: &mut Sink,
    );
}
