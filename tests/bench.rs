//! `warpgait bench`: a row for every case, finished cases kept, bad input refused.

use std::path::Path;
use std::process::Command;

use serde_json::Value;

fn warpgait(folder: &Path, arguments: &[&str]) -> (i32, String, String) {
    let output =
        Command::new(env!("CARGO_BIN_EXE_warpgait")).current_dir(folder).args(arguments).output().unwrap();
    let text = |bytes: Vec<u8>| String::from_utf8(bytes).unwrap();
    (output.status.code().unwrap(), text(output.stdout), text(output.stderr))
}

fn results(folder: &Path, bench: &str) -> Value {
    let path = folder.join("bench").join(bench).join("results.json");
    serde_json::from_slice(&std::fs::read(path).unwrap()).unwrap()
}

#[test]
fn finished_cases_are_kept_and_a_damaged_one_is_computed_again() {
    let folder = tempfile::tempdir().unwrap();
    let arguments =
        ["bench", "table1", "--quick", "--terrain", "rippled", "--formulation", "direct", "--level", "easy"];
    let (code, out, err) = warpgait(folder.path(), &arguments);
    assert_eq!(code, 0, "{err}");
    assert!(out.contains("3 (100 %)") && out.contains("results.csv"), "{out}");
    let first = results(folder.path(), "table1");
    let motion = &first["cases"][0]["measured"]["motion"];
    assert_eq!(motion["solved"], true);
    let history = motion["history"].as_array().unwrap();
    assert_eq!(history.len() as u64, motion["iterations"].as_u64().unwrap() + 1);
    let cpu = first["cases"][0]["measured"]["cpu"]["solve"].as_f64().unwrap();
    assert!(cpu > 0.01 && cpu < 100.0, "{cpu}");

    let case = folder.path().join("bench/cases/anymal_towr-rippled-easy-000-direct.json");
    std::fs::write(&case, "{").unwrap();
    let kept = folder.path().join("bench/cases/anymal_towr-rippled-easy-120-direct.json");
    let written = std::fs::metadata(&kept).unwrap().modified().unwrap();
    let (code, _, err) = warpgait(folder.path(), &arguments);
    assert_eq!(code, 0, "{err}");
    assert_eq!(std::fs::metadata(&kept).unwrap().modified().unwrap(), written);
    let second = results(folder.path(), "table1");
    // The kept row is identical, times included; the case computed again took as many iterations.
    assert_eq!(second["cases"][1], first["cases"][1]);
    assert_eq!(second["cases"][0]["measured"]["motion"]["iterations"], motion["iterations"]);
    let svg = std::fs::read_to_string(folder.path().join("bench/table1/table1.svg")).unwrap();
    assert!(svg.starts_with("<svg"));
}

#[test]
fn every_method_of_the_map_is_a_row_with_its_quality() {
    let folder = tempfile::tempdir().unwrap();
    let arguments = ["bench", "map", "--quick", "--terrain", "conic", "--json"];
    let (code, out, _) = warpgait(folder.path(), &arguments);
    assert_eq!(code, 0);
    let printed: Value = serde_json::from_str(&out).unwrap();
    assert_eq!(printed["bench"], "map");
    let results = results(folder.path(), "map");
    let cases = results["cases"].as_array().unwrap();
    assert_eq!(cases.len(), 8);
    for case in cases {
        let report = &case["measured"]["map"]["report"];
        assert!(report["misfit_max"].as_f64().unwrap() < 5e-3, "{case}");
        let folded = report["inverted_points"].as_u64().unwrap() > 0;
        assert_eq!(case["verdict"].as_str().unwrap().contains("FOLDED"), folded, "{case}");
        assert_eq!(case["good"], !folded, "{case}");
        let open = case["method"] == "auto";
        assert!(
            !open || (report["method"] == "mips" && report["rejected"][0]["method"] == "shear"),
            "{case}"
        );
    }
    let csv = std::fs::read_to_string(folder.path().join("bench/map/results.csv")).unwrap();
    assert_eq!(csv.lines().count(), 9);
}

#[test]
fn a_case_that_takes_too_long_times_out() {
    let folder = tempfile::tempdir().unwrap();
    // The steepest map takes seconds on any machine.
    let arguments = ["bench", "fig4", "--level", "hard", "--terrain", "pit", "--time-limit", "1"];
    let (code, out, _) = warpgait(folder.path(), &arguments);
    assert_eq!(code, 0);
    assert!(out.contains("1 of 1 cases fail") && out.contains("timed out after 1 s"), "{out}");
}

/// The running process whose parent is `parent`.
#[cfg(target_os = "linux")]
fn child_of(parent: u32) -> Option<u32> {
    let entries = std::fs::read_dir("/proc").unwrap().flatten();
    let mut ids = entries.filter_map(|entry| entry.file_name().to_str()?.parse::<u32>().ok());
    ids.find(|id| stat(*id).is_some_and(|(state, of)| of == parent && state != 'Z'))
}

/// State and parent of a process, from `/proc/ID/stat` (id, name, state, parent, …); none when it has ended.
#[cfg(target_os = "linux")]
fn stat(id: u32) -> Option<(char, u32)> {
    let text = std::fs::read_to_string(format!("/proc/{id}/stat")).ok()?;
    let mut fields = text[text.rfind(')')? + 1..].split_whitespace();
    Some((fields.next()?.chars().next()?, fields.next()?.parse().ok()?))
}

/// Calls `ask` until it answers, for a minute at most.
#[cfg(target_os = "linux")]
fn awaited<T>(what: &str, mut ask: impl FnMut() -> Option<T>) -> T {
    for _ in 0..1200 {
        if let Some(answer) = ask() {
            return answer;
        }
        std::thread::sleep(std::time::Duration::from_millis(50));
    }
    panic!("{what}: not within a minute");
}

#[test]
#[cfg(target_os = "linux")]
fn a_case_ends_with_its_sweep() {
    for signal in ["TERM", "KILL"] {
        let folder = tempfile::tempdir().unwrap();
        let mut sweep = Command::new(env!("CARGO_BIN_EXE_warpgait"))
            .current_dir(folder.path())
            // A map that takes seconds on any machine.
            .args(["bench", "fig4", "--level", "hard", "--terrain", "pit", "--quiet"])
            .spawn()
            .unwrap();
        let case = awaited("the process of the case", || child_of(sweep.id()));
        let kill = format!("kill -{signal} {}", sweep.id());
        assert!(Command::new("sh").args(["-c", &kill]).status().unwrap().success());
        assert!(!sweep.wait().unwrap().success());
        awaited("the end of that process", || stat(case).is_none_or(|(state, _)| state == 'Z').then_some(()));
        let left = std::fs::read_dir(folder.path().join("bench/cases")).unwrap().flatten();
        let result = left.map(|file| file.file_name()).find(|name| name.to_string_lossy().contains("result"));
        assert_eq!(result, None, "SIG{signal}: the case finished before it could be stopped");
    }
}

#[test]
fn the_process_of_a_case_reports_its_error() {
    let folder = tempfile::tempdir().unwrap();
    std::fs::write(folder.path().join("s.toml"), "schema = 1\n").unwrap();
    let (code, out, err) = warpgait(folder.path(), &["bench-case", "plan", "s.toml", "p.npz", "r.json"]);
    assert_eq!((code, out.as_str()), (2, ""));
    assert!(err.contains("terrain"), "{err}");
    assert!(!folder.path().join("r.json").exists());
}

#[test]
fn bad_input_is_refused_before_anything_is_written() {
    let folder = tempfile::tempdir().unwrap();
    for (arguments, part) in [
        (&["bench", "table2"][..], "table1"),
        (&["bench", "table1", "--jobs", "0"], "1..=256"),
        (&["bench", "table1", "--robot", "dog"], "anymal_towr"),
        (&["bench", "table1", "--level", "medium,steep"], "steep"),
        (&["bench", "fig8", "--terrain", "pit"], "no case matches"),
    ] {
        let (code, out, err) = warpgait(folder.path(), arguments);
        assert_eq!((code, out.as_str()), (2, ""), "{arguments:?}: {err}");
        assert!(err.contains(part), "{arguments:?}: {err}");
    }
    assert_eq!(std::fs::read_dir(folder.path()).unwrap().count(), 0);
}
