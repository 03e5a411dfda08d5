//! `warpgait export`: runs the Python package, which writes a motion in the format of a trainer, a robot or a viewer.

use clap::Args;

use super::python::PythonArguments;

const EXAMPLES: &str = "\
Examples:
  warpgait export hill.plan.npz --to csv                          hill.csv, and hill.ground.npz
  warpgait export hill.plan.npz --to isaaclab --rate 50           for Isaac Lab's motion loader
  warpgait export hill.plan.npz --to mcap --from replay           the motion of the replay, after warpgait validate
  warpgait export --list                                          every format, and what each is for
  warpgait export -- --help                                       all options of the Python package

Formats: csv, json, parquet, amp, isaaclab, mjlab, locomujoco, lerobot, mujoco, mcap, rosbag1, rosbag2, rerun, usd. docs/exports.md has the conventions of each.
Python is that of .venv in the program's repository, or else python3. Nothing in the working folder is run.
Exit codes: 0 written; 2 bad input, or a Python package is missing; 130 interrupted.";

#[derive(Debug, Args)]
#[command(after_help = EXAMPLES)]
pub(super) struct ExportArguments {
    #[command(flatten)]
    pub python: PythonArguments,
}
