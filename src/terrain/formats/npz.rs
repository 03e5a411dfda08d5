//! Heights in an archive of NumPy arrays: those of a plan, of `warpgait terrain convert`, or of others.
//!
//! | member | meaning |
//! | --- | --- |
//! | `NAME` | the heights, two dimensions |
//! | `NAME_spacing`, `spacing` or `resolution` | distance between neighboring cells, m: one number, or those along x and y |
//! | `NAME_origin` or `origin` | x, y of the cell with the least x and y, m |
//! | `layout` | a string as in `terrain.layout` |

use std::io::{Cursor, Read};

use zip::ZipArchive;

use super::input::Input;
use super::npy;
use crate::error::{Error, Result};
use crate::files::npy::{Header, number_size, numbers, tuple};
use crate::scenario::terrain::Layout;
use crate::terrain::raster::Raster;

/// The first bytes of every zip file that is not empty.
pub const SIGNATURE: &[u8] = b"PK\x03\x04";

/// The ground of a plan, the raw one first.
const OF_PLANS: [&str; 2] = ["heightfield_raw", "heightfield"];
/// More members than this are not looked at.
const MOST_MEMBERS: usize = 1000;
/// Bytes of a header that are read to learn a shape.
const HEADER: u64 = 1 << 16;
/// Bytes of an array beyond which it cannot be allowed: the largest raster, and its header.
const MOST_BYTES: u64 = (crate::heightfield::MAX_SAMPLES as u64) * 8 + HEADER;

type Archive<'a> = ZipArchive<Cursor<&'a [u8]>>;

/// Decodes the heights of an archive, and what it says about their places.
///
/// # Errors
/// If it is damaged, no member or more than one can be meant, or a member is not as it should be.
pub fn decode(input: &Input) -> Result<Raster> {
    let mut zip = ZipArchive::new(Cursor::new(input.bytes))
        .map_err(|e| Error::input(format!("not an .npz archive, or truncated: {e}")))?;
    let name = chosen(&mut zip, input.member)?;
    let bytes = member(&mut zip, &name, MOST_BYTES)?.ok_or_else(|| missing(&mut zip, &name))?;
    let mut raster = npy::array(&bytes).map_err(|e| at(&name, e))?;
    // The two grounds of a plan share one place.
    let of_plan = OF_PLANS.contains(&name.as_str());
    let own = if of_plan { OF_PLANS[1] } else { &name };
    if let Some((name, values)) = first_of(&mut zip, &[&format!("{own}_spacing"), "spacing", "resolution"])? {
        raster.spacing = Some(match values[..] {
            [both] => [both; 2],
            [x, y] => [x, y],
            _ => return Err(at(&name, format!("{} numbers; it must have one or two", values.len()))),
        });
    }
    if let Some((name, values)) = first_of(&mut zip, &[&format!("{own}_origin"), "origin"])? {
        match values[..] {
            [x, y] | [x, y, _] => raster.corner = Some([x, y]),
            _ => return Err(at(&name, format!("{} numbers; it must have two, x and y", values.len()))),
        }
    }
    if let Some(text) = string(&mut zip, "layout")? {
        let layouts = [Layout::Picture, Layout::YUp, Layout::XY, Layout::GridMap];
        let names = layouts.map(Layout::name).join(", ");
        let known = layouts.into_iter().find(|layout| layout.name() == text);
        raster.layout = known.ok_or_else(|| at("layout", format!("given {text:?}, allowed: {names}")))?;
    } else if of_plan {
        raster.layout = Layout::YUp;
    }
    raster.value_type = format!("{} in member {name}", raster.value_type);
    Ok(raster)
}

fn at(member: &str, what: impl std::fmt::Display) -> Error {
    Error::input(format!("member {member:?}: {what}"))
}

/// The member that a user wants.
fn chosen(zip: &mut Archive, wanted: Option<&str>) -> Result<String> {
    if let Some(wanted) = wanted {
        return Ok(wanted.trim_end_matches(".npy").to_owned());
    }
    let has = |zip: &Archive, name: &str| zip.index_for_name(&format!("{name}.npy")).is_some();
    if let Some(name) = OF_PLANS.into_iter().find(|name| has(zip, name)) {
        return Ok(name.to_owned());
    }
    let flat = two_dimensional(zip);
    match &flat[..] {
        [only] => Ok(only.clone()),
        [] => Err(Error::input("an archive without an array of two dimensions")),
        _ => {
            let what = format!(
                "missing; the archive has {} arrays of two dimensions: {}",
                flat.len(),
                flat.join(", ")
            );
            Err(Error::key("terrain.member", what))
        }
    }
}

fn missing(zip: &mut Archive, name: &str) -> Error {
    let flat = two_dimensional(zip).join(", ");
    Error::key("terrain.member", format!("there is no {name:?}; arrays of two dimensions: {flat}"))
}

/// The names of the arrays of two dimensions, neither of which is 1.
fn two_dimensional(zip: &mut Archive) -> Vec<String> {
    let names: Vec<String> = zip
        .file_names()
        .filter_map(|n| n.strip_suffix(".npy"))
        .take(MOST_MEMBERS)
        .map(str::to_owned)
        .collect();
    let is_flat = |bytes: &[u8]| {
        Header::read(bytes).is_ok_and(|(header, _)| {
            matches!(header.shape[..], [a, b] if a > 1 && b > 1) && number_size(&header.dtype).is_some()
        })
    };
    let mut start = |name: &str| start_of(zip, name, HEADER).ok().flatten();
    names.into_iter().filter(|name| start(name).is_some_and(|bytes| is_flat(&bytes))).collect()
}

/// At most `most` bytes of a member; none if there is no such member.
fn start_of(zip: &mut Archive, name: &str, most: u64) -> Result<Option<Vec<u8>>> {
    let Some(index) = zip.index_for_name(&format!("{name}.npy")) else { return Ok(None) };
    let mut bytes = Vec::new();
    let read = |file: zip::read::ZipFile<_>| file.take(most).read_to_end(&mut bytes);
    match zip.by_index(index).map_err(std::io::Error::from).and_then(read) {
        Ok(_) => Ok(Some(bytes)),
        Err(e) => Err(at(name, format!("damaged or truncated: {e}"))),
    }
}

/// A whole member of at most `most` bytes; none if there is no such member.
fn member(zip: &mut Archive, name: &str, most: u64) -> Result<Option<Vec<u8>>> {
    match start_of(zip, name, most + 1)? {
        Some(bytes) if bytes.len() as u64 > most => Err(at(name, format!("more than {most} bytes"))),
        other => Ok(other),
    }
}

/// The first of some members that is there, as finite numbers.
fn first_of(zip: &mut Archive, names: &[&str]) -> Result<Option<(String, Vec<f64>)>> {
    for name in names {
        let Some(bytes) = member(zip, name, HEADER)? else { continue };
        let (header, data) = Header::read(&bytes).map_err(|e| at(name, e))?;
        let values = number_size(&header.dtype)
            .filter(|width| header.num_bytes(*width) == Some(data.len()))
            .and_then(|_| numbers(&header.dtype, data))
            .filter(|values| values.iter().all(|v| v.is_finite()));
        let what = || format!("{} of {}; it must hold finite numbers", tuple(&header.shape), header.dtype);
        return Ok(Some(((*name).to_owned(), values.ok_or_else(|| at(name, what()))?)));
    }
    Ok(None)
}

/// A member that is one string.
fn string(zip: &mut Archive, name: &str) -> Result<Option<String>> {
    let Some(bytes) = member(zip, name, HEADER)? else { return Ok(None) };
    let (header, data) = Header::read(&bytes).map_err(|e| at(name, e))?;
    if !header.dtype.starts_with("<U") || header.shape.iter().any(|&n| n != 1) {
        return Err(at(name, format!("{} of {}; it must be a string", tuple(&header.shape), header.dtype)));
    }
    let characters = data.as_chunks().0.iter().map(|&c| char::from_u32(u32::from_le_bytes(c)).unwrap_or('?'));
    Ok(Some(characters.collect::<String>().trim_end_matches('\0').to_owned()))
}
