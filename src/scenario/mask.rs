//! `keep_out.mask`: a raster of where no foot may stand becomes outlines, so that a plan needs no other file.

use std::collections::BTreeMap;
use std::path::Path;

use toml::Value;

use crate::digest::sha256_hex;
use crate::files::{self, npy, png};
use crate::input::Document;
use crate::{Error, Result};

/// Cells, at most.
const MOST_CELLS: u64 = 4096 * 4096;
/// Corners of the outlines, at most.
const MOST_CORNERS: usize = 20_000;
/// x_min, x_max, y_min, y_max of a terrain that does not say, m.
const EXTENT: [f64; 4] = [-3.0, 3.0, -3.0, 3.0];

/// Cells that are kept free, the first row at the top.
struct Mask {
    columns: usize,
    rows: usize,
    kept: Vec<bool>,
}

/// Replaces each mask by its outlines. Returns the files: name and SHA-256.
///
/// # Errors
/// For files that cannot be read or are no masks, and for values beside them.
pub(super) fn expand(document: &mut Document, base_dir: &Path) -> Result<Vec<(String, String)>> {
    let Some(items) = document.table().get("keep_out").and_then(Value::as_array).cloned() else {
        return Ok(Vec::new());
    };
    let mut inputs = Vec::new();
    for (n, item) in items.iter().enumerate() {
        let key = |name: &str| format!("keep_out[{n}].{name}");
        let Some(name) = item.get("mask").and_then(Value::as_str) else {
            if item.get("extent").is_some() {
                return Err(
                    document.error(&key("extent"), "given without a mask, which it places; remove it")
                );
            }
            continue;
        };
        for other in ["polygon", "outlines"] {
            if item.get(other).is_some() {
                let what = format!(
                    "given together with a mask ({}); remove one of them",
                    document.place(&key("mask"))
                );
                return Err(document.error(&key(other), what));
            }
        }
        let bytes = files::read(&base_dir.join(name), files::MAX_FILE);
        let bytes = bytes.map_err(|e| document.error(&key("mask"), e))?;
        let mask = Mask::read(&bytes).map_err(|e| document.error(&key("mask"), e))?;
        let extent = extent(document, item, n)?;
        let outlines = mask.outlines(extent);
        let corners = outlines.iter().map(Vec::len).sum::<usize>();
        if corners == 0 || corners > MOST_CORNERS {
            let what = if corners == 0 {
                "keeps nothing free: all of it is zero, or black; remove it".to_owned()
            } else {
                format!("its outlines have {corners} corners, allowed: {MOST_CORNERS}; use larger cells")
            };
            return Err(document.error(&key("mask"), what));
        }
        let corner = |[x, y]: [f64; 2]| Value::Array(vec![Value::Float(x), Value::Float(y)]);
        let outline = |corners: Vec<[f64; 2]>| Value::Array(corners.into_iter().map(corner).collect());
        let value = Value::Array(outlines.into_iter().map(outline).collect());
        inputs.push((name.to_owned(), sha256_hex(&bytes)));
        document.replace_in("keep_out", n, &["mask", "extent"], "outlines", value);
    }
    Ok(inputs)
}

/// Where a mask is.
fn extent(document: &Document, item: &Value, n: usize) -> Result<[f64; 4]> {
    let terrain = document.table().get("terrain");
    let of_terrain = terrain.and_then(|terrain| terrain.get("extent"));
    let measured =
        terrain.and_then(|terrain| terrain.get("kind")).and_then(Value::as_str) == Some("heightmap");
    let (key, given) = match (item.get("extent"), of_terrain) {
        (Some(own), _) => (format!("keep_out[{n}].extent"), own),
        (None, Some(extent)) => ("terrain.extent".to_owned(), extent),
        (None, None) if measured => {
            let what = "needs extent = [x_min, x_max, y_min, y_max], the ground that it covers, here or for the terrain";
            return Err(document.error(&format!("keep_out[{n}].mask"), what));
        }
        (None, None) => return Ok(EXTENT),
    };
    let number = |v: &Value| v.as_float().or(v.as_integer().map(|n| n as f64)).filter(|v| v.is_finite());
    let numbers: Option<Vec<f64>> = given.as_array().and_then(|values| values.iter().map(number).collect());
    match numbers.as_deref() {
        Some(&[x_min, x_max, y_min, y_max]) if x_min < x_max && y_min < y_max => {
            Ok([x_min, x_max, y_min, y_max])
        }
        _ => Err(document.error(&key, "allowed: [x_min, x_max, y_min, y_max] in m, each max above its min")),
    }
}

impl Mask {
    fn read(bytes: &[u8]) -> Result<Self> {
        let check_size = |columns: u64, rows: u64| {
            if columns.checked_mul(rows).is_some_and(|cells| (1..=MOST_CELLS).contains(&cells)) {
                return Ok(());
            }
            Err(Error::input(format!("{columns} x {rows} cells; allowed: 1 to {MOST_CELLS}")))
        };
        if bytes.starts_with(png::SIGNATURE) {
            let image = png::decode(bytes, check_size)?;
            let kept = image.levels.iter().map(|level| 2.0 * level >= image.white).collect();
            return Ok(Self { columns: image.columns, rows: image.rows, kept });
        }
        if !bytes.starts_with(npy::SIGNATURE) {
            return Err(Error::input("is neither a PNG image nor a NumPy array (.npy)"));
        }
        let (header, elements) = npy::Header::read(bytes).map_err(Error::input)?;
        let &[rows, columns] = &header.shape[..] else {
            return Err(Error::input(format!(
                "has the shape {}, allowed: (rows, columns)",
                npy::tuple(&header.shape)
            )));
        };
        check_size(columns, rows)?;
        // NumPy's booleans are bytes.
        let dtype = if header.dtype == "|b1" { "|u1" } else { header.dtype.as_str() };
        let size = npy::number_size(dtype).ok_or_else(|| {
            Error::input(format!("has elements of type {}; allowed: booleans and numbers", header.dtype))
        })?;
        if header.num_bytes(size) != Some(elements.len()) {
            return Err(Error::input(format!(
                "has {} bytes of elements, not those of its shape",
                elements.len()
            )));
        }
        let numbers = npy::numbers(dtype, elements).unwrap_or_default();
        let nans = numbers.iter().filter(|number| number.is_nan()).count();
        if nans > 0 {
            return Err(Error::input(format!(
                "has {nans} elements that are NaN; write 0 where feet may stand, and 1 where not"
            )));
        }
        let (columns, rows) = (columns as usize, rows as usize);
        let at = |n: usize| if header.fortran_order { n % columns * rows + n / columns } else { n };
        let kept = (0..numbers.len()).map(|n| numbers[at(n)] != 0.0).collect();
        Ok(Self { columns, rows, kept })
    }

    /// Whether a cell is kept free; beyond the raster none is.
    fn at(&self, column: i64, row: i64) -> bool {
        let within = (0..self.columns as i64).contains(&column) && (0..self.rows as i64).contains(&row);
        within && self.kept[row as usize * self.columns + column as usize]
    }

    /// Loops along the edges between cells that are kept free and others, corners only. Cells that touch at a corner are apart.
    fn outlines(&self, [x_min, x_max, y_min, y_max]: [f64; 4]) -> Vec<Vec<[f64; 2]>> {
        // From each corner of cells, the directions of edges that have a cell kept free on their right, seen with rows downward.
        const STEPS: [[i64; 2]; 4] = [[1, 0], [0, 1], [-1, 0], [0, -1]];
        let mut edges: BTreeMap<[i64; 2], Vec<usize>> = BTreeMap::new();
        for row in 0..self.rows as i64 {
            for column in (0..self.columns as i64).filter(|column| self.at(*column, row)) {
                for (direction, ([u, v], [from_u, from_v])) in [[0, -1], [1, 0], [0, 1], [-1, 0]]
                    .into_iter()
                    .zip([[0, 0], [1, 0], [1, 1], [0, 1]])
                    .enumerate()
                {
                    if !self.at(column + u, row + v) {
                        edges.entry([column + from_u, row + from_v]).or_default().push(direction);
                    }
                }
            }
        }
        let place = |[u, v]: [i64; 2]| {
            let along = |n: i64, count: usize| n as f64 / count as f64;
            [x_min + along(u, self.columns) * (x_max - x_min), y_max - along(v, self.rows) * (y_max - y_min)]
        };
        let mut outlines = Vec::new();
        while let Some((&start, directions)) = edges.iter().next() {
            let (mut at, mut direction) = (start, directions[0]);
            let mut corners = Vec::new();
            let mut before = None;
            while let Some(here) = edges.get_mut(&at) {
                // Where two parts touch, turn right, and so stay with the same part.
                let turns = [1, 0, 3].map(|turn| (before.unwrap_or(direction) + turn) % 4);
                let next = turns.into_iter().find(|turn| here.contains(turn));
                let Some(next) = next.or(here.first().copied()) else { break };
                direction = next;
                here.retain(|other| *other != direction);
                if here.is_empty() {
                    edges.remove(&at);
                }
                if before != Some(direction) {
                    corners.push(place(at));
                }
                before = Some(direction);
                at = [at[0] + STEPS[direction][0], at[1] + STEPS[direction][1]];
                if at == start {
                    break;
                }
            }
            outlines.push(corners);
        }
        outlines
    }
}

#[cfg(test)]
mod tests {
    use super::super::KeepOutSpec;
    use super::*;

    fn spec(rows: &[&str], extent: [f64; 4]) -> KeepOutSpec {
        let kept = rows.iter().flat_map(|row| row.chars().map(|c| c == '#')).collect();
        let mask = Mask { columns: rows[0].len(), rows: rows.len(), kept };
        KeepOutSpec { outlines: mask.outlines(extent), ..KeepOutSpec::default() }
    }

    #[test]
    fn outlines_have_their_cells_inside() {
        let rows = ["#..##", "#.#..", "####.", "#..#.", "####."];
        let spec = spec(&rows, [0.0, 5.0, 0.0, 5.0]);
        for (row, line) in rows.iter().enumerate() {
            for (column, cell) in line.chars().enumerate() {
                let place = [column as f64 + 0.5, 4.5 - row as f64];
                assert_eq!(spec.distance(place) < 0.0, cell == '#', "{place:?}: {}", spec.distance(place));
            }
        }
        // Two parts that touch at a corner, one of them with a hole.
        assert_eq!(spec.outlines.len(), 3, "{:?}", spec.outlines);
        assert!(
            (spec.distance([1.5, 4.5]) - 0.5).abs() < 1e-12
                && (spec.distance([-2.0, 2.5]) - 2.0).abs() < 1e-12
        );
    }
}
