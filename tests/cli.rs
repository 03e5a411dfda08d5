//! The command line: exit codes, one message, no incomplete files.

use std::io::Read;
use std::path::Path;
use std::process::Command;

use crate::common;
use serde_json::Value;

pub fn warpgait(folder: &Path, arguments: &[&str]) -> (i32, String, String) {
    let output =
        Command::new(env!("CARGO_BIN_EXE_warpgait")).current_dir(folder).args(arguments).output().unwrap();
    let text = |bytes: Vec<u8>| String::from_utf8(bytes).unwrap();
    (output.status.code().unwrap(), text(output.stdout), text(output.stderr))
}

/// Bad input: exit code 2, nothing on standard output, one line on standard error that contains all `parts`.
pub fn refused(folder: &Path, arguments: &[&str], parts: &[&str]) {
    let before = files(folder);
    let (code, out, err) = warpgait(folder, arguments);
    assert_eq!(code, 2, "{arguments:?}: {out}{err}");
    assert_eq!(out, "", "{arguments:?}");
    assert_eq!(err.trim_end().lines().count(), 1, "{err}");
    for part in parts {
        assert!(err.contains(part), "`{part}` is missing in: {err}");
    }
    assert_eq!(files(folder), before, "{arguments:?} left something behind");
}

fn files(folder: &Path) -> Vec<String> {
    let mut names: Vec<String> =
        std::fs::read_dir(folder).unwrap().map(|f| f.unwrap().file_name().into_string().unwrap()).collect();
    names.sort();
    names
}

#[test]
fn help_and_usage() {
    let folder = tempfile::tempdir().unwrap();
    let (code, out, _) = warpgait(folder.path(), &["--help"]);
    assert_eq!(code, 0);
    assert!(out.contains("Examples:") && out.contains("Exit codes:"), "{out}");
    assert_eq!(warpgait(folder.path(), &["--version"]).0, 0);
    assert_eq!(warpgait(folder.path(), &[]).0, 2);
    assert_eq!(warpgait(folder.path(), &["chekc"]).0, 2);
    assert_eq!(warpgait(folder.path(), &["check"]).0, 2);
    for command in ["show", "convert"] {
        let (code, out, _) = warpgait(folder.path(), &["terrain", command, "--help"]);
        assert!(code == 0 && out.contains("Examples:"), "{command}: {out}");
    }
    for command in [
        "init", "schema", "solve", "map", "check", "bench", "validate", "export", "view", "sweep", "atlas",
        "dataset", "robot",
    ] {
        let (code, out, _) = warpgait(folder.path(), &[command, "--help"]);
        assert!(code == 0 && out.contains("Examples:"), "{command}: {out}");
    }
}

#[test]
fn robots_are_listed_and_shown() {
    let folder = tempfile::tempdir().unwrap();
    let (code, out, _) = warpgait(folder.path(), &["robot", "list"]);
    assert_eq!(code, 0);
    for name in warpgait::robot::Robot::shipped() {
        assert!(out.contains(name), "{name}: {out}");
    }
    let (code, out, _) = warpgait(folder.path(), &["robot", "show", "anymal_c"]);
    assert!(code == 0 && out.contains("52.13 kg") && out.contains("RH_KFE"), "{out}");
    let drawing = std::fs::read_to_string(folder.path().join("anymal_c.robot.svg")).unwrap();
    assert!(drawing.matches("<polyline").count() >= 8 && drawing.contains(">RH<"), "{drawing}");
    std::fs::write(folder.path().join("mine.toml"), include_str!("../robots/anymal_b.toml")).unwrap();
    let (code, out, _) = warpgait(folder.path(), &["robot", "show", "mine.toml", "--json"]);
    assert_eq!(code, 0);
    let robot: Value = serde_json::from_str(&out).unwrap();
    assert_eq!(robot["feet"][3]["leg"]["joints"][2]["name"], "RH_KFE");
    refused(folder.path(), &["robot", "show", "anymal_d"], &["robot.name", "did you mean"]);
    refused(folder.path(), &["robot", "show", "none.toml"], &["none.toml"]);
}

#[test]
fn init_writes_a_scenario_once() {
    let folder = tempfile::tempdir().unwrap();
    let (code, out, err) = warpgait(folder.path(), &["init", "hill"]);
    assert_eq!((code, out.trim()), (0, "hill.toml"));
    assert!(err.contains("warpgait solve hill.toml"));
    warpgait::scenario::load(&folder.path().join("hill.toml"), &[]).unwrap();
    refused(folder.path(), &["init", "hill.toml"], &["hill.toml", "--force"]);
    assert_eq!(warpgait(folder.path(), &["init", "hill", "--force"]).0, 0);
    refused(folder.path(), &["init", "no/such/folder"], &["there is no folder no/such"]);
    let (_, out, err) = warpgait(folder.path(), &["init", "quiet", "--quiet", "--json"]);
    assert_eq!(serde_json::from_str::<Value>(&out).unwrap()["scenario"], "quiet.toml");
    assert_eq!(err, "");
}

#[test]
fn init_writes_examples_with_their_ground() {
    let folder = tempfile::tempdir().unwrap();
    let (code, out, _) = warpgait(folder.path(), &["init", "--list"]);
    assert_eq!(code, 0);
    assert!(out.lines().any(|line| line.starts_with("stairs ") && line.contains("15 cm")), "{out}");
    let (code, out, _) = warpgait(folder.path(), &["init", "--example", "stairs"]);
    assert_eq!((code, out.trim()), (0, "stairs.toml"));
    assert!(folder.path().join("stairs.png").is_file());
    let (code, ..) = warpgait(folder.path(), &["terrain", "show", "stairs.toml"]);
    assert_eq!(code, 0);
    refused(folder.path(), &["init", "mine", "--example", "stairs"], &["stairs.png", "--force"]);
    assert!(!folder.path().join("mine.toml").exists());
    refused(folder.path(), &["init", "--example", "sea"], &["sea", "stepping_stones"]);
}

#[test]
fn schema_is_json() {
    let folder = tempfile::tempdir().unwrap();
    let (code, out, _) = warpgait(folder.path(), &["schema"]);
    assert_eq!(code, 0);
    assert_eq!(serde_json::from_str::<Value>(&out).unwrap()["title"], "Scenario");
}

#[test]
fn check_tells_good_from_bad() {
    let folder = tempfile::tempdir().unwrap();
    common::lifting(0.08).write(&folder.path().join("good.plan.npz")).unwrap();
    common::lifting(0.04).write(&folder.path().join("low.plan.npz")).unwrap();
    let mut unsolved = common::standing();
    unsolved.meta.solver.success = false;
    unsolved.write(&folder.path().join("unsolved.plan.npz")).unwrap();

    let (code, out, err) = warpgait(folder.path(), &["check", "good.plan.npz"]);
    assert_eq!((code, err.as_str()), (0, ""), "{out}");
    assert!(out.contains("newton_rms") && out.contains("checks hold.") && !out.contains('\x1b'), "{out}");
    let (code, out, _) = warpgait(folder.path(), &["check", "low.plan.npz"]);
    assert_eq!(code, 1);
    let line = out.lines().find(|line| line.starts_with("swing_apex_shortfall")).unwrap();
    assert!(line.contains("FAILS") && line.contains("0.500 s LF"), "{line}");
    let (code, out, _) = warpgait(folder.path(), &["check", "unsolved.plan.npz"]);
    assert!(code == 1 && out.contains("not solved"), "{out}");
    assert_eq!(warpgait(folder.path(), &["check", "low.plan.npz", "--quiet"]).1, "");

    let (code, out, _) = warpgait(folder.path(), &["check", "low.plan.npz", "--json"]);
    let object: Value = serde_json::from_str(&out).unwrap();
    assert_eq!((code, &object["passed"]), (1, &Value::Bool(false)));
    let row = object["checks"]
        .as_array()
        .unwrap()
        .iter()
        .find(|row| row["name"] == "swing_apex_shortfall")
        .unwrap();
    assert_eq!((&row["passed"], &row["foot"]), (&Value::Bool(false), &Value::from("LF")));

    std::fs::write(folder.path().join("limits.toml"), "swing_apex_shortfall = 30\n").unwrap();
    assert_eq!(warpgait(folder.path(), &["check", "low.plan.npz", "--limits", "limits.toml"]).0, 0);
    let (code, _, _) = warpgait(folder.path(), &["check", "low.plan.npz", "--plot", "low.svg"]);
    assert!(code == 1 && std::fs::read_to_string(folder.path().join("low.svg")).unwrap().starts_with("<svg"));
}

#[test]
fn check_refuses_bad_input() {
    let folder = tempfile::tempdir().unwrap();
    let at = |name: &str| folder.path().join(name);
    common::standing().write(&at("good.plan.npz")).unwrap();
    let whole = std::fs::read(at("good.plan.npz")).unwrap();
    std::fs::write(at("half.plan.npz"), &whole[..whole.len() / 2]).unwrap();
    let mut newer = common::standing();
    newer.meta.schema = 2;
    newer.write(&at("newer.plan.npz")).unwrap();
    let mut odd = common::standing();
    odd.meta.scenario = "horizon = nan".into();
    odd.write(&at("odd.plan.npz")).unwrap();
    std::fs::write(at("limits.toml"), "newton = 3\n").unwrap();

    refused(folder.path(), &["check", "none.plan.npz"], &["none.plan.npz"]);
    refused(folder.path(), &["check", "half.plan.npz"], &["half.plan.npz", "truncated"]);
    refused(folder.path(), &["check", "newer.plan.npz"], &["newer.plan.npz", "`meta`", "schema 2 is newer"]);
    refused(folder.path(), &["check", "odd.plan.npz"], &["meta.scenario:1: horizon: given nan"]);
    refused(folder.path(), &["check", "limits.toml"], &["limits.toml", "not an .npz archive"]);
    refused(folder.path(), &["check", "good.plan.npz", "--limits", "limits.toml"], &["newton: no such law"]);
    refused(
        folder.path(),
        &["check", "good.plan.npz", "--plot", "no/such.svg"],
        &["no/such.svg", "there is no folder"],
    );
    refused(folder.path(), &["check", "."], &["."]);

    let (code, out, _) = warpgait(folder.path(), &["check", "half.plan.npz", "--json"]);
    assert_eq!(code, 2);
    assert!(
        serde_json::from_str::<Value>(&out).unwrap()["error"].as_str().unwrap().contains("half.plan.npz")
    );
}

/// As [`warpgait`], with a Python of the user's own.
fn with_python(folder: &Path, python: &Path, arguments: &[&str]) -> (i32, String, String) {
    let mut command = Command::new(env!("CARGO_BIN_EXE_warpgait"));
    let output = command.current_dir(folder).args(arguments).env("WARPGAIT_PYTHON", python).output().unwrap();
    let text = |bytes: Vec<u8>| String::from_utf8(bytes).unwrap();
    (output.status.code().unwrap(), text(output.stdout), text(output.stderr))
}

/// Writes a program of the shell.
fn script(path: &Path, text: &str) {
    use std::os::unix::fs::PermissionsExt;
    std::fs::create_dir_all(path.parent().unwrap()).unwrap();
    std::fs::write(path, format!("#!/bin/sh\n{text}\n")).unwrap();
    std::fs::set_permissions(path, std::fs::Permissions::from_mode(0o755)).unwrap();
}

#[test]
fn validate_runs_python() {
    let folder = tempfile::tempdir().unwrap();
    let python = folder.path().join("python");
    let validate = |arguments: &[&str]| with_python(folder.path(), &python, arguments);
    // Poses as Python: it has the package, prints its arguments, and judges the plan not trackable.
    script(&python, "[ \"$2\" = -c ] && echo found && exit 0\necho \"$@\"\nexit 1");
    let (code, out, _) = validate(&["validate", "a.plan.npz", "--friction", "0.5"]);
    assert_eq!((code, out.trim()), (1, "-P -m warpgait.commands.validate a.plan.npz --friction 0.5"));
    let (_, out, _) = validate(&["--json", "validate", "a.plan.npz"]);
    assert_eq!(out.trim(), "-P -m warpgait.commands.validate a.plan.npz --json");

    let (_, out, _) = validate(&["validate", "a.plan.npz", "--json"]);
    assert_eq!(out.trim(), "-P -m warpgait.commands.validate a.plan.npz --json");

    let (_, out, _) = validate(&["--quiet", "export", "a.plan.npz", "--to", "csv", "--json"]);
    assert_eq!(out.trim(), "-P -m warpgait.commands.export a.plan.npz --to csv --json --quiet");

    let (_, out, _) = validate(&["sweep", "a.toml", "--shard", "1/2"]);
    assert_eq!(out.trim(), "-P -m warpgait.commands.sweep a.toml --shard 1/2");
    let (_, out, _) = validate(&["atlas", "a.png", "--robot", "go1"]);
    assert_eq!(out.trim(), "-P -m warpgait.commands.atlas a.png --robot go1");
    let (_, out, _) = validate(&["dataset", "-o", "walks", "--count", "3", "--json"]);
    assert_eq!(out.trim(), "-P -m warpgait.commands.dataset -o walks --count 3 --json");
    let (_, out, _) = validate(&["view", "a.plan.npz", "--html", "a.html"]);
    assert_eq!(out.trim(), "-P -m warpgait.commands.view a.plan.npz --html a.html");

    // It is told which process it ends with.
    script(&python, "[ \"$2\" = -c ] && echo found && exit 0\n[ $WARPGAIT_PARENT = $PPID ] && echo mine");
    let (_, out, _) = validate(&["validate", "a.plan.npz"]);
    assert_eq!(out.trim(), "mine");

    // A Python that crashes is neither "not trackable" nor an interruption.
    script(&python, "[ \"$2\" = -c ] && echo found && exit 0\nkill -s SEGV $$");
    let (code, _, err) = validate(&["validate", "a.plan.npz"]);
    assert_eq!(code, 2, "{err}");
    assert!(err.contains("crashed"), "{err}");
    let (_, out, _) = validate(&["validate", "a.plan.npz", "--json"]);
    assert!(out.contains("\"error\""), "{out}");

    script(&python, "exit 1");
    let (code, _, err) = validate(&["validate", "a.plan.npz"]);
    assert!(code == 2 && err.contains("WARPGAIT_PYTHON=") && err.contains("does not have"), "{err}");
}

/// Ctrl-C to this program alone, as from a program that runs it, ends Python in good order.
#[test]
fn an_interrupt_is_passed_on_to_python() {
    let folder = tempfile::tempdir().unwrap();
    let python = folder.path().join("python");
    script(
        &python,
        "[ \"$2\" = -c ] && echo found && exit 0\ntrap 'echo heard >> heard; exit 130' INT\necho ready\nwhile :; do sleep 0.01; done",
    );
    let mut launcher = Command::new(env!("CARGO_BIN_EXE_warpgait"))
        .current_dir(folder.path())
        .args(["validate", "a.plan.npz"])
        .env("WARPGAIT_PYTHON", &python)
        .stdout(std::process::Stdio::piped())
        .spawn()
        .unwrap();
    let mut ready = [0; 6];
    launcher.stdout.as_mut().unwrap().read_exact(&mut ready).unwrap();
    let id = launcher.id().to_string();
    assert!(Command::new("sh").args(["-c", "kill -s INT $0", &id]).status().unwrap().success());
    assert_eq!(launcher.wait().unwrap().code(), Some(130));
    assert_eq!(std::fs::read_to_string(folder.path().join("heard")).unwrap(), "heard\n");
}

/// Whatever lies in the working folder, a clone of the repository for instance, is not taken for the package or for Python.
#[test]
fn nothing_in_the_working_folder_is_run() {
    let folder = tempfile::tempdir().unwrap();
    let at = |name: &str| folder.path().join(name);
    let mark = "open('ran', 'a').write(__file__)\n";
    std::fs::create_dir_all(at("warpgait")).unwrap();
    for module in
        ["numpy.py", "importlib.py", "sitecustomize.py", "warpgait/__init__.py", "warpgait/validate.py"]
    {
        std::fs::write(at(module), mark).unwrap();
    }
    for python in [".venv/bin/python", "python3", "bin/python3"] {
        script(&at(python), "echo $0 >> ran; exit 0");
    }
    let path = format!(":.:bin:{}", std::env::var("PATH").unwrap());
    // Once as found, and once with the system's Python by name, which has no package.
    for python in ["", "python3"] {
        let mut command = Command::new(env!("CARGO_BIN_EXE_warpgait"));
        if !python.is_empty() {
            let system = std::env::split_paths(&std::env::var_os("PATH").unwrap())
                .map(|folder| folder.join(python))
                .find(|python| python.is_file())
                .unwrap();
            command.env("WARPGAIT_PYTHON", system);
        }
        let run = command
            .current_dir(folder.path())
            .args(["validate", "none.plan.npz", "--no-files"])
            .envs([("PATH", path.as_str()), ("PYTHONPATH", ":.:")])
            .output()
            .unwrap();
        let ran = std::fs::read_to_string(at("ran")).unwrap_or_default();
        assert_eq!(ran, "", "{python}: {}", String::from_utf8_lossy(&run.stderr));
        assert_eq!(run.status.code(), Some(2));
    }
}

const FLAT: &str = "\
horizon = 3.0
formulation = \"direct\"
[robot]
name = \"anymal_towr\"
[terrain]
kind = \"flat\"
extent = [-1.5, 1.5, -1.0, 1.0]
spacing = 0.05
[start]
position = [0.0, 0.0]
[goal]
position = [0.3, 0.0]
";

#[test]
fn solve_refuses_bad_input_before_computing() {
    let folder = tempfile::tempdir().unwrap();
    let write = |name: &str, text: &str| std::fs::write(folder.path().join(name), text).unwrap();
    write("flat.toml", FLAT);
    write("malformed.toml", &FLAT.replace("[start]", "[start"));
    write("unknown.toml", &FLAT.replace("spacing", "spaceing"));
    write("outside.toml", &FLAT.replace("[0.3, 0.0]", "[9.0, 0.0]"));
    write("feet.toml", &FLAT.replace("[0.3, 0.0]", "[1.4, 0.0]"));
    write("degrees.toml", &FLAT.replace("[0.3, 0.0]", "[0.3, 0.0]\nyaw = 90.0"));
    write("far.toml", &FLAT.replace("1.5, -1.0", "9.0, -1.0").replace("[0.3, 0.0]", "[5.0, 0.0]"));
    write("nan.toml", &FLAT.replace("3.0\n", "nan\n"));
    write("robot.toml", &FLAT.replace("anymal_towr", "anymal_x"));
    write(
        "image.toml",
        &FLAT
            .replace("kind = \"flat\"", "kind = \"heightmap\"\nfile = \"none.png\"")
            .replace("extent", "# extent"),
    );
    write("cut.plan.npz", "half of a plan");
    let solve =
        |arguments: &[&str], parts: &[&str]| refused(folder.path(), &[&["solve"], arguments].concat(), parts);
    solve(&["none.toml"], &["none.toml"]);
    solve(&["malformed.toml"], &["malformed.toml:9: not TOML"]);
    solve(&["unknown.toml"], &["unknown.toml:8: terrain.spaceing: unknown key; did you mean `spacing`?"]);
    solve(&["outside.toml"], &["outside.toml:12: goal.position: given [9, 0], outside the terrain"]);
    solve(
        &["feet.toml"],
        &["feet.toml:12: goal.position: given [1.4, 0], where foot LF would stand 0.240 m outside"],
    );
    solve(
        &["degrees.toml"],
        &["degrees.toml:13: goal.yaw: given 90, allowed: -2π to 2π rad; 90° are 1.5708 rad"],
    );
    solve(
        &["far.toml", "--quiet"],
        &["far.toml:12: goal.position: 5.00 m from the start; in 3 s", "set horizon to "],
    );
    solve(&["nan.toml"], &["nan.toml:1: horizon: given nan"]);
    solve(&["robot.toml"], &["anymal_x", "anymal_towr"]);
    solve(&["flat.toml", "-o", "no/such/a.plan.npz"], &["no/such/a.plan.npz", "cannot be written"]);
    solve(&["flat.toml", "-o", "."], &["cannot be written"]);
    solve(&["flat.toml", "--set", "gait.kind=gallop"], &["--set gait.kind=gallop: gait.kind"]);
    solve(&["flat.toml", "--formulation", "curved"], &["formulation", "\"warped\", \"direct\""]);
    let (code, out, err) = warpgait(folder.path(), &["solve", "image.toml"]);
    assert!(code == 2 && out.is_empty() && err.contains("none.png"), "{err}");
    assert!(!folder.path().join("image.plan.npz").exists());
}

#[test]
fn solve_writes_a_plan_that_checks() {
    let folder = tempfile::tempdir().unwrap();
    std::fs::write(folder.path().join("flat.toml"), FLAT).unwrap();
    let (code, out, err) = warpgait(folder.path(), &["solve", "flat.toml", "--json", "--plot=drawing.svg"]);
    assert_eq!(code, 0, "{out}{err}");
    let object: Value = serde_json::from_str(&out).unwrap();
    assert_eq!((&object["solved"], &object["passed"]), (&Value::Bool(true), &Value::Bool(true)));
    assert_eq!(files(folder.path()), ["drawing.svg", "flat.plan.npz", "flat.toml"]);
    let plan = warpgait::plan::Plan::read(&folder.path().join("flat.plan.npz")).unwrap();
    assert!(
        plan.meta.scenario == FLAT
            && plan.meta.checks.len() > 20
            && plan.meta.inputs.contains_key("flat.toml")
    );
    assert_eq!(warpgait(folder.path(), &["check", "flat.plan.npz", "--quiet"]).0, 0);

    // One iteration is not enough: the plan is written nevertheless, and marked as not solved.
    let few = ["solve", "flat.toml", "--set", "solver.max_iterations=1", "-o", "few.plan.npz"];
    let (code, out, _) = warpgait(folder.path(), &few);
    assert!(code == 1 && out.contains("NOT SOLVED"), "{out}");
    let plan = warpgait::plan::Plan::read(&folder.path().join("few.plan.npz")).unwrap();
    assert!(!plan.meta.solver.success);
}

#[cfg(unix)]
#[test]
fn an_interrupted_solve_writes_what_it_has() {
    let folder = tempfile::tempdir().unwrap();
    std::fs::write(folder.path().join("flat.toml"), FLAT).unwrap();
    let mut child = Command::new(env!("CARGO_BIN_EXE_warpgait"))
        .current_dir(folder.path())
        // With a tolerance that cannot be met, the solve lasts until it is interrupted.
        .args(["solve", "flat.toml", "--quiet", "--set", "solver.tolerance=1e-12", "--set", "horizon=30"])
        .args(["--set", "solver.effort=optimal", "--set", "solver.max_iterations=100000"])
        .spawn()
        .unwrap();
    std::thread::sleep(std::time::Duration::from_secs(3));
    let kill = format!("kill -INT {}", child.id());
    assert!(Command::new("sh").args(["-c", &kill]).status().unwrap().success());
    assert_eq!(child.wait().unwrap().code(), Some(130));
    let plan = warpgait::plan::Plan::read(&folder.path().join("flat.plan.npz")).unwrap();
    assert!(!plan.meta.solver.success && plan.meta.scenario.contains("max_iterations"));
}
