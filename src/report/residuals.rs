//! The residuals of a check, drawn over time.

use super::axes::{Axes, range};
use super::svg::{Font, Svg};
use super::table::check_counts;
use crate::check::CheckReport;
use crate::plan::Plan;
use crate::scenario;

/// Frame of a panel, pixels.
const PANEL: [f64; 2] = [905.0, 150.0];
/// From the top of one panel to the top of the next, pixels.
const PANEL_STEP: f64 = 196.0;

/// An SVG drawing with one panel per law; limits are dashed.
pub fn residuals(plan: &Plan, report: &CheckReport) -> String {
    let r = &report.residuals;
    let limit = |name: &str| report.rows.iter().find(|row| row.name == name).map(|row| row.limit);
    let clearance =
        scenario::parse("meta.scenario", &plan.meta.scenario).ok().map(|s| 1e3 * s.motion.base_clearance);
    let panels = [
        ("Newton's law", "% of m g", &r.newton, limit("newton_max")),
        ("Euler's law", "% of m g · 0.3 m", &r.euler, limit("euler_max")),
        ("Distance of standing feet from the ground", "mm", &r.stance_gap, limit("stance_gap")),
        ("Force outside the friction cone", "% of m g", &r.friction, limit("friction")),
        ("Foot outside its reach box", "mm", &r.reach, limit("reach")),
        ("Clearance of the torso's underside (lower limit)", "mm", &r.clearance, clearance),
    ];
    let mut svg = Svg::new(PANEL[0] + 95.0, 70.0 + (PANEL_STEP + 4.0) * panels.len() as f64);
    let title = format!("Check of {}: {}", plan.meta.robot.name, check_counts(&report.rows));
    svg.text([70.0, 28.0], &title, Font { size: 18.0, ..Font::TITLE });
    let time = [r.t.first().copied().unwrap_or(0.0), r.t.last().copied().unwrap_or(1.0)];
    let last = panels.len() - 1;
    for (i, (title, unit, values, limit)) in panels.into_iter().enumerate() {
        let frame = [70.0, 66.0 + PANEL_STEP * i as f64, PANEL[0], PANEL[1]];
        let [low, high] = range(values.iter().copied().chain(limit), 0.06);
        // Residuals are never negative; a scale that starts at zero shows how large they are.
        let axes = Axes::new(frame, time, [low.min(0.0), high.max(1e-3)]);
        axes.draw(&mut svg, title, if i == last { "time, s" } else { "" }, unit);
        svg.clipped(axes.frame, |svg| {
            let points = r.t.iter().zip(values).map(|(t, v)| axes.at(*t, *v));
            svg.polyline(points, "stroke=\"#2166ac\" stroke-width=\"1.4\"");
            if let Some(limit) = limit {
                let ends = time.map(|t| axes.at(t, limit));
                svg.line(
                    ends[0],
                    ends[1],
                    "stroke=\"#c8352c\" stroke-width=\"1.3\" stroke-dasharray=\"6 4\"",
                );
            }
        });
    }
    svg.finish()
}
