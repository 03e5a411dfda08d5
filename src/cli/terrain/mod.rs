//! `warpgait terrain show` and `warpgait terrain convert`.

mod convert;
mod show;
mod source;

use clap::{Args, Subcommand};

use super::console::Console;
use super::ending::Ending;
use crate::Result;

#[derive(Debug, Args)]
pub(super) struct TerrainArguments {
    #[command(subcommand)]
    command: TerrainCommand,
}

#[derive(Debug, Subcommand)]
enum TerrainCommand {
    /// Draw a ground, and say what its file was taken for
    Show(show::ShowArguments),
    /// Write a ground in another format
    Convert(convert::ConvertArguments),
}

pub(super) fn terrain(arguments: &TerrainArguments, console: &Console) -> Result<Ending> {
    match &arguments.command {
        TerrainCommand::Show(arguments) => show::show(arguments, console),
        TerrainCommand::Convert(arguments) => convert::convert(arguments, console),
    }
}
