//! Standing poses.

use nalgebra::{Matrix3, Vector3};

use crate::constraints::margins;
use crate::constraints::posture::within;
use crate::heightfield::Heightfield;
use crate::nlp::Model;
use crate::scenario::{PostureSpec, Scenario};
use crate::trajectory::rotation::{euler, euler_angles, project_to_rotation};
use crate::trajectory::space::Space;
use crate::warp::Order;
use crate::{Error, Result};

/// Fixed-point rounds in which feet and pose are matched; the feet move with the pose.
const ROUNDS: usize = 3;

/// m²: what a slope costs with fewer than three feet, beside their distances from the plane.
const LEVEL: f64 = 1e-6;

/// A standing pose on the ground: position of the center of mass and orientation, ambient.
#[derive(Clone, Copy, Debug)]
pub struct Pose {
    /// p, m.
    pub position: Vector3<f64>,
    /// R.
    pub rotation: Matrix3<f64>,
}

/// The pose over (x, y) with heading `yaw`, aligned with the plane through the ground under the nominal feet, and at nominal
/// height over it on average.
pub fn standing_pose(nominal: &[Vector3<f64>], ground: &Heightfield, xy: [f64; 2], yaw: f64) -> Pose {
    let heading = euler(&Vector3::new(0.0, 0.0, yaw)).rotation;
    let mut pose = Pose { position: Vector3::new(xy[0], xy[1], 0.0), rotation: heading };
    for _ in 0..ROUNDS {
        let feet: Vec<Vector3<f64>> = nominal
            .iter()
            .map(|n| {
                let q = pose.position + pose.rotation * n;
                Vector3::new(q.x, q.y, ground.height(q.x, q.y))
            })
            .collect();
        // Least squares z = c0 + c1 (x − x̂) + c2 (y − ŷ).
        let (mut a, mut b) = (Matrix3::zeros(), Vector3::zeros());
        for q in &feet {
            let row = Vector3::new(1.0, q.x - xy[0], q.y - xy[1]);
            a += row * row.transpose();
            b += row * q.z;
        }
        // One foot, or two, do not say how the ground slopes: as little as they allow.
        if nominal.len() < 3 {
            a += Matrix3::from_diagonal(&Vector3::new(0.0, LEVEL, LEVEL));
        }
        let plane = a.try_inverse().map_or_else(Vector3::zeros, |inverse| inverse * b);
        let normal = Vector3::new(-plane[1], -plane[2], 1.0).normalize();
        let forward = heading.column(0).into_owned();
        let x_axis = (forward - normal * normal.dot(&forward)).normalize();
        pose.rotation = Matrix3::from_columns(&[x_axis, normal.cross(&x_axis), normal]);
        let drop: f64 = nominal.iter().zip(&feet).map(|(n, q)| q.z - (pose.rotation * n).z).sum::<f64>();
        pose.position.z = drop / nominal.len() as f64;
    }
    pose
}

/// A standing pose brought into the limits of a posture, and if one is given to a height over the feet, m.
pub fn allowed(
    mut pose: Pose,
    nominal: &[Vector3<f64>],
    size: f64,
    posture: &PostureSpec,
    height: Option<f64>,
) -> Pose {
    if *posture == PostureSpec::default() && height.is_none() {
        return pose;
    }
    let own = -nominal.iter().map(|n| (pose.rotation * n).z).sum::<f64>() / nominal.len() as f64;
    let clamped = |value: f64, range: Option<[f64; 2]>, margin: f64| {
        let range = range.map(|range| within(range, margin));
        range.map_or(value, |[least, greatest]| value.clamp(least, greatest))
    };
    let wanted = clamped(height.unwrap_or(own), posture.height, size * margins::POSTURE_HEIGHT);
    pose.position.z += wanted - own;
    let mut angles = euler_angles(&pose.rotation);
    angles.x = clamped(angles.x, posture.roll, margins::POSTURE_TILT);
    angles.y = clamped(angles.y, posture.pitch, margins::POSTURE_TILT);
    pose.rotation = euler(&angles).rotation;
    pose
}

/// A pose in the variables (p̄, θ̄) of a space.
pub fn pulled_back(space: &Space, pose: &Pose) -> Result<[f64; 6]> {
    let (position, frame) = match space {
        Space::Direct => (pose.position, Matrix3::identity()),
        Space::Warped(map) => {
            let position = Vector3::from(map.inverse(pose.position.into())?);
            (position, project_to_rotation(&space.jet(&position, Order::First).jacobian))
        }
    };
    let angles = euler_angles(&frame.tr_mul(&pose.rotation));
    Ok([position.x, position.y, position.z, angles.x, angles.y, angles.z])
}

/// Every foot must find ground within its box at the start.
pub fn ensure_reach(scenario: &Scenario, model: &Model, pose: &Pose) -> Result<()> {
    let start = &scenario.start;
    let state = start.state.as_ref();
    let (key, given) = match state.map_or((None, None), |state| (state.height, state.tilt)) {
        (Some(height), _) => ("start.state.height", format!("{height} m")),
        (None, Some(tilt)) => ("start.state.tilt", format!("{tilt:?}")),
        (None, None) => ("start.position", format!("[{}, {}]", start.position[0], start.position[1])),
    };
    for (i, reach) in model.reach.iter().enumerate() {
        let steps = 8;
        let mut nearest = f64::INFINITY;
        for a in 0..=steps {
            for b in 0..=steps {
                let at = |c: usize, s: usize| {
                    reach.center[c] + reach.half_size[c] * (2.0 * s as f64 / steps as f64 - 1.0)
                };
                // The point of the box's column (a, b) that lies on the ground: a few fixed-point steps along the body's z.
                let mut z = reach.center[2];
                for _ in 0..20 {
                    let q = pose.position + pose.rotation * Vector3::new(at(0, a), at(1, b), z);
                    z -= (q.z - model.surfaces.posture.height(q.x, q.y)) * pose.rotation[(2, 2)];
                }
                nearest = nearest.min(((z - reach.center[2]).abs() - reach.half_size[2]).max(0.0));
            }
        }
        if nearest > 1e-3 {
            return Err(Error::key(
                key,
                format!(
                    "given {given}, where foot {} cannot reach the ground, which is {:.0} mm outside its reach box; start on more even ground, change start.yaw, or leave height and tilt out",
                    model.foot_names[i],
                    nearest * 1e3
                ),
            ));
        }
    }
    Ok(())
}

/// Where the robot arrives, every foot must have ground under its nominal place. (What the scenario alone tells is refused before.)
pub fn ensure_ground_at_goal(model: &Model, pose: &Pose, xy: [f64; 2]) -> Result<()> {
    let [x_min, x_max, y_min, y_max] = model.surfaces.feet.extent();
    for (name, nominal) in model.foot_names.iter().zip(&model.nominal) {
        let foot = pose.position + pose.rotation * nominal;
        let along = |v: f64, low: f64, high: f64| (low - v).max(v - high).max(0.0);
        let outside = along(foot.x, x_min, x_max).hypot(along(foot.y, y_min, y_max));
        if outside > 0.0 {
            return Err(Error::key(
                "goal.position",
                format!(
                    "given [{}, {}], where foot {name} would stand {outside:.3} m outside the terrain, as the robot arrives with a heading of {:.2} rad; choose another goal or goal.yaw",
                    xy[0],
                    xy[1],
                    euler_angles(&pose.rotation).z
                ),
            ));
        }
    }
    Ok(())
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_robot_stands_along_a_slope_at_nominal_height() {
        let slope = 0.3;
        let ground =
            Heightfield::from_function([-2.0, 2.0, -2.0, 2.0], 0.05, |x, _| Ok(slope * x)).expect("a slope");
        let nominal: Vec<_> = [(0.3, 0.2), (0.3, -0.2), (-0.3, 0.2), (-0.3, -0.2)]
            .map(|(x, y)| Vector3::new(x, y, -0.42))
            .to_vec();
        let pose = standing_pose(&nominal, &ground, [0.1, 0.0], 0.0);
        let normal = Vector3::new(-slope, 0.0, 1.0).normalize();
        assert!((pose.rotation.column(2) - normal).norm() < 1e-9);
        for n in &nominal {
            let q = pose.position + pose.rotation * n;
            assert!((q.z - slope * q.x).abs() < 1e-9);
        }
    }
}
