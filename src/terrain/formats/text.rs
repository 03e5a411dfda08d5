//! Grids of numbers in text: comma-separated or spaced values, and ESRI ASCII grids.

use super::input::Input;
use crate::error::{Error, Result};
use crate::terrain::raster::{Raster, Values, check_size};

/// Bytes at the start of a file that show whether it is text.
const LOOKED_AT: usize = 4096;
/// Lines that start like this hold no numbers.
const COMMENTS: [char; 2] = ['#', '%'];
/// Keys of the header of an ESRI grid.
const KEYS: [&str; 10] = [
    "ncols",
    "nrows",
    "xllcorner",
    "xllcenter",
    "yllcorner",
    "yllcenter",
    "cellsize",
    "dx",
    "dy",
    "nodata_value",
];

/// Whether a file starts with the header of an ESRI ASCII grid.
pub fn is_esri(input: &Input) -> bool {
    let start = start(input.bytes);
    let word = start.split_whitespace().next().unwrap_or_default().to_ascii_lowercase();
    ["ncols", "nrows"].contains(&word.as_str())
}

/// Whether a file starts with lines of numbers, after comments and at most one line of names.
pub fn is_grid(input: &Input) -> bool {
    let start = start(input.bytes);
    let mut lines = content(&start).map(|(_, line)| line).take(2);
    let (first, second) = (lines.next().unwrap_or_default(), lines.next().unwrap_or_default());
    let numbers =
        |line: &str| fields(line).next().is_some() && fields(line).all(|field| number(field).is_some());
    numbers(first) || (numbers(second) && (input.ends_in("csv") || input.ends_in("txt")))
}

/// The start of a file as text, up to what is none; control characters are none. What may be half a word is left out.
fn start(bytes: &[u8]) -> String {
    let is_part = bytes.len() > LOOKED_AT;
    let bytes = &bytes[..bytes.len().min(LOOKED_AT)];
    let text = String::from_utf8_lossy(bytes);
    let whole = text.rfind(|c: char| c.is_whitespace() || [',', ';'].contains(&c)).filter(|_| is_part);
    let text = &text[..whole.unwrap_or(text.len())];
    let end = text.find(|c: char| (c.is_control() && !c.is_whitespace()) || c == '\u{fffd}');
    text[..end.unwrap_or(text.len())].trim_start_matches('\u{feff}').to_owned()
}

/// The lines with content, with their numbers from 1.
fn content(text: &str) -> impl Iterator<Item = (usize, &str)> {
    let lines = text.lines().enumerate().map(|(i, line)| (i + 1, line.trim()));
    lines.filter(|(_, line)| !line.is_empty() && !line.starts_with(COMMENTS))
}

/// The fields of a line: between commas, semicolons or tabs, or else between spaces.
fn fields(line: &str) -> impl Iterator<Item = &str> {
    let separator = [';', ',', '\t'].into_iter().find(|c| line.contains(*c));
    let line = line.trim_end_matches([',', ';']);
    line.split(move |c: char| separator.map_or(c.is_whitespace(), |s| c == s))
        .map(str::trim)
        .filter(move |field| separator.is_some() || !field.is_empty())
}

/// A number; NaN for an empty field.
fn number(field: &str) -> Option<f64> {
    if field.is_empty() { Some(f64::NAN) } else { field.parse().ok() }
}

fn text(bytes: &[u8]) -> Result<&str> {
    let text = std::str::from_utf8(bytes).map_err(|e| {
        let line = 1 + bytes[..e.valid_up_to()].iter().filter(|b| **b == b'\n').count();
        Error::input(format!("line {line}: not text in UTF-8"))
    })?;
    Ok(text.trim_start_matches('\u{feff}'))
}

fn wrong(line: usize, field: &str) -> Error {
    let shown: String = field.chars().take(20).collect();
    Error::input(format!("line {line}: {shown:?} is no number; decimals must have a point"))
}

/// Decodes rows of numbers, one row a line. Empty fields and `nan` have no data.
///
/// # Errors
/// For what is no number, rows of different lengths, and grids that are too small or too large.
pub fn grid(input: &Input) -> Result<Raster> {
    let text = text(input.bytes)?;
    let (mut values, mut columns, mut rows) = (Vec::new(), 0, 0);
    for (i, (line, content)) in content(text).enumerate() {
        if i == 0 && fields(content).all(|field| number(field).is_none()) {
            // Names of the columns.
            continue;
        }
        let before = values.len();
        for field in fields(content) {
            let value = number(field).ok_or_else(|| wrong(line, field))?;
            if value.is_infinite() {
                return Err(Error::input(format!(
                    "line {line}: {field} is no height; write nan where there is no data"
                )));
            }
            values.push(value);
        }
        rows += 1;
        let found = values.len() - before;
        if rows == 1 {
            columns = found;
        }
        if found != columns {
            return Err(Error::input(format!(
                "line {line}: {found} numbers, but {columns} in the first row"
            )));
        }
        if values.len() > crate::heightfield::MAX_SAMPLES {
            check_size(columns as u64, rows)?;
        }
    }
    if columns == 3 {
        return Err(Error::input(
            "3 columns: a list of points x, y, z is no grid of heights; rasterize it first",
        ));
    }
    check_size(columns as u64, rows)?;
    Ok(Raster::new(columns, rows as usize, values, Values::Meters, "text".to_owned()))
}

/// Decodes an ESRI ASCII grid; the first row has the largest y.
///
/// # Errors
/// For keys that are missing or wrong, and another number of values than they tell.
pub fn esri(input: &Input) -> Result<Raster> {
    let text = text(input.bytes)?;
    let mut header: [Option<f64>; KEYS.len()] = [None; KEYS.len()];
    let mut words =
        text.lines().enumerate().flat_map(|(i, line)| line.split_whitespace().map(move |word| (i + 1, word)));
    let mut values = Vec::new();
    let mut size = None;
    while let Some((line, word)) = words.next() {
        if let Some(key) = KEYS.iter().position(|key| key.eq_ignore_ascii_case(word))
            && values.is_empty()
        {
            let (line, word) = words.next().unwrap_or((line, ""));
            header[key] = Some(number(word).filter(|_| !word.is_empty()).ok_or_else(|| wrong(line, word))?);
            continue;
        }
        if size.is_none() {
            let count = |key: usize| {
                let n = header[key].filter(|n| n.fract() == 0.0 && (0.0..1e9).contains(n));
                n.map(|n| n as u64)
                    .ok_or_else(|| Error::input(format!("{} is missing, or no whole number", KEYS[key])))
            };
            let (columns, rows) = (count(0)?, count(1)?);
            check_size(columns, rows)?;
            size = Some((columns as usize, rows as usize));
        }
        let value = number(word).ok_or_else(|| wrong(line, word))?;
        if value.is_infinite() {
            return Err(Error::input(format!("line {line}: {word} is no height")));
        }
        values.push(value);
        if size.is_some_and(|(columns, rows)| values.len() > columns * rows) {
            return Err(Error::input(format!("line {line}: more values than ncols and nrows tell")));
        }
    }
    let Some((columns, rows)) = size.filter(|(columns, rows)| values.len() == columns * rows) else {
        return Err(Error::input(format!("{} values, fewer than ncols and nrows tell", values.len())));
    };
    let mut raster = Raster::new(columns, rows, values, Values::Meters, "text".to_owned());
    let [_, _, x_corner, x_center, y_corner, y_center, cell, dx, dy, no_data] = header;
    raster.spacing = match (dx, dy, cell) {
        (Some(dx), Some(dy), _) => Some([dx, dy]),
        (_, _, cell) => cell.map(|cell| [cell; 2]),
    };
    // A corner is that of a cell's area, whose center is half a cell further.
    if let Some([dx, dy]) = raster.spacing
        && let Some(x) = x_center.or(x_corner.map(|x| x + 0.5 * dx))
        && let Some(y) = y_center.or(y_corner.map(|y| y + 0.5 * dy))
        && x.is_finite()
        && y.is_finite()
    {
        raster.corner = Some([x, y]);
    }
    raster.no_data.extend(no_data);
    Ok(raster)
}
