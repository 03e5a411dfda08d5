//! From rows to rates, medians and failures; and JSON.

use serde::Serialize;
use serde_json::json;

use super::case::{Measured, MotionMeasured};
use super::protocol::{Bench, Case};
use super::sweep::Row;
use super::{Options, tracking};
use crate::replay::{Tracked, Verdict};
use crate::report::number;
use crate::{Error, Result};

/// Cases that differ only in where the motion goes.
#[derive(Clone, Debug, PartialEq, Serialize)]
pub struct Group {
    /// Name of the robot.
    pub robot: String,
    /// Kind of terrain.
    pub terrain: String,
    /// Level, or the one departed from.
    pub level: String,
    /// Formulation, or method of the map.
    pub method: String,
    /// What is varied besides: name and value.
    pub parameter: Option<(&'static str, f64)>,
    /// Cases.
    pub cases: usize,
    /// Cases with a motion that meets the tolerance.
    pub solved: usize,
    /// … and all checks.
    pub passed: usize,
    /// Cases without any result.
    pub without_result: usize,
    /// Cases that needed a continuation.
    pub continued: usize,
    /// Median number of iterations of the solved ones.
    pub iterations: Option<f64>,
    /// Greatest number of iterations of the solved ones.
    pub iterations_max: Option<f64>,
    /// Median of the first iteration that met the tolerance.
    pub first_feasible: Option<f64>,
    /// Median processor time of guess and NLP, s, of all with a result.
    pub cpu_solve: Option<f64>,
    /// Greatest of it, s.
    pub cpu_solve_max: Option<f64>,
    /// Processor time of the map where it was built in one of the cases, s.
    pub cpu_map: Option<f64>,
    /// Median of the largest violations, units of the NLP.
    pub violation: Option<f64>,
    /// Greatest of them.
    pub violation_max: Option<f64>,
    /// Mean conformal error of the map on the ground, %.
    pub conformal_error: Option<f64>,
    /// Greatest conformal error of the map on the ground, %.
    pub conformal_error_max: Option<f64>,
    /// Greatest distance of the map's bottom from the terrain, mm.
    pub misfit: Option<f64>,
    /// Points where the map is folded.
    pub inversions: Option<f64>,
    /// The map's energy at the end, m³; energies of different methods cannot be compared.
    pub energy: Option<f64>,
    /// The method that made the map, where the case leaves it open.
    pub taken: Option<&'static str>,
    /// Replays that pass, are marginal, and fail.
    pub replayed: [usize; 3],
    /// The first metric that decides against a replay, with the number of replays that it decides, the most frequent first.
    pub objections: Vec<(String, usize)>,
}

impl Group {
    fn of(rows: &[&Row]) -> Self {
        let case = &rows[0].case;
        let measured: Vec<&Measured> = rows.iter().filter_map(|row| row.outcome.as_ref().ok()).collect();
        let motions: Vec<&MotionMeasured> = measured.iter().filter_map(|m| m.motion.as_ref()).collect();
        let solved: Vec<&MotionMeasured> = motions.iter().copied().filter(|m| m.solved).collect();
        let of = |all: &[&MotionMeasured], value: fn(&MotionMeasured) -> f64| {
            all.iter().map(|m| value(m)).collect()
        };
        let iterations: Vec<f64> = of(&solved, |m| m.iterations as f64);
        let violations: Vec<f64> = of(&motions, |m| m.violation);
        let cpu_solve: Vec<f64> =
            measured.iter().filter(|m| m.motion.is_some()).map(|m| m.cpu.solve).collect();
        let tracks: Vec<&Tracked> = measured.iter().filter_map(|m| m.track.as_ref()).collect();
        let maps = || measured.iter().filter_map(|m| m.map.as_ref().map(|map| (m, map)));
        Self {
            robot: case.robot.clone(),
            terrain: case.terrain.clone(),
            level: case.level.clone(),
            method: case.method.clone(),
            parameter: case.parameter,
            cases: rows.len(),
            solved: solved.len(),
            passed: solved.iter().filter(|m| m.passed).count(),
            without_result: rows.len() - measured.len(),
            continued: motions.iter().filter(|m| m.continuation).count(),
            iterations: median(&iterations),
            iterations_max: greatest(&iterations),
            first_feasible: median(
                &solved.iter().filter_map(|m| Some(m.first_feasible? as f64)).collect::<Vec<_>>(),
            ),
            cpu_solve: median(&cpu_solve),
            cpu_solve_max: greatest(&cpu_solve),
            cpu_map: greatest(
                &maps().filter(|(_, map)| !map.cached).map(|(m, _)| m.cpu.map).collect::<Vec<_>>(),
            ),
            violation: median(&violations),
            violation_max: greatest(&violations),
            conformal_error: greatest(
                &maps().map(|(_, map)| 100.0 * map.report.conformal_ground.mean).collect::<Vec<_>>(),
            ),
            conformal_error_max: greatest(
                &maps().map(|(_, map)| 100.0 * map.report.conformal_ground.max).collect::<Vec<_>>(),
            ),
            misfit: greatest(&maps().map(|(_, map)| 1e3 * map.report.misfit_max).collect::<Vec<_>>()),
            inversions: greatest(
                &maps().map(|(_, map)| map.report.inverted_points as f64).collect::<Vec<_>>(),
            ),
            energy: greatest(&maps().map(|(_, map)| map.report.energy).collect::<Vec<_>>()),
            taken: maps().map(|(_, map)| map.report.method.name()).next(),
            replayed: [Verdict::Pass, Verdict::Marginal, Verdict::Fail]
                .map(|verdict| tracks.iter().filter(|track| track.verdict == verdict).count()),
            objections: tracking::objections(&tracks),
        }
    }
}

/// The groups, in the order of their first row.
pub fn groups(rows: &[Row]) -> Vec<Group> {
    let alike = |a: &Row, b: &Row| {
        let (a, b) = (&a.case, &b.case);
        let key =
            |case: &Case| (case.robot.clone(), case.terrain.clone(), case.level.clone(), case.method.clone());
        key(a) == key(b) && a.parameter == b.parameter
    };
    let mut sorted: Vec<Vec<&Row>> = Vec::new();
    for row in rows {
        match sorted.iter_mut().find(|group| alike(group[0], row)) {
            Some(group) => group.push(row),
            None => sorted.push(vec![row]),
        }
    }
    sorted.iter().map(|group| Group::of(group)).collect()
}

fn median(values: &[f64]) -> Option<f64> {
    let mut values = values.to_vec();
    values.sort_by(f64::total_cmp);
    let n = values.len();
    if n == 0 { None } else { Some(0.5 * (values[(n - 1) / 2] + values[n / 2])) }
}

fn greatest(values: &[f64]) -> Option<f64> {
    values.iter().copied().max_by(f64::total_cmp)
}

/// What became of a case, in a line.
pub fn verdict(row: &Row) -> String {
    let measured = match &row.outcome {
        Ok(measured) => measured,
        Err(reason) => return reason.clone(),
    };
    let Some(motion) = &measured.motion else {
        return map_verdict(measured);
    };
    let walked = measured.track.as_ref().map_or(String::new(), tracking::verdict);
    let effort = format!("{} iterations, {} s", motion.iterations, number(measured.cpu.solve));
    if !motion.solved {
        return format!(
            "NOT SOLVED ({effort}): {}; {} misses by {}, {}",
            motion.status,
            motion.worst_block,
            number(motion.violation),
            motion.worst_place
        );
    }
    match failed_checks(motion) {
        failed if failed.is_empty() => format!("solved, checks hold ({effort}){walked}"),
        failed => format!("solved ({effort}), CHECK FAILS: {failed}"),
    }
}

fn map_verdict(measured: &Measured) -> String {
    measured.map.as_ref().map_or(String::new(), |map| {
        let report = &map.report;
        let folded = match report.inverted_points {
            0 => String::new(),
            n => format!(", FOLDED at {n} points"),
        };
        let ending = if report.converged { "" } else { ", NOT converged" };
        format!(
            "conformal error {} %, misfit {} mm, {} s{ending}{folded}",
            number(100.0 * report.conformal_ground.mean),
            number(1e3 * report.misfit_max),
            number(measured.cpu.map)
        )
    })
}

/// The laws that do not hold, each with its value and limit.
fn failed_checks(motion: &MotionMeasured) -> String {
    let failed = motion.checks.iter().filter(|row| !row.passed);
    let words = failed.map(|row| {
        let foot = row.foot.as_ref().map_or(String::new(), |foot| format!(" {foot}"));
        let time = row.time.map_or(String::new(), |time| format!(" at {time:.2} s"));
        format!("{} {} > {} {}{foot}{time}", row.name, number(row.value), number(row.limit), row.unit)
    });
    words.collect::<Vec<_>>().join("; ")
}

/// Whether a row is as good as it can be.
pub fn is_good(row: &Row) -> bool {
    row.outcome.as_ref().is_ok_and(Measured::is_good)
}

/// `results.json`.
pub(super) fn json(bench: Bench, options: &Options, rows: &[Row], groups: &[Group]) -> Result<String> {
    let cases: Vec<serde_json::Value> = rows
        .iter()
        .map(|row| {
            let case = &row.case;
            json!({
                "name": case.name,
                "robot": case.robot,
                "terrain": case.terrain,
                "level": case.level,
                "method": case.method,
                "parameter": case.parameter,
                "heading": case.heading,
                "good": is_good(row),
                "verdict": verdict(row),
                "measured": row.outcome.as_ref().ok(),
            })
        })
        .collect();
    let results = json!({
        "bench": bench.name(),
        "version": env!("CARGO_PKG_VERSION"),
        "robot": options.robot,
        "machine": machine(),
        "jobs": options.jobs,
        "groups": groups,
        "cases": cases,
    });
    serde_json::to_string_pretty(&results).map_err(|e| Error::Internal(format!("results: {e}")))
}

/// Model and number of the processors, as far as the operating system tells.
fn machine() -> String {
    let text = std::fs::read_to_string("/proc/cpuinfo").unwrap_or_default();
    let model = text.lines().find_map(|line| line.strip_prefix("model name")?.split_once(": "));
    let count = std::thread::available_parallelism().map_or(0, |n| n.get());
    format!("{} × {count}", model.map_or("processor of unknown model", |(_, name)| name))
}

#[cfg(test)]
pub(super) mod tests {
    use super::*;
    use crate::bench::case::Cpu;
    use crate::plan::CheckRow;

    fn row(index: usize, motion: MotionMeasured, seconds: f64) -> Row {
        let case = Bench::Table1.cases(&Options::default()).remove(2 * index);
        let cpu = Cpu { solve: seconds, ..Cpu::default() };
        Row { case, outcome: Ok(Measured { motion: Some(motion), map: None, track: None, cpu }) }
    }

    /// Four cases: good, not good, not solved, without a result.
    pub fn rows() -> Vec<Row> {
        let good = MotionMeasured {
            solved: true,
            passed: true,
            iterations: 10,
            violation: 1e-5,
            ..Default::default()
        };
        let checks = vec![CheckRow {
            name: "friction".into(),
            value: 2.0,
            unit: "% m g".into(),
            limit: 0.5,
            passed: false,
            time: Some(1.5),
            foot: Some("LF".into()),
        }];
        let slips = MotionMeasured { passed: false, iterations: 20, checks, ..good.clone() };
        let lost = MotionMeasured {
            solved: false,
            status: "too, many \"iterations\"".into(),
            worst_block: "reach".into(),
            violation: 0.3,
            ..good.clone()
        };
        let mut broken = row(3, good.clone(), 0.0);
        broken.outcome = Err("no result (signal: 9)".into());
        vec![row(0, good, 1.0), row(1, slips, 3.0), row(2, lost, 9.0), broken]
    }

    #[test]
    fn a_group_counts_every_case() {
        let groups = groups(&rows());
        assert_eq!(groups.len(), 1);
        let group = &groups[0];
        assert_eq!((group.cases, group.solved, group.passed, group.without_result), (4, 2, 1, 1));
        assert_eq!(
            (group.iterations, group.cpu_solve, group.cpu_solve_max),
            (Some(15.0), Some(3.0), Some(9.0))
        );
        assert_eq!(group.violation_max, Some(0.3));
    }

    #[test]
    fn verdicts_name_the_law_the_block_and_the_reason() {
        let words: Vec<String> = rows().iter().map(verdict).collect();
        assert!(words[0].starts_with("solved, checks hold"));
        assert!(words[1].contains("friction 2.00 > 0.500 % m g LF at 1.50 s"), "{}", words[1]);
        assert!(words[2].starts_with("NOT SOLVED") && words[2].contains("reach misses by 0.300"));
        assert_eq!(words[3], "no result (signal: 9)");
    }

    #[test]
    fn medians() {
        assert_eq!(median(&[]), None);
        assert_eq!(median(&[3.0, 1.0, 2.0]), Some(2.0));
        assert_eq!(median(&[4.0, 1.0]), Some(2.5));
    }
}
