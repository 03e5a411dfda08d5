//! Replays on the full robot, summed up: verdicts, what decides them, and the distribution of every metric.

use super::csv::{cell, quoted};
use super::summary::Group;
use super::sweep::Row;
use super::tables::share;
use crate::replay::Tracked;
use crate::report::number;
use crate::report::table::Table;

/// The first metric that decides against each replay, counted, the most frequent first.
pub(super) fn objections(tracks: &[&Tracked]) -> Vec<(String, usize)> {
    let mut counted: Vec<(String, usize)> = Vec::new();
    for metric in tracks.iter().filter_map(|track| track.first_failing()) {
        let name = format!("{}: {}", metric.layer, metric.name);
        match counted.iter_mut().find(|(known, _)| *known == name) {
            Some((_, count)) => *count += 1,
            None => counted.push((name, 1)),
        }
    }
    counted.sort_by_key(|(_, count)| std::cmp::Reverse(*count));
    counted
}

/// How a replay went, to be put after what became of the plan.
pub(super) fn verdict(track: &Tracked) -> String {
    let metric = track.first_failing().map_or(String::new(), |metric| {
        let value = metric.value.map_or("no number".into(), number);
        format!(": {}: {} {value} {} (pass {})", metric.layer, metric.name, metric.unit, number(metric.pass))
    });
    let first = track.first_failure.as_ref().map_or(String::new(), |incident| {
        let foot = incident.foot.as_ref().map_or(String::new(), |foot| format!(" {foot}"));
        format!("; first at {:.2} s{foot}: {}", incident.time, incident.what)
    });
    format!("; replay: {}{metric}{first}", track.verdict.word())
}

/// The groups with their replays.
pub(super) fn table(groups: &[Group]) -> Vec<String> {
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
        "what decides against them",
    ]);
    for group in groups {
        let words = group.objections.iter().map(|(name, count)| format!("{count} × {name}"));
        let names = [&group.robot, &group.terrain, &group.level, &group.method].map(String::clone);
        let counts = [group.cases.to_string(), share(group.passed, group.cases)];
        let replayed = group.replayed.map(|count| share(count, group.cases));
        let why = [words.collect::<Vec<_>>().join("; ")];
        table.row(names.into_iter().chain(counts).chain(replayed).chain(why));
    }
    let mut lines = table.lines(|_, _, text| text);
    lines.push("Shares are of all cases; a plan that is not solved is not replayed.".into());
    lines
}

/// `metrics.csv`: one row for each metric of each replay, for the choice of limits.
pub(super) fn metrics_csv(rows: &[Row]) -> String {
    let mut text =
        String::from("case,robot,terrain,level,method,layer,metric,value,unit,pass,marginal,verdict\n");
    for row in rows {
        let case = &row.case;
        let track = row.outcome.as_ref().ok().and_then(|m| m.track.as_ref());
        for metric in track.iter().flat_map(|track| &track.metrics) {
            let place = [&case.name, &case.robot, &case.terrain, &case.level, &case.method, &metric.layer];
            let limits = [metric.pass, metric.marginal].map(|limit| limit.to_string());
            let cells = place.into_iter().chain([&metric.name]).cloned();
            let cells = cells.chain([cell(metric.value), metric.unit.clone()]).chain(limits);
            let cells = cells.chain([metric.verdict.word().to_owned()]);
            text += &cells.map(|cell| quoted(&cell)).collect::<Vec<_>>().join(",");
            text.push('\n');
        }
    }
    text
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::bench::case::{Measured, MotionMeasured};
    use crate::bench::{Bench, Options, summary};
    use crate::replay::{Incident, Metric, Verdict};

    fn tracked(verdict: Verdict) -> Tracked {
        let metric = |name: &str, verdict| Metric {
            layer: "closed loop".into(),
            name: name.into(),
            value: Some(2.5),
            unit: "mm".into(),
            pass: 1.0,
            marginal: 2.0,
            verdict,
        };
        let first_failure =
            Some(Incident { time: 1.5, foot: Some("LF".into()), what: "slips, badly".into() });
        Tracked {
            verdict,
            first_failure: first_failure.filter(|_| verdict != Verdict::Pass),
            metrics: vec![metric("feet", Verdict::Pass), metric("slip", verdict)],
            seconds: 4.0,
        }
    }

    #[test]
    fn replays_are_counted_by_verdict_and_cause() {
        let cases = Bench::Track.cases(&Options { quick: true, ..Options::default() });
        assert!(cases.iter().any(|c| c.robot == "anymal_b") && cases.iter().any(|c| c.robot == "anymal_c"));
        let verdicts = [Verdict::Pass, Verdict::Fail, Verdict::Fail];
        let same =
            cases.iter().filter(|c| c.terrain == "pit" && c.method == "direct" && c.robot == "anymal_c");
        let rows: Vec<Row> = same
            .zip(verdicts)
            .map(|(case, verdict)| {
                let motion = MotionMeasured { solved: true, passed: true, ..Default::default() };
                let track = Some(tracked(verdict));
                Row {
                    case: case.clone(),
                    outcome: Ok(Measured { motion: Some(motion), track, ..Default::default() }),
                }
            })
            .collect();
        let groups = summary::groups(&rows);
        assert_eq!(groups.len(), 1);
        assert_eq!((groups[0].cases, groups[0].passed, groups[0].replayed), (3, 3, [1, 0, 2]));
        assert_eq!(groups[0].objections, [("closed loop: slip".to_owned(), 2)]);
        assert!(summary::is_good(&rows[0]) && !summary::is_good(&rows[1]));
        let words = summary::verdict(&rows[1]);
        assert!(
            words.contains("replay: fail: closed loop: slip 2.50 mm") && words.contains("1.50 s LF"),
            "{words}"
        );
        assert!(table(&groups).iter().any(|line| line.contains("2 × closed loop: slip")));
        assert_eq!(metrics_csv(&rows).lines().count(), 7);
    }
}
