//! `warpgait view`: runs the Python package, which writes a page of a plan and opens it in the browser.

use clap::Args;

use super::python::PythonArguments;

const EXAMPLES: &str = "\
Examples:
  warpgait view hill.plan.npz                    hill.view.html, opened in the browser
  warpgait view hill.plan.npz --html walk.html   this file, and open nothing
  warpgait view --live hill.toml                 plan it, and show the iterates as they come
  warpgait view -- --help                        all options of the Python package

The page is one file that needs no network. It shows the replay, too, if warpgait validate was run before. page.html#2.5 opens at 2.5 s.
With --live, 127.0.0.1 serves the page until the plan is shown; hill.plan.npz and hill.view.html are written. Ctrl-C ends it; the motion so far is written.
Python is that of .venv in the program's repository, or else python3. Nothing in the working folder is run.
Exit codes: 0 written; 1 with --live: not solved, or a check fails; 2 bad input, or the Python package is missing; 130 interrupted.";

#[derive(Debug, Args)]
#[command(after_help = EXAMPLES)]
pub(super) struct ViewArguments {
    #[command(flatten)]
    pub python: PythonArguments,
}
