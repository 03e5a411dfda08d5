//! Gray levels of a PNG image, 0 (black) to 1 (white).

use std::io::Cursor;

use png::{BitDepth, ColorType, Decoder, Limits, Transformations};

use super::raster::{Raster, check_size};
use crate::error::{Error, Result};

/// The first bytes of every PNG file.
pub const SIGNATURE: &[u8] = b"\x89PNG\r\n\x1a\n";

/// Luma of red, green and blue (ITU-R BT.601).
const LUMA: [f64; 3] = [0.299, 0.587, 0.114];

/// Decodes any PNG: 1 to 16 bits, gray, color (by luma) or palette; fully transparent pixels have no data.
///
/// # Errors
/// If the bytes are not a valid PNG, or the image is too small or too large.
pub fn decode(bytes: &[u8]) -> Result<Raster> {
    // Twice what the largest image allowed takes at 8 bytes per pixel.
    let mut decoder = Decoder::new_with_limits(Cursor::new(bytes), Limits { bytes: 256 << 20 });
    let complain = |e: png::DecodingError| Error::input(format!("not a valid PNG image: {e}"));
    let header = decoder.read_header_info().map_err(complain)?;
    let (columns, rows) = (header.width as usize, header.height as usize);
    check_size(columns as u64, rows as u64)?;
    // Palettes become colors, few bits eight, a transparent color an alpha channel.
    decoder.set_transformations(Transformations::EXPAND);
    let mut reader = decoder.read_info().map_err(complain)?;
    let size = reader.output_buffer_size().ok_or_else(|| Error::input("the image is too large"))?;
    let mut buffer = vec![0; size];
    let frame = reader.next_frame(&mut buffer).map_err(complain)?;

    let channels = frame.color_type.samples();
    let alpha = match frame.color_type {
        ColorType::GrayscaleAlpha | ColorType::Rgba => Some(channels - 1),
        ColorType::Grayscale | ColorType::Rgb | ColorType::Indexed => None,
    };
    let wide = frame.bit_depth == BitDepth::Sixteen;
    let sample = |i: usize| {
        if wide {
            f64::from(u16::from_be_bytes([buffer[2 * i], buffer[2 * i + 1]])) / 65535.0
        } else {
            f64::from(buffer[i]) / 255.0
        }
    };
    let value = |pixel: usize| {
        let first = pixel * channels;
        if alpha.is_some_and(|a| sample(first + a) == 0.0) {
            f64::NAN
        } else if channels >= 3 {
            (0..3).map(|k| LUMA[k] * sample(first + k)).sum()
        } else {
            sample(first)
        }
    };
    Ok(Raster { columns, rows, values: (0..columns * rows).map(value).collect() })
}
