//! The end of a cyclic motion is its start, turned about the vertical and shifted ([`crate::nlp::cycle`]).
//!
//! ```text
//!   p_z(T) − p_z(0) = shift_z,   θ(T) − θ(0) = (0, 0, turn)                        base; x and y are given at both ends
//!   ṗ(T) = Rz ṗ(0),   p̈(T) = Rz p̈(0),   θ̇(T) = θ̇(0),   θ̈(T) = θ̈(0)
//!   p_i(T) = moved(p_i(0)) in x and y,   f_i(T) = Rz f_i(0)                        feet; z follows from the ground
//! ```
//!
//! A foot that swings over the end has the same footholds and control points there as in the swing over the start.
//!
//! A turn about the vertical adds to the yaw θ_z alone. All variables are ambient, so that the rows are linear in them. A force that is zero
//! at one end, where the foot lifts off or touches down, is zero at the other.
//!
//! Rows: of the base 4, then 6 rates in m/s and rad/s, then 6 in m/s² and rad/s² over a tenth of a second; of each foot two in m and three in m g, or those of its
//! swing, in m.

use nalgebra::Vector3;

use super::variable_rows::{VariableRow, VariableRows};
use crate::nlp::{Cycle, Model};
use crate::trajectory::LinearNode;
use crate::trajectory::variables::SwingVariables;

/// Accelerations count as velocities over this time, s.
const TIME: f64 = 0.1;
/// x, y and z.
const AXES: usize = 3;

/// The component of `end` less that of the turned `start`, which is `value`.
fn turned([start, end]: [&LinearNode; 2], component: usize, cycle: &Cycle, value: f64) -> VariableRow {
    let mut row = VariableRow { value, ..VariableRow::default() };
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

/// Rows that close a cycle, of base, feet and forces.
pub fn closure(model: &Model, cycle: &Cycle) -> VariableRows {
    let layout = &model.layout;
    let last = layout.intervals;
    let mut rows = base_rows(model, cycle);
    // What a place at the start is moved by beside the turn.
    let offset = cycle.moved(&Vector3::zeros());
    for (i, foot) in layout.feet.iter().enumerate() {
        let mut add = |mut row: VariableRow| {
            row.place.foot = Some(i);
            rows.push(row);
        };
        let count = foot.stances.len();
        let foothold = |j: usize| &foot.stances[j].foothold;
        if foot.swings.first().is_some_and(|swing| swing.swing.start < 0.0) {
            // The last swing is the first one, from foothold to foothold.
            for ends in [[foothold(0), foothold(count - 2)], [foothold(1), foothold(count - 1)]] {
                (0..2).for_each(|c| add(turned(ends, c, cycle, offset[c])));
            }
            for point in 0..layout.swing_shape.free() {
                let of = |swing: &SwingVariables| LinearNode::variable(swing.control_points + 3 * point);
                let [start, end] = [&foot.swings[0], &foot.swings[count - 2]].map(of);
                (0..AXES).for_each(|c| add(turned([&start, &end], c, cycle, offset[c])));
            }
        } else if count > 1 {
            (0..2).for_each(|c| {
                add(turned([foothold(0), foothold(count - 1)], c, cycle, offset[c]));
            });
        }
        let none = LinearNode::default();
        let ends = [0, last].map(|k| layout.force(i, k).map_or(&none, |(_, node)| node));
        if ends.iter().any(|node| !node.terms.is_empty()) {
            (0..AXES).for_each(|c| add(turned(ends, c, cycle, 0.0)));
        }
    }
    let sample = last as f64;
    rows.iter_mut().for_each(|row: &mut VariableRow| row.place.sample = sample);
    VariableRows { name: "closure", rows }
}

/// Position, orientation, velocities and accelerations.
fn base_rows(model: &Model, cycle: &Cycle) -> Vec<VariableRow> {
    let layout = &model.layout;
    let last = layout.intervals;
    let mut rows = Vec::new();
    let shift = [cycle.to.z - cycle.from.z, 0.0, 0.0, cycle.turn];
    for (value, component) in shift.into_iter().zip(2..) {
        let mut row = VariableRow { value, ..VariableRow::default() };
        row.add(&layout.base[last], component, 1.0);
        row.add(&layout.base[0], component, -1.0);
        rows.push(row);
    }
    for (order, scale) in [(0, 1.0), (1, TIME)] {
        let ends = [0, last].map(|k| &layout.base_rates[k][order]);
        let mut add = |mut row: VariableRow| {
            row.terms.iter_mut().for_each(|term| term.1 *= scale);
            rows.push(row);
        };
        (0..AXES).for_each(|c| add(turned(ends, c, cycle, 0.0)));
        for component in AXES..2 * AXES {
            let mut row = VariableRow::default();
            row.add(ends[1], component, 1.0);
            row.add(ends[0], component, -1.0);
            add(row);
        }
    }
    rows
}
