//! The torso's posture stays within given limits.
//!
//! ```text
//!   least ≤ p_z − mean z_i ≤ greatest                                  (height over the feet, as in [`super::goal`])
//!   sin(least) ≤ −R_zx ≤ sin(greatest)                                 (pitch)
//!   R_zy cos(least) − R_zz sin(least) ≥ 0 ≥ R_zy cos(greatest) − R_zz sin(greatest)      (roll)
//! ```
//!
//! Rows: in this order, where given, at every sample but the first, at which the pose is given; the height in m, the others 1.

use super::goal::height_row;
use super::linear::{LinearRow, LinearRows};
use super::margins;
use crate::nlp::Model;
use crate::scenario::PostureSpec;

/// z, and the columns of R for the base's axes.
const Z: usize = 2;

/// Bounds on height, roll and pitch at all samples.
pub fn posture(model: &Model, spec: &PostureSpec) -> LinearRows {
    let mut rows = Vec::new();
    for k in 1..=model.layout.intervals {
        if let Some(range) = spec.height {
            rows.push(height_row(model, k, within(range, model.size * margins::POSTURE_HEIGHT)));
        }
        if let Some(range) = spec.pitch {
            let mut row = LinearRow::at(k, within(range, margins::POSTURE_TILT).map(f64::sin));
            row.rotation[(Z, 0)] = -1.0;
            rows.push(row);
        }
        if let Some(range) = spec.roll {
            let [least, greatest] = within(range, margins::POSTURE_TILT);
            for (angle, range) in [(least, [0.0, f64::INFINITY]), (greatest, [f64::NEG_INFINITY, 0.0])] {
                let mut row = LinearRow::at(k, range);
                row.rotation[(Z, 1)] = angle.cos();
                row.rotation[(Z, 2)] = -angle.sin();
                rows.push(row);
            }
        }
    }
    LinearRows { name: "posture", rows }
}

/// A range without a margin on each side, at most a quarter of it.
pub fn within([least, greatest]: [f64; 2], margin: f64) -> [f64; 2] {
    let margin = margin.min(0.25 * (greatest - least));
    [least + margin, greatest - margin]
}
