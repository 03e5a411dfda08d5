//! `warpgait schema`.

use clap::Args;

use super::console::Console;
use super::ending::Ending;
use crate::{Error, Result, scenario};

const EXAMPLES: &str = "\
Examples:
  warpgait schema > scenario.schema.json    for editors that complete and check TOML by a schema";

#[derive(Debug, Args)]
#[command(after_help = EXAMPLES)]
pub(super) struct SchemaArguments {}

pub(super) fn schema(console: &Console) -> Result<Ending> {
    let schema = serde_json::to_string_pretty(&scenario::json_schema());
    console.output(&schema.map_err(|e| Error::Internal(format!("schema: {e}")))?);
    Ok(Ending::Good)
}
