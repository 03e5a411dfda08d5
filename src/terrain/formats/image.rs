//! Gray levels of a PNG image, 0 (black) to 255 or 65535 (white), as heights.

use super::input::Input;
use crate::error::Result;
use crate::files::png;
use crate::terrain::raster::{Raster, Values, check_size};

/// Decodes any PNG that [`png::decode`] does.
///
/// # Errors
/// If the bytes are not a valid PNG, the image is too small or too large, or it is in color.
pub fn decode(input: &Input) -> Result<Raster> {
    let image = png::decode(input.bytes, check_size)?;
    let (white, bits) = (image.white, if image.white > 255.0 { 16 } else { 8 });
    let values = Values::Levels { white };
    Ok(Raster::new(image.columns, image.rows, image.levels, values, format!("{bits} bit gray")))
}
