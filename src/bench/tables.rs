//! The groups as tables for the terminal.

use super::case::{CaseRow, Work};
use super::protocol::AUTO;
use super::summary::Group;
use super::verdict::verdict;
use crate::report::number;
use crate::report::table::Table;

/// The groups as a table, followed by the cases that are not good, each with the reason.
pub fn table(rows: &[CaseRow], groups: &[Group]) -> String {
    let mut lines = if rows.iter().any(|row| row.case.work == Work::Track) {
        track_table(groups)
    } else if rows.iter().any(|row| row.motion().is_some()) {
        motion_table(rows, groups)
    } else {
        map_table(groups)
    };
    let failing: Vec<&CaseRow> = rows.iter().filter(|row| !row.is_good()).collect();
    if !failing.is_empty() {
        lines.push(format!("\n{} of {} cases fail:", failing.len(), rows.len()));
        lines.extend(failing.iter().map(|row| format!("  {}: {}", row.case.name, verdict(row))));
    }
    lines.push(String::new());
    lines.join("\n")
}

/// One row per group of motions.
fn motion_table(rows: &[CaseRow], groups: &[Group]) -> Vec<String> {
    let mut table = Table::new(&[
        "terrain",
        "level",
        "varied",
        "formulation",
        ">cases",
        ">solved",
        ">solved and checked",
        ">continued",
        ">iterations",
        ">max",
        ">feasible at",
        ">solve CPU s",
        ">max",
        ">map CPU s",
        ">violation",
        ">max",
    ]);
    for group in groups {
        table.row([
            group.terrain.clone(),
            group.level.clone(),
            group.parameter.map_or(String::new(), |(name, value)| format!("{name} {value}")),
            group.method.clone(),
            group.cases.to_string(),
            count(group.solved, group.cases),
            count(group.passed, group.cases),
            group.continued.to_string(),
            plain(group.iterations),
            plain(group.iterations_max),
            plain(group.first_feasible),
            figure(group.cpu_solve),
            figure(group.cpu_solve_max),
            figure(group.cpu_map),
            figure(group.violation),
            figure(group.violation_max),
        ]);
    }
    let mut lines = table.lines(|_, _, text| text);
    lines.push(
        "Figures are medians over the cases, those of iterations over the solved ones; max: the maximum."
            .into(),
    );
    lines.extend(evaluations(rows));
    lines
}

/// Size of the NLP and time of its functions, one row per case for which they were measured.
fn evaluations(rows: &[CaseRow]) -> Vec<String> {
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
        let Some(motion) = row.motion() else { continue };
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
        true => std::iter::once("\nWall times, which depend on other load on the machine:".into())
            .chain(table.lines(|_, _, text| text))
            .collect(),
        false => Vec::new(),
    }
}

/// One row per map.
fn map_table(groups: &[Group]) -> Vec<String> {
    let mut table = Table::new(&[
        "terrain",
        "level",
        "method",
        ">CPU s",
        ">conformal error %",
        ">max",
        ">misfit mm",
        ">inversions",
        ">energy m³",
    ]);
    for group in groups {
        let method = match group.taken {
            Some(taken) if group.method == AUTO.0 => format!("auto: {taken}"),
            _ => group.method.clone(),
        };
        let [cpu, mean, max, misfit, energy] =
            [group.cpu_map, group.conformal_error, group.conformal_error_max, group.misfit, group.energy]
                .map(figure);
        let inversions = plain(group.inversions);
        let figures = [cpu, mean, max, misfit, inversions, energy];
        table.row([group.terrain.clone(), group.level.clone(), method].into_iter().chain(figures));
    }
    table.lines(|_, _, text| text)
}

/// One row per group of replays.
fn track_table(groups: &[Group]) -> Vec<String> {
    let mut table = Table::new(&[
        "robot",
        "terrain",
        "level",
        "formulation",
        ">cases",
        ">solved and checked",
        ">pass",
        ">marginal",
        ">fail",
        "decided by",
    ]);
    for group in groups {
        let objections = group.objections.iter().map(|(name, count)| format!("{count} × {name}"));
        let names = [&group.robot, &group.terrain, &group.level, &group.method].map(String::clone);
        let counts = [group.cases.to_string(), count(group.passed, group.cases)];
        let replayed = group.replayed.map(|replays| count(replays, group.cases));
        let decided_by = [objections.collect::<Vec<_>>().join("; ")];
        table.row(names.into_iter().chain(counts).chain(replayed).chain(decided_by));
    }
    let mut lines = table.lines(|_, _, text| text);
    lines.push("Percentages are of all cases. The replay of a plan that is not good is skipped.".into());
    lines
}

/// A count, and its percentage of all.
fn count(part: usize, all: usize) -> String {
    format!("{part} ({:.0} %)", 100.0 * part as f64 / all as f64)
}

/// A figure with three digits, or a dash for none.
fn figure(value: Option<f64>) -> String {
    value.map_or("–".into(), number)
}

/// A figure as it is, or a dash for none.
fn plain(value: Option<f64>) -> String {
    value.map_or("–".into(), |value| format!("{value}"))
}

#[cfg(test)]
mod tests {
    use super::super::fixtures::{replayed_rows, rows};
    use super::super::summary::groups;
    use super::*;

    #[test]
    fn a_table_lists_groups_and_failures() {
        let rows = rows();
        let text = table(&rows, &groups(&rows));
        assert!(text.lines().nth(1).unwrap().contains("2 (50 %)"), "{text}");
        assert!(text.contains("3 of 4 cases fail:") && text.contains("killed"), "{text}");
    }

    #[test]
    fn a_table_of_replays_names_what_decides_them() {
        let rows = replayed_rows();
        let text = table(&rows, &groups(&rows));
        assert!(text.lines().nth(1).unwrap().contains("2 × closed loop: slip"), "{text}");
    }
}
