//! `warpgait init`.

use std::path::{Path, PathBuf};

use clap::Args;
use serde_json::json;

use super::console::Console;
use super::ending::Ending;
use crate::files::{ensure_outputs, write_atomically};
use crate::scenario::examples::{EXAMPLES, Example};
use crate::visible::visible;
use crate::{Error, Result, scenario};

const USAGE: &str = "\
Examples:
  warpgait init                 write scenario.toml
  warpgait init hill            write hill.toml
  warpgait init hill --force    replace hill.toml
  warpgait init --example stairs            write stairs.toml and its ground, stairs.png
  warpgait init --list                      show the examples";

#[derive(Debug, Args)]
#[command(after_help = USAGE)]
pub(super) struct InitArguments {
    /// Name of the scenario, written to NAME.toml [default: scenario, or that of the example]
    name: Option<PathBuf>,
    /// Write one of the scenarios that ship with the program, and the file of its ground
    #[arg(long, value_name = "NAME")]
    example: Option<String>,
    /// Show the examples, and write nothing
    #[arg(long, conflicts_with_all = ["name", "example", "force"])]
    list: bool,
    /// Replace existing files
    #[arg(long)]
    force: bool,
}

pub(super) fn init(arguments: &InitArguments, console: &Console) -> Result<Ending> {
    if arguments.list {
        list(console);
        return Ok(Ending::Good);
    }
    let example = arguments.example.as_deref().map(Example::find).transpose()?;
    let path = scenario_file(arguments.name.as_deref(), example);
    let ground = example.and_then(|example| example.ground);
    let files = ground.map(|(name, content)| (path.with_file_name(name), content));
    let outputs: Vec<&Path> =
        std::iter::once(&*path).chain(files.as_ref().map(|(path, _)| &**path)).collect();
    ensure_outputs(&outputs, &[])?;
    if let Some(there) = outputs.iter().find(|output| output.exists() && !arguments.force) {
        return Err(Error::input(format!("{}: already exists; use --force to replace it", there.display())));
    }
    let name = Path::new(path.file_name().unwrap_or_default()).with_extension("");
    let text = example.map_or_else(|| scenario::template(&name.to_string_lossy()), |example| example.text());
    if let Some((path, content)) = &files {
        write_atomically(path, content)?;
    }
    write_atomically(&path, text.as_bytes())?;
    console.object(&json!({ "scenario": path, "ground": files.as_ref().map(|(path, _)| path) }));
    console.result(&visible(&path.display().to_string()));
    console.note(&format!("Edit it, then run: warpgait solve {}", path.display()));
    Ok(Ending::Good)
}

/// `NAME.toml`.
fn scenario_file(name: Option<&Path>, example: Option<&Example>) -> PathBuf {
    let name = name.unwrap_or_else(|| Path::new(example.map_or("scenario", |example| example.name)));
    if name.extension().is_some_and(|extension| extension == "toml") {
        return name.to_owned();
    }
    let mut name = name.to_owned().into_os_string();
    name.push(".toml");
    PathBuf::from(name)
}

fn list(console: &Console) {
    let width = EXAMPLES.iter().map(|example| example.name.len()).max().unwrap_or_default();
    for example in EXAMPLES {
        console.result(&format!("{:width$}  {}", example.name, example.purpose()));
    }
    let object = |example: &Example| json!({ "name": example.name, "purpose": example.purpose() });
    console.object(&json!({ "examples": EXAMPLES.iter().map(object).collect::<Vec<_>>() }));
}
