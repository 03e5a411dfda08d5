//! `[guess]`: a motion to start the solve from.

use std::ops::ControlFlow;
use std::path::Path;

use tempfile::TempDir;
use warpgait::ipopt::NlpProblem;
use warpgait::pipeline::{self, Prepared};
use warpgait::plan::Plan;
use warpgait::planner::{Iterate, IterateSamples};
use warpgait::scenario::{Formulation, load_text};
use warpgait::warp;

use crate::common::solved;

fn walk(formulation: &str, robot: &str) -> String {
    format!(
        "formulation = \"{formulation}\"\nhorizon = 3.0\n[robot]\nname = \"{robot}\"\n\
         [terrain]\nkind = \"formula\"\nexpression = \"0.04*sin(5*x)*cos(4*y)\"\nextent = [-1.5, 1.5, -1.5, 1.5]\nspacing = 0.02\n\
         [start]\nposition = [0.0, 0.0]\n[goal]\nposition = [0.3, 0.0]\n"
    )
}

/// The motion as a CSV, every `step`-th sample.
fn csv(plan: &Plan, step: usize) -> String {
    let feet = &plan.foot_names;
    let mut text = String::from("# a comment\ntime");
    let axes = ["x", "y", "z"];
    axes.iter().for_each(|axis| text += &format!(",center_of_mass_{axis}"));
    ["w", "x", "y", "z"].iter().for_each(|part| text += &format!(",base_quaternion_{part}"));
    for foot in feet {
        axes.iter().for_each(|axis| text += &format!(",{foot}_contact_position_{axis}"));
        axes.iter().for_each(|axis| text += &format!(",{foot}_force_{axis}"));
    }
    for n in (0..plan.t.len()).step_by(step) {
        let mut row = vec![plan.t[n]];
        row.extend(plan.base_position[n]);
        row.extend(plan.base_quaternion_wxyz[n]);
        for i in 0..feet.len() {
            row.extend(plan.foot_position[n * feet.len() + i]);
            row.extend(plan.foot_force[n * feet.len() + i]);
        }
        text += "\n";
        text += &row.iter().map(f64::to_string).collect::<Vec<_>>().join(",");
    }
    text + "\n"
}

/// The guess of a scenario whose relative paths start at a folder.
fn guess(folder: &Path, text: &str) -> IterateSamples {
    let loaded = load_text("s.toml", text, folder, &[]).expect("a scenario");
    let prepared = Prepared::new(&loaded, &mut |_| ControlFlow::Continue(())).expect("a ground");
    let scenario = &loaded.scenario;
    let build = || warp::build(&prepared.surfaces.posture, &scenario.map, &mut |_| ControlFlow::Continue(()));
    let map = (scenario.formulation() != Formulation::Direct).then(|| build().expect("a map").0);
    let problem = prepared.task(&loaded, map.as_ref()).problem().expect("a guess");
    let mut x = vec![0.0; problem.num_variables()];
    problem.initial_point(&mut x);
    Iterate { model: &problem.model, x: &x }.sampled()
}

fn farthest(a: &[[f64; 3]], b: &[[f64; 3]]) -> f64 {
    assert_eq!(a.len(), b.len());
    a.iter().zip(b).flat_map(|(a, b)| (0..3).map(move |d| (a[d] - b[d]).abs())).fold(0.0, f64::max)
}

#[test]
fn the_guess_is_the_motion_of_the_file() {
    for (formulation, robot) in [("warped", "anymal_towr"), ("direct", "anymal_towr"), ("hybrid", "anymal_c")]
    {
        let text = walk(formulation, robot);
        let (_, plan) = solved(&text);
        let folder = TempDir::new().unwrap();
        plan.write(&folder.path().join("m.plan.npz")).unwrap();
        std::fs::write(folder.path().join("m.csv"), csv(&plan, 1)).unwrap();
        // 50 frames a second instead of 200.
        std::fs::write(folder.path().join("coarse.csv"), csv(&plan, 4)).unwrap();
        let feet = plan.foot_names.len();
        for file in ["m.plan.npz", "m.csv", "coarse.csv"] {
            let found = guess(folder.path(), &format!("{text}[guess]\nfile = \"{file}\"\n"));
            let at: Vec<usize> = found.t.iter().map(|t| (t * 200.0).round() as usize).collect();
            let base: Vec<[f64; 3]> = at.iter().map(|&n| plan.base_position[n]).collect();
            let of_feet = |values: &[[f64; 3]]| -> Vec<[f64; 3]> {
                at.iter().flat_map(|&n| values[n * feet..][..feet].to_vec()).collect()
            };
            let name = format!("{formulation} {file}");
            assert!(
                farthest(&found.base_position, &base) < 1e-3,
                "{name}: base {}",
                farthest(&found.base_position, &base)
            );
            let foot = farthest(&found.foot_position, &of_feet(&plan.foot_position));
            assert!(foot < 5e-3, "{name}: feet {foot}");
            let (force, weight) = (farthest(&found.foot_force, &of_feet(&plan.foot_force)), 300.0);
            assert!(force < 0.1 * weight, "{name}: forces {force} N");
            for (q, &n) in found.base_quaternion_wxyz.iter().zip(&at) {
                let same: f64 = q.iter().zip(&plan.base_quaternion_wxyz[n]).map(|(a, b)| a * b).sum();
                assert!(same.abs() > 1.0 - 1e-5, "{name}: turned by {}", 2.0 * same.abs().acos());
            }
        }
        let again =
            load_text("s.toml", &format!("{text}[guess]\nfile = \"m.csv\"\n"), folder.path(), &[]).unwrap();
        let again = pipeline::run(&again, false, &mut |_| ControlFlow::Continue(())).unwrap().unwrap();
        assert!(again.motion.solved && again.check.passed);
        assert!(again.plan.meta.inputs.iter().any(|(name, _)| name == "m.csv"));
    }
}

#[test]
fn files_that_do_not_fit_are_refused_with_their_line() {
    let text = walk("direct", "anymal_towr") + "[guess]\nfile = \"m.csv\"\n";
    let folder = TempDir::new().unwrap();
    let good = {
        let motion = crate::common::standing();
        // Three seconds.
        let mut plan = motion;
        plan.t.iter_mut().for_each(|t| *t *= 3.0);
        csv(&plan, 10)
    };
    let line = |n: usize| good.lines().nth(n - 1).unwrap().to_owned();
    let with = |n: usize, other: String| good.replace(&line(n), &other);
    let mut cells: Vec<String> = line(5).split(',').map(String::from).collect();
    cells[2] = "nan".into();
    let nan = cells.join(",");
    cells[2] = "0".into();
    (cells[4], cells[5]) = ("2".into(), "0".into());
    let long = cells.join(",");
    let header = line(2);
    for (content, words) in [
        (
            with(2, header.replace("RF_contact_position_y", "other")),
            "m.csv:2: RF_contact_position_y: there is no such column",
        ),
        (
            with(2, header.replace("base_quaternion_z", "base_quaternion_x")),
            "m.csv:2: base_quaternion_x: two columns",
        ),
        (
            with(2, header.replace("LH_contact", "LM_contact")),
            "m.csv:2: has a foot LM; the feet of the robot are LF, RF, LH, RH",
        ),
        (with(5, nan), "m.csv:5: center_of_mass_y: given \"nan\", allowed: a finite number"),
        (with(5, long), "quaternion has a norm of 2"),
        (with(5, "1,2".into()), "m.csv:5: has 2 values, expected"),
        (with(5, line(4)), "m.csv:5: time: "),
        (
            good.lines().take(12).collect::<Vec<_>>().join("\n"),
            "lasts 1.35 s, the motion 3 s; allowed: the same duration",
        ),
        (String::new(), "has no line with the names"),
        (good.lines().take(2).collect::<Vec<_>>().join("\n"), "has 0 frames"),
    ] {
        std::fs::write(folder.path().join("m.csv"), content).unwrap();
        let error = load_text("s.toml", &text, folder.path(), &[]).unwrap_err().to_string();
        assert!(error.starts_with("s.toml:15: guess.file: ") && error.contains(words), "{error}");
        assert_eq!(error.lines().count(), 1);
    }
    std::fs::write(folder.path().join("m.csv"), &good).unwrap();
    load_text("s.toml", &text, folder.path(), &[]).expect("the file itself is good");
    // As a spreadsheet writes it.
    let quoted = header.split(',').map(|name| format!("\"{name}\"")).collect::<Vec<_>>().join(",");
    let from_spreadsheet: Vec<&str> = std::iter::once(&*quoted).chain(good.lines().skip(2)).collect();
    let content = format!("\u{feff}{}", from_spreadsheet.join("\r\n"));
    std::fs::write(folder.path().join("m.csv"), content).unwrap();
    load_text("s.toml", &text, folder.path(), &[]).expect("a byte order mark and quotes");
    let plan = text.replace("m.csv", "other.plan.npz");
    let mut motion = crate::common::standing();
    motion.foot_names[2] = "LM".into();
    motion.write(&folder.path().join("other.plan.npz")).unwrap();
    let error = load_text("s.toml", &plan, folder.path(), &[]).unwrap_err().to_string();
    assert!(
        error.contains("`foot_names`: feet LF, RF, LM, RH; the feet of the robot are LF, RF, LH, RH"),
        "{error}"
    );
    let error =
        load_text("s.toml", &text.replace("m.csv", "none.csv"), folder.path(), &[]).unwrap_err().to_string();
    assert!(error.contains("none.csv"), "{error}");
}
