//! Heights in a NumPy `.npy` file.

use super::input::Input;
use crate::error::{Error, Result};
use crate::files::npy::{self, Header};
use crate::terrain::raster::{Raster, Values, check_size};

pub use crate::files::npy::SIGNATURE;

/// Decodes a two-dimensional array of floats or integers; NaN = no data.
///
/// # Errors
/// If the bytes are not a valid array of this kind, it is too small or too large, or an element is infinite.
pub fn decode(input: &Input) -> Result<Raster> {
    array(input.bytes)
}

/// As [`decode`], for an array anywhere.
///
/// # Errors
/// Those of [`decode`].
pub fn array(bytes: &[u8]) -> Result<Raster> {
    let complain = |what| Error::input(format!("not a valid .npy array: {what}"));
    let (header, data) = Header::read(bytes).map_err(complain)?;
    let Header { dtype, fortran_order, shape } = &header;
    let &[rows, columns] = &shape[..] else {
        return Err(Error::input(format!(
            "an array of shape {}; it must have two dimensions, rows and columns",
            npy::tuple(shape)
        )));
    };
    check_size(columns, rows)?;
    let (columns, rows) = (columns as usize, rows as usize);
    let unsupported = || {
        Error::input(format!("an array of type {dtype}; it must hold floats of 2, 4 or 8 bytes, or integers"))
    };
    let width = npy::number_size(dtype).ok_or_else(unsupported)?;
    let data = data.get(..columns * rows * width).ok_or_else(|| {
        complain(format!("{} bytes of data do not make {} of {dtype}", data.len(), npy::tuple(shape)))
    })?;
    let stored = npy::numbers(dtype, data).ok_or_else(unsupported)?;
    if let Some(i) = stored.iter().position(|v| v.is_infinite()) {
        let (row, column) = if *fortran_order { (i % rows, i / rows) } else { (i / columns, i % columns) };
        return Err(Error::input(format!(
            "element [{row}, {column}] is {}: heights must be finite, or NaN where there is no data",
            stored[i]
        )));
    }
    let stored = if *fortran_order {
        (0..columns * rows).map(|i| stored[(i % columns) * rows + i / columns]).collect()
    } else {
        stored
    };
    let (kind, values) = match dtype.trim_start_matches(['<', '>', '|', '=']).split_at(1) {
        ("f", _) => ("float", Values::Meters),
        ("u", _) => ("uint", Values::Integers),
        _ => ("int", Values::Integers),
    };
    Ok(Raster::new(columns, rows, stored, values, format!("{kind}{}", 8 * width)))
}
