//! The residuals of a check over time.

use super::axes::{Axes, range};
use super::svg::{Font, Svg};
use crate::check::CheckReport;
use crate::plan::Plan;
use crate::scenario;

/// An SVG drawing: one panel a law, the limit dashed.
pub fn residuals(plan: &Plan, report: &CheckReport) -> String {
    let r = &report.residuals;
    let limit = |name: &str| report.rows.iter().find(|row| row.name == name).map(|row| row.limit);
    let clearance =
        scenario::parse("meta.scenario", &plan.meta.scenario).ok().map(|s| 1e3 * s.motion.base_clearance);
    let panels = [
        ("Newton's law", "% of m g", &r.newton, limit("newton_max")),
        ("Euler's law", "% of m g · 0.3 m", &r.euler, limit("euler_max")),
        ("Standing foot to ground", "mm", &r.stance_gap, limit("stance_gap")),
        ("Beyond the friction cone", "% of m g", &r.friction, limit("friction")),
        ("Beyond the reach box", "mm", &r.reach, limit("reach")),
        ("Torso's underside over ground (at least)", "mm", &r.clearance, clearance),
    ];
    let (width, height) = (1000.0, 150.0);
    let mut svg = Svg::new(width, 70.0 + (height + 50.0) * panels.len() as f64);
    let failed = report.rows.iter().filter(|row| !row.passed).count();
    let verdict = match failed {
        0 => format!("all {} checks hold", report.rows.len()),
        n => format!("{n} of {} checks fail", report.rows.len()),
    };
    svg.text(
        [70.0, 28.0],
        &format!("Check residuals, {}: {verdict}", plan.meta.robot.name),
        Font { size: 18.0, ..Font::TITLE },
    );
    let time = [r.t.first().copied().unwrap_or(0.0), r.t.last().copied().unwrap_or(1.0)];
    let last = panels.len() - 1;
    for (i, (title, unit, values, limit)) in panels.into_iter().enumerate() {
        let top = 66.0 + (height + 46.0) * i as f64;
        let [low, high] = range(values.iter().copied().chain(limit), 0.06);
        // Residuals are never negative, and a scale that starts at zero shows their size.
        let axes = Axes::new([70.0, top, width - 95.0, height], time, [low.min(0.0), high.max(1e-3)]);
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
