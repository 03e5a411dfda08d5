//! File formats of heightmaps: each reader turns bytes into a [`Raster`], and says what the file itself knows about its cells.
//!
//! Every reader checks the sizes that a file declares against the length of the file and against the limit on cells before it
//! allocates. A new format is a reader in a file of its own, and an entry in [`FORMATS`].

mod hfield;
mod image;
mod input;
mod mesh;
mod mjcf;
mod npy;
mod npz;
mod text;
mod tiff;

pub use input::Input;

use super::raster::Raster;
use crate::error::{Error, Result};
use crate::files::png;

/// A file format of heightmaps.
pub struct Format {
    /// With an article, in messages.
    pub name: &'static str,
    /// The usual ends of names, in messages.
    extensions: &'static str,
    /// Whether a file is in this format, judged by its first bytes and its length, and by its name where these do not tell.
    recognizes: fn(&Input) -> bool,
    /// Decodes a file.
    pub decode: fn(&Input) -> Result<Raster>,
    /// Whether a file holds several things of which `terrain.member` names one.
    has_members: bool,
}

/// The formats, in the order in which a file is tried: first those with a signature, last those that are known by their content.
const FORMATS: [Format; 11] = [
    Format {
        name: "a PNG image",
        extensions: ".png",
        recognizes: |input| input.bytes.starts_with(png::SIGNATURE),
        decode: image::decode,
        has_members: false,
    },
    Format {
        name: "a TIFF file",
        extensions: ".tif, .tiff",
        recognizes: |input| tiff::SIGNATURES.iter().any(|signature| input.bytes.starts_with(signature)),
        decode: tiff::decode,
        has_members: false,
    },
    Format {
        name: "a NumPy array",
        extensions: ".npy",
        recognizes: |input| input.bytes.starts_with(npy::SIGNATURE),
        decode: npy::decode,
        has_members: false,
    },
    Format {
        name: "a NumPy archive",
        extensions: ".npz",
        recognizes: |input| input.bytes.starts_with(npz::SIGNATURE),
        decode: npz::decode,
        has_members: true,
    },
    Format {
        name: "a PLY mesh",
        extensions: ".ply",
        recognizes: |input| input.bytes.starts_with(mesh::PLY_SIGNATURE),
        decode: mesh::ply,
        has_members: false,
    },
    Format {
        name: "an ESRI ASCII grid",
        extensions: ".asc",
        recognizes: text::is_esri,
        decode: text::esri,
        has_members: false,
    },
    Format {
        name: "a MuJoCo model with an hfield",
        extensions: ".xml",
        recognizes: mjcf::is_mjcf,
        decode: mjcf::decode,
        has_members: true,
    },
    Format {
        name: "a MuJoCo height field",
        extensions: ".bin, .hf",
        recognizes: hfield::is_hfield,
        decode: hfield::decode,
        has_members: false,
    },
    Format {
        name: "an STL mesh",
        extensions: ".stl",
        recognizes: mesh::is_stl,
        decode: mesh::stl,
        has_members: false,
    },
    Format {
        name: "a text grid",
        extensions: ".csv, .txt",
        recognizes: text::is_grid,
        decode: text::grid,
        has_members: false,
    },
    Format {
        name: "an OBJ mesh",
        extensions: ".obj",
        recognizes: mesh::is_obj,
        decode: mesh::obj,
        has_members: false,
    },
];

/// The format of a file.
///
/// # Errors
/// If it is in none of them, or `terrain.member` is given for one without members.
pub fn recognize(input: &Input) -> Result<&'static Format> {
    let Some(format) = FORMATS.iter().find(|format| (format.recognizes)(input)) else {
        let known: Vec<String> =
            FORMATS.iter().map(|format| format!("{} ({})", format.name, format.extensions)).collect();
        let what = if input.bytes.is_empty() { "an empty file" } else { "not a format that can be read" };
        return Err(Error::input(format!("{what}; these can: {}", known.join(", "))));
    };
    if input.member.is_some() && !format.has_members {
        let what = format!("only allowed for files with several members; {} has none", format.name);
        return Err(Error::key("terrain.member", what));
    }
    Ok(format)
}
