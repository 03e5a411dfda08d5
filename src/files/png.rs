//! Gray levels of a PNG image, 0 (black) to 255 or 65535 (white).

use std::io::Cursor;

use png::{BitDepth, ColorType, Decoder, Limits, Transformations};

use crate::error::{Error, Result};

/// The first bytes of every PNG file.
pub const SIGNATURE: &[u8] = b"\x89PNG\r\n\x1a\n";

/// Most entries of a palette.
const MOST_COLORS: usize = 256;

/// A gray image.
pub struct Gray {
    /// Pixels along x.
    pub columns: usize,
    /// Pixels along y, from the top.
    pub rows: usize,
    /// (rows, columns), NaN where the image is transparent.
    pub levels: Vec<f64>,
    /// The level of white.
    pub white: f64,
}

/// Decodes any PNG of a size, columns and rows, that `check_size` allows: 1 to 16 bits, gray, or color whose channels agree, also by a palette. Pixels of which less than half is opaque
/// have no data. Fewer than 8 bits count as 8.
///
/// # Errors
/// If the bytes are not a valid PNG, the image has another size, or it is in color.
pub fn decode(bytes: &[u8], check_size: impl Fn(u64, u64) -> Result<()>) -> Result<Gray> {
    // Twice what the largest image allowed takes at 8 bytes per pixel.
    let mut decoder = Decoder::new_with_limits(Cursor::new(bytes), Limits { bytes: 256 << 20 });
    let complain = |e: png::DecodingError| Error::input(format!("not a valid PNG image: {e}"));
    let header = decoder.read_header_info().map_err(complain)?;
    let (columns, rows) = (header.width as usize, header.height as usize);
    check_size(columns as u64, rows as u64)?;
    // Palettes become colors, few bits eight, a transparent color an alpha channel.
    decoder.set_transformations(Transformations::EXPAND);
    let mut reader = decoder.read_info().map_err(complain)?;
    // The decoder takes palettes for whole colors and panics otherwise.
    if let Some(palette) = &reader.info().palette
        && (!palette.len().is_multiple_of(3) || palette.len() > 3 * MOST_COLORS)
    {
        let what = format!("not a valid PNG image: a palette of {} bytes", palette.len());
        return Err(Error::input(format!("{what}; it must be 3 for each of at most {MOST_COLORS} colors")));
    }
    if let (ColorType::Indexed, Some(palette)) = (reader.info().color_type, &reader.info().palette) {
        ensure_colors(bytes, palette.len() / 3)?;
    }
    let size = reader.output_buffer_size().ok_or_else(|| Error::input("the image is too large"))?;
    let mut buffer = vec![0; size];
    let frame = reader.next_frame(&mut buffer).map_err(complain)?;

    let wide = frame.bit_depth == BitDepth::Sixteen;
    let pixels = Pixels {
        columns,
        channels: frame.color_type.samples(),
        alpha: matches!(frame.color_type, ColorType::GrayscaleAlpha | ColorType::Rgba),
        white: if wide { 65535.0 } else { 255.0 },
    };
    let sample = |i: usize| {
        if wide {
            f64::from(u16::from_be_bytes([buffer[2 * i], buffer[2 * i + 1]]))
        } else {
            f64::from(buffer[i])
        }
    };
    let levels = (0..columns * rows).map(|pixel| pixels.level(pixel, &sample)).collect::<Result<_>>()?;
    Ok(Gray { columns, rows, levels, white: pixels.white })
}

/// Refuses indices beyond the colors of a palette, which the decoder takes for black.
fn ensure_colors(bytes: &[u8], colors: usize) -> Result<()> {
    let complain = |e: png::DecodingError| Error::input(format!("not a valid PNG image: {e}"));
    let mut decoder = Decoder::new_with_limits(Cursor::new(bytes), Limits { bytes: 256 << 20 });
    decoder.set_transformations(Transformations::IDENTITY);
    let mut reader = decoder.read_info().map_err(complain)?;
    let bits = reader.info().bit_depth as usize;
    let size = reader.output_buffer_size().ok_or_else(|| Error::input("the image is too large"))?;
    let mut buffer = vec![0; size];
    let frame = reader.next_frame(&mut buffer).map_err(complain)?;
    let (columns, mask) = (frame.width as usize, 0xff >> (8 - bits));
    for (row, line) in buffer.chunks_exact(frame.line_size).take(frame.height as usize).enumerate() {
        for column in 0..columns {
            let bit = column * bits;
            let index = usize::from((line[bit / 8] >> (8 - bits - bit % 8)) & mask);
            if index >= colors {
                return Err(Error::input(format!(
                    "not a valid PNG image: pixel [row {row}, column {column}] has color {index}, but the palette has only {colors}"
                )));
            }
        }
    }
    Ok(())
}

/// How the channels of an image make a gray level; also used for TIFF.
pub struct Pixels {
    /// Pixels along x.
    pub columns: usize,
    /// Samples of each pixel.
    pub channels: usize,
    /// Whether the last of them is how opaque a pixel is.
    pub alpha: bool,
    /// The greatest sample.
    pub white: f64,
}

impl Pixels {
    /// Red, green and blue may differ by this much, as a fraction of white: two levels of 8 bits.
    const GRAY: f64 = 2.0 / 255.0;

    /// The level of a pixel from the samples of all, NaN where it is less than half opaque.
    ///
    /// # Errors
    /// If the pixel has a color.
    pub fn level(&self, pixel: usize, sample: &dyn Fn(usize) -> f64) -> Result<f64> {
        let first = pixel * self.channels;
        if self.alpha && 2.0 * sample(first + self.channels - 1) < self.white {
            return Ok(f64::NAN);
        }
        if self.channels < 3 {
            return Ok(sample(first));
        }
        let colors: [f64; 3] = std::array::from_fn(|k| sample(first + k));
        let (least, most) = colors.iter().fold((f64::INFINITY, 0.0_f64), |(a, b), &c| (a.min(c), b.max(c)));
        if most - least > Self::GRAY * self.white {
            let (row, column) = (pixel / self.columns, pixel % self.columns);
            let colors = colors.map(|level| level as u32);
            return Err(Error::input(format!(
                "it is in color: pixel [row {row}, column {column}] has red, green, blue {colors:?}; heights must be gray \
                 levels, because a color map or a packing of heights into colors cannot be guessed; save the heights \
                 themselves, as 16 bit gray, .npy or .tif"
            )));
        }
        Ok(colors.iter().sum::<f64>() / 3.0)
    }
}
