//! `warpgait init` and `warpgait schema`.

use std::path::{Path, PathBuf};

use clap::Args;
use serde_json::json;

use super::Ending;
use super::console::Console;
use crate::files::write_atomically;
use crate::{Error, Result, scenario};

#[derive(Debug, Args)]
pub(super) struct InitArguments {
    /// Name of the scenario; NAME.toml is written
    #[arg(default_value = "scenario")]
    name: PathBuf,
    /// Replace a file that is there already
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
    if path.exists() && !arguments.force {
        return Err(Error::input(format!("{}: is there already; --force replaces it", path.display())));
    }
    let name = Path::new(path.file_name().unwrap_or_default()).with_extension("");
    write_atomically(&path, scenario::template(&name.to_string_lossy()).as_bytes())?;
    console.object(&json!({ "scenario": path }));
    console.result(&path.display().to_string());
    console.note(&format!("Edit it, then run: warpgait solve {}", path.display()));
    Ok(Ending::Good)
}

pub(super) fn schema(console: &Console) -> Result<Ending> {
    let schema = scenario::json_schema();
    console
        .always(&serde_json::to_string_pretty(&schema).map_err(|e| Error::Internal(format!("schema: {e}")))?);
    Ok(Ending::Good)
}
