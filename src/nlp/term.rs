//! What the nonlinear program is made of: blocks of constraint rows, and terms of the objective.

use super::curvature::NodeCurvature;
use super::model::Model;
use super::sink::{Gradient, Sink};
use super::state::State;

/// Where and when a row acts.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
pub struct RowPlace {
    /// Index of the foot.
    pub foot: Option<usize>,
    /// Time in samples.
    pub sample: f64,
}

/// A named block of rows.
pub trait Constraint: Sync {
    /// Name, as users see it.
    fn name(&self) -> &'static str;
    /// Number of rows.
    fn rows(&self) -> usize;
    /// Least and greatest value of each row.
    fn bounds(&self, model: &Model, lower: &mut [f64], upper: &mut [f64]);
    /// The rows' values.
    fn values(&self, model: &Model, state: &State, out: &mut [f64]);
    /// Adds ∂(row `first` + r)/∂x: the same places in the same order every time.
    fn jacobian(&self, model: &Model, state: &State, first: usize, sink: &mut Sink);
    /// Adds the second derivatives of Σ multiplier · row in the ambient quantities, pulled back to the variables, and
    /// accumulates the weights of the ambient quantities' own second derivatives in `curvature`.
    fn hessian(
        &self,
        model: &Model,
        state: &State,
        multipliers: &[f64],
        curvature: &mut NodeCurvature,
        sink: &mut Sink,
    );
    /// Where and when a row acts.
    fn place(&self, row: usize) -> RowPlace;
}

/// A named term of the objective.
pub trait Cost: Sync {
    /// Name, as users see it.
    fn name(&self) -> &'static str;
    /// Its value.
    fn value(&self, model: &Model, state: &State, x: &[f64]) -> f64;
    /// Adds its gradient.
    fn gradient(&self, model: &Model, state: &State, x: &[f64], gradient: &mut Gradient);
    /// Adds its second derivatives times `factor`; those through ambient quantities go to `curvature`.
    fn hessian(
        &self,
        model: &Model,
        state: &State,
        x: &[f64],
        factor: f64,
        curvature: &mut NodeCurvature,
        sink: &mut Sink,
    );
}
