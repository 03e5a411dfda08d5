//! `start.plan`: a motion that goes on where another plan is left. What is read of that plan becomes `start.position`, `start.yaw` and
//! `start.state`, so that the new plan needs nothing but itself.

use std::path::Path;

use crate::digest::sha256_hex;
use crate::files;
use crate::files::npz::NpzReader;
use crate::input::Document;
use crate::robot::Robot;
use crate::visible::visible;
use crate::{Error, Result};

/// The plan that a motion goes on from.
pub(super) struct Before {
    /// Its name in the scenario and its SHA-256.
    pub input: (String, String),
    robot: String,
    mass: f64,
    feet: Vec<String>,
}

/// Masses of one robot may differ by this fraction.
const SAME_MASS: f64 = 1e-9;

impl Before {
    fn read(npz: &mut NpzReader, input: (String, String)) -> Result<Self> {
        let (_, feet) = npz.str("foot_names")?;
        let (_, meta) = npz.str("meta")?;
        let text = meta.first().map_or("", String::as_str);
        let meta: serde_json::Value =
            serde_json::from_str(text).map_err(|e| npz.error("meta", format!("not a JSON object: {e}")))?;
        let robot = &meta["robot"];
        match (robot["name"].as_str(), robot["mass"].as_f64()) {
            (Some(name), Some(mass)) => Ok(Self { input, robot: name.to_owned(), mass, feet }),
            _ => Err(npz.error("meta", "has no robot.name and robot.mass")),
        }
    }

    /// Refuses a plan for another robot than this one, payload included.
    pub fn ensure_robot(&self, document: &Document, robot: &Robot) -> Result<()> {
        let key = if document.has("robot.file") { "robot.file" } else { "robot.name" };
        let (place, theirs) = (document.place(key), visible(&self.robot));
        let what = if self.robot != robot.name {
            format!("a plan for the robot {theirs}, but here it is {} ({place})", robot.name)
        } else if self.feet != robot.foot_names() {
            let names = robot.foot_names().join(", ");
            format!(
                "a plan for {theirs} with the feet {}, but here they are {names} ({place})",
                self.feet.iter().map(|name| visible(name)).collect::<Vec<_>>().join(", ")
            )
        } else if (self.mass - robot.mass).abs() > SAME_MASS * robot.mass {
            format!(
                "a plan for {theirs} of {} kg, but here it has {} kg ({place}{})",
                self.mass,
                robot.mass,
                if document.has("payload") {
                    format!("; {}", document.place("payload.mass"))
                } else {
                    String::new()
                }
            )
        } else {
            return Ok(());
        };
        let what = format!(
            "given \"{}\", {what}; allowed: a plan for the same robot with the same payload",
            self.input.0
        );
        Err(document.error("start.plan", what))
    }
}

/// Reads what `start.plan` names, if anything, and sets the keys that follow.
///
/// # Errors
/// For a plan that cannot be read, and for keys that it would set.
pub(super) fn expand(document: &mut Document, base_dir: &Path) -> Result<Option<Before>> {
    let start = document.table().get("start").and_then(toml::Value::as_table);
    let Some(name) = start.and_then(|start| start.get("plan")).and_then(toml::Value::as_str) else {
        if document.has("start.time") {
            return Err(document.error(
                "start.time",
                "given without start.plan, the plan that is left at that time; remove it",
            ));
        }
        return Ok(None);
    };
    let name = name.to_owned();
    for key in ["start.position", "start.yaw", "start.state"] {
        if document.has(key) {
            let what = format!(
                "given together with start.plan ({}), which sets it; remove one of them",
                document.place("start.plan")
            );
            return Err(document.error(key, what));
        }
    }
    let time = start.and_then(|start| start.get("time"));
    if let Some(given) = time.filter(|time| number(time).is_none()) {
        return Err(document.error("start.time", format!("given {given}, allowed: a number of seconds")));
    }
    let time = time.and_then(number);
    let path = base_dir.join(&name);
    let located = |e: Error| document.error("start.plan", e);
    let digest = sha256_hex(files::read(&path, files::MAX_FILE).map_err(located)?);
    let mut npz = NpzReader::open(&path).map_err(located)?;
    let before = Before::read(&mut npz, (name, digest)).map_err(located)?;
    let keys = keys(&mut npz, time).map_err(|(key, e)| document.error(key, e))?;
    for assignment in keys {
        document.derive(&assignment, Some("start.plan"))?;
    }
    document.remove("start", "plan");
    document.remove("start", "time");
    Ok(Some(before))
}

/// An integer or a float.
fn number(value: &toml::Value) -> Option<f64> {
    value.as_float().or_else(|| value.as_integer().map(|n| n as f64))
}

/// The place of the base is rounded to so many parts of a meter.
const ROUNDING: f64 = 1e12;

/// `key=value` for each key that the plan sets; on failure, the key that is to blame.
fn keys(npz: &mut NpzReader, time: Option<f64>) -> std::result::Result<Vec<String>, (&'static str, Error)> {
    let plan = |e: Error| ("start.plan", e);
    let (_, t) = npz.finite_f64("t").map_err(plan)?;
    let (n, last) = (t.len(), t.last().copied().unwrap_or(0.0));
    if n < 2 || last <= 0.0 {
        return Err(plan(npz.error("t", "has no samples")));
    }
    let time = time.unwrap_or(last);
    if !(0.0..=last + 1e-9).contains(&time) {
        let what = Error::input(format!("given {time} s, allowed: 0 to {last} s, the end of that plan"));
        return Err(("start.time", what));
    }
    let k = ((time / last * (n - 1) as f64).round() as usize).min(n - 1);
    let mut at = |member: &str| -> std::result::Result<[f64; 3], (&'static str, Error)> {
        Ok(npz.points::<3>(member, &[n]).map_err(plan)?[k])
    };
    let [x, y, z] = at("base_position")?;
    let velocity = at("base_linear_velocity")?;
    let acceleration = at("base_linear_acceleration")?;
    let angular_velocity = at("base_angular_velocity")?;
    let angular_acceleration = at("base_angular_acceleration")?;
    let quaternion = npz.points::<4>("base_quaternion_wxyz", &[n]).map_err(plan)?[k];
    let (_, names) = npz.str("foot_names").map_err(plan)?;
    let e = names.len();
    let contact = npz.bool("foot_contact", &[n, e]).map_err(plan)?;
    let all_stand = |k: &usize| (0..e).all(|foot| contact[k * e + foot]);
    let stands = all_stand(&k);
    if !stands && npz.has("angular_momentum") {
        // Accelerations and forces that follow from moving legs with mass are not those of a motion with massless ones.
        let near = (0..n).filter(all_stand).min_by_key(|other| other.abs_diff(k)).map_or(0.0, |k| t[k]);
        let what = Error::input(format!(
            "at {time} s a foot is in the air, and the legs of that plan have mass, which those of a motion that starts moving have not; allowed: a time when all feet stand, such as {near} s, or a plan with physics.legs = \"massless\""
        ));
        return Err(("start.time", what));
    }
    let mut of_feet = |member: &str| -> std::result::Result<Vec<[f64; 3]>, (&'static str, Error)> {
        Ok(npz.points::<3>(member, &[n, e]).map_err(plan)?[k * e..][..e].to_vec())
    };
    let (feet, forces) = (of_feet("foot_position")?, of_feet("foot_force")?);
    let velocities = of_feet("foot_velocity")?;
    let in_air = if stands {
        Vec::new()
    } else {
        let swings = swings(npz, e, t[k]).map_err(plan)?;
        // As the samples have it, where a switch is near.
        let of_foot = |foot: usize| if contact[k * e + foot] { [0.0; 2] } else { swings[foot] };
        let swings: Vec<[f64; 2]> = (0..e).map(of_foot).collect();
        // Of feet in the air alone.
        let of_foot = |foot: usize| if contact[k * e + foot] { [0.0; 3] } else { velocities[foot] };
        let velocities: Vec<[f64; 3]> = (0..e).map(of_foot).collect();
        vec![format!("start.state.swings={swings:?}"), format!("start.state.feet_velocity={velocities:?}")]
    };
    let [roll, pitch, yaw] = angles(quaternion);
    // Readable in messages: without rounding errors around zero.
    let [x, y] = [x, y].map(|v| (v * ROUNDING).round() / ROUNDING + 0.0);
    let standing = vec![
        format!("start.position=[{x:?}, {y:?}]"),
        format!("start.yaw={yaw:?}"),
        format!("start.state.height={z:?}"),
        format!("start.state.tilt=[{roll:?}, {pitch:?}]"),
        format!("start.state.velocity={velocity:?}"),
        format!("start.state.angular_velocity={angular_velocity:?}"),
        format!("start.state.acceleration={acceleration:?}"),
        format!("start.state.angular_acceleration={angular_acceleration:?}"),
        format!("start.state.feet={feet:?}"),
        format!("start.state.forces={forces:?}"),
    ];
    Ok(standing.into_iter().chain(in_air).collect())
}

/// For how long each foot has been in the air at a time and when it lands after it, s; zeros for one that stands.
fn swings(npz: &mut NpzReader, feet: usize, time: f64) -> Result<Vec<[f64; 2]>> {
    let (shape, durations) = npz.any_f64("phase_durations")?;
    let &[rows, columns] = &shape[..] else {
        return Err(npz.error("phase_durations", format!("shape {shape:?}, expected ({feet}, P)")));
    };
    if rows != feet || columns == 0 {
        return Err(npz.error("phase_durations", format!("shape {shape:?}, expected ({feet}, P)")));
    }
    let beyond =
        if npz.has("swing_beyond") { npz.f64("swing_beyond", &[feet, 2])? } else { vec![0.0; 2 * feet] };
    let of_foot = |(row, beyond): (&[f64], &[f64; 2])| {
        let row = &row[..row.iter().position(|d| d.is_nan()).unwrap_or(columns)];
        let mut start = 0.0;
        for (i, duration) in row.iter().enumerate() {
            let end = start + duration;
            // Whole swings, also over the ends.
            let before = if i == 1 { beyond[0] } else { 0.0 };
            let after = if i + 2 == row.len() { beyond[1] } else { 0.0 };
            if i % 2 == 1 && (start..=end).contains(&time) {
                return [time - start + before, end - time + after];
            }
            start = end;
        }
        [0.0; 2]
    };
    Ok(durations.chunks(columns).zip(beyond.as_chunks::<2>().0).map(of_foot).collect())
}

/// Roll, pitch and yaw of a unit quaternion w, x, y, z: R = Rz(yaw) Ry(pitch) Rx(roll).
fn angles([w, x, y, z]: [f64; 4]) -> [f64; 3] {
    [
        (2.0 * (w * x + y * z)).atan2(1.0 - 2.0 * (x * x + y * y)),
        (2.0 * (w * y - z * x)).clamp(-1.0, 1.0).asin(),
        (2.0 * (w * z + x * y)).atan2(1.0 - 2.0 * (y * y + z * z)),
    ]
}
