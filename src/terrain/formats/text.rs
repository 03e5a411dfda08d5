//! Grids of numbers in text: comma-separated or spaced values, and ESRI ASCII grids.

use super::input::Input;
use crate::error::{Error, Result};
use crate::terrain::raster::{Raster, Values, check_size};

/// Bytes at the start of a file that show whether it is text.
const LOOKED_AT: usize = 4096;
/// Lines that start like this hold no numbers.
const COMMENTS: [char; 2] = ['#', '%'];
/// The first bytes of text in UTF-16.
const UTF_16: [&[u8]; 2] = [b"\xff\xfe", b"\xfe\xff"];
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

/// Whether a file starts with lines of numbers, after comments and at most one line of names; or is called so and starts as text.
pub fn is_grid(input: &Input) -> bool {
    let is_called_so = ["csv", "tsv", "txt"].into_iter().any(|name| input.ends_in(name));
    if is_called_so && UTF_16.iter().any(|mark| input.bytes.starts_with(mark)) {
        return true;
    }
    let start = start(input.bytes);
    let separator = Separator::of(&start);
    let Some((_, first)) = content(&start).find(|(_, line)| !line.trim().is_empty()) else { return false };
    let mut fields = separator.fields(first);
    // Numbers that are written in another way are complained of when they are read.
    fields.clone().all(|field| number(field).is_some())
        || (is_called_so && !super::mesh::is_obj(input) && fields.any(|field| !field.is_empty()))
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

/// The lines without comments, with their numbers from 1. Spaces around them are left out, tabs are not.
fn content(text: &str) -> impl Iterator<Item = (usize, &str)> {
    let lines = text.lines().enumerate().map(|(i, line)| (i + 1, line.trim_matches([' ', '\r'])));
    lines.filter(|(_, line)| !line.trim_start().starts_with(COMMENTS))
}

/// What is between the fields of all lines: a character, or else any space.
#[derive(Clone, Copy)]
struct Separator(Option<char>);

impl Separator {
    /// That of the first line that does not hold names.
    fn of(text: &str) -> Self {
        let of_line = |line: &str| {
            let found = [';', ',', '\t'].into_iter().find(|c| line.contains(*c));
            // Numbers with tabs and spaces between them.
            let mixed = |c| line.split(c).any(|field| field.trim().contains(' '));
            Self(found.filter(|c| *c != '\t' || !mixed(*c)))
        };
        let mut lines = content(text).map(|(_, line)| line).filter(|line| !line.is_empty());
        let first = lines.next().unwrap_or_default();
        let separator = of_line(first);
        if separator.has_names(first) { lines.next().map_or(separator, of_line) } else { separator }
    }

    /// The fields of a line. Of separated ones, some may be empty.
    fn fields(self, line: &str) -> impl Iterator<Item = &str> + Clone {
        line.split(move |c: char| self.0.map_or(c.is_whitespace(), |s| c == s))
            .map(str::trim)
            .filter(move |field| self.0.is_some() || !field.is_empty())
    }

    /// Whether a line holds names, not numbers written in some way.
    fn has_names(self, line: &str) -> bool {
        let is_name = |field: &str| {
            number(field).is_none() && !field.starts_with(|c: char| c.is_ascii_digit() || "+-.".contains(c))
        };
        self.fields(line).all(is_name)
    }
}

/// A number; NaN for an empty field.
fn number(field: &str) -> Option<f64> {
    if field.is_empty() { Some(f64::NAN) } else { field.parse().ok() }
}

/// Whether every row ends in a separator.
fn ends_all(text: &str, separator: Separator) -> bool {
    let mut rows = content(text).map(|(_, line)| line).filter(|line| !line.is_empty());
    rows.all(|line| separator.has_names(line) || line.ends_with(|c| Some(c) == separator.0))
}

fn text(bytes: &[u8]) -> Result<&str> {
    if UTF_16.iter().any(|mark| bytes.starts_with(mark)) {
        return Err(Error::input("text in UTF-16; save it in UTF-8"));
    }
    let text = std::str::from_utf8(bytes).map_err(|e| {
        let line = 1 + bytes[..e.valid_up_to()].iter().filter(|b| **b == b'\n').count();
        Error::input(format!("line {line}: not text in UTF-8"))
    })?;
    Ok(text.trim_start_matches('\u{feff}'))
}

fn wrong(line: usize, number: usize, field: &str) -> Error {
    let shown: String = field.chars().take(20).collect();
    Error::input(format!("line {line}, field {number}: {shown:?} is no number; decimals must have a point"))
}

/// Decodes rows of numbers, one row a line. Empty fields and `nan` have no data.
///
/// # Errors
/// For what is no number, rows of different lengths, and grids that are too small or too large.
pub fn grid(input: &Input) -> Result<Raster> {
    let text = text(input.bytes)?;
    let separator = Separator::of(text);
    let (mut values, mut columns, mut rows, mut blank) = (Vec::new(), 0, 0, None);
    let mut is_first = true;
    for (line, content) in content(text) {
        if content.trim().is_empty() && (separator.0.is_none() || content.is_empty()) {
            blank = blank.or(Some(line).filter(|_| rows > 0 && separator.0.is_some()));
            continue;
        }
        if std::mem::take(&mut is_first) && separator.has_names(content) {
            continue;
        }
        if let Some(line) = blank {
            let what =
                "an empty line between rows; leave it out, or write the separators of a row without data";
            return Err(Error::input(format!("line {line}: {what}")));
        }
        let before = values.len();
        for (k, field) in separator.fields(content).enumerate() {
            let value = number(field).ok_or_else(|| wrong(line, k + 1, field))?;
            if value.is_infinite() {
                return Err(Error::input(format!(
                    "line {line}: {field:.20} is no height; write nan where there is no data"
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
    let mut notes = Vec::new();
    let is_empty = |column: usize| values.iter().skip(column).step_by(columns).all(|v: &f64| v.is_nan());
    if separator.0.is_some()
        && columns > 1
        && is_empty(columns - 1)
        && !is_empty(columns - 2)
        && ends_all(text, separator)
    {
        notes.push("the separator at the end of every row is left out".to_owned());
        let all = columns;
        let mut k = 0;
        values.retain(|_| {
            k += 1;
            k % all != 0
        });
        columns -= 1;
    }
    if columns == 3 {
        return Err(Error::input(
            "3 columns: a list of points x, y, z is no grid of heights; rasterize it first",
        ));
    }
    check_size(columns as u64, rows)?;
    let mut raster = Raster::new(columns, rows as usize, values, Values::Meters, "text".to_owned());
    raster.notes = notes;
    Ok(raster)
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
            header[key] =
                Some(number(word).filter(|_| !word.is_empty()).ok_or_else(|| wrong(line, 2, word))?);
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
        let value =
            number(word).ok_or_else(|| wrong(line, values.len() % size.map_or(1, |s| s.0) + 1, word))?;
        if value.is_infinite() {
            return Err(Error::input(format!("line {line}: {word:.20} is no height")));
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
