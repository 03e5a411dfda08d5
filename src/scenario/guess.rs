//! `[guess]`: a motion to start the solve from, and the file that holds it.
//!
//! A CSV has a row for each time and the columns that `warpgait export --to csv` writes; lines that begin with `#` are left out. An `.npz`
//! has the members of a plan.

use std::collections::HashMap;
use std::path::Path;

use schemars::JsonSchema;
use serde::{Deserialize, Serialize};

use crate::files;
use crate::files::npz::NpzReader;
use crate::{Error, Result};

/// Bytes of a CSV that is read.
const MOST_TEXT: u64 = 64 << 20;
/// By how much the norm of a quaternion may differ from one.
const UNIT: f64 = 0.01;
/// By how much of the horizon a file may be shorter or longer, at most. Otherwise it is the time between its last two frames.
const SPAN: f64 = 0.05;

/// `[guess]`.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize, JsonSchema)]
#[serde(deny_unknown_fields)]
pub struct GuessSpec {
    /// A motion of base and feet, relative to the scenario: a CSV with the columns of `warpgait export --to csv`, or a plan. Its gait
    /// should be that of the scenario.
    pub file: String,
}

/// A motion of base and feet at N times. World frame, SI units.
#[derive(Clone, Debug)]
pub struct GivenMotion {
    /// (N,) s, increasing, from 0.
    t: Vec<f64>,
    /// (N,) center of mass.
    base: Vec<[f64; 3]>,
    /// (N,) w, x, y, z, unit, neighbors with the same sign.
    quaternion: Vec<[f64; 4]>,
    /// `[foot][n]`: contact points.
    feet: Vec<Vec<[f64; 3]>>,
    /// `[foot][n]`, of the ground on the robot, if the file has them.
    forces: Option<Vec<Vec<[f64; 3]>>>,
}

impl GivenMotion {
    /// Reads a motion of a robot with these feet, which lasts as long as the horizon.
    ///
    /// # Errors
    /// For files that cannot be read, columns that are missing, other feet, values that are not finite, times that do not increase, and
    /// another duration.
    pub fn read(path: &Path, feet: &[&str], horizon: f64) -> Result<Self> {
        let is_csv = path.extension().is_some_and(|e| e.eq_ignore_ascii_case("csv"));
        let mut motion = if is_csv { from_csv(path, feet)? } else { from_npz(path, feet)? };
        let refuse = |what: String| Err(Error::input(format!("{}: {what}", path.display())));
        let n = motion.t.len();
        if n < 2 {
            return refuse(format!("has {n} frames; allowed: two or more"));
        }
        let first = motion.t[0];
        motion.t.iter_mut().for_each(|t| *t -= first);
        let (duration, last) = (motion.t[n - 1], motion.t[n - 1] - motion.t[n - 2]);
        if (duration - horizon).abs() > last.min(SPAN * horizon) + 1e-9 {
            let shown = (1e6 * duration).round() / 1e6;
            return refuse(format!(
                "lasts {shown} s, the motion {horizon} s; allowed: the same duration, such as with horizon = {shown}"
            ));
        }
        for k in 0..n {
            let q = motion.quaternion[k];
            let norm = q.iter().map(|v| v * v).sum::<f64>().sqrt();
            if (norm - 1.0).abs() > UNIT {
                return refuse(format!(
                    "at {} s the base's quaternion has a norm of {norm:.3}; allowed: 1",
                    motion.t[k]
                ));
            }
            let before = motion.quaternion[k.saturating_sub(1)];
            let sign = q.iter().zip(&before).map(|(a, b)| a * b).sum::<f64>().signum();
            motion.quaternion[k] = q.map(|v| sign * v / norm);
        }
        Ok(motion)
    }

    /// From samples at times that increase from 0, with unit quaternions of which neighbors have the same sign; feet and forces by foot.
    pub fn from_samples(
        t: Vec<f64>,
        base: Vec<[f64; 3]>,
        quaternion: Vec<[f64; 4]>,
        feet: Vec<Vec<[f64; 3]>>,
        forces: Vec<Vec<[f64; 3]>>,
    ) -> Self {
        Self { t, base, quaternion, feet, forces: Some(forces) }
    }

    /// Position and quaternion w, x, y, z (not unit) of the base at a time, linear between the frames.
    pub fn base(&self, t: f64) -> ([f64; 3], [f64; 4]) {
        (self.between(&self.base, t), self.between(&self.quaternion, t))
    }

    /// Where a foot is.
    pub fn foot(&self, foot: usize, t: f64) -> [f64; 3] {
        self.between(&self.feet[foot], t)
    }

    /// The force on a foot, N, if the file has forces.
    pub fn force(&self, foot: usize, t: f64) -> Option<[f64; 3]> {
        self.forces.as_ref().map(|forces| self.between(&forces[foot], t))
    }

    fn between<const D: usize>(&self, values: &[[f64; D]], t: f64) -> [f64; D] {
        let after = self.t.partition_point(|&at| at < t).clamp(1, self.t.len() - 1);
        let (before, [from, to]) = (after - 1, [after - 1, after].map(|k| self.t[k]));
        let part = ((t - from) / (to - from)).clamp(0.0, 1.0);
        std::array::from_fn(|d| values[before][d] * (1.0 - part) + values[after][d] * part)
    }
}

/// The columns of a CSV that are needed.
struct Table<'a> {
    file: String,
    header_line: usize,
    names: HashMap<&'a str, usize>,
    /// The line of each row, and its cells.
    rows: Vec<(usize, Vec<&'a str>)>,
}

impl<'a> Table<'a> {
    fn new(path: &Path, text: &'a str) -> Result<Self> {
        let file = path.display().to_string();
        // Spreadsheets begin a text with a byte order mark, and put cells in quotes.
        let text = text.strip_prefix('\u{feff}').unwrap_or(text);
        let unquoted = |cell: &'a str| {
            let cell = cell.trim();
            cell.strip_prefix('"').and_then(|rest| rest.strip_suffix('"')).map_or(cell, str::trim)
        };
        let cells = |line: &'a str| line.split(',').map(unquoted).collect::<Vec<_>>();
        let mut lines =
            (1..).zip(text.lines()).filter(|(_, line)| !line.trim().is_empty() && !line.starts_with('#'));
        let Some((header_line, header)) = lines.next() else {
            return Err(Error::input(format!("{file}: has no line with the names of columns")));
        };
        let mut names = HashMap::new();
        for (n, name) in cells(header).into_iter().enumerate() {
            if names.insert(name, n).is_some() {
                return Err(Error::input(format!(
                    "{file}:{header_line}: {name}: two columns have this name"
                )));
            }
        }
        let rows: Vec<_> = lines.map(|(line, text)| (line, cells(text))).collect();
        if let Some((line, row)) = rows.iter().find(|(_, row)| row.len() != names.len()) {
            let (found, expected) = (row.len(), names.len());
            return Err(Error::input(format!("{file}:{line}: has {found} values, expected {expected}")));
        }
        Ok(Self { file, header_line, names, rows })
    }

    fn has(&self, name: &str) -> bool {
        self.names.contains_key(name)
    }

    /// The numbers of the columns `name` and an ending each.
    fn columns<const D: usize>(&self, name: &str, endings: [&str; D]) -> Result<Vec<[f64; D]>> {
        let mut found = vec![[0.0; D]; self.rows.len()];
        for (d, ending) in endings.iter().enumerate() {
            let name = format!("{name}{ending}");
            let Some(&column) = self.names.get(&*name) else {
                let place = format!("{}:{}", self.file, self.header_line);
                return Err(Error::input(format!(
                    "{place}: {name}: there is no such column; needed are time, center_of_mass_x (or base_position_x), base_quaternion_w, LF_contact_position_x and so on"
                )));
            };
            for (value, (line, row)) in found.iter_mut().zip(&self.rows) {
                value[d] = row[column].parse().ok().filter(|v: &f64| v.is_finite()).ok_or_else(|| {
                    let given: String = row[column].chars().take(40).collect();
                    Error::input(format!(
                        "{}:{line}: {name}: given {given:?}, allowed: a finite number",
                        self.file
                    ))
                })?;
            }
        }
        Ok(found)
    }
}

const AXES: [&str; 3] = ["_x", "_y", "_z"];
/// Columns of a foot's place, the better one first.
const PLACES: [&str; 2] = ["_contact_position", "_foot_position"];

fn from_csv(path: &Path, feet: &[&str]) -> Result<GivenMotion> {
    let file = path.display();
    let text = String::from_utf8(files::read(path, MOST_TEXT)?)
        .map_err(|_| Error::input(format!("{file}: not a CSV: it is no text in UTF-8")))?;
    let table = Table::new(path, &text)?;
    let mut others: Vec<&str> = (table.names.keys())
        .filter_map(|name| PLACES.iter().find_map(|place| name.strip_suffix("_x")?.strip_suffix(place)))
        .filter(|foot| !feet.contains(foot))
        .collect();
    others.sort_unstable();
    if let Some(other) = others.first() {
        return Err(Error::input(format!(
            "{file}:{}: has a foot {other}; the feet of the robot are {}",
            table.header_line,
            feet.join(", ")
        )));
    }
    let t: Vec<f64> = table.columns("time", [""])?.into_iter().map(|[t]| t).collect();
    if let Some(k) = (1..t.len()).find(|&k| t[k] <= t[k - 1]) {
        let line = table.rows[k].0;
        return Err(Error::input(format!(
            "{file}:{line}: time: {} after {}; allowed: increasing times",
            t[k],
            t[k - 1]
        )));
    }
    let center = if table.has("center_of_mass_x") { "center_of_mass" } else { "base_position" };
    let of_feet =
        |what: &str| feet.iter().map(|foot| table.columns(&format!("{foot}{what}"), AXES)).collect();
    let place = PLACES.into_iter().find(|place| table.has(&format!("{}{place}_x", feet[0])));
    let has_forces = table.has(&format!("{}_force_x", feet[0]));
    Ok(GivenMotion {
        t,
        base: table.columns(center, AXES)?,
        quaternion: table.columns("base_quaternion", ["_w", "_x", "_y", "_z"])?,
        feet: of_feet(place.unwrap_or(PLACES[0]))?,
        forces: has_forces.then(|| of_feet("_force")).transpose()?,
    })
}

fn from_npz(path: &Path, feet: &[&str]) -> Result<GivenMotion> {
    let mut npz = NpzReader::open(path)?;
    let (_, t) = npz.finite_f64("t")?;
    let n = t.len();
    if let Some(k) = (1..n).find(|&k| t[k] <= t[k - 1]) {
        return Err(npz.error("t", format!("{} after {}; allowed: increasing times", t[k], t[k - 1])));
    }
    let (_, names) = npz.str("foot_names")?;
    let find = |foot: &&str| names.iter().position(|name| name == foot);
    let order = feet.iter().map(find).collect::<Option<Vec<_>>>().filter(|_| names.len() == feet.len());
    let Some(order) = order else {
        let what = format!("feet {}; the feet of the robot are {}", names.join(", "), feet.join(", "));
        return Err(npz.error("foot_names", what));
    };
    let of_feet = |npz: &mut NpzReader, member: &str| -> Result<Vec<Vec<[f64; 3]>>> {
        let all = npz.points::<3>(member, &[n, feet.len()])?;
        Ok(order.iter().map(|i| all.iter().skip(*i).step_by(feet.len()).copied().collect()).collect())
    };
    Ok(GivenMotion {
        t,
        base: npz.points("base_position", &[n])?,
        quaternion: npz.points("base_quaternion_wxyz", &[n])?,
        feet: of_feet(&mut npz, "foot_position")?,
        forces: npz.has("foot_force").then(|| of_feet(&mut npz, "foot_force")).transpose()?,
    })
}
