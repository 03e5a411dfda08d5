//! Figures over all headings: Fig. 8 and 9.

use super::super::sweep::Row;
use super::{blend, colour, distinct, motion, solved};
use crate::report::svg::{Font, Svg};

/// Of a plot, pixels.
const RADIUS: f64 = 190.0;
/// Of the square that a plot stands in.
const PANEL: f64 = 480.0;
const TOP: f64 = 90.0;
/// Violations from this (red) …
const WORST: f64 = 1.0;
/// … to this (blue), the tolerance.
const TOLERANCE: f64 = 1e-4;

/// A polar plot: angle 0 points up and grows clockwise, as the paper counts headings.
struct Polar {
    centre: [f64; 2],
    most: f64,
}

impl Polar {
    /// The panel in a column and row; `most` is the value at the rim.
    fn new(column: usize, row: usize, most: f64) -> Self {
        let at = |i: usize| PANEL * (i as f64 + 0.5);
        Self { centre: [at(column), TOP + at(row)], most }
    }

    fn at(&self, heading: f64, value: f64) -> [f64; 2] {
        let (sin, cos) = heading.to_radians().sin_cos();
        let radius = RADIUS * (value / self.most).clamp(0.0, 1.0);
        [self.centre[0] + radius * sin, self.centre[1] - radius * cos]
    }

    /// What lies below the data.
    fn grid(&self, svg: &mut Svg, title: &str) {
        let faint = "fill=\"none\" stroke=\"#000\" stroke-opacity=\"0.15\"";
        for i in 1..=4 {
            svg.circle(self.centre, RADIUS * f64::from(i) / 4.0, faint);
        }
        for heading in (0..360).step_by(45) {
            let rim = self.at(heading.into(), self.most);
            svg.line(self.centre, rim, "stroke=\"#000\" stroke-opacity=\"0.1\"");
            let [x, y] = [0, 1].map(|d| self.centre[d] + 1.1 * (rim[d] - self.centre[d]));
            svg.text([x, y + 4.0], &format!("{heading}°"), Font::TICK);
        }
        let [x, y] = self.centre;
        svg.text([x - RADIUS, y - RADIUS - 32.0], title, Font::TITLE);
    }

    /// What lies above it: the values at the rings.
    fn rings(&self, svg: &mut Svg, unit: &str) {
        for i in 1..=4 {
            let value = self.most * f64::from(i) / 4.0;
            let [x, y] = self.at(22.5, value);
            svg.label([x, y + 4.0], &format!("{value}{unit}"), Font::TICK);
        }
    }

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
    let mut svg = Svg::new(PANEL * columns as f64, TOP + PANEL * rows as f64);
    svg.text([40.0, 34.0], title, Font { size: 17.0, ..Font::TITLE });
    svg
}

/// Fig. 8: the radius is the iteration, the colour the largest violation there.
pub(super) fn histories(rows: &[&Row]) -> String {
    let terrains = distinct(rows.iter().map(|row| row.case.terrain.as_str()));
    let methods = distinct(rows.iter().map(|row| row.case.method.as_str()));
    let longest = rows.iter().filter_map(|row| Some(motion(row)?.history.len())).max().unwrap_or(1);
    let most = longest.next_multiple_of(4) as f64;
    let mut svg =
        page(methods.len(), terrains.len(), "Largest violation (colour) by iteration (radius) and heading");
    svg.text([40.0, 60.0], "1", Font::TICK.anchored("start"));
    for i in 0..100 {
        let x = 55.0 + 2.0 * f64::from(i);
        svg.rect([x, 50.0, 2.5, 12.0], &format!("fill=\"{}\"", blend(f64::from(i) / 99.0)));
    }
    svg.text([263.0, 60.0], "1e-4: solved; red cross: not solved", Font::TICK.anchored("start"));
    for (r, terrain) in terrains.iter().enumerate() {
        for (c, method) in methods.iter().enumerate() {
            let plot = Polar::new(c, r, most);
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

fn history(svg: &mut Svg, plot: &Polar, row: &Row) {
    let heading = row.case.heading.unwrap_or(0.0);
    let violations = motion(row).map_or(&[][..], |motion| &motion.history);
    for (i, violation) in violations.iter().enumerate() {
        let share = (violation.max(1e-12) / WORST).log10() / (TOLERANCE / WORST).log10();
        let ends = [i as f64, i as f64 + 1.0].map(|iteration| plot.at(heading, iteration));
        svg.line(ends[0], ends[1], &format!("stroke=\"{}\" stroke-width=\"6\"", blend(share)));
    }
    if !solved(row) {
        let end = if violations.is_empty() { plot.most } else { violations.len() as f64 };
        plot.cross(svg, heading, end);
    }
}

/// Fig. 9: the radius is the processor time of guess and NLP.
pub(super) fn times(rows: &[&Row]) -> String {
    let terrains = distinct(rows.iter().map(|row| row.case.terrain.as_str()));
    let methods = distinct(rows.iter().map(|row| row.case.method.as_str()));
    let seconds = |row: &Row| row.outcome.as_ref().ok().map(|measured| measured.cpu.solve);
    let most = rows.iter().filter_map(|row| seconds(row)).fold(0.0, f64::max).ceil().max(1.0);
    let mut svg =
        page(terrains.len().max(2), 1, "Processor time of a motion of 10 s by heading, s; map apart");
    let styles: Vec<String> =
        methods.iter().map(|m| format!("stroke=\"{}\" stroke-width=\"2\"", colour(m))).collect();
    let names: Vec<(&str, &str)> = methods.iter().copied().zip(styles.iter().map(String::as_str)).collect();
    super::legend(&mut svg, [40.0, 62.0], &names);
    for (column, terrain) in terrains.iter().enumerate() {
        let plot = Polar::new(column, 0, most);
        plot.grid(&mut svg, terrain);
        for (method, style) in &names {
            let here: Vec<&&Row> = rows
                .iter()
                .filter(|row| row.case.terrain == *terrain && row.case.method == *method)
                .collect();
            let heading = |row: &Row| row.case.heading.unwrap_or(0.0);
            let points: Vec<[f64; 2]> =
                here.iter().filter_map(|row| Some(plot.at(heading(row), seconds(row)?))).collect();
            svg.polyline(points.iter().copied().chain(points.first().copied()), style);
            points.iter().for_each(|&point| svg.circle(point, 3.0, &format!("fill=\"{}\"", colour(method))));
            for row in here.iter().filter(|row| !solved(row)) {
                plot.cross(&mut svg, heading(row), seconds(row).unwrap_or(most));
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
        let plot = Polar { centre: [0.0, 0.0], most: 2.0 };
        for (heading, [x, y]) in [(0.0, [0.0, -1.0]), (90.0, [1.0, 0.0]), (180.0, [0.0, 1.0])] {
            let at = plot.at(heading, 1.0).map(|v| v / (0.5 * RADIUS));
            assert!((at[0] - x).abs() < 1e-12 && (at[1] - y).abs() < 1e-12, "{heading}: {at:?}");
        }
        // Values beyond the rim are drawn on it.
        assert_eq!(plot.at(0.0, 5.0)[1], -RADIUS);
    }
}
