//! `warpgait atlas`: runs the Python package, which maps where a robot can start on a ground.

use clap::Args;

use super::python::PythonArguments;

const EXAMPLES: &str = "\
Examples:
  warpgait atlas scan.png --robot go1 --spacing 0.04 --height-scale 1.25     scan.atlas/: atlas.svg, atlas.csv, index.html
  warpgait atlas hill.toml --step 0.25 --headings 16 --gaits walk,trot       finer, for two gaits; resumes
  warpgait atlas -- --help                                                   all options

Each place, heading and gait is planned in a process of its own. The map is colored by how planning ended, and by the law that binds.
Python is that of .venv in the program's repository, or else python3. Nothing in the working folder is run.
Exit codes: 0 every case has a result; 2 bad input, or the Python package is missing; 130 interrupted.";

#[derive(Debug, Args)]
#[command(after_help = EXAMPLES)]
pub(super) struct AtlasArguments {
    #[command(flatten)]
    pub python: PythonArguments,
}
