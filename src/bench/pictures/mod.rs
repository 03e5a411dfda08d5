//! Drawings of results, like the paper's figures.

mod bars;
mod curves;
mod energies;
mod frontier;
mod ground;
mod polar;
mod style;

use super::case::CaseRow;
use super::kind::Bench;
use super::summary::Group;

/// File names and SVG texts of a bench's drawings.
pub(super) fn draw(bench: Bench, rows: &[CaseRow], groups: &[Group]) -> Vec<(String, String)> {
    let by_level = |draw: &dyn Fn(&[&CaseRow]) -> String| by_level(rows, bench.name(), draw);
    match bench {
        Bench::Table1 => vec![("table1.svg".into(), bars::rates(groups))],
        Bench::Fig8 => by_level(&polar::histories),
        Bench::Fig9 => by_level(&polar::times),
        Bench::Fig11 => by_level(&curves::histories),
        Bench::Fig4 => by_level(&ground::errors),
        Bench::Fig5 => by_level(&energies::energies),
        Bench::Frontier => vec![("frontier.svg".into(), frontier::frontier(groups))],
        Bench::Map => vec![("map.svg".into(), bars::conformal_errors(groups))],
        Bench::Speed => by_level(&curves::speed),
        Bench::Track => vec![("track.svg".into(), bars::replays(groups))],
    }
}

/// One drawing for each level.
fn by_level(rows: &[CaseRow], name: &str, draw: &dyn Fn(&[&CaseRow]) -> String) -> Vec<(String, String)> {
    style::distinct(rows.iter().map(|row| row.case.level.as_str()))
        .into_iter()
        .map(|level| {
            let of_level: Vec<&CaseRow> = rows.iter().filter(|row| row.case.level == level).collect();
            (format!("{name}-{level}.svg"), draw(&of_level))
        })
        .collect()
}

#[cfg(test)]
mod tests {
    use super::super::measured::{Cpu, Evaluation, Measured, MotionMeasured};
    use super::super::{BenchOptions, protocol, summary};
    use super::*;

    /// Every case of a bench, one of them without a result.
    fn rows(bench: Bench) -> Vec<CaseRow> {
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
        let cases = protocol::cases(bench, &BenchOptions { quick: true, ..BenchOptions::default() });
        let mut rows: Vec<CaseRow> =
            cases.into_iter().map(|case| CaseRow { case, outcome: Ok(measured.clone()) }).collect();
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
}
