//! Every member of a plan is covered: spoiled in any way, it fails a law or is refused.

use std::io::{Read, Write};
use std::path::Path;

use serde_json::Value;

use crate::common::{lifting, solved, standing};
use warpgait::check::{LAWS, check};
use warpgait::files::npy::{Header, numbers};
use warpgait::plan::Plan;

/// Name without `.npy`, header, and the bytes of the elements.
type Member = (String, Header, Vec<u8>);

fn members(path: &Path) -> Vec<Member> {
    let mut archive = zip::ZipArchive::new(std::fs::File::open(path).unwrap()).unwrap();
    (0..archive.len())
        .map(|i| {
            let mut member = archive.by_index(i).unwrap();
            let mut bytes = Vec::new();
            member.read_to_end(&mut bytes).unwrap();
            let (header, elements) = Header::read(&bytes).unwrap();
            (member.name().trim_end_matches(".npy").to_owned(), header, elements.to_vec())
        })
        .collect()
}

fn write(path: &Path, members: &[Member]) {
    let options = zip::write::SimpleFileOptions::default().compression_method(zip::CompressionMethod::Stored);
    let mut out = zip::ZipWriter::new(std::fs::File::create(path).unwrap());
    for (name, header, elements) in members {
        out.start_file(format!("{name}.npy"), options).unwrap();
        out.write_all(&header.write().unwrap()).unwrap();
        out.write_all(elements).unwrap();
    }
    out.finish().unwrap();
}

/// What a reader or the check objects to; nothing if all is well.
fn objection(path: &Path) -> Option<String> {
    let report = match Plan::read(path).and_then(|plan| check(&plan)) {
        Ok(report) => report,
        Err(error) => return Some(error.to_string()),
    };
    let failed: Vec<&str> =
        report.rows.iter().filter(|row| !row.passed).map(|row| row.name.as_str()).collect();
    assert_eq!(report.passed, failed.is_empty());
    (!failed.is_empty()).then(|| failed.join(", "))
}

/// Swaps two blocks of bytes.
fn swap(bytes: &mut [u8], a: usize, b: usize, size: usize) {
    for k in 0..size {
        bytes.swap(a * size + k, b * size + k);
    }
}

/// All ways to spoil a member, with their names.
fn spoiled(header: &Header, bytes: &[u8]) -> Vec<(&'static str, Vec<u8>)> {
    let rows = header.shape.first().map_or(1, |&n| n as usize);
    let row = bytes.len() / rows.max(1);
    let reversed = bytes.chunks(row).rev().flatten().copied().collect();
    let mut swapped = bytes.to_vec();
    swap(&mut swapped, 0, rows / 2, row);
    let mut ways = vec![("reversed", reversed), ("rows swapped", swapped)];
    match header.dtype.as_str() {
        "<f8" => {
            let values = numbers("<f8", bytes).unwrap();
            let map = |f: &dyn Fn(f64) -> f64| values.iter().flat_map(|v| f(*v).to_le_bytes()).collect();
            let middle = (values.len() / 2..values.len()).find(|&i| !values[i].is_nan()).unwrap_or(0);
            let one = |value: f64| {
                let mut bytes = bytes.to_vec();
                bytes[8 * middle..8 * middle + 8].copy_from_slice(&value.to_le_bytes());
                bytes
            };
            ways.extend([
                ("times 1.5", map(&|v| 1.5 * v)),
                ("plus 1", map(&|v| v + 1.0)),
                ("zeros", map(&|v| if v.is_nan() { v } else { 0.0 })),
                ("one NaN", one(f64::NAN)),
                ("one infinite", one(f64::INFINITY)),
                ("one 1e308", one(1e308)),
                ("all 1e308", map(&|v| if v.is_nan() { v } else { 1e308 })),
            ]);
        }
        "|b1" => {
            ways.extend([
                ("inverted", bytes.iter().map(|b| 1 - b).collect()),
                ("all true", vec![1; bytes.len()]),
                ("all false", vec![0; bytes.len()]),
            ]);
        }
        _ => {}
    }
    // A way that changes nothing spoils nothing. The sign of a zero is no change either.
    let same = |new: &[u8]| {
        new == bytes
            || header.dtype == "<f8"
                && numbers("<f8", new)
                    .unwrap()
                    .iter()
                    .zip(numbers("<f8", bytes).unwrap())
                    .all(|(a, b)| *a == b)
    };
    ways.retain(|(_, new)| !same(new));
    ways
}

/// A walk over rubble, from a file of heights in `folder` that lacks some in a corner if it has a `hole`.
fn rubble(folder: &Path, formulation: &str, hole: bool, more: &str) -> String {
    let (rows, columns) = (80, 130);
    let heights = (0..rows * columns).flat_map(|i| {
        let (x, y) = (f64::from(i % columns) * 0.02, f64::from(i / columns) * 0.02);
        let known = if hole && x < 0.2 && y < 0.2 { f64::NAN } else { 0.0 };
        (known + 0.02 * (3.0 * x + 1.0).sin() * (3.0 * y).cos() + 0.1 * f64::from(u8::from(x > 1.6)))
            .to_le_bytes()
    });
    let header =
        Header { dtype: "<f8".into(), fortran_order: false, shape: vec![rows as u64, columns as u64] };
    let file = folder.join("rubble.npy");
    std::fs::write(&file, [header.write().unwrap(), heights.collect()].concat()).unwrap();
    format!(
        "formulation = \"{formulation}\"\nhorizon = 3.0\n[robot]\nname = \"anymal_towr\"\n[terrain]\nkind = \"heightmap\"\n\
         file = {file:?}\nspacing = 0.02\n[start]\nposition = [-0.4, 0.0]\n[goal]\nposition = [0.0, 0.05]\nyaw = 0.1\n{more}"
    )
}

/// A walk over ripples; in all formulations but the direct one with a map of few cells.
fn ripples(formulation: &str, more: &str) -> String {
    format!(
        "formulation = \"{formulation}\"\nhorizon = 3.0\n[robot]\nname = \"anymal_towr\"\nadhesive_feet = [\"LF\", \"RH\"]\n\
         [terrain]\nkind = \"rippled\"\nextent = [-1.0, 1.2, -0.8, 0.9]\nspacing = 0.02\n[map]\ncells = [10, 8, 6]\n\
         [start]\nposition = [-0.1, 0.0]\n[goal]\nposition = [0.3, 0.1]\n{more}"
    )
}

/// One that is passed, and one that is met at its time.
const WAYPOINTS: &str = "[[goal.waypoints]]\nposition = [0.0, 0.1]\n\
    [[goal.waypoints]]\nposition = [0.15, 0.1]\ntime = 1.5\nyaw = 0.2\nheight = 0.43\n";

/// What the motion takes place under.
const CONDITIONS: &str = "[posture]\nheight = [0.38, 0.46]\nroll = [-0.2, 0.2]\npitch = [-0.2, 0.2]\n\
    [payload]\nmass = 4.0\nposition = [0.05, 0.02, 0.1]\n\
    [[force]]\nvector = [20.0, -10.0, 0.0]\nfrom = 0.8\nuntil = 2.2\npoint = [0.1, 0.0, 0.1]\n\
    [[foothold]]\nfoot = \"LF\"\nstep = 1\nposition = [0.4, 0.28]\n\
    [[keep_out]]\npolygon = [[0.45, -0.2], [0.6, -0.3], [0.65, -0.1]]\n";

/// A foot in the middle of a step.
const IN_THE_AIR: &str = "[start.state]\nswings = [[0.1, 0.2], [0.0, 0.0], [0.0, 0.0], [0.0, 0.0]]\n\
    feet = [[0.26, 0.2, 0.04], [0.24, -0.19, 0.0], [-0.44, 0.19, 0.0], [-0.44, -0.19, 0.0]]\n\
    feet_velocity = [[0.4, 0.0, 0.1], [0.0, 0.0, 0.0], [0.0, 0.0, 0.0], [0.0, 0.0, 0.0]]\n";

/// A cycle up a slope.
const CYCLE: &str = "[robot]\nname = \"anymal_towr\"\n[terrain]\nkind = \"formula\"\nexpression = \"0.1*x\"\n\
    extent = [-1.0, 1.5, -1.0, 1.0]\nspacing = 0.05\n[start]\nposition = [0.0, 0.0]\n[goal]\nposition = [0.4, 0.0]\nspeed = 0.4\n\
    [gait]\nkind = \"trot\"\nduty = 0.6\nperiodic = true\n";

#[test]
fn every_member_is_covered_by_a_law() {
    let folder = tempfile::tempdir().unwrap();
    let (good, bad) = (folder.path().join("good.plan.npz"), folder.path().join("bad.plan.npz"));
    let mut reported = std::collections::BTreeSet::new();
    for text in [
        ripples("warped", "[contact]\nfriction_margin = 0.1\n"),
        ripples("hybrid", "[contact]\nmax_slope = 2.0\n"),
        ripples("direct", "[gait]\noptimize_durations = true\n"),
        rubble(folder.path(), "direct", false, ""),
        rubble(folder.path(), "hybrid", false, ""),
        ripples("hybrid", "[gait]\ncycle = 1.2\nduty = 0.75\n").replace("anymal_towr", "anymal_c"),
        ripples("direct", WAYPOINTS),
        ripples("hybrid", CONDITIONS).replace("[-0.1, 0.0]", "[-0.1, 0.0]\nyaw = 0.1"),
        ripples("hybrid", "[start.state]\nvelocity = [0.1, 0.0, 0.0]\nangular_velocity = [0.0, 0.0, 0.1]\n"),
        ripples("direct", IN_THE_AIR).replace("rippled", "flat").replace("spacing = 0.02\n", ""),
    ] {
        let (_, plan) = solved(&text);
        plan.write(&good).unwrap();
        assert_eq!(objection(&good), None, "{text}");
        let report = check(&plan).unwrap();
        reported.extend(report.rows.into_iter().chain(report.figures).map(|row| row.name));
        let members = members(&good);
        let mut unnoticed = Vec::new();
        for (i, (name, header, elements)) in members.iter().enumerate().filter(|(_, m)| m.0 != "meta") {
            for (way, bytes) in spoiled(header, elements) {
                let mut changed = members.clone();
                changed[i].2 = bytes;
                write(&bad, &changed);
                if objection(&bad).is_none() {
                    unnoticed.push(format!("{name}: {way}"));
                }
            }
        }
        assert!(unnoticed.is_empty(), "{text}\nnothing objects to {unnoticed:#?}");
    }
    // A plan cannot show whether what it calls unknown is unknown, so that member is not spoiled; its laws are there.
    let anywhere = "[contact]\nfootholds = \"anywhere\"\non_known_ground = false\n";
    for more in ["", anywhere] {
        let (_, plan) = solved(&rubble(folder.path(), "direct", true, more));
        let report = check(&plan).unwrap();
        assert!(plan.ground.unknown.is_some(), "{more}");
        reported.extend(report.rows.into_iter().chain(report.figures).map(|row| row.name));
    }
    // Slow cycles on a plane hardly change when they are spoiled; `cyclic.rs` spoils their ends.
    let cycle = check(&solved(CYCLE).1).unwrap();
    reported.extend(cycle.rows.into_iter().map(|row| row.name));
    // Together, these plans are judged by all laws.
    let unused: Vec<&str> =
        LAWS.iter().map(|law| law.name).filter(|name| !reported.contains(*name)).collect();
    assert_eq!(unused, [""; 0]);
}

/// Every number below a JSON value, as a path of keys.
fn numbers_in(value: &Value, at: &str, found: &mut Vec<String>) {
    match value {
        Value::Number(_) => found.push(at.to_owned()),
        Value::Object(map) => map.iter().for_each(|(key, v)| numbers_in(v, &format!("{at}/{key}"), found)),
        Value::Array(items) => {
            items.iter().enumerate().for_each(|(i, v)| numbers_in(v, &format!("{at}/{i}"), found));
        }
        _ => {}
    }
}

#[test]
fn what_meta_states_is_what_the_scenario_asks_for() {
    for robot in ["anymal_towr", "anymal_c"] {
        meta_states_what_the_scenario_asks_for(robot);
    }
}

fn meta_states_what_the_scenario_asks_for(robot: &str) {
    let (_, plan) =
        solved(&ripples("direct", "[gait]\ncycle = 1.2\nduty = 0.75\n").replace("anymal_towr", robot));
    let meta = serde_json::to_value(&plan.meta).unwrap();
    let mut keys = Vec::new();
    for part in ["robot", "limits", "sample_rate_hz", "schema"] {
        numbers_in(&meta[part], &format!("/{part}"), &mut keys);
    }
    keys.push("/solver/max_violation".into());
    assert!(keys.len() > 40 && keys.contains(&"/robot/reach/2/half_size/1".to_owned()), "{keys:?}");
    let objects = |change: &dyn Fn(&mut Value)| {
        let mut meta = meta.clone();
        change(&mut meta);
        let Ok(meta) = serde_json::from_value(meta) else { return true };
        let changed = Plan { meta, ..plan.clone() };
        check(&changed).map_or(true, |report| !report.passed)
    };
    assert!(!objects(&|_| {}));
    for key in keys {
        for factor in [1.5, 1e300, 0.0] {
            let change = |meta: &mut Value| {
                let number = meta.pointer_mut(&key).unwrap();
                *number = (number.as_f64().unwrap() * factor).into();
            };
            if meta.pointer(&key).unwrap().as_f64() != Some(0.0) {
                assert!(objects(&change), "nothing objects to {key} times {factor}");
            }
        }
    }
    assert!(objects(&|meta| meta["solver"]["success"] = false.into()));
    assert!(objects(&|meta| meta["robot"]["name"] = "anymal_b".into()));
    assert!(objects(&|meta| meta["formulation"] = "warped".into()));
}

#[test]
fn a_plan_is_judged_by_what_its_scenario_asks_for_and_says_where_it_differs() {
    let mut plan = standing();
    plan.meta.robot.friction = 1.5;
    plan.meta.robot.reach[1].half_size[0] = 1e9;
    let report = check(&plan).unwrap();
    let failed: Vec<&str> =
        report.rows.iter().filter(|row| !row.passed).map(|row| row.name.as_str()).collect();
    assert_eq!(failed, ["claims"]);
    assert_eq!(
        report.remarks[0],
        "meta.robot.friction is 1.5 where the scenario asks for 0.75, by which the plan is judged"
    );
    assert!(report.remarks[1].starts_with("meta.robot.reach[1] is [0.34,"), "{:?}", report.remarks);

    let squeeze = |plan: &mut Plan| {
        for n in 0..plan.t.len() {
            plan.foot_force[4 * n][1] += 60.0;
            plan.foot_force[4 * n + 1][1] -= 60.0;
        }
    };
    squeeze(&mut plan);
    let report = check(&plan).unwrap();
    assert!(report.rows.iter().any(|row| row.name == "friction" && !row.passed));
}

#[test]
fn a_plan_that_is_not_solved_does_not_pass() {
    let mut plan = lifting(0.08);
    plan.meta.solver.success = false;
    let report = check(&plan).unwrap();
    assert!(!report.passed);
    let failed: Vec<&str> =
        report.rows.iter().filter(|row| !row.passed).map(|row| row.name.as_str()).collect();
    assert_eq!(failed, ["solved"]);
}

#[test]
fn adhesive_feet_have_a_limit_of_shear() {
    // Half of the weight on two feet, which push against each other: the cone ends at 0.75 (0.25 + pull_limit) m g.
    let pushed = |tangential: f64| {
        let mut plan = standing();
        plan.foot_adhesive = vec![true, true, false, false];
        plan.meta.scenario = plan
            .meta
            .scenario
            .replace("name = \"anymal_towr\"", "name = \"anymal_towr\"\nadhesive_feet = [\"LF\", \"RF\"]")
            + "[motion]\npull_limit = 0.5\n";
        let weight = plan.meta.robot.mass * 9.81;
        for n in 0..plan.t.len() {
            plan.foot_force[4 * n][1] = tangential * weight;
            plan.foot_force[4 * n + 1][1] = -tangential * weight;
        }
        for (sign, foot) in [(1.0, "LF_force_nodes"), (-1.0, "RF_force_nodes")] {
            let (.., values) = plan.splines.iter_mut().find(|(name, ..)| name == foot).unwrap();
            values.chunks_mut(3).for_each(|force| force[1] = sign * tangential * weight);
        }
        let report = check(&plan).unwrap();
        report.rows.iter().filter(|row| !row.passed).map(|row| row.name.clone()).collect::<Vec<_>>()
    };
    assert_eq!(pushed(0.6 * 0.75), [""; 0]);
    assert_eq!(pushed(0.6 * 0.76), ["shear"]);
}

#[test]
fn arrays_in_fortran_order_are_read() {
    let folder = tempfile::tempdir().unwrap();
    let (good, other) = (folder.path().join("good.plan.npz"), folder.path().join("other.plan.npz"));
    let plan = lifting(0.08);
    plan.write(&good).unwrap();
    let mut members = members(&good);
    for (_, header, elements) in members.iter_mut().filter(|(_, header, _)| header.shape.len() > 1) {
        let shape: Vec<usize> = header.shape.iter().map(|&n| n as usize).collect();
        let count = shape.iter().product::<usize>();
        let width = elements.len() / count.max(1);
        let mut columns = vec![0; elements.len()];
        for flat in 0..count {
            // The indices, the last one fastest, and where the first one is fastest.
            let (mut rest, mut stride, mut place) = (flat, count, 0);
            for &n in shape.iter().rev() {
                stride /= n;
                place += (rest % n) * stride;
                rest /= n;
            }
            columns[place * width..][..width].copy_from_slice(&elements[flat * width..][..width]);
        }
        (header.fortran_order, *elements) = (true, columns);
    }
    write(&other, &members);
    let read = Plan::read(&other).unwrap();
    assert!(format!("{read:?}") == format!("{plan:?}"), "the arrays differ");
}
