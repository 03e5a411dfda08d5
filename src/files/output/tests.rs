use std::os::unix::fs::symlink;

use super::*;

fn message(result: Result<()>) -> String {
    result.unwrap_err().to_string()
}

fn names(folder: &Path) -> Vec<String> {
    let mut names: Vec<String> =
        fs::read_dir(folder).unwrap().map(|e| e.unwrap().file_name().into_string().unwrap()).collect();
    names.sort();
    names
}

#[test]
fn a_file_keeps_its_mode_and_a_link_stays_a_link() {
    let folder = tempfile::tempdir().unwrap();
    let at = |name: &str| folder.path().join(name);
    fs::write(at("private"), "old").unwrap();
    fs::set_permissions(at("private"), fs::Permissions::from_mode(0o600)).unwrap();
    symlink("private", at("link")).unwrap();
    symlink("nowhere", at("dangling")).unwrap();
    write_atomically(&at("link"), b"new").unwrap();
    write_atomically(&at("dangling"), b"made").unwrap();
    assert_eq!(fs::read(at("private")).unwrap(), b"new");
    assert_eq!(fs::metadata(at("private")).unwrap().mode() & PERMISSIONS, 0o600);
    assert_eq!(fs::read_link(at("link")).unwrap(), Path::new("private"));
    assert_eq!(fs::read(at("nowhere")).unwrap(), b"made");
    symlink("circle", at("circle")).unwrap();
    assert!(message(write_atomically(&at("circle"), b"")).contains("circle"));
    assert_eq!(names(folder.path()), ["circle", "dangling", "link", "nowhere", "private"]);
}

#[test]
fn what_is_no_writable_file_is_refused() {
    let folder = tempfile::tempdir().unwrap();
    let at = |name: &str| folder.path().join(name);
    fs::write(at("fixed"), "old").unwrap();
    fs::set_permissions(at("fixed"), fs::Permissions::from_mode(0o444)).unwrap();
    assert!(std::process::Command::new("mkfifo").arg(at("pipe")).status().unwrap().success());
    symlink("/dev/null", at("null")).unwrap();
    let _socket = std::os::unix::net::UnixListener::bind(at("socket")).unwrap();
    for (path, what) in [
        (at("fixed"), "read-only"),
        (at("pipe"), "a pipe"),
        (at("null"), "a device"),
        (at("socket"), "a socket"),
        (at("."), "a folder"),
        (at("none/file"), "there is no folder"),
        (at("file/"), "not the name of a file"),
        ("/dev/full".into(), "a device"),
        (at(&"n".repeat(300)), "name too long"),
    ] {
        for refused in [write_atomically(&path, b"new"), ensure_outputs(&[&path], &[])] {
            let message = message(refused);
            assert!(message.to_lowercase().contains(what), "{message}");
        }
    }
    assert_eq!(fs::read(at("fixed")).unwrap(), b"old");
    assert_eq!(names(folder.path()), ["fixed", "null", "pipe", "socket"]);
}

#[test]
fn outputs_replace_neither_inputs_nor_each_other() {
    let folder = tempfile::tempdir().unwrap();
    let at = |name: &str| folder.path().join(name);
    fs::write(at("input"), "kept").unwrap();
    fs::create_dir(at("sub")).unwrap();
    symlink("input", at("link")).unwrap();
    symlink("..", at("sub/up")).unwrap();
    symlink("new", at("to-new")).unwrap();
    let inputs = [at("input"), at("missing")];
    for spelled in ["input", "link", "sub/../input", "sub/up/link"] {
        let message = message(ensure_outputs(&[&at(spelled)], &inputs));
        assert!(message.contains("which this command reads"), "{spelled}: {message}");
    }
    for (one, other) in [("a", "sub/../a"), ("new", "to-new"), ("new", "sub/up/new")] {
        let message = message(ensure_outputs(&[&at(one), &at(other)], &inputs));
        assert!(message.contains("as well"), "{one}, {other}: {message}");
    }
    ensure_outputs(&[&at("a"), &at("b"), &at("missing")], &inputs).unwrap();
    assert_eq!(fs::read(at("input")).unwrap(), b"kept");
    assert_eq!(names(folder.path()), ["input", "link", "sub", "to-new"]);
}

#[test]
fn what_killed_runs_left_is_cleared_and_nothing_else() {
    let folder = tempfile::tempdir().unwrap();
    let at = |name: &str| folder.path().join(name);
    let others = [".warpgait-0123.part", ".warpgait-0123456789abcdeg.part", "warpgait-0123456789abcdef.part"];
    for name in others.iter().chain(&[".warpgait-0123456789abcdef.part"]) {
        fs::write(at(name), "left").unwrap();
    }
    // That of a run that goes on.
    let mut running = Pending::create(&at("slow")).unwrap();
    assert!(!at(".warpgait-0123456789abcdef.part").exists());
    running.write_all(b"slow").unwrap();
    write_atomically(&at("quick"), b"quick").unwrap();
    running.commit().unwrap();
    assert_eq!(fs::read(at("slow")).unwrap(), b"slow");
    let mut expected = others.to_vec();
    expected.extend(["quick", "slow"]);
    expected.sort_unstable();
    assert_eq!(names(folder.path()), expected);
}
