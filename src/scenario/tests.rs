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
            assert_eq!(loaded.effective_text, loaded.source_text);
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
fn a_gait_with_flight_has_a_finer_time_step() {
    let step = |gait: &str| {
        let text = with("kind = \"trot\"", gait);
        load_text("s.toml", &text, Path::new("."), &[]).unwrap().scenario.time_step
    };
    assert_eq!(step("kind = \"flying-trot\""), 0.025);
    assert_eq!(step("kind = \"bound\"\nduty = 0.4"), 0.025);
    assert_eq!(step("kind = \"bound\"\nduty = 0.5"), 0.05);
    assert_eq!(step("kind = \"walk\"\nduty = 0.4"), 0.05);
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

/// The `oneOf` of `[terrain]` in the schema.
fn terrain_schemas() -> Vec<serde_json::Value> {
    json_schema()["$defs"]["TerrainSpec"]["oneOf"].as_array().unwrap().clone()
}

#[test]
fn every_kind_of_terrain_is_closed_and_knows_its_name() {
    let kinds: Vec<String> = terrain_schemas()
        .iter()
        .map(|schema| {
            assert_eq!(schema["additionalProperties"], false, "{schema}");
            let kind = schema["properties"]["kind"]["const"].as_str().unwrap();
            let mut text = format!("kind = \"{kind}\"\n");
            for key in schema["required"].as_array().unwrap().iter().filter(|key| *key != "kind") {
                let property = &schema["properties"][key.as_str().unwrap()];
                text += &format!("{key} = {}\n", if property["type"] == "string" { "\"x\"" } else { "0.5" });
            }
            let spec: TerrainSpec = toml::from_str(&text).unwrap();
            assert_eq!(spec.kind(), kind);
            assert!(toml::from_str::<TerrainSpec>(&format!("{text}no_such_key = 1")).is_err(), "{text}");
            kind.to_owned()
        })
        .collect();
    let (_, _, comment) = terrain_lines().swap_remove(0);
    assert_eq!(comment, kinds.join(" | "));
}

/// The lines of the template's `[terrain]`: key, value, comment; those that are commented out, too.
fn terrain_lines() -> Vec<(String, toml::Value, String)> {
    let text = template("t");
    let section = text.split("[terrain]\n").nth(1).unwrap().split("\n\n").next().unwrap();
    let parse = |line: &str| {
        let (assignment, comment) = line.trim_start_matches("# ").split_once('#').unwrap();
        let (key, value) = toml::from_str::<toml::Table>(assignment).unwrap().into_iter().next().unwrap();
        (key, value, comment.trim().to_owned())
    };
    section.lines().map(parse).collect()
}

#[test]
fn the_template_shows_every_terrain_key_with_its_default() {
    let lines = terrain_lines();
    for schema in terrain_schemas() {
        let kind = schema["properties"]["kind"]["const"].as_str().unwrap();
        for key in schema["properties"].as_object().unwrap().keys() {
            assert!(lines.iter().any(|(k, ..)| k == key), "{key} is not in the template");
        }
        // Parameters of the paper's terrains: as shown, they are those of the medium level.
        let shown = |key: &str| {
            let (_, value, comment) = lines.iter().find(|(k, ..)| k == key).unwrap();
            let other = comment.split("; ").find_map(|part| part.strip_prefix(&format!("{kind}: ")));
            other.map_or(value.as_float().unwrap(), |text| text.parse().unwrap())
        };
        match toml::from_str(&format!("kind = \"{kind}\"")) {
            Ok(TerrainSpec::Rippled(s)) => {
                assert_eq!([s.amplitude(), s.wavelength()], ["amplitude", "wavelength"].map(shown));
                let (domain, extent) = (s.domain, lines.last().unwrap().1.clone().try_into());
                assert_eq!((domain.spacing, Ok(domain.extent)), (shown("spacing"), extent));
            }
            Ok(TerrainSpec::Conic(s)) => {
                let names = ["slope", "radius", "tip", "foot"];
                assert_eq!([s.slope(), s.radius(), s.tip(), s.foot()], names.map(shown));
            }
            Ok(TerrainSpec::Hilly(s)) => {
                assert_eq!([s.height(), s.width()], ["height", "width"].map(shown));
            }
            Ok(TerrainSpec::Pit(s)) => {
                assert_eq!([s.depth(), s.radius(), s.edge()], ["depth", "radius", "edge"].map(shown));
            }
            _ => (),
        }
    }
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
            with("position = [1.0, 1.0]", "position = [1.0, 1.0]\nyaw = 90.0"),
            vec!["s.toml:9: goal.yaw: given 90, allowed: -2π to 2π rad; 90° are 1.5708 rad"],
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
        (
            with("kind = \"rippled\"", "kind = \"mesh\""),
            vec!["s.toml:4: terrain.kind: given \"mesh\" (a string), allowed: \"flat\", \"rippled\""],
        ),
        (
            with("kind = \"rippled\"", "kind = \"rippled\"\namplitud = 1.0"),
            vec![
                "s.toml:5: terrain.amplitud: unknown key; did you mean `amplitude`?",
                "allowed with kind = \"rippled\": level, amplitude, wavelength, extent, spacing",
            ],
        ),
        (
            with("kind = \"rippled\"", "kind = \"hilly\"\nheight = 21"),
            vec!["s.toml:5: terrain.height: given 21, allowed: a finite number from -20 to 20"],
        ),
        (
            with("kind = \"rippled\"", "kind = \"formula\""),
            vec!["s.toml:3: terrain.expression: missing; kind = \"formula\" needs it: a string"],
        ),
        (
            with("kind = \"rippled\"", "kind = \"heightmap\"\nspacing = 0.1"),
            vec!["s.toml:3: terrain.file: missing; kind = \"heightmap\" needs it: a string"],
        ),
        (
            with("kind = \"rippled\"", "kind = \"heightmap\"\nfile = \"h.png\"\nlayout = \"yup\""),
            vec!["s.toml:6: terrain.layout: given \"yup\"", "\"picture\", \"y-up\", \"x-y\", \"grid-map\""],
        ),
        (
            with("kind = \"rippled\"", "kind = \"heightmap\"\nfile = \"h.png\"\nno_data = \"none\""),
            vec!["s.toml:6: terrain.no_data: given \"none\"", "a finite number, or an array"],
        ),
        (
            with(
                "kind = \"rippled\"",
                "kind = \"heightmap\"\nfile = \"h.png\"\nspacing = 0.01\nsmoothing = 1",
            ),
            vec!["s.toml:7: terrain.smoothing: given 1, allowed: at most 0.5 m, 50 times the spacing"],
        ),
        (
            with(
                "kind = \"rippled\"",
                "kind = \"heightmap\"\nfile = \"h.png\"\nspacing = 0.1\nextent = [0, 1, 0, 0.1]",
            ),
            vec!["s.toml:7: terrain.extent: given [0, 1, 0, 0.1], allowed"],
        ),
        (
            with("horizon = 10", "horizon = 10\nphysics.law = \"newton-euler\""),
            vec![
                "s.toml:3: physics.law: given \"newton-euler\"",
                "law = \"pcdm\"",
                "formulation = \"direct\"",
            ],
        ),
        (
            with("horizon = 10", "horizon = 10\nphysics.legs = \"light\""),
            vec!["s.toml:3: physics.legs: given \"light\"", "\"massive\", \"massless\""],
        ),
        (
            with("kind = \"rippled\"", "kind = \"flat\"\nextent = [3.0, -3.0, 0.0, 1.0]"),
            vec!["s.toml:5: terrain.extent: given [3, -3"],
        ),
        (with("schema = 1", "schema = 2"), vec!["s.toml:1: schema: given 2, allowed: 1", "newer"]),
        (with("schema = 1", "schema = 0"), vec!["s.toml:1: schema: given 0, allowed: 1"]),
        (with("kind = \"trot\"", "kind = \"custom\""), vec!["s.toml:9: gait.phases: missing"]),
        (
            with("kind = \"trot\"", "kind = \"trot\"\nsequence = [{ kind = \"walk\" }]"),
            vec!["s.toml:10: gait.kind: given together with gait.sequence"],
        ),
        (with("kind = \"trot\"", "sequence = []"), vec!["s.toml:10: gait.sequence: given none"]),
        (
            with("kind = \"trot\"", "sequence = [{ kind = \"walk\", duration = 4.0 }]"),
            vec!["s.toml:10: gait.sequence: the durations sum to 4 s, but the horizon is 10 s"],
        ),
        (
            with("kind = \"trot\"", "sequence = [{ kind = \"walk\", duration = 10.0 }, { kind = \"trot\" }]"),
            vec!["s.toml:10: gait.sequence: the durations sum to 10 s, which leaves 0.000 s"],
        ),
        (
            with("kind = \"trot\"", "sequence = [{ kind = \"walk\" }, { kind = \"custom\" }]"),
            vec!["gait.sequence[1].kind: given \"custom\""],
        ),
        (
            with("kind = \"trot\"", "sequence = [{ kind = \"walk\" }, { kind = \"stand\", cycle = 1.0 }]"),
            vec!["gait.sequence[1].cycle: given for \"stand\" (gait.sequence[1].kind, line 10)"],
        ),
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
        (
            with("horizon = 10", "horizon = 0.1"),
            vec!["time_step: given 0.05, which divides the horizon of 0.1 s into 2.0 steps"],
        ),
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
    // A plan carries both: what was in effect, and the user's own text.
    assert_eq!(parse("plan", &loaded.effective_text).unwrap(), loaded.scenario);
    assert_eq!(loaded.source_text, GOOD);
    assert_eq!(loaded.overrides[0], "gait.kind=pace");

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
fn what_the_robot_does_not_allow_is_refused_with_its_line() {
    let robot = |line: &str| with("[terrain]", &format!("[robot]\n{line}\n[terrain]"));
    let phases = with("kind = \"trot\"", "kind = \"custom\"\nphases = [[10.0], [10.0]]");
    for (text, expected) in [
        (
            robot("adhesive_feet = [\"LF\", \"RFF\"]"),
            vec![
                "s.toml:4: robot.adhesive_feet[1]: \"RFF\" is not a foot of anymal_b; its feet: LF, RF, LH, RH",
                "did you mean \"RF\"?",
            ],
        ),
        (
            with("horizon = 10", "horizon = 10\nrobot.name = \"anymal_towr\"\nphysics.legs = \"massive\""),
            vec!["s.toml:4: physics.legs: given \"massive\"", "anymal_towr has no links", "massless"],
        ),
        (
            robot("adhesive_feet = [\"LF\", \"LF\"]"),
            vec!["s.toml:4: robot.adhesive_feet[1]: \"LF\" is given twice"],
        ),
        (
            robot("name = \"anymal_d\""),
            vec!["s.toml:4: robot.name: given \"anymal_d\"", "did you mean \"anymal_b\"?"],
        ),
        (robot("file = \"none.toml\""), vec!["s.toml:4: robot.file: ", "none.toml"]),
        (
            robot("name = \"anymal_b\"\nfile = \"r.toml\""),
            vec!["s.toml:5: robot.file: given together with robot.name"],
        ),
        (phases, vec!["s.toml:11: gait.phases: given 2 rows, allowed: one for each foot: LF, RF, LH, RH"]),
    ] {
        let folder = tempfile::tempdir().unwrap();
        std::fs::write(folder.path().join("r.toml"), include_str!("../../robots/anymal_b.toml")).unwrap();
        let message = load_text("s.toml", &text, folder.path(), &[]).expect_err(&text).to_string();
        for part in expected {
            assert!(message.contains(part), "`{part}` is not in: {message}");
        }
    }
    let key = crate::Error::key("gait.kind", "not for this robot");
    let message = load_text("s.toml", GOOD, Path::new("."), &[]).unwrap().locate(key).to_string();
    assert_eq!(message, "s.toml:10: gait.kind: not for this robot");
}

/// Clearances that the scenario does not give go by the robot's size, and the plan carries them.
#[test]
fn lengths_that_are_not_given_go_by_the_size_of_the_robot() {
    let of = |robot: &str, rest: &str| {
        let text = format!("{GOOD}[robot]\nname = \"{robot}\"\n{rest}");
        load_text("s.toml", &text, Path::new("."), &[]).unwrap()
    };
    let anymal = of("anymal_c", "");
    assert_eq!(anymal.robot.size(), 1.0);
    assert_eq!(anymal.effective_text, anymal.source_text);
    let small = of("solo12", "");
    let size = small.robot.size();
    assert!(size > 0.3 && size < 0.7, "{size}");
    let lengths = |s: &Scenario| {
        [s.motion.swing_clearance, s.motion.base_clearance, s.contact.edge_margin, s.map.thickness]
    };
    for (found, default) in lengths(&small.scenario).into_iter().zip(lengths(&anymal.scenario)) {
        assert!((found - size * default).abs() < 1e-4, "{found} {default}");
    }
    let carried = parse("plan", &small.effective_text).unwrap();
    assert_eq!(lengths(&carried), lengths(&small.scenario));
    let given = of("solo12", "[motion]\nswing_clearance = 0.07\n").scenario.motion;
    assert_eq!(given.swing_clearance, 0.07);
    assert!((given.base_clearance - size * 0.1).abs() < 1e-4);
}

#[test]
fn digests_are_those_of_what_was_read() {
    let robot = include_str!("../../robots/anymal_b.toml");
    let text = format!("{GOOD}[robot]\nfile = \"r.toml\" # mine\n");
    let (folder, path) = in_folder(&text);
    std::fs::write(folder.path().join("r.toml"), robot).unwrap();
    let loaded = load(&path, &["horizon=9".into()]).unwrap();
    let expected = [("r.toml", robot), ("s.toml", &text)];
    let expected = expected.map(|(name, text)| (name.to_owned(), crate::digest::sha256_hex(text)));
    assert_eq!(loaded.inputs, expected);
    assert_eq!(loaded.source_text, text);
    assert_eq!(parse("plan", &loaded.effective_text).unwrap().horizon, 9.0);
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
