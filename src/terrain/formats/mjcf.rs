//! `<hfield>` in an MJCF file: heights as MuJoCo maps them, at the place of the geom that uses them.
//!
//! MuJoCo brings the values to 0…1, multiplies them by the third number of `size`, and adds them to the geom's place. The rows of an
//! image and of the attribute `elevation` run from the largest y, those of a binary file from the least.

use std::path::{Path, PathBuf};

use roxmltree::{Document, Node, ParsingOptions};

use super::input::Input;
use super::{hfield, image};
use crate::digest::sha256_hex;
use crate::error::{Error, Result};
use crate::files::png;
use crate::terrain::file::read_file;
use crate::terrain::raster::{Raster, Values, check_size};

/// Larger documents are refused, elements and attributes.
const MOST_NODES: u32 = 1 << 20;
/// Deeper documents are refused, elements inside elements.
const MOST_DEPTH: usize = 200;
/// Attributes that turn a body.
const TURNS: [&str; 5] = ["quat", "axisangle", "xyaxes", "zaxis", "euler"];

/// Whether a file is XML with MuJoCo's outermost element, or called so.
pub fn is_mjcf(input: &Input) -> bool {
    let start = String::from_utf8_lossy(&input.bytes[..input.bytes.len().min(4096)]);
    start.trim_start_matches('\u{feff}').trim_start().starts_with('<')
        && (start.contains("<mujoco") || input.ends_in("xml") || input.ends_in("mjcf"))
}

/// Decodes the height field that `terrain.member` names, or the only one.
///
/// # Errors
/// If the file is not XML, there is no such height field, or it is turned.
pub fn decode(input: &Input) -> Result<Raster> {
    let text = std::str::from_utf8(input.bytes).map_err(|_| Error::input("not XML: not text in UTF-8"))?;
    ensure_shallow(text)?;
    let options = ParsingOptions { allow_dtd: false, nodes_limit: MOST_NODES, ..Default::default() };
    let document =
        Document::parse_with_options(text, options).map_err(|e| Error::input(format!("not XML: {e}")))?;
    if let Some(include) = document.descendants().find(|node| node.has_tag_name("include")) {
        let file = include.attribute("file").unwrap_or_default();
        let what = format!(
            "the model includes {file:?}, which is not read; give a model without include, as MuJoCo's mj_saveLastXML writes it"
        );
        return Err(Error::input(what));
    }
    let field = chosen(&document, input.member)?;
    let name = name(field);
    let refuse = |what: String| Error::input(format!("hfield {name:?}: {what}"));
    let size = numbers(field, "size").map_err(refuse)?;
    let Some([x, y, z, _]) =
        size.as_deref().filter(|s| s.iter().all(|v| *v > 0.0)).and_then(|s| s.first_chunk())
    else {
        return Err(refuse("size must have four positive numbers".to_owned()));
    };
    let mut raster = values(&document, field, input).map_err(|e| refuse(e.to_string()))?;
    let (place, note) = place(&document, &name).map_err(refuse)?;
    // As MuJoCo has it: a value that stands for no data counts for the least and the greatest, too.
    let (zero, span) = raster.least_and_span();
    raster.meaning = Values::Mapped { zero, unit: z / span, base: place[2] };
    let spacing = |radius: f64, count: usize| 2.0 * radius / (count - 1) as f64;
    raster.spacing = Some([spacing(*x, raster.columns), spacing(*y, raster.rows)]);
    raster.corner = Some([place[0] - x, place[1] - y]);
    raster.notes.extend(note);
    raster.value_type = format!("{} of hfield {name:?}, brought to 0…{z} m", raster.value_type);
    Ok(raster)
}

/// Refuses elements so deep inside each other that the parser's own depth would matter.
fn ensure_shallow(text: &str) -> Result<()> {
    let (mut depth, mut deepest) = (0_usize, 0);
    for (i, _) in text.match_indices('<') {
        match text.as_bytes().get(i + 1) {
            Some(b'/') => depth = depth.saturating_sub(1),
            Some(b'!' | b'?') => {}
            _ => {
                let end = text[i..].find('>').map_or(text.len(), |end| i + end);
                depth += usize::from(!text[..end].ends_with('/'));
                deepest = deepest.max(depth);
            }
        }
        if deepest > MOST_DEPTH {
            return Err(Error::input(format!("elements are more than {MOST_DEPTH} deep inside each other")));
        }
    }
    Ok(())
}

/// The name of a height field: that of its file, unless it has one.
fn name(field: Node) -> String {
    let of_file = || {
        Path::new(field.attribute("file").unwrap_or_default())
            .file_stem()
            .map(|s| s.to_string_lossy().into_owned())
    };
    field.attribute("name").map(str::to_owned).or_else(of_file).unwrap_or_default()
}

fn chosen<'a>(document: &'a Document, wanted: Option<&str>) -> Result<Node<'a, 'a>> {
    let fields: Vec<Node> = document.descendants().filter(|node| node.has_tag_name("hfield")).collect();
    let names = || fields.iter().map(|field| name(*field)).collect::<Vec<_>>().join(", ");
    match (wanted, &fields[..]) {
        (_, []) => Err(Error::input("a MuJoCo model without hfield")),
        (None, [only]) => Ok(*only),
        (None, _) => {
            let what = format!("missing; the model has {} height fields: {}", fields.len(), names());
            Err(Error::key("terrain.member", what))
        }
        (Some(wanted), _) => fields.iter().copied().find(|field| name(*field) == wanted).ok_or_else(|| {
            Error::key("terrain.member", format!("there is no hfield {wanted:?}; there are: {}", names()))
        }),
    }
}

/// The numbers of an attribute; none if it is not there.
fn numbers(node: Node, attribute: &str) -> std::result::Result<Option<Vec<f64>>, String> {
    let Some(text) = node.attribute(attribute) else { return Ok(None) };
    let parse = |word: &str| word.parse::<f64>().ok().filter(|v| v.is_finite());
    let numbers = text
        .split_whitespace()
        .map(|word| parse(word).ok_or_else(|| format!("{attribute}: {word:.20} is no number")));
    numbers.collect::<std::result::Result<_, _>>().map(Some)
}

/// The values as they are in the file, or in the attribute `elevation`.
fn values(document: &Document, field: Node, input: &Input) -> Result<Raster> {
    if let Some(file) = field.attribute("file") {
        let path = path(document, file, input.path);
        let bytes = read_file(&path)?;
        let named = Input { bytes: &bytes, path: &path, member: None, spacing: None };
        let mut raster =
            if bytes.starts_with(png::SIGNATURE) { image::decode(&named)? } else { hfield::values(&bytes)? };
        raster.inputs.push((path.to_string_lossy().into_owned(), sha256_hex(&bytes)));
        return Ok(raster);
    }
    let count = |attribute: &str| {
        let count = field.attribute(attribute).and_then(|text| text.trim().parse::<u64>().ok());
        count.ok_or_else(|| Error::input(format!("{attribute} is missing, or no whole number")))
    };
    let (rows, columns) = (count("nrow")?, count("ncol")?);
    check_size(columns, rows)?;
    let (rows, columns) = (rows as usize, columns as usize);
    let values =
        numbers(field, "elevation").map_err(Error::input)?.unwrap_or_else(|| vec![0.0; rows * columns]);
    if values.len() != rows * columns {
        return Err(Error::input(format!("elevation has {} numbers, not {rows} x {columns}", values.len())));
    }
    Ok(Raster::new(columns, rows, values, Values::Normalized, "text".to_owned()))
}

/// Where MuJoCo looks for a file that a model names.
fn path(document: &Document, file: &str, model: &Path) -> PathBuf {
    let compiler = |attribute: &str| {
        document.descendants().filter(|n| n.has_tag_name("compiler")).find_map(|n| n.attribute(attribute))
    };
    let strip = compiler("strippath") == Some("true");
    let file = Path::new(file);
    let file = if strip { Path::new(file.file_name().unwrap_or_default()) } else { file };
    let folder = model.parent().unwrap_or(Path::new(""));
    folder.join(compiler("meshdir").or(compiler("assetdir")).unwrap_or_default()).join(file)
}

/// The place of the only geom that uses a height field, and a note if there is none.
fn place(document: &Document, name: &str) -> std::result::Result<([f64; 3], Option<String>), String> {
    let in_default = |node: &Node| node.ancestors().any(|ancestor| ancestor.has_tag_name("default"));
    let all = || document.descendants().filter(|node| node.has_tag_name("geom"));
    if all().any(|node| in_default(&node) && node.attribute("hfield").is_some()) {
        return Err("a default gives geoms an hfield; write it at the geom that is the ground".to_owned());
    }
    let geoms: Vec<Node> = all().filter(|node| node.attribute("hfield") == Some(name)).collect();
    let geom = match &geoms[..] {
        [only] => only,
        [] => {
            return Ok((
                [0.0; 3],
                Some(format!("no geom uses the hfield {name:?}; its center is put at 0, 0, 0")),
            ));
        }
        _ => return Err(format!("{} geoms use it; only one can be the ground", geoms.len())),
    };
    ensure_no_defaults(document, *geom)?;
    let mut place = [0.0; 3];
    for node in geom.ancestors().filter(|node| node.is_element()) {
        if node.has_tag_name("replicate") {
            return Err("it is inside a replicate, which is not read; write the geom out".to_owned());
        }
        if let Some(turn) = turn(node)? {
            return Err(format!("{turn} turns it; ground must not be turned"));
        }
        if let Some(offset) = numbers(node, "pos")? {
            let offset: &[f64; 3] =
                offset.as_slice().try_into().map_err(|_| "pos must have three numbers".to_owned())?;
            place.iter_mut().zip(offset).for_each(|(sum, part)| *sum += part);
        }
    }
    let others = all().filter(|node| node != geom && !in_default(node) && stays(node)).count();
    let note =
        format!("{others} other geoms of the model that do not move are left out; only the hfield is ground");
    Ok((place, (others > 0).then_some(note)))
}

/// The attribute that turns a body or a geom.
fn turn(node: Node) -> std::result::Result<Option<&'static str>, String> {
    for turn in TURNS {
        let identity = if turn == "quat" { vec![1.0, 0.0, 0.0, 0.0] } else { vec![0.0; 3] };
        if numbers(node, turn)?.is_some_and(|given| given != identity) {
            return Ok(Some(turn));
        }
    }
    Ok(None)
}

/// Refuses a geom that a default moves or turns.
fn ensure_no_defaults(document: &Document, geom: Node) -> std::result::Result<(), String> {
    let of_body = || geom.ancestors().skip(1).find_map(|node| node.attribute("childclass"));
    let class = geom.attribute("class").or_else(of_body);
    let is_default = |node: &Node| node.has_tag_name("default");
    // The outermost ones hold for every geom, and a class takes over from those around it.
    let outermost = |node: &Node| is_default(node) && !node.ancestors().skip(1).any(|n| is_default(&n));
    let applies = |node: &Node| {
        let of_class =
            |inner: Node| is_default(&inner) && class.is_some() && inner.attribute("class") == class;
        outermost(node) || (is_default(node) && node.descendants().any(of_class))
    };
    for default in document.descendants().filter(applies) {
        for given in default.children().filter(|node| node.has_tag_name("geom")) {
            let moved = numbers(given, "pos")?.is_some_and(|pos| pos != [0.0; 3]);
            if let Some(what) = turn(given)?.or((moved && !geom.has_attribute("pos")).then_some("pos")) {
                return Err(format!(
                    "a default gives its geom {what}; write pos at the geom itself, not turned"
                ));
            }
        }
    }
    Ok(())
}

/// Whether a geom is fixed to the world.
fn stays(geom: &Node) -> bool {
    let is_joint = |node: Node| node.has_tag_name("joint") || node.has_tag_name("freejoint");
    geom.ancestors().any(|node| node.has_tag_name("worldbody"))
        && !geom.ancestors().any(|node| node.has_tag_name("body") && node.children().any(is_joint))
}
