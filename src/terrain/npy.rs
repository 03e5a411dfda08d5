//! Heights in a NumPy `.npy` file.

use npyz::{DType, NpyFile, NpyHeader, Order, TypeChar};

use super::raster::{Raster, check_size};
use crate::error::{Error, Result};

/// The first bytes of every `.npy` file.
pub const SIGNATURE: &[u8] = b"\x93NUMPY";

/// Decodes a two-dimensional array of floats or integers; NaN = no data.
///
/// # Errors
/// If the bytes are not a valid array of this kind, it is too small or too large, or an element is infinite.
pub fn decode(bytes: &[u8]) -> Result<Raster> {
    let complain = |e: std::io::Error| Error::input(format!("not a valid .npy array: {e}"));
    let mut data = bytes;
    let header = NpyHeader::from_reader(&mut data).map_err(complain)?;
    let &[rows, columns] = header.shape() else {
        return Err(Error::input(format!(
            "an array of shape {:?}; it must have two dimensions, rows and columns",
            header.shape()
        )));
    };
    check_size(columns, rows)?;
    let (columns, rows) = (columns as usize, rows as usize);
    let order = header.order();
    let stored = numbers(header, data)?.map_err(complain)?;
    if let Some(i) = stored.iter().position(|v| v.is_infinite()) {
        let (row, column) = match order {
            Order::C => (i / columns, i % columns),
            Order::Fortran => (i % rows, i / rows),
        };
        return Err(Error::input(format!(
            "element [{row}, {column}] is {}: heights must be finite, or NaN where there is no data",
            stored[i]
        )));
    }
    let values = match order {
        Order::C => stored,
        Order::Fortran => (0..columns * rows).map(|i| stored[(i % columns) * rows + i / columns]).collect(),
    };
    Ok(Raster { columns, rows, values })
}

/// All elements in the order they are stored, as f64.
fn numbers(header: NpyHeader, data: &[u8]) -> Result<std::io::Result<Vec<f64>>> {
    let dtype = header.dtype();
    let unsupported = || {
        Error::input(format!(
            "an array of type {}; it must hold floats of 4 or 8 bytes, or integers",
            dtype.descr()
        ))
    };
    let DType::Plain(kind) = &dtype else {
        return Err(unsupported());
    };
    let file = NpyFile::with_header(header, data);
    macro_rules! read {
        ($number:ty) => {
            file.into_vec::<$number>().map(|values| values.into_iter().map(|v| v as f64).collect())
        };
    }
    Ok(match (kind.type_char(), kind.size_field()) {
        (TypeChar::Float, 4) => read!(f32),
        (TypeChar::Float, 8) => read!(f64),
        (TypeChar::Int, 1) => read!(i8),
        (TypeChar::Int, 2) => read!(i16),
        (TypeChar::Int, 4) => read!(i32),
        (TypeChar::Int, 8) => read!(i64),
        (TypeChar::Uint, 1) => read!(u8),
        (TypeChar::Uint, 2) => read!(u16),
        (TypeChar::Uint, 4) => read!(u32),
        (TypeChar::Uint, 8) => read!(u64),
        _ => return Err(unsupported()),
    })
}
