//! The end of a cyclic motion is its start, turned about the vertical and shifted ([`crate::nlp::cycle`]).
//!
//! ```text
//!   p_z(T) − p_z(0) = shift_z,   θ(T) − θ(0) = (0, 0, turn)                        base; x and y are given at both ends
//!   ṗ(T) = Rz ṗ(0),   p̈(T) = Rz p̈(0),   θ̇(T) = θ̇(0),   θ̈(T) = θ̈(0)
//!   p_i(T) = moved(p_i(0)) in x and y,   f_i(T) = Rz f_i(0)                        feet; z follows from the ground
//! ```
//!
//! A turn about the vertical adds to the yaw θ_z alone. All variables are ambient, so that the rows are linear in them. A force that is zero
//! at one end, where the foot lifts off or touches down, is zero at the other.
//!
//! Rows: of the base 4, then 6 rates in m/s and rad/s, then 6 in m/s² and rad/s² over a tenth of a second; of each foot two in m and three in m g.

use nalgebra::Vector3;

use crate::nlp::curvature::NodeCurvature;
use crate::nlp::cycle::Cycle;
use crate::nlp::sink::Sink;
use crate::nlp::term::{Constraint, RowPlace};
use crate::nlp::{Model, State};
use crate::trajectory::LinearNode;

/// Accelerations count as velocities over this time, s.
const TIME: f64 = 0.1;
/// x, y and z.
const AXES: usize = 3;

/// Σ weight · variable = value.
#[derive(Clone, Debug, Default)]
struct Row {
    terms: Vec<(usize, f64)>,
    value: f64,
    foot: Option<usize>,
}

impl Row {
    fn add(&mut self, node: &LinearNode, component: usize, weight: f64) {
        self.terms.extend(node.terms.iter().map(|(variable, part)| (variable + component, part * weight)));
    }

    /// The component of `end` less that of the turned `start`, which is `value`.
    fn turned([start, end]: [&LinearNode; 2], component: usize, cycle: &Cycle, value: f64) -> Self {
        let mut row = Self { value, ..Self::default() };
        row.add(end, component, 1.0);
        for c in 0..AXES {
            let unit = Vector3::from_fn(|r, _| f64::from(u8::from(r == c)));
            let weight = cycle.turned(&unit)[component];
            if weight != 0.0 {
                row.add(start, c, -weight);
            }
        }
        row
    }
}

/// Rows that close the cycle.
#[derive(Clone, Debug)]
pub struct Closure {
    rows: Vec<Row>,
    /// The last sample.
    last: f64,
}

impl Closure {
    /// Of base, feet and forces.
    pub fn new(model: &Model, cycle: &Cycle) -> Self {
        let layout = &model.layout;
        let last = layout.intervals;
        let mut rows = base_rows(model, cycle);
        // What a place at the start is moved by beside the turn.
        let offset = cycle.moved(&Vector3::zeros());
        for (i, foot) in layout.feet.iter().enumerate() {
            let mut add = |row: Row| rows.push(Row { foot: Some(i), ..row });
            let count = foot.stances.len();
            if count > 1 {
                let ends = [0, count - 1].map(|j| &foot.stances[j].foothold);
                (0..2).for_each(|c| add(Row::turned(ends, c, cycle, offset[c])));
            }
            let none = LinearNode::default();
            let ends = [0, last].map(|k| layout.force(i, k).map_or(&none, |(_, node)| node));
            if ends.iter().any(|node| !node.terms.is_empty()) {
                (0..AXES).for_each(|c| add(Row::turned(ends, c, cycle, 0.0)));
            }
        }
        Self { rows, last: last as f64 }
    }
}

/// Position, orientation, velocities and accelerations.
fn base_rows(model: &Model, cycle: &Cycle) -> Vec<Row> {
    let layout = &model.layout;
    let last = layout.intervals;
    let mut rows = Vec::new();
    let shift = [cycle.to.z - cycle.from.z, 0.0, 0.0, cycle.turn];
    for (value, component) in shift.into_iter().zip(2..) {
        let mut row = Row { value, ..Row::default() };
        row.add(&layout.base[last], component, 1.0);
        row.add(&layout.base[0], component, -1.0);
        rows.push(row);
    }
    for (order, scale) in [(0, 1.0), (1, TIME)] {
        let ends = [0, last].map(|k| &layout.base_rates[k][order]);
        let mut add = |mut row: Row| {
            row.terms.iter_mut().for_each(|term| term.1 *= scale);
            rows.push(row);
        };
        (0..AXES).for_each(|c| add(Row::turned(ends, c, cycle, 0.0)));
        for component in AXES..2 * AXES {
            let mut row = Row::default();
            row.add(ends[1], component, 1.0);
            row.add(ends[0], component, -1.0);
            add(row);
        }
    }
    rows
}

impl Constraint for Closure {
    fn name(&self) -> &'static str {
        "closure"
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
        RowPlace { foot: self.rows[row].foot, sample: self.last }
    }
}
