//! Fig. 4: the conformal error on the ground.

use super::super::case::CaseRow;
use super::style::{PAGE_TITLE, red_to_blue};
use crate::report::axes::{Axes, range};
use crate::report::number;
use crate::report::svg::{Font, Svg};

/// Bars of a histogram.
const BINS: usize = 30;
/// Colors; all points of one color are one element of the drawing.
const SHADES: usize = 32;
/// From the panels of one map to those of the next, pixels.
const ROW_HEIGHT: f64 = 460.0;
/// The scale of errors reaches at least this far, so that a perfect map can be drawn.
const MIN_SCALE: f64 = 1e-3;
/// Overlap of neighboring points, which hides the seams between them, pixels.
const OVERLAP: f64 = 1.5;

/// The error on the ground as seen from above and its histogram, one map below the other.
pub(super) fn errors(rows: &[&CaseRow]) -> String {
    let mut svg = Svg::new(1000.0, 60.0 + ROW_HEIGHT * rows.len() as f64);
    let title = "Conformal error 1 − σ_min/σ_max of the map on the ground";
    svg.text([70.0, 34.0], title, PAGE_TITLE);
    for (i, row) in rows.iter().enumerate() {
        let top = 100.0 + ROW_HEIGHT * i as f64;
        let name = format!("{} {}", row.case.terrain, row.case.level);
        match row.map() {
            Some(map) if !map.ground_errors.is_empty() => {
                let mean = 100.0 * map.report.conformal_ground.mean;
                from_above(&mut svg, &name, &map.ground_errors, top);
                histogram(&mut svg, mean, &map.ground_errors, top);
            }
            _ => svg.text([90.0, top], &format!("{name}: no map"), Font::LABEL.anchored("start")),
        }
    }
    svg.finish()
}

/// The largest error, at least [`MIN_SCALE`].
fn largest(errors: &[[f64; 3]]) -> f64 {
    errors.iter().map(|[_, _, error]| *error).fold(MIN_SCALE, f64::max)
}

fn from_above(svg: &mut Svg, name: &str, errors: &[[f64; 3]], top: f64) {
    let frame = [90.0, top, 340.0, 340.0];
    let axes = Axes::equal(
        frame,
        range(errors.iter().map(|e| e[0]), 0.02),
        range(errors.iter().map(|e| e[1]), 0.02),
    );
    let worst = largest(errors);
    let side = frame[2] / (errors.len() as f64).sqrt() + OVERLAP;
    svg.clipped(frame, |svg| {
        for (shade, points) in shades(errors, worst).iter().enumerate() {
            let color = red_to_blue(1.0 - (shade as f64 + 0.5) / SHADES as f64);
            let rects = points.iter().map(|point| {
                let [px, py] = axes.at(point[0], point[1]);
                [px - 0.5 * side, py - 0.5 * side, side, side]
            });
            svg.rects(rects, &format!("fill=\"{color}\""));
        }
    });
    let title = format!("{name}: blue 0, red {} %", number(100.0 * worst));
    axes.draw(svg, &title, "x, m", "y, m");
}

/// The points sorted into equal intervals of the error, from 0 to `worst`.
fn shades(errors: &[[f64; 3]], worst: f64) -> [Vec<[f64; 3]>; SHADES] {
    let mut shades = [const { Vec::new() }; SHADES];
    for point in errors {
        shades[((point[2] / worst * SHADES as f64) as usize).min(SHADES - 1)].push(*point);
    }
    shades
}

fn histogram(svg: &mut Svg, mean: f64, errors: &[[f64; 3]], top: f64) {
    let worst = 100.0 * largest(errors);
    let counts = counts(errors.iter().map(|e| 100.0 * e[2]), worst);
    let percent = |count: usize| 100.0 * count as f64 / errors.len() as f64;
    let highest = counts.iter().map(|&count| percent(count)).fold(1.0, f64::max);
    let axes = Axes::new([540.0, top, 420.0, 340.0], [0.0, worst], [0.0, 1.05 * highest]);
    let title = format!("mean {} % (the paper on its ripple: 7.8 %)", number(mean));
    axes.draw(svg, &title, "error, %", "points, %");
    let width = worst / BINS as f64;
    for (bin, &count) in counts.iter().enumerate() {
        let [left, y] = axes.at(width * bin as f64, percent(count));
        let [right, bottom] = axes.at(width * (bin + 1) as f64, 0.0);
        svg.rect(
            [left, y, right - left, bottom - y],
            "fill=\"#2166ac\" stroke=\"#fff\" stroke-width=\"0.6\"",
        );
    }
    let ends = [0.0, 1.05 * highest].map(|y| axes.at(mean, y));
    svg.line(ends[0], ends[1], "stroke=\"#c8352c\" stroke-width=\"1.6\"");
}

/// How many values lie in each of [`BINS`] equal intervals from 0 to `max`.
fn counts(values: impl Iterator<Item = f64>, max: f64) -> [usize; BINS] {
    let mut counts = [0; BINS];
    for value in values {
        counts[((value / max * BINS as f64) as usize).min(BINS - 1)] += 1;
    }
    counts
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn every_value_is_counted_once() {
        let counts = counts([0.0, 0.5, 1.0, 1.0].into_iter(), 1.0);
        assert_eq!((counts[0], counts[BINS / 2], counts[BINS - 1]), (1, 1, 2));
        assert_eq!(counts.iter().sum::<usize>(), 4);
        let shades = shades(&[[0.0, 0.0, 0.0], [1.0, 0.0, 0.3], [2.0, 0.0, 0.3]], 0.3);
        assert_eq!((shades[0].len(), shades[SHADES - 1].len()), (1, 2));
    }
}
