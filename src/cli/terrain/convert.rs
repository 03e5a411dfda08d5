//! `warpgait terrain convert`.

use std::fmt::Write;
use std::path::{Path, PathBuf};

use clap::Args;
use serde_json::json;

use super::source::{Read, SourceArguments};
use crate::cli::console::Console;
use crate::cli::ending::Ending;
use crate::files::npy::Header;
use crate::files::npz::NpzWriter;
use crate::files::write_atomically;
use crate::terrain::Scan;
use crate::visible::visible;
use crate::{Error, Result};

/// What stands for no data in an ESRI grid.
const NO_DATA: f64 = -9999.0;
/// The greatest gray level.
const WHITE: f64 = 65535.0;

const EXAMPLES: &str = "\
Examples:
  warpgait terrain convert isaac.npy ground.npz --spacing 0.1 --height-scale 0.005 --layout x-y
  warpgait terrain convert tiles.stl tiles.npz --spacing 0.02
  warpgait terrain convert hill.toml hill.asc            the ground of a scenario
  warpgait terrain convert scan.npz scan.png             16 bit; prints the scale

An .npz file holds spacing, origin and layout; for others the keys of a scenario are printed.
Exit codes: 0 written; 2 bad input, nothing written.";

#[derive(Debug, Args)]
#[command(after_help = EXAMPLES)]
pub(super) struct ConvertArguments {
    #[command(flatten)]
    source: SourceArguments,
    /// The file to write: .npz, .npy, .asc or .png
    output: PathBuf,
}

pub(super) fn convert(arguments: &ConvertArguments, console: &Console) -> Result<Ending> {
    let (input, output) = (arguments.source.input(), &arguments.output);
    let extension = output.extension().unwrap_or_default().to_string_lossy().to_ascii_lowercase();
    if !["npz", "npy", "asc", "png"].contains(&extension.as_str()) {
        let what = "cannot be written; its name must end in .npz, .npy, .asc or .png";
        return Err(Error::input(format!("{}: {what}", output.display())));
    }
    let scan = scan(arguments.source.read(Some(output))?);
    let (low, high) = known(&scan).fold((f64::INFINITY, f64::NEG_INFINITY), |(a, b), h| (a.min(h), b.max(h)));
    if low > high {
        return Err(Error::input(format!("{}: every cell is without data", input.display())));
    }
    let mut keys = vec![("spacing", json!(scan.grid.spacing[0])), ("origin", json!(center(&scan)))];
    match extension.as_str() {
        "npz" => {
            write_npz(&scan, output)?;
            keys.clear();
        }
        "npy" => write_atomically(output, &npy(&scan)?)?,
        "asc" => {
            write_atomically(output, esri(&scan).as_bytes())?;
            keys.clear();
        }
        _ => {
            write_atomically(output, &png(&scan, low, high)?)?;
            keys.push(("height_scale", json!(high - low)));
        }
    }
    let mut text = format!("Written: {}\n", visible(&output.display().to_string()));
    let name = output.file_name().unwrap_or_default().to_string_lossy();
    let _ =
        write!(text, "[terrain]\nkind = \"heightmap\"\nfile = {}", toml::Value::String(name.into_owned()));
    for (key, value) in &keys {
        let _ = write!(text, "\n{key} = {value}");
    }
    if extension == "png" {
        let _ = write!(text, "\n# black is z = {low:.4} m, which the image does not tell");
    }
    console.result(&text);
    console.object(&json!({
        "input": input,
        "output": output,
        "terrain": keys.iter().map(|(key, value)| ((*key).to_owned(), value.clone())).collect::<serde_json::Map<_, _>>(),
        "height_range": [low, high],
    }));
    Ok(Ending::Good)
}

/// The ground as measured, or the samples of a function.
fn scan(read: Read) -> Scan {
    let field = read.ground.field;
    let sampled = || Scan { grid: *field.grid(), heights: field.samples().to_vec() };
    read.heightmap.map_or_else(sampled, |heightmap| heightmap.scan)
}

fn known(scan: &Scan) -> impl Iterator<Item = f64> {
    scan.heights.iter().copied().filter(|h| !h.is_nan())
}

/// x, y of the center, m.
fn center(scan: &Scan) -> [f64; 2] {
    let [x_min, x_max, y_min, y_max] = scan.grid.extent();
    [0.5 * (x_min + x_max), 0.5 * (y_min + y_max)]
}

fn write_npz(scan: &Scan, output: &Path) -> Result<()> {
    let grid = &scan.grid;
    let mut npz = NpzWriter::create(output)?;
    npz.add_f64("heights", &[grid.rows, grid.columns], scan.heights.iter().copied())?;
    npz.add_f64("spacing", &[], [grid.spacing[0]])?;
    npz.add_f64("origin", &[2], grid.origin)?;
    npz.add_str("layout", &[], &["y-up".to_owned()])?;
    npz.finish()
}

/// Rows from the largest y, as pictures and arrays are read.
fn downward(scan: &Scan) -> impl Iterator<Item = f64> {
    scan.heights.chunks(scan.grid.columns).rev().flatten().copied()
}

fn npy(scan: &Scan) -> Result<Vec<u8>> {
    let shape = vec![scan.grid.rows as u64, scan.grid.columns as u64];
    let header = Header { dtype: "<f8".into(), fortran_order: false, shape };
    let mut bytes = header.write().map_err(Error::Internal)?;
    bytes.extend(downward(scan).flat_map(f64::to_le_bytes));
    Ok(bytes)
}

fn esri(scan: &Scan) -> String {
    let grid = &scan.grid;
    let mut text = format!(
        "ncols {}\nnrows {}\nxllcenter {}\nyllcenter {}\ncellsize {}\nNODATA_value {NO_DATA}\n",
        grid.columns, grid.rows, grid.origin[0], grid.origin[1], grid.spacing[0]
    );
    for (i, height) in downward(scan).enumerate() {
        let end = if (i + 1) % grid.columns == 0 { '\n' } else { ' ' };
        let _ = write!(text, "{}{end}", if height.is_nan() { NO_DATA } else { height });
    }
    text
}

/// 16 bit gray, with an alpha channel where there are holes.
fn png(scan: &Scan, low: f64, high: f64) -> Result<Vec<u8>> {
    let holes = scan.heights.iter().any(|h| h.is_nan());
    let span = if high > low { high - low } else { 1.0 };
    let mut data = Vec::new();
    for height in downward(scan) {
        let level = if height.is_nan() { 0.0 } else { (WHITE * (height - low) / span).round() };
        data.extend((level as u16).to_be_bytes());
        if holes {
            data.extend(if height.is_nan() { [0, 0] } else { [255, 255] });
        }
    }
    let mut bytes = Vec::new();
    let mut encoder = png::Encoder::new(&mut bytes, scan.grid.columns as u32, scan.grid.rows as u32);
    encoder.set_color(if holes { png::ColorType::GrayscaleAlpha } else { png::ColorType::Grayscale });
    encoder.set_depth(png::BitDepth::Sixteen);
    let written = encoder.write_header().and_then(|mut writer| writer.write_image_data(&data));
    written.map_err(|e| Error::Internal(format!("PNG: {e}")))?;
    Ok(bytes)
}
