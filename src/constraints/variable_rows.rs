//! Rows that are linear in the variables. The blocks are made elsewhere: [`super::closure`], [`super::feet_at_start`].

use crate::nlp::curvature::NodeCurvature;
use crate::nlp::sink::Sink;
use crate::nlp::term::{Constraint, RowPlace};
use crate::nlp::{Model, State};
use crate::trajectory::LinearNode;

/// Σ weight · variable = value.
#[derive(Clone, Debug, Default)]
pub struct VariableRow {
    /// (variable, weight).
    pub terms: Vec<(usize, f64)>,
    /// The right-hand side.
    pub value: f64,
    /// Where the row acts.
    pub place: RowPlace,
}

impl VariableRow {
    /// Adds a component of a node times a weight.
    pub fn add(&mut self, node: &LinearNode, component: usize, weight: f64) {
        self.terms.extend(node.terms.iter().map(|(variable, part)| (variable + component, part * weight)));
    }
}

/// A named block of them.
#[derive(Clone, Debug)]
pub struct VariableRows {
    /// Its name.
    pub name: &'static str,
    /// Its rows.
    pub rows: Vec<VariableRow>,
}

impl Constraint for VariableRows {
    fn name(&self) -> &'static str {
        self.name
    }

    fn rows(&self) -> usize {
        self.rows.len()
    }

    fn bounds(&self, _model: &Model, lower: &mut [f64], upper: &mut [f64]) {
        for (r, row) in self.rows.iter().enumerate() {
            (lower[r], upper[r]) = (row.value, row.value);
        }
    }

    fn values(&self, _model: &Model, state: &State, out: &mut [f64]) {
        for (value, row) in out.iter_mut().zip(&self.rows) {
            *value = row.terms.iter().map(|(variable, weight)| weight * state.x[*variable]).sum();
        }
    }

    fn jacobian(&self, _model: &Model, _state: &State, first: usize, sink: &mut Sink) {
        for (r, row) in self.rows.iter().enumerate() {
            for &(variable, weight) in &row.terms {
                sink.add(first + r, variable, weight);
            }
        }
    }

    /// The rows are linear.
    fn hessian(
        &self,
        _model: &Model,
        _state: &State,
        _multipliers: &[f64],
        _curvature: &mut NodeCurvature,
        _sink: &mut Sink,
    ) {
    }

    fn place(&self, row: usize) -> RowPlace {
        self.rows[row].place
    }
}
