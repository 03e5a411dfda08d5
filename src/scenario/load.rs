//! Loads a scenario: its file, the overrides from the command line, and its robot, checked together.

use std::path::{Path, PathBuf};
use std::sync::Arc;

use super::consistency;
use super::continued;
use super::format::Scenario;
use super::guess::{GivenMotion, GuessSpec};
use super::mask;
use super::motion::Legs;
use super::way;
use crate::digest::sha256_hex;
use crate::files;
use crate::input::{self, Document};
use crate::robot::Robot;
use crate::{Error, Result};

/// Name and SHA-256 (hexadecimal) of a file.
type Input = (String, String);

/// A scenario and its robot, with where they came from.
#[derive(Clone, Debug)]
pub struct LoadedScenario {
    /// What the user specified, overrides included.
    pub scenario: Scenario,
    /// The robot that it names.
    pub robot: Robot,
    /// The scenario in effect, as TOML: the user's own text, or if there are overrides, a speed, a gait with flight, a plan to go on from, a mask, or a robot that is not of
    /// ANYmal's size, all values with these, with the horizon that follows, and with the time step and the lengths that go by gait and size.
    pub effective_text: String,
    /// The user's own text, exactly as it was read.
    pub source_text: String,
    /// Values set from the command line, `key=value` each.
    pub overrides: Vec<String>,
    /// Relative paths in the scenario start at this folder.
    pub base_dir: PathBuf,
    /// Name and SHA-256 (hexadecimal) of each file read so far: the scenario's and the robot's, where these are files.
    pub inputs: Vec<(String, String)>,
    /// The motion to start the solve from, where it names one.
    pub guess: Option<Arc<GivenMotion>>,
    document: Document,
    /// The plan that it goes on from, and masks.
    other_files: Vec<PathBuf>,
    /// The scenario's file; none for one in memory.
    file: Option<PathBuf>,
}

impl LoadedScenario {
    /// The files that it is read from: the scenario, the robot and the terrain, as far as these are files.
    pub fn files(&self) -> Vec<PathBuf> {
        let Scenario { robot, terrain, guess, .. } = &self.scenario;
        let guess = guess.as_ref().map(|guess| &*guess.file);
        let named = [robot.file.as_deref(), terrain.file(), guess].into_iter().flatten();
        let own = self.file.iter().chain(&self.other_files).cloned();
        named.map(|name| self.base_dir.join(name)).chain(own).collect()
    }

    /// Paths of files that were read later, such as those that a terrain file names.
    pub fn paths(&self, inputs: &[(String, String)]) -> Vec<PathBuf> {
        inputs.iter().map(|(name, _)| self.base_dir.join(name)).collect()
    }

    /// An input error at a key of the scenario, with file and line.
    pub fn error(&self, key: &str, what: impl std::fmt::Display) -> Error {
        self.document.error(key, what)
    }

    /// Adds file and line to an error that names a key of the scenario; other errors stay as they are.
    pub fn locate(&self, error: Error) -> Error {
        located(&self.document, error)
    }

    /// Where a value was set, for messages about another one that contradicts it.
    pub fn place(&self, key: &str) -> String {
        self.document.place(key)
    }

    /// The same with massless legs, for a motion with flight that is not found with massive ones; none where the scenario says which, or
    /// they are massless anyway.
    ///
    /// # Errors
    /// None for a scenario that was loaded.
    pub fn with_massless_legs(&self) -> Result<Option<Self>> {
        let scenario = &self.scenario;
        let massive = scenario.legs() == Legs::Massive && self.robot.body().is_some();
        if !massive || scenario.physics.legs.is_some() || !scenario.gait.flies() {
            return Ok(None);
        }
        let mut other = self.clone();
        other.document.derive("physics.legs=massless", None)?;
        other.scenario = read(&other.document)?;
        other.effective_text = text_of(&other.document)?;
        Ok(Some(other))
    }

    /// Whether the state at the start is where `start.plan` is left.
    pub fn goes_on(&self) -> bool {
        self.document.derived_from("start.position").is_some()
    }

    /// Refuses a start or goal outside the ground.
    pub fn ensure_base_inside(&self, extent: [f64; 4]) -> Result<()> {
        consistency::inside(&self.document, &self.scenario, None, extent)
    }

    /// Refuses a start or goal at which the base or a foot is outside the ground. For terrain files, whose extent is known only once
    /// they are read.
    pub fn ensure_inside(&self, extent: [f64; 4]) -> Result<()> {
        consistency::inside(&self.document, &self.scenario, Some(&self.robot), extent)
    }
}

/// Reads a scenario file, applies the `overrides` (each `key=value`, with a dotted key and a TOML value or a bare word as a
/// string), and loads the robot.
///
/// # Errors
/// For files that cannot be read, malformed TOML, unknown keys, wrong types, values out of range, NaN and infinity, another
/// schema, and values that do not fit together. Messages have file, line, key, what was given and what is allowed.
pub fn load(path: &Path, overrides: &[String]) -> Result<LoadedScenario> {
    let (document, text) = Document::read(path)?;
    let base_dir = match path.parent() {
        Some(parent) if !parent.as_os_str().is_empty() => parent.to_path_buf(),
        _ => PathBuf::from("."),
    };
    let name = path.file_name().map(|name| (name.to_string_lossy().into_owned(), sha256_hex(&text)));
    let mut loaded = assemble(document, text, base_dir, overrides)?;
    loaded.inputs.extend(name);
    loaded.file = Some(path.to_path_buf());
    Ok(loaded)
}

/// As [`load`], for a scenario in memory. Its relative paths start at `base_dir`; `name` is its name in messages.
///
/// # Errors
/// Those of [`load`].
pub fn load_text(name: &str, text: &str, base_dir: &Path, overrides: &[String]) -> Result<LoadedScenario> {
    assemble(Document::parse(name, text)?, text.to_owned(), base_dir.to_path_buf(), overrides)
}

/// Parses the effective text of a scenario, as a plan carries it; `file` is its name in messages. Neither the robot nor any
/// other file is read.
///
/// # Errors
/// Those of [`load`] that need no other file.
pub fn parse(file: &str, text: &str) -> Result<Scenario> {
    let document = Document::parse(file, text)?;
    let scenario = read(&document)?;
    consistency::check(&document, &scenario, None)?;
    Ok(scenario)
}

fn assemble(
    mut document: Document,
    source_text: String,
    base_dir: PathBuf,
    overrides: &[String],
) -> Result<LoadedScenario> {
    for assignment in overrides {
        document.set(assignment)?;
    }
    let before = continued::expand(&mut document, &base_dir)?;
    let masks = mask::expand(&mut document, &base_dir)?;
    let scenario = read(&document)?;
    let robot = Robot::load(&scenario.robot, &base_dir).map_err(|e| located(&document, e))?;
    way::check_speed(&document, &scenario, &robot)?;
    let by_size = set_by_size(&mut document, &scenario, robot.size())?;
    let robot = match &scenario.payload {
        Some(payload) => {
            robot.with_payload(payload.mass, payload.position).map_err(|e| located(&document, e))?
        }
        None => robot,
    };
    if let Some(before) = &before {
        before.ensure_robot(&document, &robot)?;
    }
    let by_speed = set_by_speed(&mut document, &scenario, &robot)?;
    let by_gait = set_by_gait(&mut document, &scenario)?;
    let changed = by_size || by_speed || by_gait || before.is_some() || !masks.is_empty();
    let scenario = if changed { read(&document)? } else { scenario };
    consistency::check(&document, &scenario, Some(&robot))?;
    let start_plan = before.map(|before| before.input);
    let guess = given(&document, &scenario, &robot, &base_dir)?;
    let effective_text = match overrides {
        [] if !changed => source_text.clone(),
        _ => text_of(&document)?,
    };
    Ok(LoadedScenario {
        other_files: start_plan.iter().chain(&masks).map(|(name, _)| base_dir.join(name)).collect(),
        inputs: robot
            .input
            .iter()
            .cloned()
            .chain(start_plan)
            .chain(masks)
            .chain(guess.as_ref().map(|(_, input)| input.clone()))
            .collect(),
        guess: guess.map(|(motion, _)| motion),
        scenario,
        robot,
        effective_text,
        source_text,
        overrides: overrides.to_vec(),
        base_dir,
        document,
        file: None,
    })
}

fn text_of(document: &Document) -> Result<String> {
    toml::to_string(document.table()).map_err(|e| Error::Internal(format!("scenario: {e}")))
}

/// The motion that the scenario gives to start from, and its file's name and SHA-256.
fn given(
    document: &Document,
    scenario: &Scenario,
    robot: &Robot,
    base_dir: &Path,
) -> Result<Option<(Arc<GivenMotion>, Input)>> {
    let Some(GuessSpec { file }) = &scenario.guess else { return Ok(None) };
    let path = base_dir.join(file);
    let feet: Vec<&str> = robot.feet.iter().map(|foot| &*foot.name).collect();
    let located = |e: Error| document.error("guess.file", e);
    let motion = GivenMotion::read(&path, &feet, scenario.horizon).map_err(located)?;
    let digest = sha256_hex(files::read(&path, files::MAX_FILE).map_err(located)?);
    Ok(Some((Arc::new(motion), (file.clone(), digest))))
}

/// Sets the lengths that the scenario leaves to the robot: the defaults, which are for ANYmal, times the robot's size. Whether there are any.
fn set_by_size(document: &mut Document, scenario: &Scenario, size: f64) -> Result<bool> {
    let (motion, contact, map) = (&scenario.motion, &scenario.contact, &scenario.map);
    let distance = ("goal.waypoint_distance", scenario.goal.waypoint_distance);
    let distance = (!scenario.stops().is_empty()).then_some(distance);
    let lengths = [
        ("motion.swing_clearance", motion.swing_clearance),
        ("motion.base_clearance", motion.base_clearance),
        ("contact.edge_margin", contact.edge_margin),
        ("map.thickness", map.thickness),
    ];
    let mut found = false;
    for (key, default) in lengths.into_iter().chain(distance) {
        if size != 1.0 && !document.has(key) {
            let length = (1e4 * size * default).round() / 1e4;
            document.derive(&format!("{key}={length:?}"), None)?;
            found = true;
        }
    }
    Ok(found)
}

/// Sets the horizon that follows from the speed, where that is given and the horizon is not. Whether it does.
fn set_by_speed(document: &mut Document, scenario: &Scenario, robot: &Robot) -> Result<bool> {
    match way::horizon(scenario, robot) {
        Some(horizon) if !document.has("horizon") => {
            document.derive(&format!("horizon={horizon:?}"), Some("goal.speed"))?;
            Ok(true)
        }
        _ => Ok(false),
    }
}

/// Time step where feet are in the air together, s, if the scenario gives none: flights last a tenth of a second or two.
const FLIGHT_TIME_STEP: f64 = 0.025;

/// Sets the time step that the scenario leaves to the gait. Whether it does.
fn set_by_gait(document: &mut Document, scenario: &Scenario) -> Result<bool> {
    let sets = scenario.gait.flies() && !document.has("time_step");
    if sets {
        document.derive(&format!("time_step={FLIGHT_TIME_STEP:?}"), None)?;
    }
    Ok(sets)
}

fn located(document: &Document, error: Error) -> Error {
    match error {
        Error::Key { key, what } => document.error(&key, what),
        other => other,
    }
}

fn read(document: &Document) -> Result<Scenario> {
    if let Some(schema) = document.table().get("schema").and_then(toml::Value::as_integer)
        && schema > 1
    {
        let what = format!("given {schema}, allowed: 1; this file is for a newer warpgait");
        return Err(document.error("schema", what));
    }
    input::read_as(document)
}
