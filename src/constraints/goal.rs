//! The goal and the way-points: position, heading and height of the base at the end, and on the way.
//!
//! ```text
//!   p_x, p_y = goal;    −sin ψ R_xx + cos ψ R_yx = 0   (heading ψ, when given);    p_z − mean z_i = height   (when given)
//! ```
//!
//! at the last sample, and at the time of a way-point that has one. A way-point without a time is passed at the sample at which the guess
//! passes it, within a square that has the corners at [`crate::scenario::GoalSpec::waypoint_distance`]. Heights are those over the mean of
//! the feet; of one that swings, that of the ground between its footholds.
//!
//! Rows: x, y in m, then the heading (sine of the error), then the height in m; at way-points also the cosine of the error, at least 0.

use nalgebra::Vector3;

use super::linear::{LinearRow, LinearRows};
use crate::nlp::Model;
use crate::scenario::Scenario;

/// Of the distance, what the plan keeps to itself for what happens between the samples.
const PASSING: f64 = 0.95;

/// The end of the motion.
pub fn goal(model: &Model, scenario: &Scenario) -> LinearRows {
    let goal = &scenario.goal;
    // The closure of a cyclic motion has the heading.
    let yaw = scenario.goal_yaw().filter(|_| model.cycle.is_none());
    let rows = pose(model, model.layout.intervals, goal.position, yaw, goal.height);
    LinearRows { name: "goal", rows }
}

/// The places that are passed on the way.
pub fn way_points(model: &Model) -> LinearRows {
    let mut rows = Vec::new();
    for visit in &model.visits {
        let stop = &visit.stop;
        if stop.time.is_some() {
            rows.extend(pose(model, visit.sample, stop.position, stop.yaw, stop.height));
            rows.extend(stop.yaw.map(|yaw| {
                // The opposite heading has the same sine.
                let mut row = LinearRow::at(visit.sample, [0.0, f64::INFINITY]);
                row.rotation.set_column(0, &Vector3::new(yaw.cos(), yaw.sin(), 0.0));
                row
            }));
            continue;
        }
        let half = PASSING * std::f64::consts::FRAC_1_SQRT_2 * visit.distance;
        rows.extend(stop.position.iter().enumerate().map(|(c, at)| {
            let mut row = LinearRow::at(visit.sample, [at - half, at + half]);
            row.position[c] = 1.0;
            row
        }));
    }
    LinearRows { name: "way-points", rows }
}

/// The rows of a pose at a sample.
fn pose(
    model: &Model,
    sample: usize,
    position: [f64; 2],
    yaw: Option<f64>,
    height: Option<f64>,
) -> Vec<LinearRow> {
    let mut rows: Vec<LinearRow> = (0..2)
        .map(|c| {
            let mut row = LinearRow::at(sample, [position[c]; 2]);
            row.position[c] = 1.0;
            row
        })
        .collect();
    rows.extend(yaw.map(|yaw| {
        // The horizontal normal of the heading, along which the base's x axis has no component.
        let mut row = LinearRow::at(sample, [0.0; 2]);
        row.rotation.set_column(0, &Vector3::new(-yaw.sin(), yaw.cos(), 0.0));
        row
    }));
    rows.extend(height.map(|height| height_row(model, sample, [height; 2])));
    rows
}

/// The height over the mean of the feet at a sample.
pub(super) fn height_row(model: &Model, sample: usize, range: [f64; 2]) -> LinearRow {
    let mut row = LinearRow::at(sample, range);
    row.position = Vector3::z();
    let fraction = 1.0 / model.feet() as f64;
    for foot in 0..model.feet() {
        for (stance, weight) in ground_under(model, foot, sample as f64) {
            row.footholds.push((foot, stance, Vector3::z() * (-weight * fraction)));
        }
    }
    row
}

/// The footholds between which a foot is at time `k` in samples, with their weights: the one it stands on, or those before and after its
/// swing according to the time.
fn ground_under(model: &Model, foot: usize, k: f64) -> Vec<(usize, f64)> {
    let swings = &model.layout.feet[foot].swings;
    let begun = swings.iter().filter(|s| s.swing.start < k).count();
    match begun.checked_sub(1).map(|j| (j, swings[j].swing)) {
        Some((j, swing)) if k < swing.end => {
            let u = (k - swing.start) / (swing.end - swing.start);
            vec![(j, 1.0 - u), (j + 1, u)]
        }
        _ => vec![(begun, 1.0)],
    }
}
