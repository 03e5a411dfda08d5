//! Fig. 5: convergence of the map's energy.

use super::super::case::CaseRow;
use super::style::{PAGE_TITLE, distinct, legend};
use crate::report::axes::Axes;
use crate::report::svg::Svg;

/// Colors of the methods.
const COLORS: [&str; 4] = ["#c8352c", "#e08214", "#2166ac", "#1b7837"];

/// How far the energy is above its final value on each grid, by iteration, one grid after the other.
pub(super) fn energies(rows: &[&CaseRow]) -> String {
    let mut svg = Svg::new(1240.0, 860.0);
    let title = "Energy of the map by iteration: (E − E_final)/E_final, from coarse to fine grids; a circle where a grid begins";
    svg.text([70.0, 34.0], title, PAGE_TITLE);
    let methods = distinct(rows.iter().map(|row| row.case.method.as_str()));
    let color = |method: &str| {
        let index = methods.iter().position(|m| *m == method).unwrap_or(0);
        COLORS[index % COLORS.len()]
    };
    let stroke = |method: &str| format!("stroke=\"{}\" stroke-width=\"2\"", color(method));
    let names: Vec<(&str, String)> = methods.iter().map(|method| (*method, stroke(method))).collect();
    legend(&mut svg, [70.0, 62.0], &names);
    for (i, terrain) in distinct(rows.iter().map(|row| row.case.terrain.as_str())).into_iter().enumerate() {
        let frame = [90.0 + 600.0 * (i % 2) as f64, 110.0 + 380.0 * (i / 2) as f64, 500.0, 280.0];
        let curves: Vec<(&str, Vec<Vec<f64>>)> = rows
            .iter()
            .filter(|row| row.case.terrain == terrain)
            .filter_map(|row| Some((row.case.method.as_str(), excesses(row)?)))
            .collect();
        let values: Vec<f64> = curves.iter().flat_map(|(_, grids)| grids.concat()).collect();
        let longest = curves.iter().map(|(_, grids)| grids.concat().len()).max().unwrap_or(2).max(2);
        let axes = Axes::logarithmic(frame, [0.0, (longest - 1) as f64], &values);
        axes.draw(&mut svg, terrain, "iteration", "energy above its final value");
        svg.clipped(frame, |svg| {
            for (method, grids) in &curves {
                let mut begin = 0;
                for grid in grids {
                    let points = |k: usize| axes.at((begin + k) as f64, grid[k]);
                    svg.circle(points(0), 3.5, &format!("fill=\"{}\"", color(method)));
                    svg.polyline((0..grid.len()).map(points), &stroke(method));
                    begin += grid.len();
                }
            }
        });
    }
    svg.finish()
}

/// For each run of the optimizer, its energies less the final one, relative to that; none without a map.
fn excesses(row: &CaseRow) -> Option<Vec<Vec<f64>>> {
    let of_run = |energy: &Vec<f64>| {
        let last = *energy.last()?;
        Some(energy.iter().map(|e| (e - last) / last.abs().max(f64::MIN_POSITIVE)).collect())
    };
    Some(row.map()?.report.history.iter().filter_map(|run| of_run(&run.energy)).collect())
}
