//! `results.csv`: one row a case.

use super::summary::verdict;
use super::sweep::Row;

const COLUMNS: &str = "case,robot,terrain,level,method,parameter,value,heading_deg,solved,passed,iterations,first_feasible,\
    continuation,violation,cpu_solve_s,cpu_map_s,map_cached,map_wall_s,conformal_error_percent,\
    conformal_error_most_percent,misfit_mm,inversions,energy_m3,\
    constraints_ms,jacobian_ms,hessian_ms,wall_evaluation_s,wall_linear_solver_s,wall_total_s,\
    replay,replay_decided_by,replay_s,verdict";

/// One row a case; what does not apply stays empty.
pub(super) fn csv(rows: &[Row]) -> String {
    let mut text = format!("{COLUMNS}\n");
    for row in rows {
        text += &csv_row(row).iter().map(|cell| quoted(cell)).collect::<Vec<_>>().join(",");
        text.push('\n');
    }
    text
}

fn csv_row(row: &Row) -> Vec<String> {
    let case = &row.case;
    let measured = row.outcome.as_ref().ok();
    let motion = measured.and_then(|m| m.motion.as_ref());
    let map = measured.and_then(|m| m.map.as_ref());
    let track = measured.and_then(|m| m.track.as_ref());
    let evaluation = motion.and_then(|m| m.evaluation.as_ref());
    vec![
        case.name.clone(),
        case.robot.clone(),
        case.terrain.clone(),
        case.level.clone(),
        case.method.clone(),
        cell(case.parameter.map(|(name, _)| name)),
        cell(case.parameter.map(|(_, value)| value)),
        cell(case.heading),
        // A case without a result is not solved.
        case_cell(row, motion.map(|m| m.solved)),
        case_cell(row, motion.map(|m| m.solved && m.passed)),
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
        cell(track.map(|t| t.verdict.word())),
        cell(track.and_then(|t| Some(t.first_failing()?.name.clone()))),
        cell(track.map(|t| t.seconds)),
        verdict(row),
    ]
}

/// A value, or nothing.
pub(super) fn cell(value: Option<impl ToString>) -> String {
    value.map_or(String::new(), |value| value.to_string())
}

fn case_cell(row: &Row, value: Option<bool>) -> String {
    if row.outcome.is_err() { "false".into() } else { cell(value) }
}

/// A cell of RFC 4180.
pub(super) fn quoted(cell: &str) -> String {
    match cell.contains([',', '"', '\n', '\r']) {
        true => format!("\"{}\"", cell.replace('"', "\"\"")),
        false => cell.to_owned(),
    }
}

#[cfg(test)]
mod tests {
    use super::super::summary::tests::rows;
    use super::*;

    #[test]
    fn csv_has_as_many_cells_as_columns() {
        let rows = rows();
        assert_eq!(csv_row(&rows[3]).len(), COLUMNS.split(',').count());
        let text = csv(&rows);
        assert_eq!(text.lines().count(), 5);
        assert!(text.lines().nth(3).unwrap().ends_with('"'));
        assert!(text.lines().nth(4).unwrap().contains(",false,false,"));
        assert_eq!(quoted("a \"b\", c"), "\"a \"\"b\"\", c\"");
    }
}
