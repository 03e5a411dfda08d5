//! `warpgait map`.

use std::ops::ControlFlow;
use std::path::{Path, PathBuf};

use clap::Args;
use serde_json::json;

use super::console::Console;
use super::ending::{Ending, listen_for_ctrl_c};
use super::progress_line::ProgressLine;
use crate::files::npz::NpzWriter;
use crate::files::{ensure_no_inputs, ensure_outputs};
use crate::heightfield::Heightfield;
use crate::ipopt::InGoodOrder;
use crate::pipeline::{self, BuiltMap, Event, Step};
use crate::report::map_table;
use crate::scenario;
use crate::terrain::Surfaces;
use crate::visible::visible;
use crate::warp::{MapReport, WarpMap};
use crate::{Error, Result, terrain};

const EXAMPLES: &str = "\
Examples:
  warpgait map hill.toml                                  build the map, or read it from the cache
  warpgait map hill.toml --no-cache -o hill.map.npz       build it and write it to a file
  warpgait map hill.toml --set map.method=acap-newton     compare another method

Exit codes: 0 the map converged without folds; 1 it did not; 2 bad input; 130 interrupted.";

#[derive(Debug, Args)]
#[command(after_help = EXAMPLES)]
pub(super) struct MapArguments {
    /// The scenario whose map is built
    scenario: PathBuf,
    /// Write the map to this .npz file
    #[arg(short, long, value_name = "FILE")]
    output: Option<PathBuf>,
    /// Override a value of the scenario: a dotted key, and a TOML value or a bare word; may be repeated
    #[arg(long, value_name = "KEY=VALUE")]
    set: Vec<String>,
    /// Build the map without the cache
    #[arg(long)]
    no_cache: bool,
}

pub(super) fn map(arguments: &MapArguments, console: &Console) -> Result<Ending> {
    let loaded = scenario::load(&arguments.scenario, &arguments.set)?;
    ensure_outputs(&arguments.output.iter().map(PathBuf::as_path).collect::<Vec<_>>(), &loaded.files())?;
    listen_for_ctrl_c()?;
    let mut progress = ProgressLine::new(console.is_quiet());
    progress.show(&Event::Step(Step::Terrain));
    let ground =
        terrain::build(&loaded.scenario, &loaded.robot, &loaded.base_dir).map_err(|e| loaded.locate(e))?;
    let outputs: Vec<&Path> = arguments.output.iter().map(PathBuf::as_path).collect();
    ensure_no_inputs(&outputs, &loaded.paths(&ground.inputs))?;
    let surfaces = Surfaces::of(&loaded.scenario, &loaded.robot, &ground).map_err(|e| loaded.locate(e))?;
    let surface = &surfaces.posture;
    ground.report.notes.iter().for_each(|note| progress.note(&format!("terrain: {note}")));
    let mut show = |event: &Event| {
        progress.show(event);
        ControlFlow::Continue(())
    };
    let built = pipeline::build_map(surface, &loaded.scenario.map, !arguments.no_cache, &mut show)?;
    let Some(built) = built else { return Ok(Ending::Interrupted) };
    built.report_warnings(&mut show);
    drop(progress);
    let BuiltMap { map, report, cached } = &built;
    if let Some(output) = &arguments.output {
        let _in_good_order = InGoodOrder::begin();
        write(output, map, surface, report)?;
    }
    let sound = report.converged && report.inverted_points == 0;
    console.result(&map_table(report, *cached));
    if let Some(output) = &arguments.output {
        console.result(&format!("Written: {}", visible(&output.display().to_string())));
    }
    console.object(&json!({
        "scenario": arguments.scenario,
        "map": arguments.output,
        "sound": sound,
        "cached": cached,
        "terrain": ground.report,
        "report": report,
    }));
    Ok(if sound { Ending::Good } else { Ending::NotGood })
}

/// Writes the arrays of map and ground as in a plan, and the report as `meta`.
fn write(path: &Path, map: &WarpMap, field: &Heightfield, report: &MapReport) -> Result<()> {
    let (grid, samples) = (map.to_grid(), field.grid());
    let mut npz = NpzWriter::create(path)?;
    npz.add_map(&grid)?;
    npz.add_f64("heightfield", &[samples.rows, samples.columns], field.samples().iter().copied())?;
    npz.add_f64("heightfield_origin", &[2], samples.origin)?;
    npz.add_f64("heightfield_spacing", &[2], samples.spacing)?;
    let meta = serde_json::to_string(report).map_err(|e| Error::Internal(format!("map report: {e}")))?;
    npz.add_str("meta", &[], &[meta])?;
    npz.finish()
}
