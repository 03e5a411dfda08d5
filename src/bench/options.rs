//! Which cases of a bench to run, how, and where the results go.

use std::path::PathBuf;
use std::time::Duration;

/// Options of a bench. An empty list selects the bench's own default.
#[derive(Clone, Debug)]
pub struct BenchOptions {
    /// Folder of all results; the tables go to a subfolder named after the bench.
    pub out: PathBuf,
    /// Run a few cases only.
    pub quick: bool,
    /// Processes at a time.
    pub jobs: usize,
    /// Name of a shipped robot; none selects the bench's own.
    pub robot: Option<String>,
    /// Levels of the terrains.
    pub levels: Vec<String>,
    /// Formulations.
    pub formulations: Vec<String>,
    /// Kinds of terrain.
    pub terrains: Vec<String>,
    /// Limit on the processor time of a case, and of its replay.
    pub time_limit: Duration,
    /// Reuse finished cases of other builds of the program, too.
    pub any_program: bool,
}

impl Default for BenchOptions {
    fn default() -> Self {
        Self {
            out: "bench".into(),
            quick: false,
            jobs: 1,
            robot: None,
            levels: Vec::new(),
            formulations: Vec::new(),
            terrains: Vec::new(),
            time_limit: Duration::from_secs(900),
            any_program: false,
        }
    }
}
