//! Rows that the tests of several files use.

use super::case::CaseRow;
use super::kind::Bench;
use super::measured::{Cpu, Measured, MotionMeasured};
use super::options::BenchOptions;
use super::protocol;
use crate::plan::CheckRow;
use crate::replay::{Incident, Metric, Tracked, Verdict};

fn row(index: usize, motion: MotionMeasured, seconds: f64) -> CaseRow {
    let case = protocol::cases(Bench::Table1, &BenchOptions::default()).remove(2 * index);
    let cpu = Cpu { solve: seconds, ..Cpu::default() };
    CaseRow { case, outcome: Ok(Measured { motion: Some(motion), map: None, track: None, cpu }) }
}

/// Four cases of one group: good, failing a check, not solved, without a result.
pub fn rows() -> Vec<CaseRow> {
    let good =
        MotionMeasured { solved: true, passed: true, iterations: 10, violation: 1e-5, ..Default::default() };
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
    let unsolved = MotionMeasured {
        solved: false,
        status: "too, many \"iterations\"".into(),
        worst_block: "reach".into(),
        violation: 0.3,
        ..good.clone()
    };
    let mut killed = row(3, good.clone(), 0.0);
    killed.outcome = Err("killed (signal: 9), no message".into());
    vec![row(0, good, 1.0), row(1, slips, 3.0), row(2, unsolved, 9.0), killed]
}

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
        Some(Incident { time: Some(1.5), foot: Some("LF".into()), what: "slips, badly".into() });
    Tracked {
        verdict,
        first_failure: first_failure.filter(|_| verdict != Verdict::Pass),
        metrics: vec![metric("feet", Verdict::Pass), metric("slip", verdict)],
        seconds: 4.0,
    }
}

/// Three cases of one group whose replays pass, fail and fail.
pub fn replayed_rows() -> Vec<CaseRow> {
    let cases = protocol::cases(Bench::Track, &BenchOptions { quick: true, ..BenchOptions::default() });
    let same = cases
        .into_iter()
        .filter(|case| case.terrain == "pit" && case.method == "direct" && case.robot == "anymal_c");
    let verdicts = [Verdict::Pass, Verdict::Fail, Verdict::Fail];
    same.zip(verdicts)
        .map(|(case, verdict)| {
            let motion = MotionMeasured { solved: true, passed: true, ..Default::default() };
            let track = Some(tracked(verdict));
            let measured = Measured { motion: Some(motion), track, ..Default::default() };
            CaseRow { case, outcome: Ok(measured) }
        })
        .collect()
}
