//! Writing a plan.

use std::path::Path;

use super::Plan;
use crate::files::npz::NpzWriter;
use crate::warp::MapGrid;
use crate::{Error, Result};

impl Plan {
    /// Writes `NAME.plan.npz`: to a temporary file beside the target, which is then renamed.
    ///
    /// Fails when the file cannot be written, and when the plan itself is unsound: an array of the wrong length or a
    /// value that is not finite, which [`Plan::read`] would refuse.
    pub fn write(&self, path: &Path) -> Result<()> {
        self.ensure_sound()?;
        let (n, e) = (self.t.len(), self.foot_names.len());
        let mut npz = NpzWriter::create(path)?;

        npz.add_f64("t", &[n], self.t.iter().copied())?;
        npz.add_points("base_quaternion_wxyz", &[n], &self.base_quaternion_wxyz)?;
        for (name, values) in self.base_members() {
            npz.add_points(name, &[n], values)?;
        }
        for (name, values) in self.foot_members() {
            npz.add_points(name, &[n, e], values)?;
        }
        npz.add_bool("foot_contact", &[n, e], &self.foot_contact)?;
        npz.add_str("foot_names", &[e], &self.foot_names)?;
        npz.add_bool("foot_adhesive", &[e], &self.foot_adhesive)?;

        for (name, values) in self.leg_members() {
            npz.add_points(name, &[n], values)?;
        }
        for (name, joints, values) in self.joint_members() {
            npz.add_f64(name, &[n, e, joints], values.iter().copied())?;
        }
        if let Some(warped) = &self.warped {
            if let Some(base) = &warped.base {
                npz.add_points("warped_base_position", &[n], &base.position)?;
                npz.add_points("warped_base_euler", &[n], &base.euler)?;
            }
            npz.add_points("warped_foot_position", &[n, e], &warped.foot_position)?;
            npz.add_points("warped_foot_force", &[n, e], &warped.foot_force)?;
        }

        let phases = self.phase_durations.iter().map(Vec::len).max().unwrap_or(0);
        let padded = self.phase_durations.iter().flat_map(|durations| {
            durations.iter().copied().chain(std::iter::repeat_n(f64::NAN, phases - durations.len()))
        });
        npz.add_f64("phase_durations", &[e, phases], padded)?;
        if self.swing_beyond.iter().flatten().any(|beyond| *beyond > 0.0) {
            npz.add_f64("swing_beyond", &[e, 2], self.swing_beyond.iter().flatten().copied())?;
        }
        for (name, shape, values) in &self.splines {
            npz.add_f64(&format!("spline/{name}"), shape, values.iter().copied())?;
        }

        let ground = &self.ground;
        let shape = [ground.rows, ground.columns];
        npz.add_f64("heightfield", &shape, ground.height.iter().copied())?;
        npz.add_f64("heightfield_origin", &[2], ground.origin)?;
        npz.add_f64("heightfield_spacing", &[2], ground.spacing)?;
        if let Some(raw) = &ground.raw {
            npz.add_f64("heightfield_raw", &shape, raw.iter().copied())?;
        }
        if let Some(unknown) = &ground.unknown {
            npz.add_bool("heightfield_unknown", &shape, unknown)?;
        }
        if !self.patches.is_empty() {
            let stances = self.patches.iter().map(Vec::len).max().unwrap_or(0);
            let padded = self.patches.iter().flat_map(|patches| {
                let rest = std::iter::repeat_n(&[[f64::NAN; 3]; 4], stances - patches.len());
                patches.iter().chain(rest).flatten().flatten().copied()
            });
            npz.add_f64("patch_corners", &[e, stances, 4, 3], padded)?;
        }
        if let Some(map) = &self.map {
            npz.add_map(map)?;
        }

        for (name, values) in self.history_members() {
            npz.add_f64(name, &[values.len()], values.iter().copied())?;
        }
        let meta = serde_json::to_string(&self.meta).map_err(|e| Error::Internal(format!("meta: {e}")))?;
        npz.add_str("meta", &[], &[meta])?;
        npz.finish()
    }

    /// The arrays of shape (N, 3), by member name.
    fn base_members(&self) -> [(&'static str, &Vec<[f64; 3]>); 5] {
        [
            ("base_position", &self.base_position),
            ("base_linear_velocity", &self.base_linear_velocity),
            ("base_linear_acceleration", &self.base_linear_acceleration),
            ("base_angular_velocity", &self.base_angular_velocity),
            ("base_angular_acceleration", &self.base_angular_acceleration),
        ]
    }

    /// The arrays of shape (N, E, 3), by member name.
    fn foot_members(&self) -> [(&'static str, &Vec<[f64; 3]>); 5] {
        [
            ("foot_position", &self.foot_position),
            ("foot_velocity", &self.foot_velocity),
            ("foot_acceleration", &self.foot_acceleration),
            ("foot_force", &self.foot_force),
            ("foot_normal", &self.foot_normal),
        ]
    }

    /// The arrays of shape (N, 3) that follow from the legs' mass, by member name.
    fn leg_members(&self) -> impl Iterator<Item = (&'static str, &Vec<[f64; 3]>)> {
        self.legs.iter().flat_map(|legs| {
            [("center_of_mass_shift", &legs.shift), ("angular_momentum", &legs.angular_momentum)]
        })
    }

    /// The arrays of shape (N, E, J) of the joints, by member name, with J.
    fn joint_members(&self) -> impl Iterator<Item = (&'static str, usize, &Vec<f64>)> {
        self.legs.iter().filter_map(|legs| legs.joints.as_ref()).flat_map(|joints| {
            [("joint_position", &joints.position), ("joint_torque", &joints.torque)]
                .map(|(name, values)| (name, joints.joints, values))
        })
    }

    /// The solver's history, by member name.
    fn history_members(&self) -> [(&'static str, &Vec<f64>); 3] {
        [
            ("history_objective", &self.history_objective),
            ("history_constraint_violation", &self.history_constraint_violation),
            ("history_seconds", &self.history_seconds),
        ]
    }

    /// Refuses arrays of the wrong length and values that are not finite: the reader would refuse them, so it is better to fail
    /// before the file exists.
    pub(crate) fn ensure_sound(&self) -> Result<()> {
        let (n, e) = (self.t.len(), self.foot_names.len());
        let base = self.base_members().map(|(name, values)| (name, n, values));
        let feet = self.foot_members().map(|(name, values)| (name, n * e, values));
        let legs = self.leg_members().map(|(name, values)| (name, n, values));
        for (name, length, values) in base.into_iter().chain(feet).chain(legs) {
            ensure(name, values.len() == length, values.iter().flatten())?;
        }
        for (name, joints, values) in self.joint_members() {
            ensure(name, values.len() == n * e * joints, values)?;
        }
        ensure("t", n >= 2, &self.t)?;
        ensure(
            "base_quaternion_wxyz",
            self.base_quaternion_wxyz.len() == n,
            self.base_quaternion_wxyz.iter().flatten(),
        )?;
        ensure("foot_contact", self.foot_contact.len() == n * e, [])?;
        ensure("foot_adhesive", self.foot_adhesive.len() == e, [])?;
        ensure("swing_beyond", self.swing_beyond.len() == e, self.swing_beyond.iter().flatten())?;
        ensure("phase_durations", self.phase_durations.len() == e, self.phase_durations.iter().flatten())?;
        if let Some(warped) = &self.warped {
            if let Some(base) = &warped.base {
                ensure("warped_base_position", base.position.len() == n, base.position.iter().flatten())?;
                ensure("warped_base_euler", base.euler.len() == n, base.euler.iter().flatten())?;
            }
            ensure(
                "warped_foot_position",
                warped.foot_position.len() == n * e,
                warped.foot_position.iter().flatten(),
            )?;
            ensure(
                "warped_foot_force",
                warped.foot_force.len() == n * e,
                warped.foot_force.iter().flatten(),
            )?;
        }
        for (name, shape, values) in &self.splines {
            ensure(name, shape.iter().product::<usize>() == values.len(), values)?;
        }
        let ground = &self.ground;
        let cells = ground.rows * ground.columns;
        ensure(
            "heightfield",
            ground.height.len() == cells,
            ground.height.iter().chain(&ground.origin).chain(&ground.spacing),
        )?;
        if let Some(raw) = &ground.raw {
            ensure("heightfield_raw", raw.len() == cells, raw)?;
        }
        if let Some(unknown) = &ground.unknown {
            ensure("heightfield_unknown", unknown.len() == cells, [])?;
        }
        let feet = self.patches.len();
        ensure("patch_corners", feet == 0 || feet == e, self.patches.iter().flatten().flatten().flatten())?;
        if let Some(map) = &self.map {
            let points = &map.control_points;
            ensure(
                "map_control_points",
                points.len() == map.shape.iter().product::<usize>(),
                points.iter().flatten(),
            )?;
            ensure("map_knots", true, map.knots.iter().flatten().chain(&map.origin))?;
        }
        let iterations = self.history_objective.len();
        for (name, values) in self.history_members() {
            ensure(name, values.len() == iterations, values)?;
        }
        Ok(())
    }
}

fn ensure<'a>(name: &str, right_length: bool, values: impl IntoIterator<Item = &'a f64>) -> Result<()> {
    if !right_length {
        return Err(Error::Internal(format!("the plan's {name} has the wrong length")));
    }
    if values.into_iter().any(|v| !v.is_finite()) {
        return Err(Error::Internal(format!("the plan's {name} has a value that is not finite")));
    }
    Ok(())
}

impl NpzWriter {
    /// Adds the members of a warp map.
    pub fn add_map(&mut self, map: &MapGrid) -> Result<()> {
        self.add_points("map_control_points", &map.shape, &map.control_points)?;
        self.add_f64("map_origin", &[3], map.origin)?;
        for (axis, knots) in ["x", "y", "z"].iter().zip(&map.knots) {
            self.add_f64(&format!("map_knots_{axis}"), &[knots.len()], knots.iter().copied())?;
        }
        Ok(())
    }
}
