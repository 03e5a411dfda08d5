//! One NumPy array (`.npy`, versions 1 to 3): a signature, a Python dictionary with type, order and shape, and the elements.

use std::io::{ErrorKind, Read};

use crate::visible::visible;

/// The first bytes of every `.npy` file.
pub const SIGNATURE: &[u8] = b"\x93NUMPY";

/// Longer headers are refused unread, bytes.
const MAX_HEADER: usize = 1 << 16;
/// NumPy's arrays have no more axes.
const MAX_AXES: usize = 64;
/// Characters of a bad header that its error shows.
const SHOWN: usize = 100;

/// What precedes the elements.
#[derive(Clone, Debug, PartialEq)]
pub struct Header {
    /// The type of the elements as NumPy writes it, such as `<f8`; of a record, its whole list of fields.
    pub dtype: String,
    /// Whether the first index runs fastest.
    pub fortran_order: bool,
    /// How many elements there are along each axis.
    pub shape: Vec<u64>,
}

impl Header {
    /// Splits the bytes of a file into header and elements.
    ///
    /// # Errors
    /// What is wrong with the header.
    pub fn read(bytes: &[u8]) -> Result<(Self, &[u8]), String> {
        let mut rest = bytes;
        let header = Self::read_from(&mut rest)?;
        Ok((header, rest))
    }

    /// Reads a header; the elements follow. Its length is bounded, and the time it takes is proportional to its length.
    ///
    /// # Errors
    /// What is wrong with it.
    pub fn read_from(file: &mut impl Read) -> Result<Self, String> {
        let mut start = [0; SIGNATURE.len() + 2];
        fill(file, &mut start)?;
        let [signature @ .., major, _minor] = &start;
        if signature != SIGNATURE {
            return Err("it does not start like one".into());
        }
        let mut length = [0; 4];
        fill(file, &mut length[..if *major == 1 { 2 } else { 4 }])?;
        if !(1..=3).contains(major) {
            return Err(format!("version {major} of the format is not known"));
        }
        let length = u32::from_le_bytes(length) as usize;
        if length > MAX_HEADER {
            return Err(format!("a header of {length} bytes; at most {MAX_HEADER} are read"));
        }
        let mut text = vec![0; length];
        fill(file, &mut text)?;
        // Version 1 is Latin-1, which differs from UTF-8 only in the names of a record's fields.
        let text = String::from_utf8_lossy(&text);
        parse(&text).ok_or_else(|| format!("its header is {}", visible(&cut(text.trim()))))
    }

    /// The bytes before the elements: version 1, padded as NumPy does it.
    ///
    /// # Errors
    /// If they are too many for version 1.
    pub fn write(&self) -> Result<Vec<u8>, String> {
        let order = if self.fortran_order { "True" } else { "False" };
        let shape = tuple(&self.shape);
        let mut text = format!("{{'descr': '{}', 'fortran_order': {order}, 'shape': {shape}, }}", self.dtype);
        let before = SIGNATURE.len() + 4;
        text.push_str(&" ".repeat(63 - (before + text.len()) % 64));
        text.push('\n');
        let length = u16::try_from(text.len()).map_err(|_| "a header of over 65535 bytes".to_owned())?;
        Ok([SIGNATURE, &[1, 0], &length.to_le_bytes(), text.as_bytes()].concat())
    }

    /// Bytes of all elements of `width` bytes each, if that is a number.
    pub fn num_bytes(&self, width: usize) -> Option<usize> {
        self.shape.iter().try_fold(width, |product, &n| product.checked_mul(n.try_into().ok()?))
    }
}

/// A shape as Python writes it.
pub fn tuple(shape: &[u64]) -> String {
    match shape {
        [n] => format!("({n},)"),
        _ => format!("({})", shape.iter().map(u64::to_string).collect::<Vec<_>>().join(", ")),
    }
}

/// Bytes of an element that is a float or an integer; `None` for all other types.
pub fn number_size(dtype: &str) -> Option<usize> {
    match dtype.trim_start_matches(['<', '>', '|', '=']) {
        "i1" | "u1" => Some(1),
        "i2" | "u2" | "f2" => Some(2),
        "i4" | "u4" | "f4" => Some(4),
        "i8" | "u8" | "f8" => Some(8),
        _ => None,
    }
}

/// The elements as float64 in the order they are stored; `None` if they are neither floats nor integers.
pub fn numbers(dtype: &str, elements: &[u8]) -> Option<Vec<f64>> {
    let big = dtype.starts_with('>');
    macro_rules! read {
        ($number:ty) => {{
            let from = if big { <$number>::from_be_bytes } else { <$number>::from_le_bytes };
            elements.as_chunks().0.iter().map(|&bytes| from(bytes) as f64).collect()
        }};
    }
    Some(match dtype.trim_start_matches(['<', '>', '|', '=']) {
        "i1" => read!(i8),
        "i2" => read!(i16),
        "i4" => read!(i32),
        "i8" => read!(i64),
        "u1" => read!(u8),
        "u2" => read!(u16),
        "u4" => read!(u32),
        "u8" => read!(u64),
        "f2" => {
            let from = if big { u16::from_be_bytes } else { u16::from_le_bytes };
            elements.as_chunks().0.iter().map(|&bytes| half(from(bytes))).collect()
        }
        "f4" => read!(f32),
        "f8" => read!(f64),
        _ => return None,
    })
}

/// Reads as many bytes as fit.
fn fill(file: &mut impl Read, bytes: &mut [u8]) -> Result<(), String> {
    file.read_exact(bytes).map_err(|e| match e.kind() {
        ErrorKind::UnexpectedEof => "it ends within its header".to_owned(),
        _ => e.to_string(),
    })
}

fn cut(text: &str) -> String {
    if text.chars().nth(SHOWN).is_none() {
        return text.to_owned();
    }
    text.chars().take(SHOWN).chain(['…']).collect()
}

/// The value of a float of 2 bytes (IEEE 754: a sign, 5 bits of exponent, 10 of fraction).
fn half(bits: u16) -> f64 {
    let (exponent, fraction) = (i32::from(bits >> 10 & 31), f64::from(bits & 1023));
    let size = match exponent {
        0 => fraction * 2f64.powi(-24),
        31 if fraction == 0.0 => f64::INFINITY,
        31 => f64::NAN,
        _ => (1024.0 + fraction) * 2f64.powi(exponent - 25),
    };
    if bits >> 15 == 1 { -size } else { size }
}

/// The dictionary of a header: three keys in any order, and nothing after it but space.
fn parse(text: &str) -> Option<Header> {
    let (mut dtype, mut fortran_order, mut shape) = (None, None, None);
    let mut rest = text.trim().strip_prefix('{')?.strip_suffix('}')?.trim();
    while !rest.is_empty() {
        let (key, after) = split_value(rest)?;
        let (value, after) = split_value(after.trim_start().strip_prefix(':')?.trim_start())?;
        match unquoted(key)? {
            "descr" => dtype = Some(unquoted(value).or(value.starts_with('[').then_some(value))?.to_owned()),
            "fortran_order" => {
                fortran_order = Some(matches!(value, "True")).filter(|t| *t || value == "False")
            }
            "shape" => shape = parse_shape(value),
            _ => return None,
        }
        rest = match after.trim_start() {
            "" => "",
            more => more.strip_prefix(',')?.trim_start(),
        };
    }
    Some(Header { dtype: dtype?, fortran_order: fortran_order?, shape: shape? })
}

/// Splits off the first value: up to a comma or colon that is in no bracket and in no string.
fn split_value(text: &str) -> Option<(&str, &str)> {
    let (mut depth, mut quote) = (0_usize, None);
    let mut characters = text.char_indices();
    while let Some((i, c)) = characters.next() {
        match (c, quote) {
            ('\\', Some(_)) => _ = characters.next(),
            (_, Some(q)) => quote = quote.filter(|_| c != q),
            ('\'' | '"', None) => quote = Some(c),
            ('(' | '[', None) => depth += 1,
            (')' | ']', None) => depth = depth.checked_sub(1)?,
            (',' | ':', None) if depth == 0 => return Some((text[..i].trim_end(), &text[i..])),
            _ => {}
        }
    }
    (depth == 0 && quote.is_none()).then(|| (text.trim_end(), ""))
}

/// The content of a string without escapes.
fn unquoted(value: &str) -> Option<&str> {
    let quote = value.chars().next().filter(|c| matches!(c, '\'' | '"'))?;
    let content = value.strip_prefix(quote)?.strip_suffix(quote)?;
    (!content.contains([quote, '\\'])).then_some(content)
}

fn parse_shape(value: &str) -> Option<Vec<u64>> {
    let list = value.strip_prefix('(')?.strip_suffix(')')?.trim();
    // `(3)` is no tuple.
    let list = list.strip_suffix(',').or((list.is_empty() || list.contains(',')).then_some(list))?;
    if list.is_empty() {
        return Some(Vec::new());
    }
    let axes: Vec<u64> = list.split(',').map(|n| n.trim().parse().ok()).collect::<Option<_>>()?;
    (axes.len() <= MAX_AXES).then_some(axes)
}

#[cfg(test)]
mod tests {
    use super::*;

    fn header(text: &str) -> Result<(String, bool, Vec<u64>), String> {
        let bytes = [SIGNATURE, &[1, 0], &(text.len() as u16).to_le_bytes(), text.as_bytes()].concat();
        Header::read(&bytes).map(|(h, _)| (h.dtype, h.fortran_order, h.shape))
    }

    #[test]
    fn headers_are_read_as_python_reads_them() {
        let f8 = |fortran, shape: &[u64]| Ok(("<f8".to_owned(), fortran, shape.to_vec()));
        assert_eq!(
            header("{'descr': '<f8', 'fortran_order': False, 'shape': (3, 4), }  \n"),
            f8(false, &[3, 4])
        );
        assert_eq!(header("{ \"shape\":(3,) ,'fortran_order' : True,\"descr\":\"<f8\"}"), f8(true, &[3]));
        assert_eq!(header("{'descr': '<f8', 'fortran_order': False, 'shape': ()}"), f8(false, &[]));
        let (record, _, _) =
            header("{'descr': [('a', '<f8'), ('b, ]', '<i4', (2,))], 'fortran_order': False, 'shape': (1,)}")
                .unwrap();
        assert_eq!(record, "[('a', '<f8'), ('b, ]', '<i4', (2,))]");
        for text in [
            "",
            "{}",
            "{'descr': '<f8', 'fortran_order': False}",
            "{'descr': '<f8', 'fortran_order': False, 'shape': (3)}",
            "{'descr': '<f8', 'fortran_order': False, 'shape': (-3,)}",
            "{'descr': '<f8', 'fortran_order': False, 'shape': (3, , 4)}",
            "{'descr': '<f8', 'fortran_order': False, 'shape': (3, 4}",
            "{'descr': '<f8', 'fortran_order': False, 'shape': (99999999999999999999,)}",
            "{'descr': '<f8', 'fortran_order': 0, 'shape': (3,)}",
            "{'descr': '<f8, 'fortran_order': False, 'shape': (3,)}",
            "{'descr': <f8, 'fortran_order': False, 'shape': (3,)}",
            "{'descr': '<f8', 'fortran_order': False, 'shape': (3,), 'more': 1}",
            "{'descr': '<f8' 'fortran_order': False, 'shape': (3,)}",
            "{'descr': '<f8', 'fortran_order': False, 'shape': (3,)} 1",
        ] {
            assert!(header(text).is_err(), "{text}");
        }
    }

    #[test]
    fn what_is_written_is_read_and_aligned() {
        for shape in [vec![], vec![7], vec![3, 4], vec![u64::MAX; 9]] {
            for dtype in ["<f8", "|b1", "<U12"] {
                let header = Header { dtype: dtype.into(), fortran_order: false, shape: shape.clone() };
                let mut bytes = header.write().unwrap();
                assert!(bytes.len().is_multiple_of(64) && bytes.ends_with(b"\n"));
                bytes.push(1);
                assert_eq!(Header::read(&bytes).unwrap(), (header, &[1][..]));
                for length in 0..bytes.len() - 1 {
                    assert!(Header::read(&bytes[..length]).is_err());
                }
            }
        }
    }

    #[test]
    fn half_floats_are_read() {
        for (bits, value) in [
            (0x0000, 0.0),
            (0x0001, 2f64.powi(-24)),
            (0x0400, 2f64.powi(-14)),
            (0x3555, 0.333251953125),
            (0x3c00, 1.0),
            (0xc000, -2.0),
            (0x7bff, 65504.0),
            (0xfc00, f64::NEG_INFINITY),
        ] {
            assert_eq!(numbers("<f2", &u16::to_le_bytes(bits)), Some(vec![value]), "{bits:x}");
            assert_eq!(numbers(">f2", &u16::to_be_bytes(bits)), Some(vec![value]), "{bits:x}");
        }
        assert!(numbers("<f2", &[0, 0x7e]).unwrap()[0].is_nan());
    }

    #[test]
    fn every_version_is_read() {
        let text = "{'descr': '<f8', 'fortran_order': False, 'shape': (1,)}";
        for version in [2, 3] {
            let length = (text.len() as u32).to_le_bytes();
            let bytes = [SIGNATURE, &[version, 0], &length, text.as_bytes(), &1.0_f64.to_le_bytes()].concat();
            let (header, elements) = Header::read(&bytes).unwrap();
            assert_eq!((header.shape, numbers(&header.dtype, elements)), (vec![1], Some(vec![1.0])));
        }
        assert!(Header::read(&[SIGNATURE, &[4, 0, 0, 0, 0, 0]].concat()).unwrap_err().contains("version 4"));
        let long = [SIGNATURE, &[2, 0], &[255; 4], &[b' '; 100]].concat();
        assert!(Header::read(&long).unwrap_err().contains("at most 65536"));
    }
}
