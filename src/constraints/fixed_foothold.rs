//! Footholds whose place is given.
//!
//! ```text
//!   p_ij,x, p_ij,y = position
//! ```
//!
//! Rows: x and y of each, m.

use super::linear::{LinearRow, LinearRows};
use crate::nlp::Model;
use nalgebra::Vector3;

/// The fixed footholds of a model.
pub fn fixed_footholds(model: &Model) -> LinearRows {
    let mut rows = Vec::new();
    for fixed in &model.fixed {
        let start = model.layout.feet[fixed.foot].stances[fixed.stance].stance.start;
        for (c, at) in fixed.position.into_iter().enumerate() {
            let mut row = LinearRow::at((start.ceil() as usize).min(model.layout.intervals), [at; 2]);
            let mut by = Vector3::zeros();
            by[c] = 1.0;
            row.footholds.push((fixed.foot, fixed.stance, by));
            row.foot = Some(fixed.foot);
            rows.push(row);
        }
    }
    LinearRows { name: "fixed footholds", rows }
}
