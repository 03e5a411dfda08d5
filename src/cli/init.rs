//! `warpgait init`.

use std::path::{Path, PathBuf};

use clap::Args;
use serde_json::json;

use super::console::Console;
use super::ending::Ending;
use crate::files::{ensure_outputs, write_atomically};
use crate::visible::visible;
use crate::{Error, Result, scenario};

const EXAMPLES: &str = "\
Examples:
  warpgait init                 write scenario.toml
  warpgait init hill            write hill.toml
  warpgait init hill --force    replace hill.toml";

#[derive(Debug, Args)]
#[command(after_help = EXAMPLES)]
pub(super) struct InitArguments {
    /// Name of the scenario, written to NAME.toml
    #[arg(default_value = "scenario")]
    name: PathBuf,
    /// Replace an existing file
    #[arg(long)]
    force: bool,
}

pub(super) fn init(arguments: &InitArguments, console: &Console) -> Result<Ending> {
    let path = match arguments.name.extension() {
        Some(extension) if extension == "toml" => arguments.name.clone(),
        _ => {
            let mut name = arguments.name.clone().into_os_string();
            name.push(".toml");
            PathBuf::from(name)
        }
    };
    ensure_outputs(&[&path], &[])?;
    if path.exists() && !arguments.force {
        return Err(Error::input(format!("{}: already exists; use --force to replace it", path.display())));
    }
    let name = Path::new(path.file_name().unwrap_or_default()).with_extension("");
    write_atomically(&path, scenario::template(&name.to_string_lossy()).as_bytes())?;
    console.object(&json!({ "scenario": path }));
    console.result(&visible(&path.display().to_string()));
    console.note(&format!("Edit it, then run: warpgait solve {}", path.display()));
    Ok(Ending::Good)
}
