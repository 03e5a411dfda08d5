//! Figures with curves: violation by iteration (Fig. 11), and speed.

use super::super::case::CaseRow;
use super::super::measured::MotionMeasured;
use super::super::protocol::{FORMULATIONS, TOLERANCE, TWO_THREADS};
use super::style::{DASHED, GRAY, PAGE_TITLE, color, distinct, legend, stroke};
use crate::report::axes::{Axes, range};
use crate::report::svg::Svg;

/// Fig. 11: the largest violation by iteration, one curve per row.
pub(super) fn histories(rows: &[&CaseRow]) -> String {
    let frame = [80.0, 90.0, 650.0, 310.0];
    let mut svg = Svg::new(760.0, 460.0);
    svg.text([70.0, 34.0], "Largest violation by iteration, a climb to the top of the hill", PAGE_TITLE);
    let violations = rows.iter().filter_map(|row| row.motion()).flat_map(|motion| motion.history.clone());
    let values: Vec<f64> = violations.chain([TOLERANCE]).collect();
    let longest = rows.iter().filter_map(|row| Some(row.motion()?.history.len())).max().unwrap_or(2);
    let axes = Axes::logarithmic(frame, [0.0, longest.saturating_sub(1).max(1) as f64], &values);
    axes.draw(&mut svg, "", "iteration", "units of the NLP");
    let tolerance = format!("{GRAY} {DASHED}");
    svg.clipped(frame, |svg| {
        let [left, right] = axes.x.map(|x| axes.at(x, TOLERANCE));
        svg.line(left, right, &tolerance);
        for row in rows {
            let history = row.motion().map_or(&[][..], |motion| &motion.history);
            let points = history.iter().enumerate().map(|(i, v)| axes.at(i as f64, *v));
            svg.polyline(points, &stroke(&row.case.method));
        }
    });
    let methods = rows.iter().map(|row| (row.case.method.as_str(), stroke(&row.case.method)));
    let names: Vec<(&str, String)> = methods.chain([("tolerance", tolerance)]).collect();
    legend(&mut svg, [80.0, 64.0], &names);
    svg.finish()
}

/// Cost against the length of the motion.
pub(super) fn speed(rows: &[&CaseRow]) -> String {
    let mut svg = Svg::new(1240.0, 480.0);
    svg.text([70.0, 34.0], "Cost against the length of the motion", PAGE_TITLE);
    let methods = FORMULATIONS.map(|name| [name.to_owned(), format!("{name}{TWO_THREADS}")]).concat();
    let names: Vec<(&str, String)> = methods.iter().map(|method| (method.as_str(), stroke(method))).collect();
    legend(&mut svg, [70.0, 62.0], &names);
    let per_iteration =
        |seconds: f64, motion: &MotionMeasured| 1e3 * seconds / motion.iterations.max(1) as f64;
    let cpu = |row: &CaseRow| row.measured().map(|measured| measured.cpu.solve);
    let linear = |row: &CaseRow| row.motion().map(|m| per_iteration(m.seconds.linear_solver, m));
    let evaluation = |row: &CaseRow| row.motion().map(|m| per_iteration(m.seconds.evaluation, m));
    let left = [90.0, 110.0, 500.0, 300.0];
    panel(&mut svg, rows, left, ["guess and NLP", "processor time, s"], &[(&cpu, "")]);
    let right = [690.0, 110.0, 500.0, 300.0];
    let parts: [Curve; 2] = [(&linear, ""), (&evaluation, DASHED)];
    let labels = ["per iteration: linear solver (solid), evaluation (dashed)", "wall time, ms"];
    panel(&mut svg, rows, right, labels, &parts);
    svg.finish()
}

/// A value of a row, and the dashes of its line.
type Curve<'a> = (&'a dyn Fn(&CaseRow) -> Option<f64>, &'a str);

/// Values of the rows over the horizon, one line per method and curve.
fn panel(svg: &mut Svg, rows: &[&CaseRow], frame: [f64; 4], [title, unit]: [&str; 2], curves: &[Curve]) {
    let horizon = |row: &CaseRow| row.case.parameter.map_or(0.0, |(_, value)| value);
    let values = curves.iter().flat_map(|(value, _)| rows.iter().filter_map(|row| value(row)));
    let [_, highest] = range(values.chain([0.0]), 0.05);
    let [_, longest] = range(rows.iter().map(|row| horizon(row)), 0.05);
    let axes = Axes::new(frame, [0.0, longest], [0.0, highest]);
    axes.draw(svg, title, "horizon, s", unit);
    for method in distinct(rows.iter().map(|row| row.case.method.as_str())) {
        for (value, dashes) in curves {
            let of_method = rows.iter().filter(|row| row.case.method == method);
            let points: Vec<[f64; 2]> =
                of_method.filter_map(|row| Some(axes.at(horizon(row), value(row)?))).collect();
            svg.polyline(points.iter().copied(), &format!("{} {dashes}", stroke(method)));
            points.iter().for_each(|&at| svg.circle(at, 3.5, &format!("fill=\"{}\"", color(method))));
        }
    }
}
