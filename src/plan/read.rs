//! Reading a plan.

use std::path::Path;

use super::{GroundGrid, JointSamples, LegSamples, Meta, NamedArray, Plan, WarpedBase, WarpedSamples};
use crate::Result;
use crate::files::npz::NpzReader;
use crate::robot::is_name;
use crate::warp::MapGrid;

/// Relative rounding errors of a rectangle's corners; also its least side, m.
const RECTANGLE_SLACK: f64 = 1e-6;

/// The newest plan that this reader knows.
pub const PLAN_SCHEMA: u32 = 1;

impl Plan {
    /// Reads `NAME.plan.npz`. Refuses, with the file's and the member's name and what is wrong: a missing member, a
    /// wrong shape or dtype, a value that is not finite, a newer schema, a file cut short.
    pub fn read(path: &Path) -> Result<Self> {
        let mut npz = NpzReader::open(path)?;
        // First, so that a newer schema is refused as such and not for what it changed.
        let meta = read_meta(&mut npz)?;

        let (shape, t) = npz.finite_f64("t")?;
        let n = t.len();
        if shape.len() != 1 || n < 2 {
            return Err(npz.error("t", format!("shape {shape:?}, expected (N,) with N of at least 2")));
        }
        let (shape, foot_names) = npz.str("foot_names")?;
        let e = foot_names.len();
        if shape.len() != 1 || e == 0 {
            return Err(
                npz.error("foot_names", format!("shape {shape:?}, expected (E,) with at least one foot"))
            );
        }
        if meta.robot.reach.len() != e {
            let reach = meta.robot.reach.len();
            return Err(
                npz.error("meta", format!("robot.reach has {reach} boxes for the {e} feet of foot_names"))
            );
        }

        let warped = read_warped(&mut npz, n, e)?;
        let legs = read_legs(&mut npz, n, e)?;

        let (shape, history_objective) = npz.finite_f64("history_objective")?;
        let iterations = history_objective.len();
        if shape.len() != 1 {
            return Err(npz.error("history_objective", format!("shape {shape:?}, expected (iterations,)")));
        }

        Ok(Self {
            base_position: npz.points("base_position", &[n])?,
            base_quaternion_wxyz: npz.points("base_quaternion_wxyz", &[n])?,
            base_linear_velocity: npz.points("base_linear_velocity", &[n])?,
            base_linear_acceleration: npz.points("base_linear_acceleration", &[n])?,
            base_angular_velocity: npz.points("base_angular_velocity", &[n])?,
            base_angular_acceleration: npz.points("base_angular_acceleration", &[n])?,
            foot_position: npz.points("foot_position", &[n, e])?,
            foot_velocity: npz.points("foot_velocity", &[n, e])?,
            foot_acceleration: npz.points("foot_acceleration", &[n, e])?,
            foot_force: npz.points("foot_force", &[n, e])?,
            foot_contact: npz.bool("foot_contact", &[n, e])?,
            foot_normal: npz.points("foot_normal", &[n, e])?,
            foot_adhesive: npz.bool("foot_adhesive", &[e])?,
            warped,
            legs,
            phase_durations: read_phases(&mut npz, e)?,
            swing_beyond: read_beyond(&mut npz, e)?,
            splines: read_splines(&mut npz)?,
            ground: read_ground(&mut npz)?,
            patches: read_patches(&mut npz, e)?,
            map: if npz.has("map_control_points") { Some(read_map(&mut npz)?) } else { None },
            history_objective,
            history_constraint_violation: npz.f64("history_constraint_violation", &[iterations])?,
            history_seconds: npz.f64("history_seconds", &[iterations])?,
            t,
            foot_names,
            meta,
        })
    }
}

fn read_meta(npz: &mut NpzReader) -> Result<Meta> {
    let (shape, text) = npz.str("meta")?;
    if !shape.is_empty() {
        return Err(npz.error("meta", format!("shape {shape:?}, expected () (one string)")));
    }
    let value: serde_json::Value =
        serde_json::from_str(&text[0]).map_err(|e| npz.error("meta", format!("not a JSON object: {e}")))?;
    match value.get("schema").and_then(serde_json::Value::as_u64) {
        Some(schema) if schema == u64::from(PLAN_SCHEMA) => {}
        Some(schema) if schema > u64::from(PLAN_SCHEMA) => {
            let what = format!(
                "schema {schema} is newer than {PLAN_SCHEMA}, the newest known here; update warpgait"
            );
            return Err(npz.error("meta", what));
        }
        _ => {
            let given = value.get("schema").map_or("nothing".into(), |v| v.to_string());
            return Err(npz.error("meta", format!("schema is {given}, expected {PLAN_SCHEMA}")));
        }
    }
    let meta: Meta = serde_json::from_value(value).map_err(|e| npz.error("meta", e))?;
    if !is_name(&meta.robot.name) {
        return Err(
            npz.error("meta", format!("robot.name is {:?}, expected a name, not a path", meta.robot.name))
        );
    }
    Ok(meta)
}

/// (E, 2), zero in plans that have none.
fn read_beyond(npz: &mut NpzReader, feet: usize) -> Result<Vec<[f64; 2]>> {
    let name = "swing_beyond";
    if !npz.has(name) {
        return Ok(vec![[0.0; 2]; feet]);
    }
    let values = npz.f64(name, &[feet, 2])?;
    if let Some(at) = values.iter().position(|v| !v.is_finite() || *v < 0.0) {
        let what = format!("{} at [{}, {}], expected a duration in s", values[at], at / 2, at % 2);
        return Err(npz.error(name, what));
    }
    Ok(values.as_chunks::<2>().0.to_vec())
}

/// (E, P), padded with NaN at the end of each row.
fn read_phases(npz: &mut NpzReader, feet: usize) -> Result<Vec<Vec<f64>>> {
    let name = "phase_durations";
    let (shape, values) = npz.any_f64(name)?;
    let &[rows, columns] = &shape[..] else {
        return Err(npz.error(name, format!("shape {shape:?}, expected ({feet}, P)")));
    };
    if rows != feet {
        return Err(npz.error(name, format!("shape ({rows}, {columns}), expected ({feet}, P)")));
    }
    let mut phases = Vec::with_capacity(rows);
    for foot in 0..rows {
        let row = &values[foot * columns..(foot + 1) * columns];
        let used = row.iter().position(|v| v.is_nan()).unwrap_or(columns);
        if row[used..].iter().any(|v| !v.is_nan()) {
            return Err(npz.error(name, format!("NaN at [{foot}, {used}] before the end of the row")));
        }
        if let Some(at) = row[..used].iter().position(|v| !v.is_finite() || *v < 0.0) {
            return Err(npz.error(name, format!("{} at [{foot}, {at}], expected a duration in s", row[at])));
        }
        phases.push(row[..used].to_vec());
    }
    Ok(phases)
}

/// Whether four corners, in order, are those of a rectangle as seen from above, and lie on a plane that is not vertical.
fn is_rectangle([a, b, c, d]: &[[f64; 3]; 4]) -> bool {
    let side = |to: &[f64; 3]| -> [f64; 3] { std::array::from_fn(|k| to[k] - a[k]) };
    let (u, v) = (side(b), side(d));
    let lengths = [u[0].hypot(u[1]), v[0].hypot(v[1])];
    let slack = RECTANGLE_SLACK * (lengths[0] + lengths[1]);
    let closes = (0..3).all(|k| (a[k] + u[k] + v[k] - c[k]).abs() <= slack);
    let square = (u[0] * v[0] + u[1] * v[1]).abs() <= RECTANGLE_SLACK * lengths[0] * lengths[1];
    closes && square && lengths.iter().all(|length| *length > RECTANGLE_SLACK && length.is_finite())
}

/// (E, S, 4, 3), padded with NaN at the end of each foot's stances.
fn read_patches(npz: &mut NpzReader, feet: usize) -> Result<Vec<Vec<[[f64; 3]; 4]>>> {
    let name = "patch_corners";
    if !npz.has(name) {
        return Ok(Vec::new());
    }
    let (shape, values) = npz.any_f64(name)?;
    let &[rows, stances, 4, 3] = &shape[..] else {
        return Err(npz.error(name, format!("shape {shape:?}, expected ({feet}, S, 4, 3)")));
    };
    if rows != feet {
        return Err(npz.error(name, format!("shape {shape:?}, expected ({feet}, S, 4, 3)")));
    }
    let corners = values.as_chunks::<3>().0.as_chunks::<4>().0;
    let mut patches = Vec::with_capacity(feet);
    for foot in 0..feet {
        let row = &corners[foot * stances..(foot + 1) * stances];
        let used = row.iter().position(|p| p.iter().flatten().all(|v| v.is_nan())).unwrap_or(stances);
        let bad = |at: usize, expected: fn(&f64) -> bool| !row[at].iter().flatten().all(expected);
        if let Some(at) = (0..used).find(|&at| bad(at, |v| v.is_finite())) {
            return Err(npz.error(name, format!("[{foot}, {at}] has a value that is not finite")));
        }
        if let Some(at) = (used..stances).find(|&at| bad(at, |v| v.is_nan())) {
            return Err(npz.error(name, format!("[{foot}, {at}] follows a stance without a patch")));
        }
        if let Some(at) = row[..used].iter().position(|corners| !is_rectangle(corners)) {
            let what =
                format!("[{foot}, {at}] is not a rectangle of a plane, seen from above, in order around it");
            return Err(npz.error(name, what));
        }
        patches.push(row[..used].to_vec());
    }
    Ok(patches)
}

fn read_splines(npz: &mut NpzReader) -> Result<Vec<NamedArray>> {
    let members: Vec<String> = npz.names().into_iter().filter(|name| name.starts_with("spline/")).collect();
    members
        .into_iter()
        .map(|member| {
            let (shape, values) = npz.finite_f64(&member)?;
            Ok((member["spline/".len()..].to_owned(), shape, values))
        })
        .collect()
}

fn read_ground(npz: &mut NpzReader) -> Result<GroundGrid> {
    let (shape, height) = npz.finite_f64("heightfield")?;
    let &[rows, columns] = &shape[..] else {
        return Err(npz.error("heightfield", format!("shape {shape:?}, expected (rows, columns)")));
    };
    if rows < 2 || columns < 2 {
        return Err(npz.error("heightfield", format!("shape ({rows}, {columns}), expected at least (2, 2)")));
    }
    let origin = npz.f64("heightfield_origin", &[2])?;
    let spacing = npz.f64("heightfield_spacing", &[2])?;
    if spacing.iter().any(|&s| s <= 0.0) {
        return Err(npz.error("heightfield_spacing", format!("{spacing:?}, expected lengths above 0 m")));
    }
    let raw =
        if npz.has("heightfield_raw") { Some(npz.f64("heightfield_raw", &[rows, columns])?) } else { None };
    let unknown = if npz.has("heightfield_unknown") {
        Some(npz.bool("heightfield_unknown", &[rows, columns])?)
    } else {
        None
    };
    Ok(GroundGrid {
        rows,
        columns,
        origin: [origin[0], origin[1]],
        spacing: [spacing[0], spacing[1]],
        height,
        raw,
        unknown,
    })
}

/// The warped samples, if there are any; those of the base are absent where it was planned in ambient space.
fn read_warped(npz: &mut NpzReader, n: usize, e: usize) -> Result<Option<WarpedSamples>> {
    let of_base = ["warped_base_position", "warped_base_euler"].iter().any(|name| npz.has(name));
    let of_feet = ["warped_foot_position", "warped_foot_force"].iter().any(|name| npz.has(name));
    if !(of_base || of_feet) {
        return Ok(None);
    }
    let base = if of_base {
        Some(WarpedBase {
            position: npz.points("warped_base_position", &[n])?,
            euler: npz.points("warped_base_euler", &[n])?,
        })
    } else {
        None
    };
    Ok(Some(WarpedSamples {
        base,
        foot_position: npz.points("warped_foot_position", &[n, e])?,
        foot_force: npz.points("warped_foot_force", &[n, e])?,
    }))
}

/// What follows from the legs' mass, if they have one.
fn read_legs(npz: &mut NpzReader, n: usize, e: usize) -> Result<Option<LegSamples>> {
    if !["center_of_mass_shift", "angular_momentum"].iter().any(|name| npz.has(name)) {
        return Ok(None);
    }
    let joints = if ["joint_position", "joint_torque"].iter().any(|name| npz.has(name)) {
        let (shape, position) = npz.finite_f64("joint_position")?;
        let joints = shape.last().copied().unwrap_or(0);
        if shape != [n, e, joints] {
            return Err(npz.error("joint_position", format!("shape {shape:?}, expected ({n}, {e}, J)")));
        }
        Some(JointSamples { joints, position, torque: npz.f64("joint_torque", &[n, e, joints])? })
    } else {
        None
    };
    Ok(Some(LegSamples {
        shift: npz.points("center_of_mass_shift", &[n])?,
        angular_momentum: npz.points("angular_momentum", &[n])?,
        joints,
    }))
}

fn read_map(npz: &mut NpzReader) -> Result<MapGrid> {
    let (shape, values) = npz.finite_f64("map_control_points")?;
    let &[nx, ny, nz, 3] = &shape[..] else {
        return Err(
            npz.error("map_control_points", format!("shape {shape:?}, expected (Nx+3, Ny+3, Nz+3, 3)"))
        );
    };
    let origin = npz.f64("map_origin", &[3])?;
    let mut knots: [Vec<f64>; 3] = Default::default();
    for (axis, knots) in ["x", "y", "z"].iter().zip(&mut knots) {
        let name = format!("map_knots_{axis}");
        let (shape, values) = npz.finite_f64(&name)?;
        if shape.len() != 1 || values.windows(2).any(|pair| pair[1] < pair[0]) {
            return Err(npz.error(&name, "expected one row of knots that never decrease"));
        }
        *knots = values;
    }
    Ok(MapGrid {
        shape: [nx, ny, nz],
        control_points: values.as_chunks::<3>().0.to_vec(),
        origin: [origin[0], origin[1], origin[2]],
        knots,
    })
}
