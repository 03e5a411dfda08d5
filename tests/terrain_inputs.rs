//! Ground as people have it: every layout and every kind of value is the ground that was meant, or is refused.

use std::fs;

use crate::common::inputs::*;

#[test]
fn every_layout_is_the_same_ground() {
    let folder = tempfile::tempdir().unwrap();
    for layout in ["picture", "y-up", "x-y", "grid-map"] {
        let (shape, values) = stored(layout);
        fs::write(folder.path().join("a.npy"), floats(&shape, &values)).unwrap();
        let keys = format!("file = \"a.npy\"\nspacing = {SPACING}\norigin = [1.0, -2.0]\n");
        let found = ground(&format!("{keys}layout = \"{layout}\""), folder.path());
        assert_is_the_ground(&found, [1.0, -2.0], 1e-15);
        if layout == "picture" {
            assert_is_the_ground(&ground(&keys, folder.path()), [1.0, -2.0], 1e-15);
        }
    }
}

#[test]
fn values_that_stand_for_no_data_are_holes() {
    let folder = tempfile::tempdir().unwrap();
    let (shape, mut values) = stored("picture");
    (values[3], values[18], values[19]) = (-9999.0, -9999.0, 1e20);
    let single = npy("<f4", &shape, &values, |v| (*v as f32).to_le_bytes().to_vec());
    fs::write(folder.path().join("a.npy"), floats(&shape, &values)).unwrap();
    fs::write(folder.path().join("b.npy"), &single).unwrap();
    let keys = format!("spacing = {SPACING}");
    for name in ["a.npy", "b.npy"] {
        let text = format!("file = \"{name}\"\n{keys}\nno_data = [-9999, 1e20]");
        let found = ground(&text, folder.path());
        assert_eq!(found.report.holes_filled, 3);
        let [low, high] = found.report.height_range;
        assert!(low >= 0.0 && high < 0.1, "{low} {high}");
    }
    assert_refused(
        "a.npy",
        &floats(&shape, &values),
        &keys,
        &["s.toml:7: terrain.file", "terrain.no_data = 1"],
    );
    let parts = ["the value -9999 (2 cells) is", "terrain.no_data = -9999"];
    assert_refused("a.npy", &floats(&shape, &values), &format!("{keys}\nno_data = 1e20"), &parts);
    let counts: Vec<i16> =
        values.iter().map(|v| if *v < -1.0 { -32768 } else { (1000.0 * v.min(0.1)) as i16 }).collect();
    let integers = npy("<i2", &shape, &counts, |v| v.to_le_bytes().to_vec());
    assert_refused(
        "a.npy",
        &integers,
        &format!("{keys}\nheight_scale = 0.001"),
        &["terrain.no_data = -32768"],
    );
    fs::write(folder.path().join("a.npy"), &integers).unwrap();
    let text = format!("file = \"a.npy\"\n{keys}\nheight_scale = 0.001\nno_data = -32768");
    assert_eq!(ground(&text, folder.path()).report.holes_filled, 2);
}

#[test]
fn values_that_stand_for_no_data_are_compared_as_stored() {
    let folder = tempfile::tempdir().unwrap();
    let (shape, mut values) = stored("picture");
    values[3] = 0.0123;
    let single = values.iter().map(|v| f64::from(*v as f32)).collect::<Vec<_>>();
    let bytes = npy("<f4", &shape, &single, |v| (*v as f32).to_le_bytes().to_vec());
    // As numpy.savez stores it.
    let path = folder.path().join("a.npz");
    let mut zip = zip::ZipWriter::new(fs::File::create(&path).unwrap());
    zip.start_file("h.npy", zip::write::SimpleFileOptions::default()).unwrap();
    std::io::Write::write_all(&mut zip, &bytes).unwrap();
    zip.finish().unwrap();
    let text = format!("file = \"a.npz\"\nspacing = {SPACING}\nno_data = 0.0123");
    assert_eq!(ground(&text, folder.path()).report.holes_filled, 1);
    // 0.0123 and 0 as floats of 2 bytes.
    let bits: Vec<u16> = (0..35).map(|k| if k == 3 { 0x224c } else { 0 }).collect();
    fs::write(folder.path().join("a.npy"), npy("<f2", &shape, &bits, |v| v.to_le_bytes().to_vec())).unwrap();
    assert_eq!(ground(&text.replace(".npz", ".npy"), folder.path()).report.holes_filled, 1);
}

#[test]
fn half_floats_are_heights() {
    let folder = tempfile::tempdir().unwrap();
    let (shape, _) = stored("picture");
    // 0, 1/1024, 2/1024, … up to 34/1024, by their bits: for 1 + f/1024 the fraction f, less 1.
    let bits: Vec<u16> = (0..35).map(|k| 0x3c00 + k).collect();
    fs::write(folder.path().join("a.npy"), npy("<f2", &shape, &bits, |v| v.to_le_bytes().to_vec())).unwrap();
    let found = ground(&format!("file = \"a.npy\"\nspacing = {SPACING}\nlayout = \"y-up\""), folder.path());
    for (k, h) in found.raw.unwrap().iter().enumerate() {
        assert!((h - 1.0 - k as f64 / 1024.0).abs() < 1e-12);
    }
}

#[test]
fn what_is_out_of_proportion_is_refused() {
    let (shape, values) = stored("picture");
    let keys = format!("spacing = {SPACING}\nheight_scale = 1000.0");
    let parts = ["on ground of 0.144 m from corner to corner must be a mistake", "terrain.height_scale"];
    assert_refused("a.npy", &floats(&shape, &values), &keys, &parts);
}

#[test]
fn colors_are_refused() {
    use png::{BitDepth::Eight, BitDepth::Sixteen, ColorType};
    let keys = format!("spacing = {SPACING}\nheight_scale = 0.1");
    let parts = ["it is in color: pixel [row 1, column 0]", "16 bit gray, .npy or .tif"];
    let color = |i: usize| if i == 5 { [10, 13, 10] } else { [i as u8; 3] };
    let data: Vec<u8> = (0..25).flat_map(color).collect();
    assert_refused("a.png", &png(ColorType::Rgb, Eight, [5, 5], None, &data), &keys, &parts);
    let wide: Vec<u8> = data.iter().flat_map(|&v| [v, 0]).collect();
    assert_refused("a.png", &png(ColorType::Rgb, Sixteen, [5, 5], None, &wide), &keys, &parts);
    let indices: Vec<u8> = (0..25).collect();
    assert_refused("a.png", &png(ColorType::Indexed, Eight, [5, 5], Some(&data), &indices), &keys, &parts);
}

#[test]
fn indices_beyond_a_palette_are_refused() {
    use png::{BitDepth, ColorType::Indexed};
    let keys = format!("spacing = {SPACING}\nheight_scale = 0.1");
    let palette = [0, 0, 0, 9, 9, 9];
    let part = ["pixel [row 1, column 2] has color 2, but the palette has only 2"];
    let eight: Vec<u8> = (0..25).map(|k| if k == 7 { 2 } else { 1 }).collect();
    assert_refused("a.png", &png(Indexed, BitDepth::Eight, [5, 5], Some(&palette), &eight), &keys, &part);
    let four: Vec<u8> = (0..15).map(|k| if k == 4 { 0x20 } else { 0x10 }).collect();
    assert_refused("a.png", &png(Indexed, BitDepth::Four, [5, 5], Some(&palette), &four), &keys, &part);
}

#[test]
fn palettes_of_broken_colors_are_refused() {
    let keys = format!("spacing = {SPACING}\nheight_scale = 0.1");
    let whole = png(png::ColorType::Indexed, png::BitDepth::Eight, [4, 4], Some(&[1, 2, 3]), &[0; 16]);
    // The palette of 3 bytes becomes one of 4, and of 3 · 257.
    let at = whole.windows(4).position(|w| w == b"PLTE").unwrap();
    for palette in [vec![1, 2, 3, 4], vec![7; 3 * 257]] {
        let chunk = [b"PLTE".to_vec(), palette].concat();
        let length = (chunk.len() as u32 - 4).to_be_bytes();
        let bytes =
            [&whole[..at - 4], &length, &chunk, &crc32(&chunk).to_be_bytes(), &whole[at + 11..]].concat();
        assert_refused("a.png", &bytes, &keys, &["not a valid PNG image"]);
    }
}
