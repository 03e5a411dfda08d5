//! What needs a process of its own: the flag that all solves share, signals, the working directory, the standard output.
//!
//! Each test starts this test program again, to run one of the ignored functions below.

use std::io::{BufRead, BufReader};
use std::ops::ControlFlow;
use std::path::Path;
use std::process::{Child, Command, Stdio};
use std::thread;
use std::time::{Duration, Instant};

use warpgait::ipopt::{INTERRUPT, Options, Status, install_ctrl_c, solve};

use crate::problems::{Circle, Hs071, run};

fn child(name: &str, directory: &Path) -> Command {
    let mut command = Command::new(std::env::current_exe().expect("a test knows its program"));
    command.args([&format!("process::{name}"), "--exact", "--ignored", "--nocapture"]);
    command.current_dir(directory);
    command
}

/// Neither an option file in the working directory nor the terminal has anything to do with a solve.
#[test]
fn no_option_file_is_read_and_nothing_is_printed() {
    let directory = tempfile::tempdir().unwrap();
    std::fs::write(directory.path().join("ipopt.opt"), "max_iter 1\nprint_level 5\n").unwrap();
    let output = child("solve_in_silence", directory.path()).output().unwrap();
    let stdout = String::from_utf8(output.stdout).unwrap();
    let of_the_test_program = |line: &&str| {
        *line == "running 1 test"
            || *line == "test process::solve_in_silence ... ok"
            || line.starts_with("test result: ok. 1 passed")
    };
    let other: Vec<&str> =
        stdout.lines().filter(|line| !line.is_empty() && !of_the_test_program(line)).collect();
    assert_eq!(other, Vec::<&str>::new());
    assert_eq!(String::from_utf8_lossy(&output.stderr), "");
    assert!(output.status.success());
    let files = std::fs::read_dir(directory.path()).unwrap().count();
    assert_eq!(files, 1, "only ipopt.opt itself");
}

#[test]
#[ignore = "run by no_option_file_is_read_and_nothing_is_printed"]
fn solve_in_silence() {
    assert!(Path::new("ipopt.opt").exists());
    let solution = run(&mut Hs071::new(true), &Options::new()).unwrap();
    assert_eq!(solution.status, Status::Solved);
    run(&mut Circle { right_side: -1.0 }, &Options::new()).unwrap();
    for refused in [
        Options::new().set_int("no_such_option", 1),
        Options::new().set_int("%s%s%s", 1),
        Options::new().set_num("max_iter", 1.0),
        Options::new().set_str("mu_strategy", "%s%s"),
    ] {
        assert!(run(&mut Hs071::new(true), &refused).is_err());
    }
    // Options that contradict each other are found out only when the solve begins.
    let contradiction = Options::new().set_int("min_refinement_steps", 5).set_int("max_refinement_steps", 4);
    let invalid = run(&mut Hs071::new(true), &contradiction);
    assert_eq!(invalid.unwrap().status, Status::InvalidOption);
}

#[test]
fn the_flag_interrupts() {
    let directory = tempfile::tempdir().unwrap();
    let status = child("interrupt_by_flag", directory.path()).output().unwrap().status;
    assert!(status.success());
}

#[test]
#[ignore = "run by the_flag_interrupts"]
fn interrupt_by_flag() {
    let mut seen = Vec::new();
    let solution = solve(&mut Hs071::new(true), &Options::new(), &mut |record, x| {
        seen = x.to_vec();
        if record.iteration == 4 {
            assert!(!INTERRUPT.raise());
        }
        ControlFlow::Continue(())
    })
    .unwrap();
    assert_eq!(solution.status, Status::Interrupted);
    assert_eq!(solution.history.len(), 5);
    assert_eq!(solution.x, seen);
    // It stays raised until it is lowered.
    let again = run(&mut Hs071::new(true), &Options::new()).unwrap();
    assert_eq!((again.status, again.history.len()), (Status::Interrupted, 1));
    INTERRUPT.lower();
    assert_eq!(run(&mut Hs071::new(true), &Options::new()).unwrap().status, Status::Solved);
}

/// Starts the child and waits until it says that it is inside a solve.
fn start_and_wait_for_solve(name: &str, directory: &Path) -> Child {
    let mut child = child(name, directory).stdout(Stdio::piped()).stderr(Stdio::null()).spawn().unwrap();
    let lines = BufReader::new(child.stdout.as_mut().unwrap()).lines();
    let ready = lines.map_while(Result::ok).any(|line| line.contains("solving"));
    assert!(ready, "the child ended before its solve");
    child
}

fn press_ctrl_c(child: &Child) {
    // The shell's own `kill`: the program of that name is a package that not every machine has.
    let kill = Command::new("sh").args(["-c", &format!("kill -INT {}", child.id())]).status();
    assert!(kill.unwrap().success());
}

fn wait(child: &mut Child) -> std::process::ExitStatus {
    let start = Instant::now();
    loop {
        if let Some(status) = child.try_wait().unwrap() {
            return status;
        }
        if start.elapsed() > Duration::from_secs(20) {
            child.kill().unwrap();
            panic!("the child did not end");
        }
        thread::sleep(Duration::from_millis(5));
    }
}

#[test]
fn ctrl_c_interrupts() {
    let directory = tempfile::tempdir().unwrap();
    let mut child = start_and_wait_for_solve("solve_slowly", directory.path());
    press_ctrl_c(&child);
    assert!(wait(&mut child).success());
}

#[test]
#[ignore = "run by ctrl_c_interrupts"]
fn solve_slowly() {
    install_ctrl_c().unwrap();
    install_ctrl_c().unwrap();
    let mut problem = Hs071::new(true);
    problem.on_call = Box::new(|_| thread::sleep(Duration::from_millis(100)));
    let solution = solve(&mut problem, &Options::new(), &mut |_, _| {
        println!("solving");
        ControlFlow::Continue(())
    });
    assert_eq!(solution.unwrap().status, Status::Interrupted);
}

#[test]
fn a_second_ctrl_c_ends_the_program() {
    let directory = tempfile::tempdir().unwrap();
    let mut child = start_and_wait_for_solve("hang", directory.path());
    press_ctrl_c(&child);
    thread::sleep(Duration::from_millis(200));
    assert!(child.try_wait().unwrap().is_none(), "the first Ctrl-C waits for the iteration");
    press_ctrl_c(&child);
    assert_eq!(wait(&mut child).code(), Some(130));
}

#[test]
#[ignore = "run by a_second_ctrl_c_ends_the_program"]
fn hang() {
    install_ctrl_c().unwrap();
    let mut problem = Hs071::new(true);
    problem.on_call = Box::new(|_| {
        println!("solving");
        thread::sleep(Duration::from_secs(60));
    });
    let _ = run(&mut problem, &Options::new());
}
