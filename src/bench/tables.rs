//! The groups as tables for the terminal.

use super::case::Work;
use super::summary::{Group, is_good, verdict};
use super::sweep::Row;
use super::{Outcome, tracking};
use crate::report::number;
use crate::report::table::Table;

/// The groups as a table, and the cases that fail with their reasons.
pub fn table(outcome: &Outcome) -> String {
    let mut lines = match outcome.rows.iter().any(|row| row.case.work == Work::Track) {
        true => tracking::table(&outcome.groups),
        false => {
            match outcome.rows.iter().any(|row| row.outcome.as_ref().is_ok_and(|m| m.motion.is_some())) {
                true => motion_table(outcome),
                false => map_table(&outcome.groups),
            }
        }
    };
    let failing: Vec<&Row> = outcome.rows.iter().filter(|row| !is_good(row)).collect();
    if !failing.is_empty() {
        lines.push(format!("\n{} of {} cases fail:", failing.len(), outcome.rows.len()));
        lines.extend(failing.iter().map(|row| format!("  {}: {}", row.case.name, verdict(row))));
    }
    lines.push(String::new());
    lines.join("\n")
}

/// A row a group of motions.
fn motion_table(outcome: &Outcome) -> Vec<String> {
    let mut table = Table::new(&[
        "terrain",
        "level",
        "varied",
        "formulation",
        ">cases",
        ">solved",
        ">and checked",
        ">continued",
        ">iterations",
        ">most",
        ">feasible at",
        ">solve CPU s",
        ">most",
        ">map CPU s",
        ">violation",
        ">most",
    ]);
    for group in &outcome.groups {
        table.row([
            group.terrain.clone(),
            group.level.clone(),
            group.parameter.map_or(String::new(), |(name, value)| format!("{name} {value}")),
            group.method.clone(),
            group.cases.to_string(),
            share(group.solved, group.cases),
            share(group.passed, group.cases),
            group.continued.to_string(),
            plain(group.iterations),
            plain(group.iterations_max),
            plain(group.first_feasible),
            shown(group.cpu_solve),
            shown(group.cpu_solve_max),
            shown(group.cpu_map),
            shown(group.violation),
            shown(group.violation_max),
        ]);
    }
    let mut lines = table.lines(|_, _, text| text);
    lines.push("Medians, over solved cases for iterations; most: the greatest.".into());
    lines.extend(evaluations(&outcome.rows));
    lines
}

/// Where the time of an iteration goes, where that was measured.
fn evaluations(rows: &[Row]) -> Vec<String> {
    let mut table = Table::new(&[
        "formulation",
        ">horizon s",
        ">variables",
        ">constraints",
        ">Jacobian entries",
        ">Hessian entries",
        ">constraints ms",
        ">Jacobian ms",
        ">Hessian ms",
        ">evaluation s",
        ">linear solver s",
        ">total s",
        ">iterations",
    ]);
    let mut any = false;
    for row in rows {
        let Some(motion) = row.outcome.as_ref().ok().and_then(|m| m.motion.as_ref()) else { continue };
        let Some(evaluation) = &motion.evaluation else { continue };
        any = true;
        let [n, m, jacobian, hessian] = evaluation.size.map(|size| size.to_string());
        let seconds = &motion.seconds;
        let times = [evaluation.constraints, evaluation.jacobian, evaluation.hessian];
        let parts = [seconds.evaluation, seconds.linear_solver, seconds.total];
        let horizon = row.case.parameter.map_or(String::new(), |(_, value)| value.to_string());
        let cells = [row.case.method.clone(), horizon, n, m, jacobian, hessian].into_iter();
        let cells = cells.chain(times.map(number)).chain(parts.map(number));
        table.row(cells.chain([motion.iterations.to_string()]));
    }
    match any {
        true => std::iter::once("\nWall times, which other load on the machine lengthens:".into())
            .chain(table.lines(|_, _, text| text))
            .collect(),
        false => Vec::new(),
    }
}

/// A row a map.
fn map_table(groups: &[Group]) -> Vec<String> {
    let mut table = Table::new(&[
        "terrain",
        "level",
        "method",
        ">CPU s",
        ">conformal error %",
        ">most",
        ">misfit mm",
        ">inversions",
        ">energy m³",
    ]);
    for group in groups {
        let method = match group.taken {
            Some(taken) if group.method == "auto" => format!("auto: {taken}"),
            _ => group.method.clone(),
        };
        let [cpu, mean, most, misfit, energy] =
            [group.cpu_map, group.conformal_error, group.conformal_error_max, group.misfit, group.energy]
                .map(shown);
        let inversions = plain(group.inversions);
        let figures = [cpu, mean, most, misfit, inversions, energy];
        table.row([group.terrain.clone(), group.level.clone(), method].into_iter().chain(figures));
    }
    table.lines(|_, _, text| text)
}

/// A part of all, in numbers and per cent.
pub(super) fn share(part: usize, all: usize) -> String {
    format!("{part} ({:.0} %)", 100.0 * part as f64 / all as f64)
}

fn shown(value: Option<f64>) -> String {
    value.map_or("–".into(), number)
}

fn plain(value: Option<f64>) -> String {
    value.map_or("–".into(), |value| format!("{value}"))
}
