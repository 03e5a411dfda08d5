//! Archives of NumPy arrays (`.npz`): zip files, deflated where that makes them shorter, of `.npy` members that `numpy.load` reads.

use std::io::{BufWriter, Cursor, ErrorKind, Read, Write};
use std::iter::repeat;
use std::path::{Path, PathBuf};

use flate2::Compression;
use flate2::write::DeflateEncoder;
use zip::result::ZipError;
use zip::write::SimpleFileOptions;
use zip::{CompressionMethod, ZipArchive, ZipWriter};

use super::npy::{self, Header};
use super::output::{Pending, failed};
use crate::{Error, Result};

/// All members that are read may take this many bytes: two grounds of 4096 x 4096 heights, and as much again.
const MAX_UNPACKED: usize = 512 << 20;
/// The longest string of an array may take this many bytes, 4 for each character.
const MAX_STRING: usize = 16 << 20;
/// The fastest that deflates: a third of the time of zlib's default, 6, for plans that are 15 to 20 % larger. Level 2 takes two thirds,
/// for 2 %.
const DEFLATE_LEVEL: u32 = 1;
/// A member is deflated if so many bytes of its middle become shorter than this fraction; most numbers in full precision do not.
const TRIAL: usize = 1 << 14;
const WORTHWHILE: f64 = 0.95;
/// Bytes that are unpacked at a time.
const BLOCK: usize = 1 << 16;

/// Writes an archive under a temporary name; [`NpzWriter::finish`] gives it that of its target.
pub struct NpzWriter {
    zip: ZipWriter<BufWriter<Pending>>,
    target: PathBuf,
}

impl NpzWriter {
    /// Opens the temporary file.
    ///
    /// # Errors
    /// For targets that must not be replaced or cannot be written.
    pub fn create(target: &Path) -> Result<Self> {
        let zip = ZipWriter::new(BufWriter::new(Pending::create(target)?));
        Ok(Self { zip, target: target.to_path_buf() })
    }

    /// Adds a float64 array; `values` in C order, as many as the shape requires.
    pub fn add_f64(
        &mut self,
        name: &str,
        shape: &[usize],
        values: impl IntoIterator<Item = f64>,
    ) -> Result<()> {
        self.add(name, shape, "<f8", values.into_iter().map(f64::to_le_bytes))
    }

    /// Adds an array of points, shape `(…, K)`.
    pub fn add_points<const K: usize>(
        &mut self,
        name: &str,
        shape: &[usize],
        values: &[[f64; K]],
    ) -> Result<()> {
        let shape: Vec<usize> = shape.iter().copied().chain([K]).collect();
        self.add_f64(name, &shape, values.iter().flatten().copied())
    }

    /// Adds an array of booleans.
    pub fn add_bool(&mut self, name: &str, shape: &[usize], values: &[bool]) -> Result<()> {
        self.add(name, shape, "|b1", values.iter().map(|&v| [u8::from(v)]))
    }

    /// Adds an array of strings (`<U…`); an empty shape is a single string.
    pub fn add_str(&mut self, name: &str, shape: &[usize], values: &[String]) -> Result<()> {
        // NumPy has no strings of zero width.
        let width = values.iter().map(|s| s.chars().count()).max().unwrap_or(0).max(1);
        let padded = |s: &String| {
            let characters = s.chars().map(u32::from).chain(repeat(0)).take(width);
            characters.flat_map(u32::to_le_bytes).collect::<Vec<u8>>()
        };
        self.add(name, shape, &format!("<U{width}"), values.iter().map(padded))
    }

    /// Adds an array of elements that are given as bytes.
    fn add<T: AsRef<[u8]>>(
        &mut self,
        name: &str,
        shape: &[usize],
        dtype: &str,
        elements: impl IntoIterator<Item = T>,
    ) -> Result<()> {
        let shape: Vec<u64> = shape.iter().map(|&n| n as u64).collect();
        let (mut bytes, mut count) = (Vec::new(), 0);
        for element in elements {
            bytes.extend(element.as_ref());
            count += 1;
        }
        if count != shape.iter().product::<u64>() {
            return Err(Error::Internal(format!("{name}: {count} values for the shape {shape:?}")));
        }
        let header = Header { dtype: dtype.into(), fortran_order: false, shape };
        let header = header.write().map_err(|e| Error::Internal(format!("{name}: {e}")))?;
        let at = |e: ZipError| failed(&self.target, &io_error(e));
        let options = match is_worth_deflating(&bytes) {
            true => SimpleFileOptions::default()
                .compression_method(CompressionMethod::Deflated)
                .compression_level(Some(DEFLATE_LEVEL.into())),
            false => SimpleFileOptions::default().compression_method(CompressionMethod::Stored),
        };
        self.zip.start_file(format!("{name}.npy"), options).map_err(at)?;
        self.zip.write_all(&header).and_then(|()| self.zip.write_all(&bytes)).map_err(|e| at(e.into()))
    }

    /// Closes the archive and gives it the name of its target.
    ///
    /// # Errors
    /// When it cannot be written; what was there then stays.
    pub fn finish(self) -> Result<()> {
        let Self { zip, target } = self;
        let buffer = zip.finish().map_err(|e| failed(&target, &io_error(e)))?;
        buffer.into_inner().map_err(|e| failed(&target, e.error()))?.commit()
    }
}

/// Whether bytes from the middle of a member become shorter.
fn is_worth_deflating(bytes: &[u8]) -> bool {
    let start = bytes.len().saturating_sub(TRIAL) / 2;
    let middle = &bytes[start..bytes.len().min(start + TRIAL)];
    let mut encoder = DeflateEncoder::new(Vec::new(), Compression::new(DEFLATE_LEVEL));
    let deflated = encoder.write_all(middle).and_then(|()| encoder.finish());
    deflated.is_ok_and(|deflated| (deflated.len() as f64) < WORTHWHILE * middle.len() as f64)
}

/// Reads the members of an archive; every error names the file and the member.
pub struct NpzReader {
    zip: ZipArchive<Cursor<Vec<u8>>>,
    file: String,
    /// Bytes of elements that may still be unpacked.
    left: usize,
}

impl NpzReader {
    /// Reads the file into memory and finds its members.
    ///
    /// # Errors
    /// For files that cannot be read, are too large, or are no archives.
    pub fn open(path: &Path) -> Result<Self> {
        let file = path.display().to_string();
        let content = super::read(path, super::MAX_FILE)?;
        let zip = ZipArchive::new(Cursor::new(content))
            .map_err(|e| Error::input(format!("{file}: not an .npz archive, or truncated: {e}")))?;
        Ok(Self { zip, file, left: MAX_UNPACKED })
    }

    /// Whether there is such a member.
    pub fn has(&self, name: &str) -> bool {
        self.zip.index_for_name(&format!("{name}.npy")).is_some()
    }

    /// All members, sorted by name.
    pub fn names(&self) -> Vec<String> {
        let mut names: Vec<String> =
            self.zip.file_names().filter_map(|n| n.strip_suffix(".npy")).map(str::to_owned).collect();
        names.sort();
        names
    }

    /// An input error at a member.
    pub fn error(&self, member: &str, what: impl std::fmt::Display) -> Error {
        at_member(&self.file, member, &what)
    }

    /// A float64 array with its shape; NaN and infinities are allowed.
    pub fn any_f64(&mut self, name: &str) -> Result<(Vec<usize>, Vec<f64>)> {
        let width = |dtype: &str| (dtype == "<f8").then_some(8);
        self.read(name, "float64 (<f8)", width, |bytes| Some(f64::from_le_bytes(bytes.try_into().ok()?)))
    }

    /// A float64 array of finite values with its shape.
    pub fn finite_f64(&mut self, name: &str) -> Result<(Vec<usize>, Vec<f64>)> {
        let (shape, values) = self.any_f64(name)?;
        match values.iter().position(|v| !v.is_finite()) {
            None => Ok((shape, values)),
            Some(at) => Err(self.error(name, format!("{} at {}", values[at], index_in(&shape, at)))),
        }
    }

    /// A float64 array of finite values of a known shape.
    pub fn f64(&mut self, name: &str, shape: &[usize]) -> Result<Vec<f64>> {
        let (found, values) = self.finite_f64(name)?;
        self.expect_shape(name, &found, shape)?;
        Ok(values)
    }

    /// An array of points of a known shape `(…, K)`.
    pub fn points<const K: usize>(&mut self, name: &str, shape: &[usize]) -> Result<Vec<[f64; K]>> {
        let shape: Vec<usize> = shape.iter().copied().chain([K]).collect();
        let values = self.f64(name, &shape)?;
        Ok(values.as_chunks::<K>().0.to_vec())
    }

    /// An array of booleans of a known shape.
    pub fn bool(&mut self, name: &str, shape: &[usize]) -> Result<Vec<bool>> {
        let width = |dtype: &str| (dtype == "|b1").then_some(1);
        let (found, values) = self.read(name, "bool (|b1)", width, |bytes| match bytes {
            [0] => Some(false),
            [1] => Some(true),
            _ => None,
        })?;
        self.expect_shape(name, &found, shape)?;
        Ok(values)
    }

    /// An array of strings with its shape.
    pub fn str(&mut self, name: &str) -> Result<(Vec<usize>, Vec<String>)> {
        let width =
            |dtype: &str| dtype.strip_prefix("<U")?.parse::<usize>().ok()?.checked_mul(4).filter(|&n| n > 0);
        self.read(name, "str (<U…)", width, |bytes| {
            let characters = bytes.as_chunks().0.iter().map(|&c| char::from_u32(u32::from_le_bytes(c)));
            Some(characters.collect::<Option<String>>()?.trim_end_matches('\0').to_owned())
        })
    }

    fn expect_shape(&self, name: &str, found: &[usize], expected: &[usize]) -> Result<()> {
        if found == expected {
            return Ok(());
        }
        let tuple = |shape: &[usize]| npy::tuple(&shape.iter().map(|&n| n as u64).collect::<Vec<_>>());
        Err(self.error(name, format!("shape {}, expected {}", tuple(found), tuple(expected))))
    }

    /// Reads a member whose elements take as many bytes as `width` tells from the dtype, if it is the right one. What the member says
    /// about its size is judged before anything is allocated for it.
    fn read<T: Clone>(
        &mut self,
        name: &str,
        wanted: &str,
        width: impl Fn(&str) -> Option<usize>,
        element: impl Fn(&[u8]) -> Option<T>,
    ) -> Result<(Vec<usize>, Vec<T>)> {
        let (file, left) = (&self.file, self.left);
        let error = |what: &dyn std::fmt::Display| at_member(file, name, what);
        let mut member = self.zip.by_name(&format!("{name}.npy")).map_err(|e| match e {
            ZipError::FileNotFound => error(&"missing"),
            e => error(&format!("damaged or truncated: {e}")),
        })?;
        let header = Header::read_from(&mut member).map_err(|e| error(&format!("not a .npy array: {e}")))?;
        let Header { dtype, fortran_order, shape } = &header;
        let Some(width) = width(dtype) else {
            return Err(error(&format!("dtype {dtype}, expected {wanted}")));
        };
        let (array, limit) = (format!("{} of {dtype}", npy::tuple(shape)), MAX_UNPACKED >> 20);
        let Some(bytes) = header.num_bytes(width).filter(|&bytes| bytes <= left && width <= MAX_STRING)
        else {
            return Err(error(&format!("{array} is too large; all members together may take {limit} MiB")));
        };
        let mut block = vec![0; bytes.min(width * (BLOCK / width).max(1))];
        let (mut values, mut to_read) = (Vec::new(), bytes);
        while to_read > 0 {
            let part = to_read.min(block.len());
            let part = &mut block[..part];
            member.read_exact(part).map_err(|e| match e.kind() {
                ErrorKind::UnexpectedEof => error(&format!("fewer bytes of data than {array} takes")),
                _ => error(&format!("damaged or truncated: {e}")),
            })?;
            to_read -= part.len();
            for bytes in part.chunks_exact(width) {
                values.push(element(bytes).ok_or_else(|| error(&format!("an element is no {wanted}")))?);
            }
        }
        // At the end, the checksum is compared.
        match member.read(&mut [0]) {
            Ok(0) => {}
            Ok(_) => return Err(error(&format!("more bytes of data than {array} takes"))),
            Err(e) => return Err(error(&format!("damaged or truncated: {e}"))),
        }
        self.left -= bytes;
        let (fortran_order, shape) = (*fortran_order, shape.iter().map(|&n| n as usize).collect::<Vec<_>>());
        let values = if fortran_order { in_c_order(&shape, &values) } else { values };
        Ok((shape, values))
    }
}

/// Values whose first index runs fastest, rearranged so that the last one does.
fn in_c_order<T: Clone>(shape: &[usize], values: &[T]) -> Vec<T> {
    let place = |mut flat: usize| {
        // From the last index to the first, by the strides of the given order.
        let (mut stride, mut at) = (values.len(), 0);
        for &n in shape.iter().rev() {
            stride /= n;
            at += (flat % n) * stride;
            flat /= n;
        }
        at
    };
    (0..values.len()).map(|flat| values[place(flat)].clone()).collect()
}

/// What the operating system reported, if it did.
fn io_error(error: ZipError) -> std::io::Error {
    match error {
        ZipError::Io(error) => error,
        other => std::io::Error::other(other),
    }
}

fn at_member(file: &str, member: &str, what: &dyn std::fmt::Display) -> Error {
    Error::input(format!("{file}: member `{member}`: {what}"))
}

/// The index of a flat position, as NumPy writes it.
fn index_in(shape: &[usize], mut flat: usize) -> String {
    let mut index = vec![0; shape.len()];
    for (slot, &n) in index.iter_mut().zip(shape).rev() {
        *slot = flat % n.max(1);
        flat /= n.max(1);
    }
    format!("[{}]", index.iter().map(usize::to_string).collect::<Vec<_>>().join(", "))
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn members_are_deflated_only_if_that_makes_them_shorter() {
        let folder = tempfile::tempdir().expect("a folder");
        let path = folder.path().join("a.npz");
        let digits: Vec<f64> = (0..4000).map(|k| f64::from(k).sin()).collect();
        let steps: Vec<f64> = (0..4000).map(|k| f64::from(k / 500)).collect();
        let mut npz = NpzWriter::create(&path).expect("a file");
        npz.add_f64("digits", &[4000], digits.iter().copied()).expect("a member");
        npz.add_f64("steps", &[4000], steps.iter().copied()).expect("a member");
        npz.finish().expect("an archive");
        let mut npz = NpzReader::open(&path).expect("an archive");
        for (name, values, stored) in [("digits", digits, true), ("steps", steps, false)] {
            let member = npz.zip.by_name(&format!("{name}.npy")).expect("a member");
            assert_eq!(member.compression() == CompressionMethod::Stored, stored, "{name}");
            assert!(stored || member.compressed_size() < member.size() / 10);
            drop(member);
            assert_eq!(npz.f64(name, &[4000]).expect("values"), values);
        }
    }
}
