//! Drawings of results, like the paper's figures.

use super::protocol::{Bench, FORMULATIONS};
use super::summary::Group;
use super::sweep::Row;
use crate::report::svg::{Font, Svg};

/// File names and drawings of a bench.
pub(super) fn draw(bench: Bench, rows: &[Row], groups: &[Group]) -> Vec<(String, String)> {
    match bench {
        Bench::Table1 => vec![("table1.svg".into(), rates(groups))],
        _ => {
            let _ = rows;
            Vec::new()
        }
    }
}

/// Colours of the formulations.
fn colour(method: &str) -> &'static str {
    if method == FORMULATIONS[0] { "#2166ac" } else { "#c8352c" }
}

/// Shares of solved and checked motions as bars.
fn rates(groups: &[Group]) -> String {
    let (step, bar, tall) = (34.0, 24.0, 260.0);
    let mut svg = Svg::new(150.0 + step * groups.len() as f64, tall + 190.0);
    svg.text([60.0, 30.0], "Motions found: pale solved, full solved and checked", Font::TITLE);
    let bottom = 60.0 + tall;
    for percent in [0.0, 25.0, 50.0, 75.0, 100.0] {
        let y = bottom - tall * percent / 100.0;
        svg.line(
            [60.0, y],
            [80.0 + step * groups.len() as f64, y],
            "stroke=\"#000\" stroke-opacity=\"0.12\"",
        );
        svg.text([54.0, y + 4.0], &format!("{percent:.0} %"), Font::TICK.anchored("end"));
    }
    for (i, group) in groups.iter().enumerate() {
        let x = 70.0 + step * i as f64;
        for (count, opacity) in [(group.solved, 0.35), (group.passed, 1.0)] {
            let height = tall * count as f64 / group.cases as f64;
            let style = format!("fill=\"{}\" fill-opacity=\"{opacity}\"", colour(&group.method));
            svg.rect([x, bottom - height, bar, height], &style);
        }
        let words = format!("{} {} {}", group.terrain, group.level, group.method);
        svg.turned_text([x + 16.0, bottom + 12.0], &words, Font::TICK.anchored("end"), -60.0);
    }
    svg.finish()
}
