//! MuJoCo's binary height field: the numbers of rows and columns as int32, then float32 values, the first row at the least y.
//!
//! MuJoCo brings the values to 0…1, here without those that stand for no data, and multiplies them by the third number of the asset's `size`, which is not in the file.

use super::input::Input;
use crate::error::{Error, Result};
use crate::scenario::terrain::Layout;
use crate::terrain::raster::{Raster, Values, check_size};

/// Rows and columns, if the file's length is what they tell.
fn shape(bytes: &[u8]) -> Option<[u64; 2]> {
    let (head, values) = bytes.split_first_chunk::<8>()?;
    let count = |at: usize| {
        u64::try_from(i32::from_le_bytes([head[at], head[at + 1], head[at + 2], head[at + 3]])).ok()
    };
    let (rows, columns) = (count(0)?, count(4)?);
    (rows > 0 && rows.checked_mul(columns)?.checked_mul(4)? == values.len() as u64).then_some([rows, columns])
}

/// Whether the first eight bytes of a file tell its length.
pub fn is_hfield(input: &Input) -> bool {
    shape(input.bytes).is_some()
}

/// Decodes a file of its own, whose height the scenario has to tell.
///
/// # Errors
/// If it is too small or too large, or a value is not finite.
pub fn decode(input: &Input) -> Result<Raster> {
    values(input.bytes)
}

/// The values as they are in the file.
///
/// # Errors
/// Those of [`decode`].
pub fn values(bytes: &[u8]) -> Result<Raster> {
    let what =
        "not a height field of MuJoCo: its first eight bytes, rows and columns, do not tell its length";
    let [rows, columns] = shape(bytes).ok_or_else(|| Error::input(what))?;
    check_size(columns, rows)?;
    let values: Vec<f64> =
        bytes[8..].as_chunks().0.iter().map(|&b| f64::from(f32::from_le_bytes(b))).collect();
    if let Some(i) = values.iter().position(|v| !v.is_finite()) {
        let (row, column) = (i as u64 / columns, i as u64 % columns);
        return Err(Error::input(format!("value [{row}, {column}] is {}, no height", values[i])));
    }
    let mut raster =
        Raster::new(columns as usize, rows as usize, values, Values::Normalized, "float32".to_owned());
    raster.layout = Layout::YUp;
    Ok(raster)
}
