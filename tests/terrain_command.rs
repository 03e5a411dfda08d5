//! `warpgait terrain show` and `warpgait terrain convert`.

use std::fs;

use crate::cli::{refused, warpgait};
use crate::common::inputs::*;
use serde_json::Value;

/// A folder with `isaac.npy`, which needs `--layout x-y`, and a scenario with it.
fn folder() -> tempfile::TempDir {
    let folder = tempfile::tempdir().unwrap();
    let (shape, mut values) = stored("x-y");
    values[9] = -9999.0;
    fs::write(folder.path().join("isaac.npy"), floats(&shape, &values)).unwrap();
    let text = format!(
        "[terrain]\nkind = \"heightmap\"\nfile = \"isaac.npy\"\nspacing = {SPACING}\nlayout = \"x-y\"\nno_data = -9999\norigin = [2.0, 1.0]\n\
         [start]\nposition = [1.95, 1.0]\n[goal]\nposition = [2.05, 1.0]\n"
    );
    fs::write(folder.path().join("s.toml"), text).unwrap();
    folder
}

const OPTIONS: [&str; 7] = ["--spacing=0.02", "--layout=x-y", "--no-data", "-9999", "--origin", "2.0", "1.0"];

#[test]
fn show_says_what_a_file_was_taken_for() {
    let folder = folder();
    let bare = [&["terrain", "show", "isaac.npy"][..], &OPTIONS].concat();
    for (arguments, picture) in
        [(&bare[..], "isaac.terrain.svg"), (&["terrain", "show", "s.toml"], "s.terrain.svg")]
    {
        let (code, out, err) = warpgait(folder.path(), arguments);
        assert_eq!((code, err.as_str()), (0, ""), "{out}");
        for part in [
            "a NumPy array, float64",
            "x-y, 7 x 5 cells: the first index runs along x",
            "x 1.940 to 2.060 m, y 0.960 to 1.040 m",
            "0.000 to 0.076 m",
            "1 of 35 cells (2.9 %)",
            &format!("Written: {picture}"),
        ] {
            assert!(out.contains(part), "`{part}` is missing in {out}");
        }
        let drawing = fs::read_to_string(folder.path().join(picture)).unwrap();
        assert!(drawing.contains("y, north on a map") && drawing.contains("no data: filled"));
        assert_eq!(drawing.contains(">start<"), picture == "s.terrain.svg");
    }
    let (code, out, _) = warpgait(folder.path(), &[&bare[..], &["--json", "--no-plot"]].concat());
    let object: Value = serde_json::from_str(&out).unwrap();
    assert_eq!((code, &object["source"]["layout"]), (0, &Value::from("x-y")));
    assert_eq!(object["source"]["unknown"], 1);
    assert!(object["plot"].is_null());
    let (code, out, _) =
        warpgait(folder.path(), &["terrain", "show", "s.toml", "--layout", "grid-map", "--no-plot"]);
    assert!(code == 0 && out.contains("grid-map, 7 x 5 cells"), "{out}");
}

#[test]
fn show_refuses_in_terms_of_its_options() {
    let folder = folder();
    let show = |more: &[&'static str]| [&["terrain", "show", "isaac.npy"], more].concat();
    refused(folder.path(), &show(&[]), &["isaac.npy: --spacing: missing", "0.001 to 10 m"]);
    refused(
        folder.path(),
        &show(&["--spacing", "0.02"]),
        &["isaac.npy: the value -9999", "set --no-data -9999"],
    );
    refused(folder.path(), &show(&["--spacing", "20"]), &["isaac.npy: --spacing: given 20", "to 10"]);
    refused(folder.path(), &show(&["--layout", "xy"]), &["--layout: given \"xy\"", "did you mean \"x-y\"?"]);
    refused(
        folder.path(),
        &show(&["--set", "terrain.spacing=1"]),
        &["--set terrain.spacing=1: only allowed for a scenario"],
    );
    refused(folder.path(), &["terrain", "show", "none.npy"], &["none.npy: ", "No such file"]);
    refused(
        folder.path(),
        &["terrain", "show", "s.toml", "--set", "start.position=[9,9]"],
        &["start.position", "outside"],
    );
}

#[test]
fn what_is_converted_is_the_same_ground() {
    let folder = folder();
    let convert = |from: &'static str, to: &'static str, options: &[&'static str]| {
        let (code, out, err) =
            warpgait(folder.path(), &[&["terrain", "convert", from, to], options].concat());
        assert_eq!((code, err.as_str()), (0, ""), "{out}");
        assert!(
            out.starts_with(&format!("Written: {to}\n[terrain]\nkind = \"heightmap\"\nfile = \"{to}\"")),
            "{out}"
        );
        out
    };
    convert("isaac.npy", "a.npz", &OPTIONS);
    convert("s.toml", "b.npz", &[]);
    let first = ground("file = \"a.npz\"", folder.path());
    assert_eq!(first.report.holes_filled, 1);
    for name in ["b.npz", "c.npy", "c.asc", "c.png"] {
        let keys = if name == "b.npz" { String::new() } else { convert("a.npz", name, &[]) };
        // What was printed is what a scenario needs.
        let keys = keys.split_once("kind = \"heightmap\"\n").map_or("file = \"b.npz\"", |(_, keys)| keys);
        let again = ground(keys, folder.path());
        let tolerance = if name == "c.png" { 1e-6 } else { 1e-12 };
        for (a, b) in again.report.extent.iter().zip(first.report.extent) {
            assert!((a - b).abs() < 1e-12, "{name}");
        }
        for (a, b) in again.raw.unwrap().iter().zip(first.raw.as_ref().unwrap()) {
            assert!((a - b).abs() < tolerance, "{name}: {a}, {b}");
        }
        assert_eq!(again.report.holes_filled, 1, "{name}");
    }
    let (code, out, _) = warpgait(folder.path(), &["terrain", "convert", "a.npz", "d.png", "--json"]);
    let object: Value = serde_json::from_str(&out).unwrap();
    assert_eq!((code, object["terrain"]["spacing"].as_f64()), (0, Some(SPACING)));
    refused(
        folder.path(),
        &["terrain", "convert", "a.npz", "a.npz"],
        &["a.npz: cannot be written: it is a.npz, which this command reads"],
    );
    refused(folder.path(), &["terrain", "convert", "a.npz", "a.tif"], &["a.tif", ".npz, .npy, .asc or .png"]);
    fs::write(folder.path().join("none.npy"), floats(&[4, 4], &[f64::NAN; 16])).unwrap();
    refused(
        folder.path(),
        &["terrain", "convert", "none.npy", "n.npz", "--spacing=0.1"],
        &["none.npy", "without data"],
    );
}

#[test]
fn scenarios_of_formulas_are_shown_and_converted() {
    let folder = tempfile::tempdir().unwrap();
    fs::write(
        folder.path().join("f.toml"),
        "[terrain]\nkind = \"formula\"\nexpression = \"0.1*x\"\nspacing = 0.1\n[start]\nposition = [0, 0]\n[goal]\nposition = [1, 0]\n",
    )
    .unwrap();
    let (code, out, err) = warpgait(folder.path(), &["terrain", "show", "f.toml"]);
    assert_eq!((code, err.as_str()), (0, ""));
    assert!(
        out.contains("formula") && out.contains("Goal:      x = 1.000, y = 0.000, on ground at z = 0.100 m"),
        "{out}"
    );
    assert_eq!(warpgait(folder.path(), &["terrain", "convert", "f.toml", "f.npz"]).0, 0);
    let found = ground("file = \"f.npz\"", folder.path());
    assert!((found.field.height(1.0, 0.5) - 0.1).abs() < 1e-9);
}
