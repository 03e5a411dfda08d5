//! Archives of NumPy arrays (`.npz`): deflated zip files of `.npy` members that `numpy.load` reads.

use std::fs::File;
use std::io::{BufWriter, Cursor, Read, Write};
use std::iter::repeat;
use std::path::{Path, PathBuf};

use zip::result::ZipError;
use zip::write::SimpleFileOptions;
use zip::{CompressionMethod, ZipArchive, ZipWriter};

use super::npy::{self, Header};
use super::temporary_beside;
use crate::{Error, Result};

/// Writes an archive to a temporary file beside its target; [`NpzWriter::finish`] renames it, so that a killed process
/// never leaves half a file under the target's name.
pub struct NpzWriter {
    zip: Option<ZipWriter<BufWriter<File>>>,
    temporary: PathBuf,
    target: PathBuf,
}

impl NpzWriter {
    /// Opens the temporary file.
    pub fn create(target: &Path) -> Result<Self> {
        let temporary = temporary_beside(target)?;
        let file = File::create(&temporary).map_err(|e| Error::io(target, e))?;
        Ok(Self { zip: Some(ZipWriter::new(BufWriter::new(file))), temporary, target: target.to_path_buf() })
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
        let at = |e: std::io::Error| Error::io(&self.target, e);
        let zip = self.zip.as_mut().ok_or_else(|| Error::Internal("the archive is closed".into()))?;
        let options = SimpleFileOptions::default().compression_method(CompressionMethod::Deflated);
        zip.start_file(format!("{name}.npy"), options).map_err(|e| at(e.into()))?;
        zip.write_all(&header).and_then(|()| zip.write_all(&bytes)).map_err(at)
    }

    /// Closes the archive and renames it to its target.
    pub fn finish(mut self) -> Result<()> {
        let at = |e: std::io::Error| Error::io(&self.target, e);
        let zip = self.zip.take().ok_or_else(|| Error::Internal("the archive is closed".into()))?;
        let buffer = zip.finish().map_err(|e| at(e.into()))?;
        let file = buffer.into_inner().map_err(|e| at(e.into_error()))?;
        file.sync_all().map_err(at)?;
        drop(file);
        std::fs::rename(&self.temporary, &self.target).map_err(at)
    }
}

impl Drop for NpzWriter {
    fn drop(&mut self) {
        // After `finish` this file no longer exists; before it, a failed write must not leave one.
        drop(self.zip.take());
        let _ = std::fs::remove_file(&self.temporary);
    }
}

/// Reads the members of an archive; every error names the file and the member.
pub struct NpzReader {
    zip: ZipArchive<Cursor<Vec<u8>>>,
    file: String,
}

impl NpzReader {
    /// Reads the file into memory and finds its members.
    pub fn open(path: &Path) -> Result<Self> {
        let file = path.display().to_string();
        let content = std::fs::read(path).map_err(|e| Error::io(path, e))?;
        let zip = ZipArchive::new(Cursor::new(content))
            .map_err(|e| Error::input(format!("{file}: not an .npz archive, or truncated: {e}")))?;
        Ok(Self { zip, file })
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
        Error::input(format!("{}: member `{member}`: {what}", self.file))
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

    /// Reads a member whose elements take as many bytes as `width` tells from the dtype, if it is the right one.
    fn read<T>(
        &mut self,
        name: &str,
        wanted: &str,
        width: impl Fn(&str) -> Option<usize>,
        element: impl Fn(&[u8]) -> Option<T>,
    ) -> Result<(Vec<usize>, Vec<T>)> {
        let member = self.zip.by_name(&format!("{name}.npy")).and_then(|mut member| {
            let mut content = Vec::new();
            member.read_to_end(&mut content)?;
            Ok(content)
        });
        let content = match member {
            Ok(content) => content,
            Err(ZipError::FileNotFound) => return Err(self.error(name, "missing")),
            Err(e) => return Err(self.error(name, format!("damaged or truncated: {e}"))),
        };
        let (header, data) =
            Header::read(&content).map_err(|e| self.error(name, format!("not a .npy array: {e}")))?;
        let Header { dtype, fortran_order, shape } = &header;
        let Some(width) = width(dtype) else {
            return Err(self.error(name, format!("dtype {dtype}, expected {wanted}")));
        };
        if *fortran_order && shape.len() > 1 {
            return Err(self.error(name, "stored in Fortran order, expected C order"));
        }
        // The size must fit before anything is allocated for it.
        if header.num_bytes(width) != Some(data.len()) {
            let (bytes, shape) = (data.len(), npy::tuple(shape));
            return Err(self.error(name, format!("{bytes} bytes of data do not make {shape} of {dtype}")));
        }
        let values: Option<Vec<T>> = data.chunks_exact(width).map(element).collect();
        let values = values.ok_or_else(|| self.error(name, format!("an element is no {wanted}")))?;
        Ok((shape.iter().map(|&n| n as usize).collect(), values))
    }
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
