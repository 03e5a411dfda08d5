//! What commands write: never over an input or each other, whole or not at all, and a standard output that is full or closed.

use std::os::unix::fs::{PermissionsExt, symlink};
use std::path::Path;
use std::process::{Command, Stdio};

use crate::common;

const FLAT: &str = "\
horizon = 2.0
formulation = \"direct\"
robot.file = \"robot.toml\"
terrain = { kind = \"heightmap\", file = \"ground.npy\", spacing = 0.1 }
start.position = [-0.1, 0.0]
goal.position = [0.1, 0.0]
";

/// A folder with a scenario, its robot, its ground and a plan.
fn folder() -> tempfile::TempDir {
    let folder = tempfile::tempdir().unwrap();
    let at = |name: &str| folder.path().join(name);
    std::fs::write(at("flat.toml"), FLAT).unwrap();
    std::fs::copy("robots/anymal_towr.toml", at("robot.toml")).unwrap();
    let mut ground =
        warpgait::files::npy::Header { dtype: "<f4".into(), fortran_order: false, shape: vec![24, 32] }
            .write()
            .unwrap();
    ground.extend([0; 24 * 32 * 4]);
    std::fs::write(at("ground.npy"), ground).unwrap();
    common::standing().write(&at("standing.plan.npz")).unwrap();
    folder
}

fn warpgait(folder: &Path, arguments: &[&str], out: Stdio) -> (i32, String) {
    let mut command = Command::new(env!("CARGO_BIN_EXE_warpgait"));
    let run = command.current_dir(folder).args(arguments).stdout(out).output().unwrap();
    (run.status.code().unwrap(), String::from_utf8(run.stderr).unwrap())
}

fn content(folder: &Path) -> Vec<(String, Vec<u8>)> {
    let mut files: Vec<(String, Vec<u8>)> = std::fs::read_dir(folder)
        .unwrap()
        .map(|entry| entry.unwrap())
        .filter(|entry| entry.metadata().unwrap().is_file())
        .map(|entry| (entry.file_name().into_string().unwrap(), std::fs::read(entry.path()).unwrap()))
        .collect();
    files.sort();
    files
}

#[test]
fn no_command_replaces_what_it_reads_or_writes() {
    let folder = folder();
    let at = |name: &str| folder.path().join(name);
    symlink("ground.npy", at("link")).unwrap();
    std::fs::hard_link(at("robot.toml"), at("hard")).unwrap();
    std::fs::write(at("fixed"), "old").unwrap();
    std::fs::set_permissions(at("fixed"), std::fs::Permissions::from_mode(0o444)).unwrap();
    let before = content(folder.path());
    let (reads, writes) = ("which this command reads", "this command writes");
    for (arguments, what) in [
        (&["solve", "flat.toml", "-o", "flat.toml"][..], reads),
        (&["solve", "flat.toml", "-o", "link"], reads),
        (&["solve", "flat.toml", "--plot", "./hard"], reads),
        (&["solve", "flat.toml", "-o", "new", "--plot", "new"], writes),
        (&["solve", "flat.toml", "-o", "fixed"], "read-only"),
        (&["solve", "flat.toml", "-o", "/dev/null"], "a device"),
        (&["map", "flat.toml", "-o", "ground.npy"], reads),
        (&["check", "standing.plan.npz", "--plot", "standing.plan.npz"], reads),
        (&["check", "standing.plan.npz", "--limits", "robot.toml", "--plot", "hard"], reads),
        (&["init", "--force", "link.toml/"], "not the name of a file"),
    ] {
        let (code, said) = warpgait(folder.path(), arguments, Stdio::null());
        assert!(code == 2 && said.contains(what) && said.lines().count() == 1, "{arguments:?}: {said}");
    }
    assert_eq!(content(folder.path()), before);
}

#[test]
fn a_failed_drawing_leaves_the_plan_and_its_exit_code() {
    let folder = folder();
    let at = |name: &str| folder.path().join(name);
    std::fs::create_dir(at("drawings")).unwrap();
    let solve = ["solve", "flat.toml", "--plot", "drawings/flat.svg", "--set", "solver.max_iterations=3"];
    let mut child = Command::new(env!("CARGO_BIN_EXE_warpgait"))
        .current_dir(folder.path())
        .args(solve)
        .arg("--json")
        .stdout(Stdio::piped())
        .stderr(Stdio::piped())
        .spawn()
        .unwrap();
    // What is a folder by the time of the drawing could not be foreseen.
    let stderr = std::io::BufReader::new(child.stderr.take().unwrap());
    let mut said = String::new();
    for line in std::io::BufRead::lines(stderr) {
        let line = line.unwrap();
        if line == "terrain" {
            std::fs::create_dir(at("drawings/flat.svg")).unwrap();
        }
        said += &line;
    }
    let run = child.wait_with_output().unwrap();
    assert!(said.contains("flat.svg: cannot be written") && said.contains("the plan is written"), "{said}");
    assert_eq!(run.status.code(), Some(1), "{said}");
    let object: serde_json::Value = serde_json::from_slice(&run.stdout).unwrap();
    assert!(object["plot"].is_null() && object["plot_error"].as_str().unwrap().contains("flat.svg"));
    warpgait::plan::Plan::read(&at("flat.plan.npz")).unwrap();
}

/// A limit on the size of files stands for a full disk.
#[test]
fn a_full_disk_leaves_the_old_file() {
    let folder = folder();
    let at = |name: &str| folder.path().join(name);
    std::fs::write(at("p.plan.npz"), "old").unwrap();
    let before = content(folder.path());
    let program = env!("CARGO_BIN_EXE_warpgait");
    let solve = format!("trap '' XFSZ; ulimit -f 8; {program} solve flat.toml -o p.plan.npz --quiet");
    let run = Command::new("sh").current_dir(folder.path()).args(["-c", &solve]).output().unwrap();
    let said = String::from_utf8(run.stderr).unwrap();
    assert_eq!(run.status.code(), Some(2), "{said}");
    assert!(said.contains("p.plan.npz: cannot be written: File too large"), "{said}");
    assert_eq!(content(folder.path()), before);
}

#[test]
fn a_full_standard_output_is_an_error_and_a_closed_one_is_not() {
    let folder = folder();
    let full = || Stdio::from(std::fs::OpenOptions::new().write(true).open("/dev/full").unwrap());
    for arguments in [
        &["check", "standing.plan.npz"][..],
        &["check", "standing.plan.npz", "--json"],
        &["schema"],
        &["--help"],
        &["init", "new"],
        &["check", "none.plan.npz", "--json"],
    ] {
        let (code, said) = warpgait(folder.path(), arguments, full());
        assert!(code == 2 && said.contains("error") && !said.contains("panic"), "{arguments:?}: {said}");
        if !arguments.contains(&"none.plan.npz") {
            assert!(said.contains("standard output: No space left"), "{arguments:?}: {said}");
        }
    }
    for arguments in [&["check", "standing.plan.npz"][..], &["schema"], &["--help"]] {
        let (reader, writer) = std::io::pipe().unwrap();
        drop(reader);
        let (code, said) = warpgait(folder.path(), arguments, writer.into());
        assert_eq!((code, said.as_str()), (0, ""), "{arguments:?}");
    }
}

#[test]
fn names_from_files_do_not_act_on_the_terminal_or_in_drawings() {
    let folder = tempfile::tempdir().unwrap();
    let mut plan = common::standing();
    let name = "<LF>\u{1b}[2J\n";
    plan.foot_names[0] = name.into();
    for (member, ..) in &mut plan.splines {
        *member = member.replace("LF", name);
    }
    plan.foot_force[0] = [0.0, 0.0, 9e9];
    plan.write(&folder.path().join("named.plan.npz")).unwrap();
    let mut command = Command::new(env!("CARGO_BIN_EXE_warpgait"));
    let run = command
        .current_dir(folder.path())
        .args(["check", "named.plan.npz", "--plot", "named.svg"])
        .output()
        .unwrap();
    let out = String::from_utf8(run.stdout).unwrap();
    assert!(!out.contains('\x1b') && out.contains("<LF>\\u{1b}[2J\\n"), "{out}");
    let svg = std::fs::read_to_string(folder.path().join("named.svg")).unwrap();
    assert!(!svg.contains('\x1b') && !svg.contains("<LF>"));
    let (code, said) = warpgait(folder.path(), &["check", "a\nb\x1b[2J.npz"], Stdio::null());
    assert!(code == 2 && said.lines().count() == 1 && said.contains("a\\nb\\u{1b}[2J.npz"), "{said}");
}
