//! `warpgait terrain show`.

use std::path::PathBuf;

use clap::Args;
use serde_json::json;

use super::source::{Read, SourceArguments};
use crate::cli::console::Console;
use crate::cli::ending::Ending;
use crate::files::write_atomically;
use crate::plan::GroundGrid;
use crate::report::{TerrainView, number, terrain_sheet};
use crate::scenario::Scenario;
use crate::terrain::Ground;
use crate::visible::visible;
use crate::{Error, Result};

const EXAMPLES: &str = "\
Examples:
  warpgait terrain show hill.toml                        the ground of a scenario, with start and goal
  warpgait terrain show scan.npy --spacing 0.04          a file of heights: scan.terrain.svg shows which way it lies
  warpgait terrain show isaac.npy --spacing 0.1 --height-scale 0.005 --layout x-y
  warpgait terrain show map.png --spacing 0.05 --height-scale 1.25 --no-data 0
  warpgait terrain show tiles.stl --spacing 0.02 -o tiles.svg --json

Exit codes: 0 the ground was read; 2 bad input, nothing written.";

#[derive(Debug, Args)]
#[command(after_help = EXAMPLES)]
pub(super) struct ShowArguments {
    #[command(flatten)]
    source: SourceArguments,
    /// The drawing to write, an SVG file [default: NAME.terrain.svg in the working folder]
    #[arg(short, long, value_name = "FILE", conflicts_with = "no_plot")]
    output: Option<PathBuf>,
    /// Draw nothing
    #[arg(long)]
    no_plot: bool,
}

pub(super) fn show(arguments: &ShowArguments, console: &Console) -> Result<Ending> {
    let input = arguments.source.input();
    let plot = match (&arguments.output, input.file_stem()) {
        _ if arguments.no_plot => None,
        (Some(output), _) => Some(output.clone()),
        (None, Some(stem)) => Some(PathBuf::from(format!("{}.terrain.svg", stem.to_string_lossy()))),
        (None, None) => {
            return Err(Error::input(format!("{}: this is not the name of a file", input.display())));
        }
    };
    let read = arguments.source.read(plot.as_deref())?;
    let (facts, mut notes) = (facts(&read), read.ground.report.notes.clone());
    if read.has_ends {
        let extent = read.ground.field.extent();
        read.loaded.ensure_base_inside(extent)?;
        // A solve would refuse this; a drawing shows it.
        notes.extend(read.loaded.ensure_inside(extent).err().map(|error| error.to_string()));
    }
    if let Some(plot) = &plot {
        let title = input.file_name().unwrap_or_default().to_string_lossy();
        let ends = ends(&read);
        let view = TerrainView {
            title: &title,
            ground: &grid(&read),
            ends: ends.map(|ends| ends.map(|(position, _)| position)),
            facts: &facts,
        };
        write_atomically(plot, terrain_sheet(&view).as_bytes())?;
    }
    facts.iter().for_each(|line| console.result(&visible(line)));
    notes.iter().for_each(|note| console.result(&visible(&format!("Note: {note}."))));
    if let Some(plot) = &plot {
        console.result(&format!("Written: {}", visible(&plot.display().to_string())));
    }
    console.object(&json!({
        "input": input,
        "plot": plot,
        "source": read.heightmap.as_ref().map(|heightmap| &heightmap.source),
        "terrain": read.ground.report,
        "ends": ends(&read).map(|[start, goal]| json!({
            "start": { "position": start.0, "height": start.1 },
            "goal": { "position": goal.0, "height": goal.1 },
        })),
    }));
    Ok(Ending::Good)
}

/// The ground as it is drawn: as it was measured, holes filled.
fn grid(read: &Read) -> GroundGrid {
    let grid = read.ground.field.grid();
    GroundGrid {
        rows: grid.rows,
        columns: grid.columns,
        origin: grid.origin,
        spacing: grid.spacing,
        height: read.ground.raw.clone().unwrap_or_else(|| read.ground.field.samples().to_vec()),
        raw: None,
        unknown: read.ground.unknown.clone(),
    }
}

/// Position and height of start and goal, m; none for a bare file.
fn ends(read: &Read) -> Option<[([f64; 2], f64); 2]> {
    let Scenario { start, goal, .. } = &read.loaded.scenario;
    let with_height = |[x, y]: [f64; 2]| ([x, y], read.ground.field.height(x, y));
    read.has_ends.then(|| [start.position, goal.position].map(with_height))
}

/// Whether nothing was measured at a place.
fn is_unknown(ground: &Ground, place: [f64; 2]) -> bool {
    let cell = ground.field.grid().nearest(place);
    cell.zip(ground.unknown.as_ref()).is_some_and(|(cell, unknown)| unknown[cell])
}

/// What a user should see before planning, in lines.
fn facts(read: &Read) -> Vec<String> {
    let report = &read.ground.report;
    let mut lines = Vec::new();
    match &read.heightmap {
        Some(heightmap) => {
            let source = &heightmap.source;
            let [rows, columns] = source.shape;
            lines.push(format!("Read as:   {}, {}", source.format, source.value_type));
            lines.push(format!(
                "Layout:    {}, {rows} x {columns} cells: {}",
                source.layout,
                in_words(source.layout)
            ));
            lines.push(format!("Unit:      a value of 1 is {} m", number(source.unit)));
        }
        None => lines.push(format!("Terrain:   {}", report.kind)),
    }
    let [x_min, x_max, y_min, y_max] = report.extent;
    let [low, high] = report.height_range;
    lines.push(format!("Extent:    x {x_min:.3} to {x_max:.3} m, y {y_min:.3} to {y_max:.3} m"));
    let spacing = read.heightmap.as_ref().map_or(report.spacing[0], |h| h.scan.grid.spacing[0]);
    lines.push(format!("Spacing:   {} m", number(spacing)));
    lines.push(format!("Heights:   {low:.3} to {high:.3} m"));
    let [x, y] = report.steepest_at;
    let slope = report.largest_slope;
    lines.push(format!(
        "Slopes:    up to {} ({:.0}°), at x = {x:.3}, y = {y:.3} m",
        number(slope),
        slope.atan().to_degrees()
    ));
    if let Some(heightmap) = &read.heightmap {
        let cells = heightmap.scan.heights.len();
        let unknown = heightmap.source.unknown;
        let part = 100.0 * unknown as f64 / cells as f64;
        lines.push(format!("No data:   {unknown} of {cells} cells ({part:.1} %)"));
        lines.push(match report.smoothing {
            0.0 => "Smoothing: none".to_owned(),
            deviation => format!(
                "Smoothing: over {} m; moves the ground by {} m rms, {} m at most",
                number(deviation),
                number(report.fit_error_rms),
                number(report.fit_error_max)
            ),
        });
    }
    if let Some(ends) = ends(read) {
        for (name, ([x, y], z)) in ["Start:", "Goal:"].into_iter().zip(ends) {
            let z = (1e3 * z).round() / 1e3 + 0.0; // no -0.000
            let guess = if is_unknown(&read.ground, [x, y]) { " (no data there: a guess)" } else { "" };
            lines.push(format!("{name:<10} x = {x:.3}, y = {y:.3}, on ground at z = {z:.3} m{guess}"));
        }
    }
    lines
}

/// Where the first value of a layout lies.
fn in_words(layout: &str) -> &'static str {
    match layout {
        "picture" => "the first row has the largest y, the first column the least x",
        "y-up" => "the first row has the least y, the first column the least x",
        "x-y" => "the first index runs along x, the second along y",
        _ => "the first index runs against x, the second against y",
    }
}
