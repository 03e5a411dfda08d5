//! Figures with curves: Fig. 11, the frontier, speed.

use super::super::case::MotionMeasured;
use super::super::summary::Group;
use super::super::sweep::Row;
use super::{colour, distinct, legend, motion};
use crate::report::axes::{Axes, range};
use crate::report::svg::{Font, Svg};

const DASHED: &str = "stroke-dasharray=\"6 4\"";

fn style(method: &str, more: &str) -> String {
    format!("stroke=\"{}\" stroke-width=\"2\" {more}", colour(method))
}

fn heading(svg: &mut Svg, title: &str) {
    svg.text([70.0, 34.0], title, Font { size: 17.0, ..Font::TITLE });
}

/// Fig. 11: the largest violation by iteration of each row.
pub(super) fn histories(rows: &[&Row]) -> String {
    let mut svg = Svg::new(760.0, 460.0);
    heading(&mut svg, "Largest violation by iteration, a climb to the top of the hill");
    let all: Vec<f64> = rows.iter().filter_map(|row| motion(row)).flat_map(|m| m.history.clone()).collect();
    let longest = rows.iter().filter_map(|row| Some(motion(row)?.history.len())).max().unwrap_or(2);
    let frame = [80.0, 90.0, 650.0, 310.0];
    let axes = Axes::logarithmic(frame, [0.0, longest.saturating_sub(1).max(1) as f64], &all);
    axes.draw(&mut svg, "", "iteration", "units of the NLP");
    let floor = 10f64.powf(axes.y[0]);
    svg.clipped(frame, |svg| {
        let ends = axes.x.map(|x| axes.at(x, 1e-4));
        svg.line(ends[0], ends[1], &format!("stroke=\"#555\" {DASHED}"));
        for row in rows {
            let history = motion(row).map_or(&[][..], |motion| &motion.history);
            // A violation of zero has no logarithm; it is drawn at the bottom.
            let points = history.iter().enumerate().map(|(i, v)| axes.at(i as f64, v.max(floor)));
            svg.polyline(points, &style(&row.case.method, ""));
        }
    });
    let styles: Vec<String> = rows.iter().map(|row| style(&row.case.method, "")).collect();
    let methods = rows.iter().map(|row| row.case.method.as_str()).zip(styles.iter().map(String::as_str));
    let tolerance = format!("stroke=\"#555\" {DASHED}");
    let names: Vec<(&str, &str)> = methods.chain([("tolerance", &*tolerance)]).collect();
    legend(&mut svg, [80.0, 64.0], &names);
    svg.finish()
}

/// Fig. 5: how far the energy is above its last value on each grid, by iteration, the grids one after another.
pub(super) fn energies(rows: &[&Row]) -> String {
    const COLOURS: [&str; 4] = ["#c8352c", "#e08214", "#2166ac", "#1b7837"];
    let mut svg = Svg::new(1240.0, 860.0);
    heading(
        &mut svg,
        "How the map's energy falls: (E − last)/last, coarse grids first, circles where a grid begins",
    );
    let methods = distinct(rows.iter().map(|row| row.case.method.as_str()));
    let style = |method: &str| {
        let place = methods.iter().position(|m| *m == method).unwrap_or(0);
        COLOURS[place % COLOURS.len()]
    };
    let line = |method: &str| format!("stroke=\"{}\" stroke-width=\"2\"", style(method));
    let styles: Vec<String> = methods.iter().map(|method| line(method)).collect();
    let names: Vec<(&str, &str)> = methods.iter().copied().zip(styles.iter().map(String::as_str)).collect();
    legend(&mut svg, [70.0, 62.0], &names);
    for (i, terrain) in distinct(rows.iter().map(|row| row.case.terrain.as_str())).into_iter().enumerate() {
        let frame = [90.0 + 600.0 * (i % 2) as f64, 110.0 + 380.0 * (i / 2) as f64, 500.0, 280.0];
        let curves: Vec<(&str, Vec<Vec<f64>>)> = rows
            .iter()
            .filter(|row| row.case.terrain == terrain)
            .filter_map(|row| Some((row.case.method.as_str(), excesses(row)?)))
            .collect();
        let all: Vec<f64> =
            curves.iter().flat_map(|(_, grids)| grids.concat()).filter(|v| *v > 0.0).collect();
        let longest = curves.iter().map(|(_, grids)| grids.concat().len()).max().unwrap_or(2).max(2);
        let axes = Axes::logarithmic(frame, [0.0, (longest - 1) as f64], &all);
        axes.draw(&mut svg, terrain, "iteration", "energy above its last value");
        let floor = 10f64.powf(axes.y[0]);
        svg.clipped(frame, |svg| {
            for (method, grids) in &curves {
                let mut from = 0;
                for grid in grids {
                    let points: Vec<[f64; 2]> = grid
                        .iter()
                        .enumerate()
                        .map(|(k, v)| axes.at((from + k) as f64, v.max(floor)))
                        .collect();
                    from += grid.len();
                    svg.circle(points[0], 3.5, &format!("fill=\"{}\"", style(method)));
                    svg.polyline(points, &line(method));
                }
            }
        });
    }
    svg.finish()
}

/// By run of the optimizer, the energies less the last of it, relative to that; none without a map or an optimizer.
fn excesses(row: &Row) -> Option<Vec<Vec<f64>>> {
    let history = &row.outcome.as_ref().ok()?.map.as_ref()?.report.history;
    let one = |energy: &Vec<f64>| {
        let last = *energy.last()?;
        Some(energy.iter().map(|e| (e - last) / last.abs().max(f64::MIN_POSITIVE)).collect())
    };
    Some(history.iter().filter_map(|run| one(&run.energy)).collect())
}

/// Shares of solved and checked motions against what is varied: steepness on the left, knots on the right, a row a terrain.
pub(super) fn frontier(groups: &[Group]) -> String {
    let terrains = distinct(groups.iter().map(|group| group.terrain.as_str()));
    let mut svg = Svg::new(1240.0, 130.0 + 350.0 * terrains.len() as f64);
    heading(&mut svg, "Motions found beyond the hard level, and with fewer knots");
    let [warped, direct] = ["warped", "direct"].map(|method| style(method, ""));
    let solved = format!("stroke=\"#555\" stroke-width=\"2\" {DASHED}");
    let words = "dashed: solved, but for the checks; open circles: some were given up (--time-limit)";
    let names = [("warped", &*warped), ("direct", &*direct), (words, &*solved)];
    legend(&mut svg, [70.0, 62.0], &names);
    for (row, terrain) in terrains.into_iter().enumerate() {
        let here: Vec<&Group> = groups.iter().filter(|group| group.terrain == terrain).collect();
        let varied = distinct(here.iter().filter_map(|group| Some(group.parameter?.0)));
        for name in varied {
            let of: Vec<&Group> =
                here.iter().copied().filter(|group| group.parameter.is_some_and(|p| p.0 == name)).collect();
            let column = if name == "base_knots" { 1.0 } else { 0.0 };
            curve(&mut svg, [90.0 + 600.0 * column, 110.0 + 350.0 * row as f64], terrain, name, &of);
        }
    }
    svg.finish()
}

fn curve(svg: &mut Svg, [x, y]: [f64; 2], terrain: &str, name: &str, groups: &[&Group]) {
    let value = |group: &Group| group.parameter.map_or(0.0, |(_, value)| value);
    let frame = [x, y, 500.0, 250.0];
    let axes = Axes::new(frame, range(groups.iter().map(|group| value(group)), 0.05), [-5.0, 105.0]);
    let title = if name == "base_knots" { format!("{terrain}, medium") } else { terrain.to_string() };
    let unit = match name {
        "base_knots" => "distance of the base's knots, Δt",
        "slope" => "slope",
        _ => &format!("{name}, m"),
    };
    axes.draw(svg, &title, unit, "motions found, %");
    for method in distinct(groups.iter().map(|group| group.method.as_str())) {
        let of_method: Vec<&&Group> = groups.iter().filter(|group| group.method == method).collect();
        let at =
            |group: &Group, count: usize| axes.at(value(group), 100.0 * count as f64 / group.cases as f64);
        svg.polyline(of_method.iter().map(|group| at(group, group.solved)), &style(method, DASHED));
        svg.polyline(of_method.iter().map(|group| at(group, group.passed)), &style(method, ""));
        for group in of_method {
            let fill = if group.without_result > 0 { "#fff" } else { colour(method) };
            let look = format!("fill=\"{fill}\" stroke=\"{}\" stroke-width=\"1.5\"", colour(method));
            svg.circle(at(group, group.passed), 4.0, &look);
        }
    }
}

/// How the cost grows with the length of the motion.
pub(super) fn speed(rows: &[&Row]) -> String {
    let mut svg = Svg::new(1240.0, 480.0);
    heading(&mut svg, "Cost against the length of the motion");
    let methods = ["warped", "warped, 2 threads", "direct", "direct, 2 threads"];
    let styles = methods.map(|method| style(method, ""));
    legend(&mut svg, [70.0, 62.0], &[0, 1, 2, 3].map(|n| (methods[n], styles[n].as_str())));
    let by_iteration = |seconds: f64, m: &MotionMeasured| 1e3 * seconds / m.iterations.max(1) as f64;
    let cpu = |row: &Row| row.outcome.as_ref().ok().map(|measured| measured.cpu.solve);
    let linear = |row: &Row| motion(row).map(|m| by_iteration(m.seconds.linear_solver, m));
    let evaluation = |row: &Row| motion(row).map(|m| by_iteration(m.seconds.evaluation, m));
    let left = [90.0, 110.0, 500.0, 300.0];
    panel(&mut svg, rows, left, ["guess and NLP", "processor time, s"], &[(&cpu, "")]);
    let right = [690.0, 110.0, 500.0, 300.0];
    let parts: [Curve; 2] = [(&linear, ""), (&evaluation, DASHED)];
    let words = ["an iteration: linear solver (solid), evaluation (dashed)", "wall time, ms"];
    panel(&mut svg, rows, right, words, &parts);
    svg.finish()
}

/// A value of a row, and how its line is drawn.
type Curve<'a> = (&'a dyn Fn(&Row) -> Option<f64>, &'a str);

/// Values of the rows over the horizon, a line for each method and curve.
fn panel(svg: &mut Svg, rows: &[&Row], frame: [f64; 4], [title, unit]: [&str; 2], curves: &[Curve]) {
    let horizon = |row: &Row| row.case.parameter.map_or(0.0, |(_, value)| value);
    let values = curves.iter().flat_map(|(value, _)| rows.iter().filter_map(|row| value(row)));
    let [_, most] = range(values.chain([0.0]), 0.05);
    let [_, longest] = range(rows.iter().map(|row| horizon(row)), 0.05);
    let axes = Axes::new(frame, [0.0, longest], [0.0, most]);
    axes.draw(svg, title, "horizon, s", unit);
    for method in distinct(rows.iter().map(|row| row.case.method.as_str())) {
        for (value, dash) in curves {
            let of_method = rows.iter().filter(|row| row.case.method == method);
            let points: Vec<[f64; 2]> =
                of_method.filter_map(|row| Some(axes.at(horizon(row), value(row)?))).collect();
            svg.polyline(points.iter().copied(), &style(method, dash));
            points.iter().for_each(|&at| svg.circle(at, 3.5, &format!("fill=\"{}\"", colour(method))));
        }
    }
}
