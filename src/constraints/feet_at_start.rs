//! Feet that are in the air at the start are where, and as fast as, the given state has them.
//!
//! ```text
//!   p̄_i(0) = position,   p̄̇_i(0) = velocity   (where given)
//! ```
//!
//! in the space of the variables, to which the given values are pulled back. The rows are linear in the variables, because the swing has begun
//! at a given time before the start.
//!
//! Rows: three in m for each such foot, then three in m/s.

use super::variable_rows::{VariableRow, VariableRows};
use crate::nlp::term::RowPlace;
use crate::nlp::{Model, Start};

/// Of the feet whose swing has begun before the start.
pub fn feet_at_start(model: &Model, start: &Start) -> VariableRows {
    let mut rows = Vec::new();
    let in_air = model.layout.feet.iter().enumerate().filter(|(_, foot)| foot.starts_in_air());
    for (i, _) in in_air {
        for (derivative, given) in [(0, &start.footholds), (1, &start.feet_velocity)] {
            let Some(given) = given else { continue };
            let node = model.layout.foot_node(i, 0.0, derivative);
            for c in 0..3 {
                let place = RowPlace { foot: Some(i), sample: 0.0 };
                let mut row = VariableRow { terms: Vec::new(), value: given[i][c], place };
                row.add(&node, c, 1.0);
                rows.push(row);
            }
        }
    }
    VariableRows { name: "feet at start", rows }
}
