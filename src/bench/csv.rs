//! Results for spreadsheets: `results.csv` and `metrics.csv`.

use super::case::{Case, CaseRow};
use super::verdict::verdict;

/// Columns of `results.csv`.
const COLUMNS: &str = "case,robot,terrain,level,method,parameter,value,heading_deg,solved,passed,iterations,first_feasible,\
    continuation,violation,cpu_solve_s,cpu_map_s,map_cached,map_wall_s,conformal_error_percent,\
    conformal_error_most_percent,misfit_mm,inversions,energy_m3,\
    constraints_ms,jacobian_ms,hessian_ms,wall_evaluation_s,wall_linear_solver_s,wall_total_s,\
    replay,replay_decided_by,replay_s,verdict";
/// Columns of `metrics.csv`.
const METRIC_COLUMNS: &str = "case,robot,terrain,level,method,layer,metric,value,unit,pass,marginal,verdict";

/// `results.csv`: one row per case; cells that do not apply are empty.
pub(super) fn results(rows: &[CaseRow]) -> String {
    table(COLUMNS, rows.iter().map(case_cells))
}

/// `metrics.csv`: one row per metric of each replay, for choosing the limits.
pub(super) fn metrics(rows: &[CaseRow]) -> String {
    table(METRIC_COLUMNS, rows.iter().flat_map(metric_rows))
}

fn table(columns: &str, rows: impl Iterator<Item = Vec<String>>) -> String {
    let mut text = format!("{columns}\n");
    for row in rows {
        text += &row.iter().map(|cell| quoted(cell)).collect::<Vec<_>>().join(",");
        text.push('\n');
    }
    text
}

fn case_cells(row: &CaseRow) -> Vec<String> {
    let case = &row.case;
    let (measured, motion, map, track) = (row.measured(), row.motion(), row.map(), row.track());
    let evaluation = motion.and_then(|m| m.evaluation.as_ref());
    // A case without a result is not solved.
    let verdict_cell = |value: Option<bool>| if row.outcome.is_err() { "false".into() } else { cell(value) };
    let cells = [
        cell(case.parameter.map(|(name, _)| name)),
        cell(case.parameter.map(|(_, value)| value)),
        cell(case.heading),
        verdict_cell(motion.map(|m| m.solved)),
        verdict_cell(motion.map(|m| m.solved && m.passed)),
        cell(motion.map(|m| m.iterations)),
        cell(motion.and_then(|m| m.first_feasible)),
        cell(motion.map(|m| m.continuation)),
        cell(motion.map(|m| m.violation)),
        cell(motion.and(measured).map(|m| m.cpu.solve)),
        cell(map.and(measured).map(|m| m.cpu.map)),
        cell(map.map(|m| m.cached)),
        cell(map.map(|m| m.report.seconds)),
        cell(map.map(|m| 100.0 * m.report.conformal_ground.mean)),
        cell(map.map(|m| 100.0 * m.report.conformal_ground.max)),
        cell(map.map(|m| 1e3 * m.report.misfit_max)),
        cell(map.map(|m| m.report.inverted_points)),
        cell(map.map(|m| m.report.energy)),
        cell(evaluation.map(|e| e.constraints)),
        cell(evaluation.map(|e| e.jacobian)),
        cell(evaluation.map(|e| e.hessian)),
        cell(motion.map(|m| m.seconds.evaluation)),
        cell(motion.map(|m| m.seconds.linear_solver)),
        cell(motion.map(|m| m.seconds.total)),
        cell(track.map(|t| t.verdict.name())),
        cell(track.and_then(|t| Some(t.first_failing()?.name.clone()))),
        cell(track.map(|t| t.seconds)),
        verdict(row),
    ];
    identity(case).into_iter().chain(cells).collect()
}

fn metric_rows(row: &CaseRow) -> Vec<Vec<String>> {
    let metrics = row.track().map_or(&[][..], |track| &track.metrics);
    let cells = metrics.iter().map(|metric| {
        let cells = [
            metric.layer.clone(),
            metric.name.clone(),
            cell(metric.value),
            metric.unit.clone(),
            metric.pass.to_string(),
            metric.marginal.to_string(),
            metric.verdict.name().to_owned(),
        ];
        identity(&row.case).into_iter().chain(cells).collect()
    });
    cells.collect()
}

/// The first cells of every row.
fn identity(case: &Case) -> [String; 5] {
    [&case.name, &case.robot, &case.terrain, &case.level, &case.method].map(String::clone)
}

/// A value; none gives an empty cell.
fn cell(value: Option<impl ToString>) -> String {
    value.map_or(String::new(), |value| value.to_string())
}

/// A cell, quoted as in RFC 4180 where it has to be.
fn quoted(cell: &str) -> String {
    match cell.contains([',', '"', '\n', '\r']) {
        true => format!("\"{}\"", cell.replace('"', "\"\"")),
        false => cell.to_owned(),
    }
}

#[cfg(test)]
mod tests {
    use super::super::fixtures::{replayed_rows, rows};
    use super::*;

    #[test]
    fn rows_have_as_many_cells_as_columns() {
        let rows = rows();
        assert_eq!(case_cells(&rows[3]).len(), COLUMNS.split(',').count());
        let text = results(&rows);
        assert_eq!(text.lines().count(), 5);
        assert!(text.lines().nth(3).unwrap().ends_with('"'));
        assert!(text.lines().nth(4).unwrap().contains(",false,false,"));
        assert_eq!(quoted("a \"b\", c"), "\"a \"\"b\"\", c\"");
    }

    #[test]
    fn every_metric_of_every_replay_is_a_row() {
        let rows = replayed_rows();
        assert_eq!(metrics(&rows).lines().count(), 7);
        assert_eq!(metric_rows(&rows[0])[0].len(), METRIC_COLUMNS.split(',').count());
    }
}
