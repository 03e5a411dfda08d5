//! The initial guess: a straight line in the space of the variables, feet nominal under the base, weight shared by those that stand.

use nalgebra::{Matrix3, Vector3};

use super::model::Model;
use crate::heightfield::Heightfield;
use crate::scenario::Scenario;
use crate::trajectory::rotation::{euler, euler_angles, project_to_rotation};
use crate::trajectory::space::Space;
use crate::trajectory::spline::SWING_CONTROL_POINTS;
use crate::trajectory::switches;
use crate::warp::Order;
use crate::{Error, Result};

/// The base sets off and comes to rest this long before the first and after the last swing, s.
const LEAD: f64 = 0.2;
/// Apex of the guessed swings, of `swing_clearance`.
const SWING_APEX: f64 = 1.5;

/// A standing pose on the ground: position of the centre of mass and orientation, ambient.
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
    // The feet move with the pose; three rounds settle it.
    for _ in 0..3 {
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

/// Heading at the start: as asked for, or towards the goal.
pub fn start_yaw(scenario: &Scenario) -> f64 {
    scenario.start.yaw.unwrap_or_else(|| {
        let d = [0, 1].map(|c| scenario.goal.position[c] - scenario.start.position[c]);
        if d[0].hypot(d[1]) < 1e-9 { 0.0 } else { d[1].atan2(d[0]) }
    })
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

/// Share of the way covered at time t: constant speed with parabolic ends between `from` and `to`.
fn progress(t: f64, from: f64, to: f64) -> f64 {
    let duration = to - from;
    let ramp = (0.2 * duration).min(0.8);
    let s = (t - from).clamp(0.0, duration);
    let speed = 1.0 / (duration - ramp);
    if s < ramp {
        0.5 * speed * s * s / ramp
    } else if s > duration - ramp {
        1.0 - 0.5 * speed * (duration - s).powi(2) / ramp
    } else {
        speed * (s - 0.5 * ramp)
    }
}

/// The guess, one value for each variable; the first six are the pinned start.
pub fn guess(scenario: &Scenario, model: &Model) -> Result<Vec<f64>> {
    let layout = &model.layout;
    let last = layout.intervals as f64 * layout.time_step;
    let yaw = start_yaw(scenario);
    let goal_yaw = scenario.goal.yaw.unwrap_or(yaw);
    let start = standing_pose(&model.nominal, &model.ground, scenario.start.position, yaw);
    within_reach(model, &start, scenario.start.position)?;
    let end = standing_pose(&model.nominal, &model.ground, scenario.goal.position, goal_yaw);
    let (first, mut final_) = (pulled_back(&model.space, &start)?, pulled_back(&model.space, &end)?);
    final_[5] = first[5] + wrapped(final_[5] - first[5]);

    let swings = || layout.feet.iter().flat_map(|f| &f.swings);
    let set_off = swings()
        .map(|s| s.swing.start)
        .reduce(f64::min)
        .map_or(0.0, |k| k * layout.time_step - LEAD)
        .max(0.0);
    let arrive = swings()
        .map(|s| s.swing.end)
        .reduce(f64::max)
        .map_or(last, |k| k * layout.time_step + LEAD)
        .min(last);
    let base_at = |t: f64| -> [f64; 6] {
        let u = progress(t, set_off, arrive);
        if model.space.is_warped() {
            // A straight line in F; the ground is flat there.
            return std::array::from_fn(|d| first[d] + u * (final_[d] - first[d]));
        }
        // A straight line seen from above, standing on the ground at every instant.
        let xy = [0, 1].map(|c| first[c] + u * (final_[c] - first[c]));
        let heading = yaw + u * wrapped(goal_yaw - yaw);
        let pose = standing_pose(&model.nominal, &model.ground, xy, heading);
        let angles = euler_angles(&pose.rotation);
        [xy[0], xy[1], pose.position.z, angles.x, angles.y, first[5] + wrapped(angles.z - first[5])]
    };

    let mut x = vec![0.0; layout.variables];
    for block in 0..layout.base_blocks {
        // Block b is control point b + 2, whose Greville abscissa is knot b + 1; the outer ones are the rests.
        let t = match block {
            0 => 0.0,
            b if b + 1 == layout.base_blocks => last,
            b => (b + 1) as f64 * layout.base_knot_spacing(),
        };
        x[6 * block..6 * block + 6].copy_from_slice(&base_at(t));
    }
    x[..6].copy_from_slice(&first);

    // How many feet share the weight at a sample, those near a switch counted as the shares of their force that act.
    let shares = |i: usize, k: usize| {
        layout.force(i, k).map_or(0.0, |(j, _)| {
            let swings = &layout.feet[i].swings;
            let switch = |j: Option<usize>, which: usize| {
                let swing = swings.get(j?)?;
                swing.switches.map(|_| switches::guessed(&swing.swing)[which])
            };
            switches::share(k, switch(j.checked_sub(1), 1), switch(Some(j), 0))
        })
    };
    let bearing: Vec<f64> = (0..=layout.intervals)
        .map(|k| (0..model.feet()).map(|i| shares(i, k)).sum::<f64>().max(1.0))
        .collect();
    let apex = SWING_APEX * scenario.motion.swing_clearance;
    for (i, foot) in layout.feet.iter().enumerate() {
        let mut footholds = Vec::new();
        for stance in &foot.stances {
            let s = stance.stance;
            let middle = if s.start == 0.0 {
                0.0
            } else if s.end == layout.intervals as f64 {
                last
            } else {
                0.5 * (s.start + s.end) * layout.time_step
            };
            let foothold = foothold_under(model, i, &base_at(middle));
            x[stance.foothold.first()..][..3].copy_from_slice(foothold.as_slice());
            footholds.push(foothold);
            let jacobian = model.space.jet(&foothold, Order::First).jacobian;
            let up = jacobian.try_inverse().map_or_else(Vector3::z, |inverse| inverse * Vector3::z());
            for (k, node) in stance.free_forces() {
                for &(variable, _) in &node.terms {
                    x[variable..][..3].copy_from_slice((up / bearing[k]).as_slice());
                }
            }
        }
        for (j, swing) in foot.swings.iter().enumerate() {
            if let Some(lift_off) = swing.switches {
                x[lift_off..lift_off + 2].copy_from_slice(&switches::guessed(&swing.swing));
            }
            let (from, to) = (footholds[j], footholds[j + 1]);
            for c in 0..SWING_CONTROL_POINTS {
                let share = (c + 1) as f64 / (SWING_CONTROL_POINTS + 1) as f64;
                let mut point = from + (to - from) * share;
                point.z = if model.space.is_warped() {
                    apex
                } else {
                    apex + point.z.max(model.ground.height(point.x, point.y))
                };
                x[swing.control_points + 3 * c..][..3].copy_from_slice(point.as_slice());
            }
        }
    }
    Ok(x)
}

/// Where foot `i` would stand under a base with variables y, in the space of the variables.
fn foothold_under(model: &Model, i: usize, y: &[f64; 6]) -> Vector3<f64> {
    let (point, turn) = model.space.pose(y, false);
    let q = point.position + turn.rotation * model.nominal[i];
    match &model.space {
        Space::Direct => Vector3::new(q.x, q.y, model.ground.height(q.x, q.y)),
        Space::Warped(map) => {
            // Nominal as seen in F, scaled as lengths are there, if the ambient point has no preimage.
            let [x, y] = map.ground_inverse([q.x, q.y]).unwrap_or_else(|_| {
                let scale = point.jacobian.determinant().abs().cbrt();
                let offset = euler(&Vector3::new(0.0, 0.0, y[5])).rotation * model.nominal[i] / scale;
                [y[0] + offset.x, y[1] + offset.y]
            });
            Vector3::new(x, y, 0.0)
        }
    }
}

fn wrapped(angle: f64) -> f64 {
    angle - (angle / std::f64::consts::TAU).round() * std::f64::consts::TAU
}

/// Every foot must find ground within its box at the start.
fn within_reach(model: &Model, pose: &Pose, xy: [f64; 2]) -> Result<()> {
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
                    z -= (q.z - model.ground.height(q.x, q.y)) * pose.rotation[(2, 2)];
                }
                nearest = nearest.min(((z - reach.center[2]).abs() - reach.half_size[2]).max(0.0));
            }
        }
        if nearest > 1e-3 {
            return Err(Error::input(format!(
                "start.position = [{}, {}]: foot {} cannot reach the ground there, it is {:.0} mm outside its box; start on more even ground or change start.yaw",
                xy[0],
                xy[1],
                model.foot_names[i],
                nearest * 1e3
            )));
        }
    }
    Ok(())
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn progress_runs_from_zero_to_one_without_a_jump() {
        let mut before = 0.0;
        for i in 0..=1000 {
            let u = progress(f64::from(i) * 0.01, 0.3, 9.7);
            assert!(u >= before - 1e-12 && u - before < 2e-3);
            before = u;
        }
        assert!((before - 1.0).abs() < 1e-12);
    }

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
