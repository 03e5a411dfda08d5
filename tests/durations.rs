//! Optimized phase durations: motions are solved and hold like others, their phases differ from the nominal ones and keep to
//! their bounds, and they cost less.

use std::path::Path;

use crate::common::solved;
use warpgait::check::check;
use warpgait::pipeline;
use warpgait::plan::Plan;
use warpgait::planner::Motion;
use warpgait::scenario::load_text;

/// The least objective of a feasible iterate.
fn cost(motion: &Motion) -> f64 {
    let feasible = motion.history.iter().filter(|r| r.violation <= 1e-4);
    feasible.map(|r| r.objective).fold(f64::INFINITY, f64::min)
}

const TERRAINS: [&str; 2] = [
    "kind = \"rippled\"\n[start]\nposition = [0.0, 0.0]\n[goal]\nposition = [0.4, 0.4]\n[robot]\nname = \"anymal_towr\"\n",
    "kind = \"hilly\"\n[start]\nposition = [-1.4, 0.0]\n[goal]\nposition = [-0.9, 0.1]\n\
     [robot]\nname = \"anymal_towr\"\nadhesive_feet = [\"LF\", \"RF\"]\n",
];

#[test]
fn free_switches_give_better_motions_that_hold() {
    for terrain in TERRAINS {
        for formulation in ["warped", "direct", "hybrid"] {
            let text = |gait: &str| {
                format!(
                    "formulation = \"{formulation}\"\nhorizon = 4.0\n[contact]\nfriction_margin = 0.0\n[terrain]\n{terrain}[gait]\n{gait}"
                )
            };
            let (fixed, _) = solved(&text("cycle = 1.0\nduty = 0.75\n"));
            let (free, plan) = solved(&text(
                "cycle = 1.0\nduty = 0.75\noptimize_durations = true\nduration_bounds = [0.1, 0.9]\n",
            ));
            let name = format!("{formulation}, {}", &terrain[..16]);
            assert!(free.solved, "{name}: {}; {:?}", free.status, free.violations);
            let report = check(&plan).expect("a sound plan");
            let failed: Vec<_> = report.rows.iter().filter(|row| !row.passed).collect();
            assert!(failed.is_empty(), "{name}: {failed:?}");
            assert!(cost(&free) < 0.99 * cost(&fixed), "{name}: {} and {}", cost(&free), cost(&fixed));

            let mut moved = 0;
            for durations in &plan.phase_durations {
                assert!((durations.iter().sum::<f64>() - 4.0).abs() < 1e-9, "{name}: {durations:?}");
                for (n, duration) in durations.iter().enumerate() {
                    let inner = n > 0 && n + 1 < durations.len();
                    assert!(*duration > 0.1 - 1e-5, "{name}: {durations:?}");
                    assert!(!inner || *duration < 0.9 + 1e-5, "{name}: {durations:?}");
                    let off_grid = (duration / 0.05 - (duration / 0.05).round()).abs() > 1e-3;
                    moved += usize::from(n % 2 == 1 && (duration - 0.25).abs() > 0.01 && off_grid);
                }
            }
            assert!(moved >= 8, "{name}: only {moved} swings have another duration");
        }
    }
}

/// A plan is read back with its switches where they are: its exact motion goes through its samples.
#[test]
fn a_plan_with_switches_between_samples_is_read_back() {
    let text = "formulation = \"direct\"\nhorizon = 2.5\n[terrain]\nkind = \"rippled\"\n[start]\nposition = [0.0, 0.0]\n\
                [goal]\nposition = [0.2, 0.1]\n[gait]\noptimize_durations = true\n[solver]\nmax_iterations = 20\ncontinuation = \"off\"\n";
    let (_, plan) = solved(text);
    let folder = tempfile::tempdir().expect("a folder");
    let path = folder.path().join("a.plan.npz");
    plan.write(&path).expect("written");
    let plan = Plan::read(&path).expect("read");
    let motion = plan.motion().expect("a motion");
    for (n, &t) in plan.t.iter().enumerate() {
        for e in 0..4 {
            let (foot, at) = (motion.foot(e, t).expect("a foot"), 4 * n + e);
            assert_eq!(foot.contact, plan.foot_contact[at], "contact of foot {e} at {t} s");
            for c in 0..3 {
                assert!((foot.position[c] - plan.foot_position[at][c]).abs() < 1e-9, "foot {e} at {t} s");
                assert!((foot.velocity[c] - plan.foot_velocity[at][c]).abs() < 1e-7, "foot {e} at {t} s");
                assert!((foot.force[c] - plan.foot_force[at][c]).abs() < 1e-7, "force {e} at {t} s");
            }
            assert!(
                foot.contact || plan.foot_force[at] == [0.0; 3],
                "foot {e} bears something in swing at {t} s"
            );
        }
    }
}

#[test]
fn bounds_that_cannot_hold_are_refused_before_anything_is_computed() {
    let scenario = |gait: &str| {
        format!(
            "schema = 1\nhorizon = 4.0\n[robot]\nname = \"anymal_towr\"\n[terrain]\nkind = \"flat\"\n[start]\nposition = [0.0, 0.0]\n[goal]\nposition = [0.3, 0.0]\n\
             [gait]\noptimize_durations = true\n{gait}\n"
        )
    };
    let cases = [
        ("duration_bounds = [0.9, 2.0]", "do not fit into the horizon of 4 s"),
        ("duration_bounds = [0.3, 2.0]", "the swing of 0.200 s"),
        ("duration_bounds = [0.1, 0.3]", "is not within gait.duration_bounds = [0.1, 0.3]"),
        ("cycle = 0.4\nduty = 0.75", "at least three time steps"),
        ("cycle = 0.4\nduty = 0.5", "no switch has room"),
        ("kind = \"stand\"", "\"stand\" has no steps"),
    ];
    for (gait, words) in cases {
        let text = scenario(gait);
        let refused = load_text("s.toml", &text, Path::new("."), &[]).and_then(|loaded| {
            pipeline::run(&loaded, false, &mut |event| panic!("{gait}: something has begun: {event:?}"))
                .map(|_| ())
        });
        let message = refused.expect_err(words).to_string();
        assert!(message.contains(words), "{gait}: `{words}` is not in: {message}");
    }
}
