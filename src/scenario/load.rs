//! From a file and the command line to a scenario that holds together.

use std::path::{Path, PathBuf};

use super::document::Document;
use super::{Scenario, validate};
use crate::{Error, Result};

/// A scenario with where it came from.
#[derive(Clone, Debug)]
pub struct LoadedScenario {
    /// What is asked for.
    pub scenario: Scenario,
    /// The file as text; with values set from the command line, the whole again as TOML with these in it.
    pub text: String,
    /// Relative paths in the scenario are relative to this folder.
    pub base_dir: PathBuf,
    /// The file, if it came from one.
    pub path: Option<PathBuf>,
    document: Document,
}

impl LoadedScenario {
    /// An input error at a key of the scenario, with its file and line.
    pub fn error(&self, key: &str, what: impl std::fmt::Display) -> Error {
        self.document.error(key, what)
    }

    /// Refuses a start or goal outside the ground.
    pub fn ensure_inside(&self, extent: [f64; 4]) -> Result<()> {
        validate::inside(&self.document, &self.scenario, extent)
    }
}

/// Reads a scenario file and sets the `overrides`, each `key=value` with a dotted key and a value in TOML (a bare
/// word is a string). Refuses, with file, line, key, what was given and what is allowed: malformed TOML, unknown keys,
/// wrong types, values out of range, NaN and infinity, another schema, and values that do not go together.
pub fn load(path: &Path, overrides: &[String]) -> Result<LoadedScenario> {
    let (document, text) = Document::read(path)?;
    let base_dir = match path.parent() {
        Some(parent) if !parent.as_os_str().is_empty() => parent.to_path_buf(),
        _ => PathBuf::from("."),
    };
    let name = path.display().to_string();
    Ok(LoadedScenario {
        path: Some(path.to_path_buf()),
        ..assemble(document, &name, text, base_dir, overrides)?
    })
}

/// As [`load`], for a scenario that is in memory; its relative paths are relative to `base_dir`, `name` is for messages.
pub fn load_text(name: &str, text: &str, base_dir: &Path, overrides: &[String]) -> Result<LoadedScenario> {
    assemble(Document::parse(name, text)?, name, text.to_owned(), base_dir.to_path_buf(), overrides)
}

fn assemble(
    mut document: Document,
    name: &str,
    mut text: String,
    base_dir: PathBuf,
    overrides: &[String],
) -> Result<LoadedScenario> {
    for assignment in overrides {
        document.set(assignment)?;
    }
    let scenario = checked(&document)?;
    if !overrides.is_empty() {
        let body =
            toml::to_string(document.table()).map_err(|e| Error::Internal(format!("scenario: {e}")))?;
        text = format!("# {name} with --set {}\n{body}", overrides.join(" --set "));
    }
    Ok(LoadedScenario { scenario, text, base_dir, path: None, document })
}

/// Parses the text of a scenario, as a plan carries it; `file` is the name for messages.
pub fn parse(file: &str, text: &str) -> Result<Scenario> {
    checked(&Document::parse(file, text)?)
}

fn checked(document: &Document) -> Result<Scenario> {
    if let Some(schema) = document.table().get("schema").and_then(toml::Value::as_integer)
        && schema > 1
    {
        let what = format!("given {schema}, allowed: 1; this file is for a newer warpgait");
        return Err(document.error("schema", what));
    }
    let scenario = document.typed::<Scenario>()?;
    validate::together(document, &scenario)?;
    Ok(scenario)
}
