//! How a case ended, in one line.

use super::case::CaseRow;
use super::measured::{MapMeasured, Measured, MotionMeasured};
use crate::replay::Tracked;
use crate::report::number;

/// How a case ended, in one line.
pub fn verdict(row: &CaseRow) -> String {
    match &row.outcome {
        Err(reason) => reason.clone(),
        Ok(measured) => match (&measured.motion, &measured.map) {
            (Some(motion), _) => motion_verdict(measured, motion),
            (None, Some(map)) => map_verdict(map, measured.cpu.map),
            (None, None) => String::new(),
        },
    }
}

fn motion_verdict(measured: &Measured, motion: &MotionMeasured) -> String {
    let effort = format!("{} iterations, {} s", motion.iterations, number(measured.cpu.solve));
    if !motion.solved {
        let (block, place) = (&motion.worst_block, &motion.worst_place);
        let violation = number(motion.violation);
        return format!("NOT SOLVED ({effort}): {}; {block} violated by {violation}, {place}", motion.status);
    }
    let failed = failed_checks(motion);
    if !failed.is_empty() {
        return format!("solved ({effort}), CHECK FAILS: {failed}");
    }
    let replay =
        measured.track.as_ref().map_or(String::new(), |track| format!("; {}", replay_verdict(track)));
    format!("solved, checks hold ({effort}){replay}")
}

/// The laws that do not hold, each with its value and limit.
fn failed_checks(motion: &MotionMeasured) -> String {
    let failed = motion.checks.iter().filter(|row| !row.passed);
    let descriptions = failed.map(|row| {
        let foot = row.foot.as_ref().map_or(String::new(), |foot| format!(" {foot}"));
        let time = row.time.map_or(String::new(), |time| format!(" at {time:.2} s"));
        format!("{} {} > {} {}{foot}{time}", row.name, number(row.value), number(row.limit), row.unit)
    });
    descriptions.collect::<Vec<_>>().join("; ")
}

fn map_verdict(map: &MapMeasured, cpu_seconds: f64) -> String {
    let report = &map.report;
    let convergence = if report.converged { "" } else { ", NOT CONVERGED" };
    let folds = match report.inverted_points {
        0 => String::new(),
        n => format!(", FOLDED at {n} points"),
    };
    format!(
        "conformal error {} %, misfit {} mm, {} s{convergence}{folds}",
        number(100.0 * report.conformal_ground.mean),
        number(1e3 * report.misfit_max),
        number(cpu_seconds)
    )
}

/// Verdict of a replay, the metric that decides it, and the first incident.
fn replay_verdict(track: &Tracked) -> String {
    let metric = track.first_failing().map_or(String::new(), |metric| {
        let value = metric.value.map_or("not a number".into(), number);
        format!(": {}: {} {value} {} (pass {})", metric.layer, metric.name, metric.unit, number(metric.pass))
    });
    let first = track.first_failure.as_ref().map_or(String::new(), |incident| {
        let foot = incident.foot.as_ref().map_or(String::new(), |foot| format!(" {foot}"));
        let time = incident.time.map_or(String::new(), |time| format!(" at {time:.2} s"));
        format!("; first{time}{foot}: {}", incident.what)
    });
    format!("replay: {}{metric}{first}", track.verdict.name())
}

#[cfg(test)]
mod tests {
    use super::super::fixtures::{replayed_rows, rows};
    use super::*;

    #[test]
    fn verdicts_name_the_law_the_constraint_and_the_reason() {
        let verdicts: Vec<String> = rows().iter().map(verdict).collect();
        assert!(verdicts[0].starts_with("solved, checks hold"));
        assert!(verdicts[1].contains("friction 2.00 > 0.500 % m g LF at 1.50 s"), "{}", verdicts[1]);
        assert!(verdicts[2].starts_with("NOT SOLVED") && verdicts[2].contains("reach violated by 0.300"));
        assert_eq!(verdicts[3], "killed (signal: 9), no message");
    }

    #[test]
    fn the_verdict_of_a_replay_names_the_metric_that_decides_it() {
        let text = verdict(&replayed_rows()[1]);
        assert!(
            text.contains("replay: fail: closed loop: slip 2.50 mm") && text.contains("1.50 s LF"),
            "{text}"
        );
    }
}
