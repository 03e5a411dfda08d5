//! Whole motions: solved, checked by the code that reads plans alone, and as a person would expect them. Short horizons, so
//! that all of them run in every build; their residuals are recorded in `tests/residuals.csv`.

use std::collections::BTreeMap;

use crate::common::solved;
use warpgait::check::{CheckReport, check};
use warpgait::plan::Plan;
use warpgait::planner::Motion;

/// Solved and checked.
fn run(text: &str) -> (Motion, Plan, CheckReport) {
    let (motion, plan) = solved(text);
    let report = check(&plan).expect("a sound plan");
    (motion, plan, report)
}

fn failures(report: &CheckReport) -> Vec<String> {
    report
        .rows
        .iter()
        .filter(|row| !row.passed)
        .map(|row| format!("{} = {} {}, limit {}", row.name, row.value, row.unit, row.limit))
        .collect()
}

/// Table I's terrains at medium, both formulations, at reduced size: 4 s, and starts where the terrain is steep.
const CASES: [(&str, &str, &str); 4] = [
    ("rippled", "[start]\nposition = [0.0, 0.0]\n[goal]\nposition = [0.4, 0.4]\n", "[48, 48, 16]"),
    ("conic", "[start]\nposition = [-0.3, 0.0]\n[goal]\nposition = [0.3, 0.1]\n", "[48, 48, 16]"),
    (
        "hilly",
        "[robot]\nname = \"anymal_towr\"\nadhesive_feet = [\"LF\", \"RF\"]\n[start]\nposition = [-1.4, 0.0]\n[goal]\nposition = [-0.9, 0.1]\n",
        "[48, 48, 16]",
    ),
    (
        "pit",
        "[robot]\nname = \"anymal_towr\"\nadhesive_feet = [\"LF\", \"RF\"]\n[start]\nposition = [0.7, 0.0]\n[goal]\nposition = [1.2, 0.0]\n",
        "[64, 64, 16]",
    ),
];

/// Figures that may not grow by more than a fifth (and a little) over what is recorded.
const RECORDED: [&str; 4] = ["newton_rms", "newton_max", "euler_rms", "euler_max"];

#[test]
fn medium_terrains_solve_hold_between_the_samples_and_stay_as_true_as_recorded() {
    let recorded: BTreeMap<String, f64> = include_str!("residuals.csv")
        .lines()
        .skip(1)
        .filter_map(|line| {
            let mut cells = line.split(',');
            let key = format!("{},{},{}", cells.next()?, cells.next()?, cells.next()?);
            Some((key, cells.next()?.parse().ok()?))
        })
        .collect();
    let mut table = String::from("terrain,formulation,figure,value\n");
    let mut worse = Vec::new();
    for (terrain, places, cells) in CASES {
        for formulation in ["warped", "direct", "hybrid"] {
            let robot = if places.contains("[robot]") { "" } else { "[robot]\nname = \"anymal_towr\"\n" };
            let text = format!(
                "formulation = \"{formulation}\"\nhorizon = 4.0\n{robot}[terrain]\nkind = \"{terrain}\"\n{places}[map]\ncells = {cells}\n"
            );
            let (motion, _, report) = run(&text);
            assert!(motion.solved, "{terrain} {formulation}: {}; {:?}", motion.status, motion.violations);
            assert_eq!(failures(&report), Vec::<String>::new(), "{terrain} {formulation}");
            for name in RECORDED {
                let value = report.rows.iter().find(|r| r.name == name).expect("a row").value;
                let key = format!("{terrain},{formulation},{name}");
                table += &format!("{key},{value:.4}\n");
                let before = recorded.get(&key).copied().unwrap_or(0.0);
                if value > 1.2 * before + 0.02 {
                    worse.push(format!("{key}: {value:.4}, recorded {before:.4}"));
                }
            }
        }
    }
    assert!(
        worse.is_empty(),
        "less true than recorded in tests/residuals.csv:\n{}\nall:\n{table}",
        worse.join("\n")
    );
}

#[test]
fn a_standing_robot_has_constant_forces_and_does_not_move() {
    for formulation in ["warped", "direct", "hybrid"] {
        let text = format!(
            "formulation = \"{formulation}\"\nhorizon = 2.0\n[gait]\nkind = \"stand\"\n[terrain]\nkind = \"rippled\"\n\
             [start]\nposition = [0.1, 0.3]\nyaw = 0.4\n[goal]\nposition = [0.1, 0.3]\n[solver]\neffort = \"optimal\"\ntolerance = 1e-6\n"
        );
        let (motion, plan, report) = run(&text);
        assert!(motion.solved, "{formulation}: {}", motion.status);
        assert_eq!(failures(&report), Vec::<String>::new(), "{formulation}");
        let weight = plan.meta.robot.mass * 9.81;
        for n in 0..plan.t.len() {
            for e in 0..4 {
                for c in 0..3 {
                    let change = plan.foot_force[4 * n + e][c] - plan.foot_force[e][c];
                    assert!(change.abs() < 1e-3 * weight, "{formulation}: force {e} changes by {change} N");
                }
            }
            for c in 0..3 {
                let change = plan.base_position[n][c] - plan.base_position[0][c];
                assert!(change.abs() < 1e-4, "{formulation}: the base moves by {change} m");
            }
        }
    }
}

/// A trot straight ahead on flat ground: what LF and RH do, RF and LH do in the mirror half a cycle later.
#[test]
fn a_trot_on_flat_ground_is_symmetric() {
    let text = "formulation = \"direct\"\nhorizon = 6.0\n[robot]\nname = \"anymal_towr\"\n\
                [gait]\nkind = \"trot\"\ncycle = 0.8\nduty = 0.5\n[terrain]\nkind = \"flat\"\nspacing = 0.1\n\
                [start]\nposition = [-0.6, 0.0]\n[goal]\nposition = [0.6, 0.0]\n[solver]\neffort = \"optimal\"\n";
    let (motion, plan, report) = run(text);
    assert!(motion.solved, "{}", motion.status);
    assert_eq!(failures(&report), Vec::<String>::new());
    let weight = plan.meta.robot.mass * 9.81;
    let force = |n: usize, e: usize| plan.foot_force[4 * n + e];
    // In the middle of the motion, away from both ends: half a cycle is 80 samples at 200 Hz.
    for n in 500..620 {
        for (left, right) in [(0, 1), (2, 3)] {
            let (a, b) = (force(n, left)[2], force(n + 80, right)[2]);
            assert!((a - b).abs() < 0.05 * weight, "sample {n}: {a} N and {b} N half a cycle later");
        }
        let sway = plan.base_position[n][1];
        assert!(sway.abs() < 0.03, "sample {n}: the base sways by {sway} m");
    }
}

/// 4.5 m in 3 s at a walk cannot be done: an honest failure that names a block, not a wrong success.
#[test]
fn what_cannot_be_done_is_reported_with_its_place() {
    let text = "formulation = \"direct\"\nhorizon = 3.0\n[robot]\nname = \"anymal_towr\"\n[terrain]\nkind = \"flat\"\nspacing = 0.1\n\
                [start]\nposition = [-2.0, 0.0]\n[goal]\nposition = [-0.8, 0.0]\nyaw = 3.0\n[solver]\nmax_iterations = 30\n";
    let (motion, plan, report) = run(text);
    assert!(!motion.solved && !plan.meta.solver.success);
    assert!(motion.max_violation() > 1e-3);
    let worst = motion.violations.iter().max_by(|a, b| a.largest.total_cmp(&b.largest)).expect("blocks");
    assert!(worst.largest > 1e-3 && !worst.block.is_empty());
    assert!(!report.passed, "the check agrees");
}

/// With `contact.friction_margin` forces keep off the cone by that share.
#[test]
fn a_margin_of_friction_is_left() {
    let text = "formulation = \"direct\"\nhorizon = 3.0\n[robot]\nname = \"anymal_towr\"\n\
                [gait]\nkind = \"trot\"\ncycle = 0.8\n[terrain]\nkind = \"rippled\"\n[start]\nposition = [0.0, 0.0]\n\
                [goal]\nposition = [0.4, 0.1]\n[contact]\nfriction_margin = 0.6\n";
    let slip = |margin: &str| {
        let (motion, plan, report) = run(&text.replace("friction_margin = 0.6", margin));
        assert!(motion.solved, "{}", motion.status);
        assert_eq!(failures(&report), Vec::<String>::new());
        let weight = plan.meta.robot.mass * 9.81;
        let over = |(force, normal): (&[f64; 3], &[f64; 3])| {
            let u: f64 = (0..3).map(|c| force[c] * normal[c]).sum();
            let t = (0..3).map(|c| (force[c] - u * normal[c]).powi(2)).sum::<f64>().sqrt();
            (t - 0.4 * 0.75 * u) / weight
        };
        plan.foot_force.iter().zip(&plan.foot_normal).map(over).fold(0.0, f64::max)
    };
    assert!(slip("friction_margin = 0.6") < 5e-3);
    assert!(slip("friction_margin = 0.0") > 5e-3, "the margin would not matter here");
}
