//! The frontier: how many motions are found beyond the hard level, and with coarser knots.

use super::super::protocol::{BASE_KNOTS, FORMULATIONS};
use super::super::summary::Group;
use super::style::{DASHED, GRAY, PAGE_TITLE, color, distinct, legend, stroke};
use crate::report::axes::{Axes, range};
use crate::report::svg::Svg;

/// Percentages of motions that are solved, and that are solved and checked, against what is varied: steepness on the left,
/// knots on the right, one row of panels per terrain.
pub(super) fn frontier(groups: &[Group]) -> String {
    let terrains = distinct(groups.iter().map(|group| group.terrain.as_str()));
    let mut svg = Svg::new(1240.0, 130.0 + 350.0 * terrains.len() as f64);
    svg.text([70.0, 34.0], "Motions found beyond the hard level, and with fewer knots", PAGE_TITLE);
    let styles = "solid: solved and checked; dashed: solved; open circles: some cases have no result";
    let methods = FORMULATIONS.map(|method| (method, stroke(method)));
    let names: Vec<(&str, String)> =
        methods.into_iter().chain([(styles, format!("{GRAY} stroke-width=\"2\" {DASHED}"))]).collect();
    legend(&mut svg, [70.0, 62.0], &names);
    for (row, terrain) in terrains.into_iter().enumerate() {
        let here: Vec<&Group> = groups.iter().filter(|group| group.terrain == terrain).collect();
        for name in distinct(here.iter().filter_map(|group| Some(group.parameter?.0))) {
            let varied: Vec<&Group> =
                here.iter().copied().filter(|group| group.parameter.is_some_and(|p| p.0 == name)).collect();
            let column = if name == BASE_KNOTS { 1.0 } else { 0.0 };
            panel(&mut svg, [90.0 + 600.0 * column, 110.0 + 350.0 * row as f64], terrain, name, &varied);
        }
    }
    svg.finish()
}

fn panel(svg: &mut Svg, [left, top]: [f64; 2], terrain: &str, name: &str, groups: &[&Group]) {
    let value = |group: &Group| group.parameter.map_or(0.0, |(_, value)| value);
    let frame = [left, top, 500.0, 250.0];
    let axes = Axes::new(frame, range(groups.iter().map(|group| value(group)), 0.05), [-5.0, 105.0]);
    let title = if name == BASE_KNOTS { format!("{terrain}, medium") } else { terrain.to_string() };
    let label = match name {
        BASE_KNOTS => "distance between the base's knots, Δt",
        "slope" => "slope",
        _ => &format!("{name}, m"),
    };
    axes.draw(svg, &title, label, "motions found, %");
    for method in distinct(groups.iter().map(|group| group.method.as_str())) {
        let of_method: Vec<&&Group> = groups.iter().filter(|group| group.method == method).collect();
        let at =
            |group: &Group, count: usize| axes.at(value(group), 100.0 * count as f64 / group.cases as f64);
        let dashed = format!("{} {DASHED}", stroke(method));
        svg.polyline(of_method.iter().map(|group| at(group, group.solved)), &dashed);
        svg.polyline(of_method.iter().map(|group| at(group, group.passed)), &stroke(method));
        for group in of_method {
            let fill = if group.without_result > 0 { "#fff" } else { color(method) };
            let style = format!("fill=\"{fill}\" stroke=\"{}\" stroke-width=\"1.5\"", color(method));
            svg.circle(at(group, group.passed), 4.0, &style);
        }
    }
}
