//! Figures over all headings: Fig. 8 and Fig. 9.

use super::super::case::CaseRow;
use super::super::protocol::TOLERANCE;
use super::style::{PAGE_TITLE, color, distinct, legend, red_to_blue, stroke};
use crate::report::svg::{Font, Svg};

/// Radius of a plot, pixels.
const PLOT_RADIUS: f64 = 190.0;
/// Side of the square around a plot, pixels.
const SQUARE: f64 = 480.0;
/// Height of the title above the plots, pixels.
const TOP: f64 = 90.0;
/// Circles of the grid.
const RINGS: u32 = 4;
/// The violation drawn in red; the tolerance is drawn in blue.
const WORST: f64 = 1.0;
/// Smallest violation whose logarithm is taken.
const LEAST: f64 = 1e-12;

/// A polar plot: angle 0 points up and grows clockwise, as headings are counted in the paper.
struct Polar {
    center: [f64; 2],
    max: f64,
}

impl Polar {
    /// The plot in a column and row of the page; `max` is the value at the rim.
    fn new(column: usize, row: usize, max: f64) -> Self {
        let at = |i: usize| SQUARE * (i as f64 + 0.5);
        Self { center: [at(column), TOP + at(row)], max }
    }

    /// From heading, degrees, and value to pixels; values beyond the rim lie on it.
    fn at(&self, heading: f64, value: f64) -> [f64; 2] {
        let (sin, cos) = heading.to_radians().sin_cos();
        let radius = PLOT_RADIUS * (value / self.max).clamp(0.0, 1.0);
        [self.center[0] + radius * sin, self.center[1] - radius * cos]
    }

    /// Draws circles, headings and title, below the data.
    fn grid(&self, svg: &mut Svg, title: &str) {
        let faint = "fill=\"none\" stroke=\"#000\" stroke-opacity=\"0.15\"";
        for i in 1..=RINGS {
            svg.circle(self.center, PLOT_RADIUS * f64::from(i) / f64::from(RINGS), faint);
        }
        for heading in (0..360).step_by(45) {
            let rim = self.at(heading.into(), self.max);
            svg.line(self.center, rim, "stroke=\"#000\" stroke-opacity=\"0.1\"");
            let [x, y] = [0, 1].map(|d| self.center[d] + 1.1 * (rim[d] - self.center[d]));
            svg.text([x, y + 4.0], &format!("{heading}°"), Font::TICK);
        }
        let [x, y] = self.center;
        svg.text([x - PLOT_RADIUS, y - PLOT_RADIUS - 32.0], title, Font::TITLE);
    }

    /// Draws the values of the circles, above the data.
    fn rings(&self, svg: &mut Svg, unit: &str) {
        for i in 1..=RINGS {
            let value = self.max * f64::from(i) / f64::from(RINGS);
            let [x, y] = self.at(22.5, value);
            svg.label([x, y + 4.0], &format!("{value}{unit}"), Font::TICK);
        }
    }

    /// Marks a case that is not solved.
    fn cross(&self, svg: &mut Svg, heading: f64, value: f64) {
        let [x, y] = self.at(heading, value);
        for side in [-1.0, 1.0] {
            svg.line(
                [x - 5.0, y - 5.0 * side],
                [x + 5.0, y + 5.0 * side],
                "stroke=\"#c8352c\" stroke-width=\"2.5\"",
            );
        }
    }
}

/// A page of polar plots.
fn page(columns: usize, rows: usize, title: &str) -> Svg {
    let mut svg = Svg::new(SQUARE * columns as f64, TOP + SQUARE * rows as f64);
    svg.text([40.0, 34.0], title, PAGE_TITLE);
    svg
}

/// Fig. 8: the radius is the iteration, the color its largest violation.
pub(super) fn histories(rows: &[&CaseRow]) -> String {
    let terrains = distinct(rows.iter().map(|row| row.case.terrain.as_str()));
    let methods = distinct(rows.iter().map(|row| row.case.method.as_str()));
    let longest = rows.iter().filter_map(|row| Some(row.motion()?.history.len())).max().unwrap_or(1);
    let max = longest.next_multiple_of(RINGS as usize) as f64;
    let mut svg =
        page(methods.len(), terrains.len(), "Largest violation (color) by iteration (radius) and heading");
    color_scale(&mut svg);
    for (r, terrain) in terrains.iter().enumerate() {
        for (c, method) in methods.iter().enumerate() {
            let plot = Polar::new(c, r, max);
            plot.grid(&mut svg, &format!("{terrain}, {method}"));
            let here = rows.iter().filter(|row| row.case.terrain == *terrain && row.case.method == *method);
            for row in here {
                history(&mut svg, &plot, row);
            }
            plot.rings(&mut svg, "");
        }
    }
    svg.finish()
}

/// The colors of violations, from [`WORST`] to [`TOLERANCE`].
fn color_scale(svg: &mut Svg) {
    const STEPS: u32 = 100;
    svg.text([40.0, 60.0], &WORST.to_string(), Font::TICK.anchored("start"));
    for i in 0..STEPS {
        let fill = red_to_blue(f64::from(i) / f64::from(STEPS - 1));
        svg.rect([55.0 + 2.0 * f64::from(i), 50.0, 2.5, 12.0], &format!("fill=\"{fill}\""));
    }
    let text = format!("{TOLERANCE:e}: solved; red cross: not solved");
    svg.text([263.0, 60.0], &text, Font::TICK.anchored("start"));
}

/// One case: a ray from the center, colored by the violation at each iteration.
fn history(svg: &mut Svg, plot: &Polar, row: &CaseRow) {
    let heading = row.case.heading.unwrap_or(0.0);
    let violations = row.motion().map_or(&[][..], |motion| &motion.history);
    for (i, violation) in violations.iter().enumerate() {
        let fraction = (violation.max(LEAST) / WORST).log10() / (TOLERANCE / WORST).log10();
        let ends = [i as f64, i as f64 + 1.0].map(|iteration| plot.at(heading, iteration));
        svg.line(ends[0], ends[1], &format!("stroke=\"{}\" stroke-width=\"6\"", red_to_blue(fraction)));
    }
    if !row.is_solved() {
        let end = if violations.is_empty() { plot.max } else { violations.len() as f64 };
        plot.cross(svg, heading, end);
    }
}

/// Fig. 9: the radius is the processor time of guess and NLP, s.
pub(super) fn times(rows: &[&CaseRow]) -> String {
    let terrains = distinct(rows.iter().map(|row| row.case.terrain.as_str()));
    let methods = distinct(rows.iter().map(|row| row.case.method.as_str()));
    let seconds = |row: &CaseRow| row.measured().map(|measured| measured.cpu.solve);
    let max = rows.iter().filter_map(|row| seconds(row)).fold(0.0, f64::max).ceil().max(1.0);
    let mut svg =
        page(terrains.len().max(2), 1, "Processor time for a motion of 10 s by heading, s, without the map");
    let names: Vec<(&str, String)> = methods.iter().map(|method| (*method, stroke(method))).collect();
    legend(&mut svg, [40.0, 62.0], &names);
    for (column, terrain) in terrains.iter().enumerate() {
        let plot = Polar::new(column, 0, max);
        plot.grid(&mut svg, terrain);
        for (method, style) in &names {
            let here: Vec<&&CaseRow> = rows
                .iter()
                .filter(|row| row.case.terrain == *terrain && row.case.method == *method)
                .collect();
            let heading = |row: &CaseRow| row.case.heading.unwrap_or(0.0);
            let points: Vec<[f64; 2]> =
                here.iter().filter_map(|row| Some(plot.at(heading(row), seconds(row)?))).collect();
            svg.polyline(points.iter().copied().chain(points.first().copied()), style);
            points.iter().for_each(|&point| svg.circle(point, 3.0, &format!("fill=\"{}\"", color(method))));
            for row in here.iter().filter(|row| !row.is_solved()) {
                plot.cross(&mut svg, heading(row), seconds(row).unwrap_or(max));
            }
        }
        plot.rings(&mut svg, " s");
    }
    svg.finish()
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn headings_turn_clockwise_from_the_top() {
        let plot = Polar { center: [0.0, 0.0], max: 2.0 };
        for (heading, [x, y]) in [(0.0, [0.0, -1.0]), (90.0, [1.0, 0.0]), (180.0, [0.0, 1.0])] {
            let at = plot.at(heading, 1.0).map(|v| v / (0.5 * PLOT_RADIUS));
            assert!((at[0] - x).abs() < 1e-12 && (at[1] - y).abs() < 1e-12, "{heading}: {at:?}");
        }
        // Values beyond the rim are drawn on it.
        assert_eq!(plot.at(0.0, 5.0)[1], -PLOT_RADIUS);
    }
}
