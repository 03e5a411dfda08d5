//! Small files that readers accept.

use std::io::Read;
use std::path::Path;

use warpgait::files::npy::Header;
use warpgait::scenario;

use super::mutate::Members;

#[path = "../common/mod.rs"]
#[allow(dead_code)]
mod common;

/// A scenario without files.
pub const FLAT: &str =
    "terrain = { kind = \"flat\" }\nstart = { position = [0.0, 0.0] }\ngoal = { position = [0.5, 0.0] }\n";
/// A scenario whose terrain overrides add.
pub const GROUND: &str = "start = { position = [0.0, 0.0] }\ngoal = { position = [0.0, 0.0] }\n[terrain]\n";

fn texts(folder: &str) -> Vec<Vec<u8>> {
    let root = Path::new(env!("CARGO_MANIFEST_DIR")).join(folder);
    let mut paths: Vec<_> = std::fs::read_dir(root).unwrap().map(|entry| entry.unwrap().path()).collect();
    paths.retain(|path| path.extension().is_some_and(|extension| extension == "toml"));
    paths.sort();
    paths.into_iter().map(|path| std::fs::read(path).unwrap()).collect()
}

pub fn scenarios() -> Vec<Vec<u8>> {
    let mut all = texts("scenarios");
    all.push(scenario::template("fuzz").into_bytes());
    all.push(FLAT.as_bytes().to_vec());
    all
}

pub fn robots() -> Vec<Vec<u8>> {
    texts("robots")
}

/// Motions of a robot with the feet L and R.
pub fn motions() -> Vec<Vec<u8>> {
    let names = "time,base_position_x,base_position_y,base_position_z,base_quaternion_w,base_quaternion_x,base_quaternion_y,base_quaternion_z,\
        L_foot_position_x,L_foot_position_y,L_foot_position_z,R_foot_position_x,R_foot_position_y,R_foot_position_z";
    let rows = "0,0,0,0.5,1,0,0,0,0,0.1,0,0,-0.1,0\n1.0,0.2,0,0.5,1,0,0,0,0.2,0.1,0,0.2,-0.1,0\n";
    vec![format!("# {{\"a\": 1}}\n{names}\n{rows}").into_bytes()]
}

pub fn overrides() -> Vec<Vec<u8>> {
    [
        "gait.kind=trot",
        "goal.position=[1.5, 0.0]",
        "solver={threads = 2}",
        "robot.name=\"anymal_c\"",
        "horizon=3",
    ]
    .map(|text| text.as_bytes().to_vec())
    .to_vec()
}

pub fn formulas() -> Vec<Vec<u8>> {
    ["0.1*sin(2*x) + max(0.05, y)^2", "sqrt(abs(x - y))/3 - exp(-x*x)", "-(1 + x)*(2 - y)", "0"]
        .map(|text| text.as_bytes().to_vec())
        .to_vec()
}

/// Small grounds in every format.
pub fn heights() -> Vec<Vec<u8>> {
    let array = |dtype: &str, fortran_order: bool, element: &[u8]| {
        let mut bytes = Header { dtype: dtype.into(), fortran_order, shape: vec![6, 7] }.write().unwrap();
        bytes.extend(element.repeat(42));
        bytes
    };
    let image = |color: png::ColorType, depth: png::BitDepth, palette: bool| {
        let mut bytes = Vec::new();
        let mut encoder = png::Encoder::new(&mut bytes, 6, 6);
        encoder.set_color(color);
        encoder.set_depth(depth);
        if palette {
            encoder.set_palette((0..48).collect::<Vec<u8>>());
            encoder.set_trns(vec![0, 255]);
        }
        let size = (6 * color.samples() * depth as usize).div_ceil(8) * 6;
        let data: Vec<u8> = (0..size).map(|i| (i % 16) as u8 * 17).collect();
        encoder.write_header().unwrap().write_image_data(&data).unwrap();
        bytes
    };
    use png::{BitDepth, ColorType};
    let samples = common::files::samples().into_iter().map(|(_, bytes)| bytes);
    let arrays_and_images = [
        array("<f8", false, &0.25_f64.to_le_bytes()),
        array("<f4", true, &0.25_f32.to_le_bytes()),
        array(">i2", false, &[0, 1]),
        array("|u1", false, &[3]),
        image(ColorType::Grayscale, BitDepth::Eight, false),
        image(ColorType::Grayscale, BitDepth::Sixteen, false),
        image(ColorType::Grayscale, BitDepth::Two, false),
        image(ColorType::Rgba, BitDepth::Eight, false),
        image(ColorType::GrayscaleAlpha, BitDepth::Eight, false),
        image(ColorType::Indexed, BitDepth::Four, true),
        image(ColorType::Indexed, BitDepth::Eight, true),
    ];
    arrays_and_images.into_iter().chain(samples).collect()
}

/// Plans, unpacked.
pub fn plans() -> Vec<Members> {
    let folder = tempfile::tempdir().unwrap();
    let path = folder.path().join("p.plan.npz");
    [common::standing(), common::lifting(0.08)]
        .into_iter()
        .map(|plan| {
            plan.write(&path).unwrap();
            let mut zip = zip::ZipArchive::new(std::fs::File::open(&path).unwrap()).unwrap();
            let members = (0..zip.len()).map(|i| {
                let mut member = zip.by_index(i).unwrap();
                let mut content = Vec::new();
                member.read_to_end(&mut content).unwrap();
                (member.name().to_owned(), content)
            });
            members.collect()
        })
        .collect()
}
