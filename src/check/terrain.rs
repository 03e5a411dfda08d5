//! The ground of the plan against that of the scenario, where the scenario describes it without a file, and against the heights
//! that were measured.

use super::laws;
use super::subject::{Finding, Subject, Worst, larger};
use crate::heightfield::Heightfield;
use crate::robot::size_of;
use crate::scenario::{Footholds, TerrainSpec};
use crate::{Error, Result, terrain};

/// The kernel of the smoothing is cut off at this many standard deviations.
const KERNEL: f64 = 3.0;
/// Spacing of the cells of a file, m, where only the file tells it.
const UNKNOWN_SPACING: f64 = 0.25;
/// A plane fitted under a kernel may leave the range of the heights below it by this fraction of that range.
const OVERSHOOT: f64 = 0.25;

pub(super) fn findings(s: &Subject, findings: &mut Vec<Finding>) -> Result<()> {
    match &s.scenario.terrain {
        TerrainSpec::Heightmap(spec) => {
            let footholds = s.scenario.footholds();
            let size = s.plan.meta.robot.standing_height().map_or(1.0, size_of);
            // The plan's grid may be finer than that of the file.
            let spacing = spec.spacing.unwrap_or(UNKNOWN_SPACING).max(s.plan.ground.spacing[0]);
            let reach = match footholds {
                Footholds::Patches => KERNEL * spec.smoothing(footholds, spacing, size),
                // A spline through the smoothed cells.
                Footholds::Anywhere => KERNEL * spec.smoothing(footholds, spacing, size) + spacing,
            };
            if let Some(raw) = &s.plan.ground.raw {
                findings.push((laws::SMOOTHING, Worst::overall(1e3 * beyond_raw(s, raw, reach))));
            }
        }
        spec => {
            let refuse = |e: Error| Error::input(format!("meta.scenario: {e}"));
            if let Some(field) = terrain::function_field(spec).map_err(refuse)? {
                findings.push((laws::TERRAIN, Worst::overall(1e3 * off_function(s, &field))));
            }
        }
    }
    Ok(())
}

/// Largest difference of the plan's heights and extent from those of the scenario's terrain, m.
fn off_function(s: &Subject, field: &Heightfield) -> f64 {
    let (plan, grid) = (&s.plan.ground, field.grid());
    let extent = s.ground.extent().iter().zip(field.extent()).fold(0.0, |m, (a, b)| larger(m, (a - b).abs()));
    let same_grid = (plan.rows, plan.columns) == (grid.rows, grid.columns);
    let heights = plan.height.iter().enumerate().map(|(i, h)| {
        let expected = if same_grid {
            field.samples()[i]
        } else {
            let [x, y] = [0, 1].map(|axis| {
                let at = if axis == 0 { i % plan.columns } else { i / plan.columns };
                plan.origin[axis] + plan.spacing[axis] * at as f64
            });
            field.height(x, y)
        };
        (h - expected).abs()
    });
    heights.fold(extent, larger)
}

/// By how much the smoothed heights leave the range of the raw ones around, up to `length` away, m.
fn beyond_raw(s: &Subject, raw: &[f64], length: f64) -> f64 {
    let ground = &s.plan.ground;
    let most = ground.rows.max(ground.columns) as f64;
    let reach = ground.spacing.map(|spacing| (length / spacing).ceil().min(most) as usize);
    let highest = |values: &[f64]| {
        let rows = extreme(values, ground.columns, reach[0]);
        transposed(&extreme(&transposed(&rows, ground.columns), ground.rows, reach[1]), ground.rows)
    };
    let high = highest(raw);
    let low = highest(&raw.iter().map(|h| -h).collect::<Vec<_>>());
    ground.height.iter().zip(high.iter().zip(&low)).fold(0.0, |worst, (h, (high, low))| {
        let slack = OVERSHOOT * (high + low);
        larger(worst, larger(h - high, -low - h) - slack)
    })
}

/// The largest of the values up to `reach` before and after each, within rows of `length`.
fn extreme(values: &[f64], length: usize, reach: usize) -> Vec<f64> {
    values
        .chunks(length)
        .flat_map(|row| {
            (0..length).map(move |i| {
                let window = &row[i.saturating_sub(reach)..(i + reach + 1).min(length)];
                window.iter().copied().fold(f64::NEG_INFINITY, larger)
            })
        })
        .collect()
}

fn transposed(values: &[f64], columns: usize) -> Vec<f64> {
    let rows = values.len() / columns;
    (0..values.len()).map(|i| values[(i % rows) * columns + i / rows]).collect()
}
