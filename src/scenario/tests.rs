//! Every shipped scenario loads; every kind of mistake is refused where it stands.

use std::path::Path;

use super::*;

const GOOD: &str = "\
schema = 1
horizon = 10
[terrain]
kind = \"rippled\"
[start]
position = [0, 0.0]
[goal]
position = [1.0, 1.0]
[gait]
kind = \"trot\"
";

fn refusal(text: &str) -> String {
    parse("s.toml", text).expect_err(text).to_string()
}

/// `GOOD` with one line replaced.
fn with(line: &str, replacement: &str) -> String {
    assert!(GOOD.contains(line));
    GOOD.replacen(line, replacement, 1)
}

fn in_folder(text: &str) -> (tempfile::TempDir, std::path::PathBuf) {
    let folder = tempfile::tempdir().unwrap();
    let path = folder.path().join("s.toml");
    std::fs::write(&path, text).unwrap();
    (folder, path)
}

#[test]
fn every_shipped_scenario_loads() {
    let folder = Path::new(env!("CARGO_MANIFEST_DIR")).join("scenarios");
    let mut count = 0;
    for entry in std::fs::read_dir(folder).unwrap() {
        let path = entry.unwrap().path();
        if path.extension().is_some_and(|e| e == "toml") {
            let loaded = load(&path, &[]).unwrap();
            crate::robot::Robot::load(&loaded.scenario.robot, &loaded.base_dir).unwrap();
            count += 1;
        }
    }
    assert!(count >= 7, "only {count} scenarios");
}

#[test]
fn defaults_are_those_of_the_format() {
    let scenario = parse("s.toml", GOOD).unwrap();
    assert_eq!(scenario.horizon, 10.0);
    assert_eq!(scenario.time_step, 0.05);
    assert_eq!(scenario.motion.base_clearance, 0.10);
    assert_eq!(scenario.solver.continuation, Continuation::Mode(ContinuationMode::Auto));
    assert_eq!(scenario.map.cells, None);
    assert_eq!(parse("s.toml", &with("schema = 1\n", "")).unwrap().schema, 1);
}

#[test]
fn the_template_is_a_scenario_of_defaults() {
    let scenario = parse("t.toml", &template("my\nname")).unwrap();
    assert_eq!(scenario.motion, MotionSpec::default());
    assert_eq!(scenario.solver, SolverSpec::default());
    assert_eq!(scenario.gait, GaitSpec::default());
    assert_eq!(scenario.map, MapSpec::default());
    assert_eq!(scenario.contact, ContactSpec::default());
}

#[test]
fn mistakes_are_refused_with_line_key_given_and_allowed() {
    for (text, expected) in [
        (
            with("horizon = 10", "horizn = 10"),
            vec!["s.toml:2: horizn: unknown key", "did you mean `horizon`?", "time_step"],
        ),
        (
            with("kind = \"trot\"", "duti = 0.5"),
            vec!["s.toml:10: gait.duti: unknown key", "did you mean `duty`?", "phases"],
        ),
        (
            with("horizon = 10", "horizon = \"long\""),
            vec!["s.toml:2: horizon: given \"long\" (a string)", "from 0.1 to 600"],
        ),
        (with("horizon = 10", "horizon = nan"), vec!["s.toml:2: horizon: given nan", "finite"]),
        (
            with("position = [1.0, 1.0]", "position = [1.0, inf]"),
            vec!["s.toml:8: goal.position[1]: given inf"],
        ),
        (
            with("position = [1.0, 1.0]", "position = [1.0]"),
            vec!["s.toml:8: goal.position: given an array of 1: [1.0]", "an array of 2"],
        ),
        (
            with("position = [1.0, 1.0]", "position = [1.0, 9.0]"),
            vec!["s.toml:8: goal.position: given [1, 9], outside"],
        ),
        (
            with("position = [1.0, 1.0]", "yaw = 0.0"),
            vec!["s.toml:7: goal.position: missing; it must be an array of 2"],
        ),
        (
            with("kind = \"rippled\"", "level = \"easy\""),
            vec!["s.toml:3: terrain.kind: missing", "\"heightmap\""],
        ),
        (
            with("kind = \"rippled\"", "kind = \"ripled\""),
            vec!["s.toml:4: terrain.kind: given \"ripled\"", "did you mean \"rippled\"?"],
        ),
        (
            with("kind = \"rippled\"", "kind = \"rippled\"\ndepth = 1.0"),
            vec!["s.toml:5: terrain.depth: not a key of kind = \"rippled\"", "wavelength"],
        ),
        (with("kind = \"rippled\"", "kind = \"formula\""), vec!["s.toml:3: terrain.expression: missing"]),
        (
            with("kind = \"rippled\"", "kind = \"flat\"\nextent = [3.0, -3.0, 0.0, 1.0]"),
            vec!["s.toml:5: terrain.extent: given [3, -3"],
        ),
        (with("schema = 1", "schema = 2"), vec!["s.toml:1: schema: given 2, allowed: 1", "newer"]),
        (with("schema = 1", "schema = 0"), vec!["s.toml:1: schema: given 0, allowed: 1"]),
        (with("kind = \"trot\"", "kind = \"custom\""), vec!["s.toml:9: gait.phases: missing"]),
        (
            with("kind = \"trot\"", "kind = \"custom\"\nphases = [[10.0], [4.0, 0.3]]"),
            vec!["s.toml:11: gait.phases[1]: the durations sum to 4.3 s"],
        ),
        (
            with("kind = \"trot\"", "duration_bounds = [0.5, 0.2]"),
            vec!["s.toml:10: gait.duration_bounds: given [0.5, 0.2]"],
        ),
        (
            with("horizon = 10", "horizon = 10\ntime_step = 0.001\n[solver]\ncontinuation = \"maybe\""),
            vec![
                "s.toml:5: solver.continuation: given \"maybe\"",
                "\"auto\", \"off\", or an integer from 1 to 100",
            ],
        ),
        (
            with("horizon = 10", "horizon = 10\n[solver]\nthreads = 3"),
            vec!["s.toml:4: solver.threads: given 3, allowed: an integer from 1 to 2"],
        ),
        (with("horizon = 10", "horizon = 0.1"), vec!["time_step: given 0.05, which makes 2.0 steps"]),
        (with("horizon = 10", "horizon = = 10"), vec!["s.toml:2: not TOML", "horizon = = 10"]),
        (with("horizon = 10", "horizon = 10\nhorizon = 11"), vec!["s.toml:3: not TOML", "duplicate"]),
        (
            with("[terrain]", "[map]\ncells = [8, 8, 1]\n[terrain]"),
            vec!["s.toml:4: map.cells[2]: given 1, allowed: an integer from 4 to 512"],
        ),
        (
            with("[terrain]", "[map]\ncells = [8, 8, 9.0]\n[terrain]"),
            vec!["s.toml:4: map.cells[2]: given 9.0, allowed: an integer"],
        ),
        (with("[terrain]", "terrain = 3\n[ground]"), vec!["ground: unknown key"]),
    ] {
        let message = refusal(&text);
        for part in expected {
            assert!(message.contains(part), "`{part}` is not in: {message}");
        }
        assert_eq!(message.lines().count(), 1, "{message}");
    }
}

#[test]
fn values_can_be_set_from_the_command_line() {
    let (_folder, path) = in_folder(GOOD);
    let set = |values: &[&str]| load(&path, &values.iter().map(|v| v.to_string()).collect::<Vec<_>>());
    let loaded =
        set(&["gait.kind=pace", "map.cells = [8, 9, 10]", "solver.continuation=3", "goal.yaw=1e-1"]).unwrap();
    assert_eq!(loaded.scenario.gait.kind, GaitKind::Pace);
    assert_eq!(loaded.scenario.map.cells, Some([8, 9, 10]));
    assert_eq!(loaded.scenario.solver.continuation, Continuation::Steps(3));
    assert_eq!(loaded.scenario.goal.yaw, Some(0.1));
    // What a plan carries says the same again.
    assert_eq!(parse("plan", &loaded.text).unwrap(), loaded.scenario);

    for (values, expected) in [
        (&["gait.knd=pace"][..], "--set gait.knd=pace: gait.knd: unknown key; did you mean `kind`?"),
        (&["gait.kind=gallop"], "--set gait.kind=gallop: gait.kind: given \"gallop\""),
        (&["horizon"], "--set horizon: expected key=value"),
        (&["horizon="], "no value"),
        (&["map.cells=[8,8"], "not a TOML value"),
        (&["horizon.x=1"], "`horizon` is 10 there, not a table"),
        (&["a..b=1"], "empty part"),
        (&["horizon=nan"], "--set horizon=nan: horizon: given nan"),
    ] {
        let message = set(values).unwrap_err().to_string();
        assert!(message.contains(expected), "{message}");
    }
}

#[test]
fn the_schema_names_every_section() {
    let schema = json_schema();
    for key in [
        "terrain",
        "start",
        "goal",
        "gait",
        "motion",
        "contact",
        "physics",
        "discretization",
        "map",
        "solver",
    ] {
        assert!(schema["properties"][key].is_object(), "{key}");
    }
    assert_eq!(schema["$defs"]["MotionSpec"]["properties"]["force_limit"]["maximum"], 100.0);
}

proptest::proptest! {
    #[test]
    fn no_text_makes_it_panic(text in "[\\[\\]a-z_=\"0-9.,\\-\n# {}]{0,120}") {
        let _ = parse("s.toml", &text);
        let _ = parse("s.toml", &format!("{GOOD}{text}"));
    }
}
