//! What the drawings share: colors, legends, and the order of curves.

use super::super::protocol::{FORMULATIONS, TWO_THREADS};
use crate::report::color::ramp;
use crate::report::svg::{Font, Svg};

/// Stroke style of a dashed line.
pub(super) const DASHED: &str = "stroke-dasharray=\"6 4\"";
/// Stroke style of lines that belong to no formulation.
pub(super) const GRAY: &str = "stroke=\"#555\"";
/// Font of a page's title.
pub(super) const PAGE_TITLE: Font = Font { size: 17.0, ..Font::TITLE };

/// Blue for the warped formulation, red for the direct and green for the hybrid one, paler with two threads.
pub(super) fn color(method: &str) -> &'static str {
    const COLORS: [[&str; 2]; 3] = [["#2166ac", "#92c5de"], ["#c8352c", "#f4a582"], ["#1b7837", "#a6dba0"]];
    let formulation = FORMULATIONS.iter().position(|name| method.starts_with(name)).unwrap_or(1);
    COLORS[formulation][usize::from(method.ends_with(TWO_THREADS))]
}

/// Stroke style of a method's curve.
pub(super) fn stroke(method: &str) -> String {
    format!("stroke=\"{}\" stroke-width=\"2\"", color(method))
}

/// A color between dark red (0), yellow (1/2) and blue (1).
pub(super) fn red_to_blue(fraction: f64) -> String {
    const STOPS: [[f64; 3]; 3] = [[150.0, 20.0, 30.0], [245.0, 200.0, 70.0], [30.0, 95.0, 170.0]];
    ramp(&STOPS, fraction)
}

/// Names of curves, from left to right, each with the style of its line.
pub(super) fn legend(svg: &mut Svg, [mut x, y]: [f64; 2], curves: &[(&str, String)]) {
    const LINE: f64 = 26.0;
    const GAP: f64 = 6.0;
    const CHARACTER: f64 = 7.0;
    for (name, style) in curves {
        svg.line([x, y - 4.0], [x + LINE, y - 4.0], style);
        svg.text([x + LINE + GAP, y], name, Font::TICK.anchored("start"));
        x += LINE + 4.0 * GAP + CHARACTER * name.chars().count() as f64;
    }
}

/// Each value once, in the order of first occurrence.
pub(super) fn distinct<'a>(values: impl Iterator<Item = &'a str>) -> Vec<&'a str> {
    let mut seen: Vec<&str> = Vec::new();
    for value in values {
        if !seen.contains(&value) {
            seen.push(value);
        }
    }
    seen
}
