//! TIFF and GeoTIFF: floats, integers and gray images; the georeference in m.

use std::io::Cursor;

use tiff::ColorType;
use tiff::decoder::{Decoder, DecodingResult, Limits};
use tiff::tags::Tag;

use super::input::Input;
use crate::error::{Error, Result};
use crate::files::png::Pixels;
use crate::scenario::terrain::Layout;
use crate::terrain::raster::{Raster, Values, check_size};

/// The first bytes of TIFF files of both byte orders, also of large ones.
pub const SIGNATURES: [&[u8]; 4] = [b"II*\0", b"MM\0*", b"II+\0", b"MM\0+"];

/// Bytes of all values, at most those of the largest raster.
const MOST_BYTES: usize = crate::heightfield::MAX_SAMPLES * 8;
/// Bytes of a tag.
const TAG_BYTES: usize = 1 << 20;

// Tags of GeoTIFF, and of GDAL.
const SCALE: Tag = Tag::Unknown(33550);
const TIEPOINT: Tag = Tag::Unknown(33922);
const TRANSFORMATION: Tag = Tag::Unknown(34264);
const KEYS: Tag = Tag::Unknown(34735);
const NO_DATA: Tag = Tag::Unknown(42113);
/// Keys among `KEYS`: what coordinates are, and whether they are those of a cell's corner (1) or center (2).
const MODEL_TYPE: u16 = 1024;
const RASTER_TYPE: u16 = 1025;
/// Keys among `KEYS`: the units of coordinates and of heights, and the meter.
const UNITS: [(u16, &str); 2] = [(3076, "coordinates"), (4099, "heights")];
const METER: u16 = 9001;

/// Decodes the first image of a file; the first row has the largest y.
///
/// # Errors
/// If it is damaged, too small or too large, in color, or of a type that holds no heights.
pub fn decode(input: &Input) -> Result<Raster> {
    let complain = |e: tiff::TiffError| Error::input(format!("not a TIFF file that can be read: {e}"));
    let mut decoder = Decoder::new(Cursor::new(input.bytes)).map_err(complain)?;
    let mut limits = Limits::default();
    limits.decoding_buffer_size = MOST_BYTES;
    limits.intermediate_buffer_size = MOST_BYTES;
    limits.ifd_value_size = TAG_BYTES;
    decoder = decoder.with_limits(limits);
    let (columns, rows) = decoder.dimensions().map_err(complain)?;
    check_size(columns.into(), rows.into())?;
    let (columns, rows) = (columns as usize, rows as usize);
    let color = decoder.colortype().map_err(complain)?;
    let (channels, alpha) = match color {
        ColorType::Gray(_) => (1, false),
        ColorType::GrayA(_) => (2, true),
        ColorType::RGB(_) => (3, false),
        ColorType::RGBA(_) => (4, true),
        other => {
            return Err(Error::input(format!(
                "a TIFF file with {other:?}; it must have one band of heights"
            )));
        }
    };
    ensure_upright(&mut decoder)?;
    let geography = Geography::read(&mut decoder)?;
    let content = decoder.read_image().map_err(complain)?;
    let (samples, value_type, meaning) = samples(content);
    if samples.len() != columns * rows * channels {
        return Err(Error::input(format!(
            "a TIFF file with {} samples for {columns} x {rows} cells",
            samples.len()
        )));
    }
    let white = match value_type {
        "uint8" => 255.0,
        "uint16" => 65535.0,
        _ => 1.0,
    };
    if channels > 1 && white == 1.0 {
        return Err(Error::input(format!(
            "a TIFF file with {channels} bands of {value_type}; it must have one band of heights"
        )));
    }
    let values = if channels == 1 {
        samples
    } else {
        let pixels = Pixels { columns, channels, alpha, white };
        (0..columns * rows).map(|pixel| pixels.level(pixel, &|i| samples[i])).collect::<Result<_>>()?
    };
    if let Some(i) = values.iter().position(|v| v.is_infinite()) {
        let (row, column) = (i / columns, i % columns);
        return Err(Error::input(format!(
            "cell [row {row}, column {column}] is {}: heights must be finite",
            values[i]
        )));
    }
    let mut raster = Raster::new(columns, rows, values, meaning, value_type.to_owned());
    geography.apply(&mut raster);
    Ok(raster)
}

/// Refuses files that say that rows run another way than from the top, or that values are upside down.
fn ensure_upright<R: std::io::Read + std::io::Seek>(decoder: &mut Decoder<R>) -> Result<()> {
    let mut number = |tag: Tag| decoder.get_tag_unsigned::<u16>(tag).ok();
    if let Some(other) = number(Tag::Orientation).filter(|orientation| *orientation != 1) {
        let what = format!("a TIFF file with orientation {other}; it must be 1: the first row is the top");
        return Err(Error::input(what));
    }
    if number(Tag::PhotometricInterpretation) == Some(0) {
        let what = "a TIFF file with the photometric interpretation WhiteIsZero, where heights may be upside down; write it with \
                    BlackIsZero";
        return Err(Error::input(what));
    }
    Ok(())
}

/// All samples with the name of their type and what they mean.
fn samples(content: DecodingResult) -> (Vec<f64>, &'static str, Values) {
    fn floats<T: Into<f64>>(values: Vec<T>) -> Vec<f64> {
        values.into_iter().map(Into::into).collect()
    }
    use DecodingResult::{F16, F32, F64, I8, I16, I32, I64, U8, U16, U32, U64};
    match content {
        F16(values) => (floats(values), "float16", Values::Meters),
        F32(values) => (floats(values), "float32", Values::Meters),
        F64(values) => (values, "float64", Values::Meters),
        U8(values) => (floats(values), "uint8", Values::Integers),
        U16(values) => (floats(values), "uint16", Values::Integers),
        U32(values) => (floats(values), "uint32", Values::Integers),
        I8(values) => (floats(values), "int8", Values::Integers),
        I16(values) => (floats(values), "int16", Values::Integers),
        I32(values) => (floats(values), "int32", Values::Integers),
        U64(values) => (values.into_iter().map(|v| v as f64).collect(), "uint64", Values::Integers),
        I64(values) => (values.into_iter().map(|v| v as f64).collect(), "int64", Values::Integers),
    }
}

/// What the tags say about places and missing data.
struct Geography {
    spacing: Option<[f64; 2]>,
    /// Column, row, and x, y of one point.
    tie: Option<[f64; 4]>,
    /// Whether points are centers of cells, not corners.
    centers: bool,
    /// Whether the first row has the least y.
    upward: bool,
    no_data: Option<f64>,
    notes: Vec<String>,
}

impl Geography {
    /// # Errors
    /// For units other than the meter, and mirrored georeferences.
    fn read<R: std::io::Read + std::io::Seek>(decoder: &mut Decoder<R>) -> Result<Self> {
        let mut numbers = |tag: Tag| decoder.get_tag_f64_vec(tag).unwrap_or_default();
        let (scale, tie, transformation) = (numbers(SCALE), numbers(TIEPOINT), numbers(TRANSFORMATION));
        let keys = decoder.get_tag_u16_vec(KEYS).unwrap_or_default();
        // A header of four numbers, then key, place (0: here), count and value.
        let key = |wanted: u16| keys.as_chunks::<4>().0.iter().skip(1).find(|k| k[0] == wanted).map(|k| k[3]);
        let no_data = decoder.get_tag_ascii_string(NO_DATA).ok();
        for (unit, what) in UNITS {
            if let Some(code) = key(unit).filter(|code| *code != METER) {
                return Err(Error::input(format!(
                    "a GeoTIFF file with {what} in unit {code}{}; convert it to meters",
                    match code {
                        9002 => ", feet",
                        9003 => ", US survey feet",
                        _ => "",
                    }
                )));
            }
        }
        if scale.iter().take(2).any(|s| *s < 0.0) {
            let what = "a GeoTIFF file with a negative pixel scale, which programs read in different ways; write it with the first \
                        row at the largest y and a positive scale";
            return Err(Error::input(what));
        }
        let mut found = Self {
            upward: false,
            spacing: scale.first_chunk::<2>().copied(),
            tie: tie.first_chunk::<6>().map(|t| [t[0], t[1], t[3], t[4]]),
            centers: key(RASTER_TYPE) == Some(2),
            no_data: no_data.and_then(|text| text.trim_matches(['\0', ' ']).parse().ok()),
            notes: Vec::new(),
        };
        if let [a, b, _, x, d, e, _, y, ..] = transformation[..] {
            if b == 0.0 && d == 0.0 && a < 0.0 {
                return Err(Error::input(
                    "a GeoTIFF file whose columns run against x; write it with the first column at the least x",
                ));
            } else if b == 0.0 && d == 0.0 {
                found.upward = e > 0.0;
                found.spacing = Some([a.abs(), e.abs()]);
                found.tie = Some([0.0, 0.0, x, y]);
            } else {
                found.notes.push("the file's georeference turns it, which is left out".to_owned());
            }
        }
        if key(MODEL_TYPE) == Some(2) {
            found.notes.push("the file's georeference is in degrees, which is left out".to_owned());
            (found.spacing, found.tie) = (None, None);
        }
        Ok(found)
    }

    fn apply(self, raster: &mut Raster) {
        let usable = |v: &f64| v.is_finite() && *v != 0.0;
        raster.spacing = self.spacing.filter(|s| s.iter().all(usable));
        if let (Some([dx, dy]), Some([column, row, x, y])) = (raster.spacing, self.tie)
            && [column, row, x, y].iter().all(|v| v.is_finite())
        {
            let half = if self.centers { 0.0 } else { 0.5 };
            let last = (raster.rows - 1) as f64;
            let y = if self.upward { y + (half - row) * dy } else { y - (last + half - row) * dy };
            raster.corner = Some([x + (half - column) * dx, y]);
        }
        if self.upward {
            raster.layout = Layout::YUp;
        }
        raster.no_data.extend(self.no_data);
        raster.notes.extend(self.notes);
    }
}
