//! Finds the Python package that replays plans on the full robot (`validate/`), and reads its reports.

use std::path::{Path, PathBuf};
use std::process::{Command, Stdio};

use serde::{Deserialize, Serialize};

use crate::{Error, Result, program};

/// Prints "found" when Python finds the package, without importing it, which would take a second.
const HAS_PACKAGE: &str = "import importlib.util, sys; \
     found = importlib.util.find_spec('warpgait'); found is None or found.origin is None or print('found')";

/// The environment variable that names a Python to use.
const PYTHON_VARIABLE: &str = "WARPGAIT_PYTHON";
/// The environment variable with the process whose end is the end of the one that it is given to: see `warpgait.children` in Python.
const PARENT_VARIABLE: &str = "WARPGAIT_PARENT";

/// How many folders above the program are searched for its repository: for `target/release/warpgait`, this reaches it.
const FOLDERS_ABOVE: usize = 4;
/// What tells the folder of the repository from others.
const OF_REPOSITORY: &str = "validate/pyproject.toml";
/// The folder that this program was compiled in.
const COMPILED_IN: &str = env!("CARGO_MANIFEST_DIR");

/// A Python that has the package: `$WARPGAIT_PYTHON`, or else the one that this program was loaded into, that of `.venv` in the program's
/// repository, or `python3`. What lies in the working folder is neither run nor imported.
///
/// # Errors
/// When none has it; the message tells how to install it.
pub fn python() -> Result<PathBuf> {
    if let Some(named) = std::env::var_os(PYTHON_VARIABLE).filter(|named| !named.is_empty()) {
        let named = PathBuf::from(named);
        return if has_package(&named) {
            Ok(named)
        } else {
            let what =
                "this Python cannot be run, is older than 3.11, or does not have the package `warpgait`";
            Err(Error::input(format!("{PYTHON_VARIABLE}={}: {what}", named.display())))
        };
    }
    if let Some(host) = program::host() {
        return Ok(host.to_owned());
    }
    candidates().into_iter().find(|python| has_package(python)).ok_or_else(|| {
        Error::input(format!(
            "this needs the Python package `warpgait`, which neither .venv in the program's repository nor python3 has; \
             run scripts/setup --python in the folder of the repository, or pip install warpgait in an environment of yours \
             and use its command, or name its Python: {PYTHON_VARIABLE}=.venv/bin/python",
        ))
    })
}

/// Runs this Python's package, isolated from the working folder: that is not searched for modules, whatever `PYTHONPATH` says. It ends with
/// this process, even if that is killed; the thread that starts it must wait for it.
pub fn command(python: &Path) -> Command {
    let mut command = Command::new(python);
    command.arg("-P").env(PARENT_VARIABLE, std::process::id().to_string());
    if let Some(path) = std::env::var_os("PYTHONPATH") {
        // To Python, an empty entry is the working folder.
        match std::env::join_paths(std::env::split_paths(&path).filter(|folder| folder.is_absolute())) {
            Ok(path) if !path.is_empty() => command.env("PYTHONPATH", path),
            _ => command.env_remove("PYTHONPATH"),
        };
    }
    command
}

fn candidates() -> Vec<PathBuf> {
    let program = std::env::current_exe().unwrap_or_default();
    let above = program.ancestors().skip(1).take(FOLDERS_ABOVE).filter(|folder| folder.is_absolute());
    let repositories = above.chain([Path::new(COMPILED_IN)]).filter(|f| f.join(OF_REPOSITORY).is_file());
    let mut pythons: Vec<PathBuf> = repositories.map(|folder| folder.join(".venv/bin/python")).collect();
    let path = std::env::var_os("PATH").unwrap_or_default();
    // A relative entry would lead into the working folder.
    let folders = std::env::split_paths(&path).filter(|folder| folder.is_absolute());
    pythons.extend(folders.map(|folder| folder.join("python3")).find(|python| python.is_file()));
    pythons.retain(|python| python.exists());
    pythons
}

fn has_package(python: &Path) -> bool {
    let mut command = command(python);
    command.args(["-c", HAS_PACKAGE]).stdin(Stdio::null()).stderr(Stdio::null());
    command.output().is_ok_and(|run| run.stdout.trim_ascii() == b"found")
}

/// Verdict on a metric or on a whole replay, from best to worst.
#[derive(Clone, Copy, Debug, PartialEq, Eq, PartialOrd, Ord, Serialize, Deserialize)]
#[serde(rename_all = "lowercase")]
pub enum Verdict {
    /// Within the limit for a pass.
    Pass,
    /// Within the wider limit.
    Marginal,
    /// Beyond both.
    Fail,
}

impl Verdict {
    /// The name in reports.
    pub fn name(self) -> &'static str {
        match self {
            Verdict::Pass => "pass",
            Verdict::Marginal => "marginal",
            Verdict::Fail => "fail",
        }
    }
}

/// A metric of the report.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
pub struct Metric {
    /// "check", "open loop", the name of the replay, or "robust".
    #[serde(default)]
    pub layer: String,
    /// What is measured.
    pub name: String,
    /// None where it is not a number.
    pub value: Option<f64>,
    /// Unit of the value and the limits.
    pub unit: String,
    /// Limit for a pass.
    pub pass: f64,
    /// Wider limit, for a marginal verdict.
    pub marginal: f64,
    /// Verdict on this metric.
    pub verdict: Verdict,
}

/// What decided the verdict.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
pub struct Incident {
    /// When, s; none for what has no place in time.
    pub time: Option<f64>,
    /// Name of the foot, where there is one.
    pub foot: Option<String>,
    /// A description.
    pub what: String,
}

/// The part of a replay's report that benches use.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
pub struct Tracked {
    /// The worst of all metrics.
    pub verdict: Verdict,
    /// The first metric that decides the verdict, in words; none for a plan that passes.
    pub first_failure: Option<Incident>,
    /// The laws, and the metrics of the open loop, of every replay and of the worlds that differ, in the order of the report.
    pub metrics: Vec<Metric>,
    /// Wall time of the validation without the start of Python, s.
    pub seconds: f64,
}

/// `NAME.report.json`.
#[derive(Deserialize)]
struct Report {
    verdict: Verdict,
    first_failure: Option<Incident>,
    check: Layer,
    open_loop: Layer,
    replays: Vec<Layer>,
    #[serde(default)]
    robust: Option<Layer>,
    seconds: f64,
}

#[derive(Deserialize)]
struct Layer {
    #[serde(default)]
    name: Option<String>,
    metrics: Vec<Metric>,
}

impl Tracked {
    /// Reads the text of a report.
    ///
    /// # Errors
    /// What is wrong with it.
    pub fn read(report: &[u8]) -> std::result::Result<Self, String> {
        let report: Report =
            serde_json::from_slice(report).map_err(|e| format!("report of the replay: {e}"))?;
        let named = |layer: Layer, name: &str| Layer { name: Some(name.into()), ..layer };
        let fixed = [named(report.check, "check"), named(report.open_loop, "open loop")];
        let robust = report.robust.map(|layer| named(layer, "robust"));
        let metrics = fixed.into_iter().chain(report.replays).chain(robust).flat_map(|layer| {
            let name = layer.name.unwrap_or_default();
            layer.metrics.into_iter().map(move |metric| Metric { layer: name.clone(), ..metric })
        });
        Ok(Self {
            verdict: report.verdict,
            first_failure: report.first_failure,
            metrics: metrics.collect(),
            seconds: report.seconds,
        })
    }

    /// The first metric whose verdict is that of the report; none for a pass.
    pub fn first_failing(&self) -> Option<&Metric> {
        let decides = |metric: &&Metric| metric.verdict == self.verdict;
        if self.verdict == Verdict::Pass { None } else { self.metrics.iter().find(decides) }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_report_is_read_with_the_metric_that_decides() {
        let metric = |name: &str, verdict: &str| {
            format!(
                r#"{{"name": "{name}", "value": 1.5, "unit": "mm", "limit": "at most", "pass": 1, "marginal": 2, "verdict": "{verdict}"}}"#
            )
        };
        let text = format!(
            r#"{{"schema": 1, "verdict": "fail", "trackable": false, "seconds": 3.5,
                "first_failure": {{"time": 2.5, "foot": null, "what": "fall"}},
                "check": {{"metrics": [{}]}},
                "open_loop": {{"metrics": [{}]}},
                "replays": [{{"name": "closed loop", "verdict": "fail", "metrics": [{}, {}], "incidents": []}},
                            {{"name": "closed loop, steps of 1 ms", "verdict": "fail", "metrics": [{}]}}],
                "robust": {{"metrics": [{}], "worlds": []}}}}"#,
            metric("newton_rms", "pass"),
            metric("peak joint speed", "marginal"),
            metric("feet", "pass"),
            metric("slip", "fail"),
            metric("fall", "fail"),
            metric("worlds that are tracked", "marginal"),
        );
        let found = Tracked::read(text.as_bytes()).unwrap();
        assert_eq!(found.verdict, Verdict::Fail);
        assert_eq!(found.metrics.len(), 6);
        assert_eq!(found.metrics[0].layer, "check");
        let first = found.first_failing().unwrap();
        assert_eq!((first.layer.as_str(), first.name.as_str()), ("closed loop", "slip"));
        assert!(Tracked::read(b"{}").unwrap_err().contains("report of the replay"));
    }
}
