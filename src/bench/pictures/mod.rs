//! Drawings of results, like the paper's figures.

mod curves;
mod ground;
mod polar;

use super::case::MotionMeasured;
use super::protocol::{Bench, FORMULATIONS};
use super::summary::Group;
use super::sweep::Row;
use crate::report::svg::{Font, Svg};

/// File names and drawings of a bench.
pub(super) fn draw(bench: Bench, rows: &[Row], groups: &[Group]) -> Vec<(String, String)> {
    let by_level = |draw: &dyn Fn(&[&Row]) -> String| levels(rows, bench.name(), draw);
    match bench {
        Bench::Table1 => vec![("table1.svg".into(), rates(groups))],
        Bench::Fig8 => by_level(&polar::histories),
        Bench::Fig9 => by_level(&polar::times),
        Bench::Fig11 => by_level(&curves::histories),
        Bench::Fig4 => by_level(&ground::errors),
        Bench::Fig5 => by_level(&curves::energies),
        Bench::Frontier => vec![("frontier.svg".into(), curves::frontier(groups))],
        Bench::Map => vec![("map.svg".into(), conformal_errors(groups))],
        Bench::Speed => by_level(&curves::speed),
        Bench::Track => vec![("track.svg".into(), replays(groups))],
    }
}

/// One drawing by level.
fn levels(rows: &[Row], name: &str, draw: &dyn Fn(&[&Row]) -> String) -> Vec<(String, String)> {
    distinct(rows.iter().map(|row| row.case.level.as_str()))
        .into_iter()
        .map(|level| {
            let of_level: Vec<&Row> = rows.iter().filter(|row| row.case.level == level).collect();
            (format!("{name}-{level}.svg"), draw(&of_level))
        })
        .collect()
}

/// Each value once, in the order of first occurrence.
fn distinct<'a>(values: impl Iterator<Item = &'a str>) -> Vec<&'a str> {
    let mut seen: Vec<&str> = Vec::new();
    for value in values {
        if !seen.contains(&value) {
            seen.push(value);
        }
    }
    seen
}

/// Colours of the formulations.
fn colour(method: &str) -> &'static str {
    // With two threads of evaluation paler.
    match (method.starts_with(FORMULATIONS[0]), method.ends_with(", 2 threads")) {
        (true, false) => "#2166ac",
        (true, true) => "#92c5de",
        (false, false) => "#c8352c",
        (false, true) => "#f4a582",
    }
}

fn motion(row: &Row) -> Option<&MotionMeasured> {
    row.outcome.as_ref().ok()?.motion.as_ref()
}

fn solved(row: &Row) -> bool {
    motion(row).is_some_and(|motion| motion.solved)
}

/// Names of lines, from left to right.
fn legend(svg: &mut Svg, [mut x, y]: [f64; 2], names: &[(&str, &str)]) {
    for (name, style) in names {
        svg.line([x, y - 4.0], [x + 26.0, y - 4.0], style);
        svg.text([x + 32.0, y], name, Font::TICK.anchored("start"));
        x += 50.0 + 7.0 * name.chars().count() as f64;
    }
}

/// Colour between dark red (0), yellow and blue (1).
fn blend(share: f64) -> String {
    const STOPS: [[f64; 3]; 3] = [[150.0, 20.0, 30.0], [245.0, 200.0, 70.0], [30.0, 95.0, 170.0]];
    let at = 2.0 * share.clamp(0.0, 1.0);
    let (low, high) = if at < 1.0 { (STOPS[0], STOPS[1]) } else { (STOPS[1], STOPS[2]) };
    let part = at - f64::from(u8::from(at >= 1.0));
    let [r, g, b] = [0, 1, 2].map(|c| (low[c] + part * (high[c] - low[c])).round());
    format!("rgb({r},{g},{b})")
}

/// A bar: its label, colour, and heights with their opacities, drawn over each other.
struct Bar<'a> {
    label: String,
    colour: &'a str,
    heights: Vec<(f64, f64)>,
}

/// Shares of solved and checked motions.
fn rates(groups: &[Group]) -> String {
    let bar = |group: &Group| {
        let share = |count: usize| 100.0 * count as f64 / group.cases as f64;
        Bar {
            label: format!("{} {} {}", group.terrain, group.level, group.method),
            colour: colour(&group.method),
            heights: vec![(share(group.solved), 0.35), (share(group.passed), 1.0)],
        }
    };
    let all: Vec<Bar> = groups.iter().map(bar).collect();
    bars("Motions found, %: pale solved, full solved and checked", &all, 100.0)
}

/// Shares of replays that pass or are marginal.
fn replays(groups: &[Group]) -> String {
    let bar = |group: &Group| {
        let [pass, marginal, _] = group.replayed;
        let share = |count: usize| 100.0 * count as f64 / group.cases as f64;
        Bar {
            label: format!("{} {} {} {}", group.robot, group.terrain, group.level, group.method),
            colour: colour(&group.method),
            heights: vec![(share(pass + marginal), 0.35), (share(pass), 1.0)],
        }
    };
    let all: Vec<Bar> = groups.iter().map(bar).collect();
    bars("Plans that the robot walks, %: full pass, pale marginal", &all, 100.0)
}

/// Mean conformal errors of maps on the ground.
fn conformal_errors(groups: &[Group]) -> String {
    let bar = |group: &Group| Bar {
        label: format!("{} {} {}", group.terrain, group.level, group.method),
        colour: colour(if group.method == "mips" { FORMULATIONS[0] } else { FORMULATIONS[1] }),
        heights: vec![(group.conformal_error.unwrap_or(0.0), 1.0)],
    };
    let all: Vec<Bar> = groups.iter().map(bar).collect();
    let most = all.iter().map(|bar| bar.heights[0].0).fold(5.0, f64::max);
    bars("Mean conformal error of the map on the ground, % (no bar: no map)", &all, most)
}

fn bars(title: &str, all: &[Bar], most: f64) -> String {
    let (step, thick, tall, left, bottom) = (34.0, 24.0, 260.0, 190.0, 320.0);
    let width = step * all.len() as f64;
    let mut svg = Svg::new((left + width + 40.0).max(640.0), bottom + 190.0);
    svg.text([60.0, 30.0], title, Font::TITLE);
    for share in [0.0, 0.25, 0.5, 0.75, 1.0] {
        let y = bottom - tall * share;
        svg.line([left, y], [left + width, y], "stroke=\"#000\" stroke-opacity=\"0.12\"");
        svg.text([left - 6.0, y + 4.0], &format!("{:.1}", share * most), Font::TICK.anchored("end"));
    }
    for (i, bar) in all.iter().enumerate() {
        let x = left + 5.0 + step * i as f64;
        for (value, opacity) in &bar.heights {
            let height = tall * value / most;
            let style = format!("fill=\"{}\" fill-opacity=\"{opacity}\"", bar.colour);
            svg.rect([x, bottom - height, thick, height], &style);
        }
        svg.turned_text([x + 16.0, bottom + 12.0], &bar.label, Font::TICK.anchored("end"), -60.0);
    }
    svg.finish()
}

#[cfg(test)]
mod tests {
    use super::super::case::{Cpu, Evaluation, Measured};
    use super::super::{Options, summary};
    use super::*;

    /// Every case of a bench, one without a result.
    fn rows(bench: Bench) -> Vec<Row> {
        let motion = MotionMeasured {
            solved: true,
            passed: true,
            history: vec![1.0, 0.01, 1e-5, 0.0],
            iterations: 3,
            evaluation: Some(Evaluation::default()),
            ..Default::default()
        };
        let cpu = Cpu { solve: 1.5, ..Cpu::default() };
        let measured = Measured { motion: Some(motion), map: None, track: None, cpu };
        let cases = bench.cases(&Options { quick: true, ..Options::default() }).into_iter();
        let mut rows: Vec<Row> = cases.map(|case| Row { case, outcome: Ok(measured.clone()) }).collect();
        rows[0].outcome = Err("no result".into());
        rows
    }

    #[test]
    fn every_bench_is_drawn_with_finite_numbers() {
        for bench in Bench::ALL {
            let rows = rows(bench);
            let drawings = draw(bench, &rows, &summary::groups(&rows));
            assert_eq!(drawings.len(), 1, "{}", bench.name());
            for (name, svg) in drawings {
                assert!(name.ends_with(".svg") && svg.ends_with("</svg>\n"), "{name}");
                assert!(!svg.contains("NaN") && !svg.contains("\"inf"), "{name}: {svg}");
            }
        }
    }

    #[test]
    fn colours_go_from_red_to_blue() {
        assert_eq!(
            [blend(-1.0), blend(0.5), blend(2.0)],
            ["rgb(150,20,30)", "rgb(245,200,70)", "rgb(30,95,170)"]
        );
    }
}
