//! Bar charts: Table I, replays, maps.

use super::super::protocol::{FORMULATIONS, MIPS};
use super::super::summary::Group;
use super::style::color;
use crate::report::svg::{Font, Svg};

/// Opacity of the pale part of a bar.
const PALE: f64 = 0.35;
/// From one bar to the next, pixels.
const STEP: f64 = 34.0;
/// Width of a bar, pixels.
const WIDTH: f64 = 24.0;
/// Height of the chart, pixels.
const HEIGHT: f64 = 260.0;
/// Left edge of the chart, pixels.
const LEFT: f64 = 190.0;
/// Bottom edge of the chart, pixels.
const BOTTOM: f64 = 320.0;
/// Angle of the labels below the bars, degrees.
const LABEL_ANGLE: f64 = -60.0;
/// The scale of conformal errors reaches at least this far, %.
const MIN_ERROR_SCALE: f64 = 5.0;

/// A bar: its label, its color, and heights with their opacities, drawn on top of each other.
struct Bar<'a> {
    label: String,
    color: &'a str,
    heights: Vec<(f64, f64)>,
}

/// Percentages of motions that are solved, and that are solved and checked.
pub(super) fn rates(groups: &[Group]) -> String {
    let bar = |group: &Group| Bar {
        label: label(group),
        color: color(&group.method),
        heights: vec![(percent(group, group.solved), PALE), (percent(group, group.passed), 1.0)],
    };
    let all: Vec<Bar> = groups.iter().map(bar).collect();
    bars("Motions found, %: pale solved, full solved and checked", &all, 100.0)
}

/// Percentages of replays that are at least marginal, and that pass.
pub(super) fn replays(groups: &[Group]) -> String {
    let bar = |group: &Group| {
        let [pass, marginal, _] = group.replayed;
        Bar {
            label: format!("{} {}", group.robot, label(group)),
            color: color(&group.method),
            heights: vec![(percent(group, pass + marginal), PALE), (percent(group, pass), 1.0)],
        }
    };
    let all: Vec<Bar> = groups.iter().map(bar).collect();
    bars("Plans that the robot walks, %: full pass, pale marginal", &all, 100.0)
}

/// Mean conformal errors of maps on the ground.
pub(super) fn conformal_errors(groups: &[Group]) -> String {
    let bar = |group: &Group| Bar {
        label: label(group),
        // The default method stands out.
        color: color(if group.method == MIPS.0 { FORMULATIONS[0] } else { FORMULATIONS[1] }),
        heights: vec![(group.conformal_error.unwrap_or(0.0), 1.0)],
    };
    let all: Vec<Bar> = groups.iter().map(bar).collect();
    let max = all.iter().map(|bar| bar.heights[0].0).fold(MIN_ERROR_SCALE, f64::max);
    bars("Mean conformal error of the map on the ground, % (no bar: no map)", &all, max)
}

fn label(group: &Group) -> String {
    format!("{} {} {}", group.terrain, group.level, group.method)
}

fn percent(group: &Group, count: usize) -> f64 {
    100.0 * count as f64 / group.cases as f64
}

/// Draws bars over a scale from 0 to `max`.
fn bars(title: &str, all: &[Bar], max: f64) -> String {
    let width = STEP * all.len() as f64;
    let mut svg = Svg::new((LEFT + width + 40.0).max(640.0), BOTTOM + 190.0);
    svg.text([60.0, 30.0], title, Font::TITLE);
    for fraction in [0.0, 0.25, 0.5, 0.75, 1.0] {
        let y = BOTTOM - HEIGHT * fraction;
        svg.line([LEFT, y], [LEFT + width, y], "stroke=\"#000\" stroke-opacity=\"0.12\"");
        svg.text([LEFT - 6.0, y + 4.0], &format!("{:.1}", fraction * max), Font::TICK.anchored("end"));
    }
    for (i, bar) in all.iter().enumerate() {
        let x = LEFT + 0.5 * (STEP - WIDTH) + STEP * i as f64;
        for (value, opacity) in &bar.heights {
            let height = HEIGHT * value / max;
            let style = format!("fill=\"{}\" fill-opacity=\"{opacity}\"", bar.color);
            svg.rect([x, BOTTOM - height, WIDTH, height], &style);
        }
        svg.rotated_text([x + 16.0, BOTTOM + 12.0], &bar.label, Font::TICK.anchored("end"), LABEL_ANGLE);
    }
    svg.finish()
}
