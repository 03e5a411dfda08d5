//! The initial guess: a straight line in the space of the variables, nominal footholds under the base, and the weight divided among
//! the feet that stand.

use nalgebra::{Matrix3, Vector3};

use super::standing::{Pose, ensure_reach, pulled_back, standing_pose};
use crate::Result;
use crate::nlp::Model;
use crate::scenario::Scenario;
use crate::trajectory::rotation::{euler, euler_angles};
use crate::trajectory::space::Space;
use crate::trajectory::spline::SWING_CONTROL_POINTS;
use crate::trajectory::{Stance, switches};
use crate::warp::Order;

/// The base departs this long before the first swing, and arrives this long after the last one, s.
const LEAD: f64 = 0.2;
/// Apex of the guessed swings, as a multiple of `swing_clearance`.
const SWING_APEX: f64 = 1.5;
/// Time in which the base speeds up and slows down: this fraction of its travel time, …
const RAMP_FRACTION: f64 = 0.2;
/// … but at most this long, s.
const LONGEST_RAMP: f64 = 0.8;

/// The guess, one value for each variable; the first six are the pinned start.
///
/// # Errors
/// When a foot cannot reach the ground at the start, or a pose has no preimage under the map.
pub fn guess(scenario: &Scenario, model: &Model) -> Result<Vec<f64>> {
    let path = BasePath::new(scenario, model)?;
    let mut x = vec![0.0; model.layout.variables];
    set_base(&path, model, &mut x);
    let footholds = set_footholds(&path, model, &mut x);
    set_swings(SWING_APEX * scenario.motion.swing_clearance, &footholds, model, &mut x);
    set_forces(&footholds, model, &mut x);
    Ok(x)
}

/// Where the base is guessed to be at each time.
struct BasePath<'a> {
    model: &'a Model,
    /// Poses at the start and at the goal, in the variables.
    ends: [[f64; 6]; 2],
    /// Heading at the start and at the goal, ambient, rad.
    yaw: [f64; 2],
    /// When the base departs and when it arrives, s.
    travel: [f64; 2],
}

impl<'a> BasePath<'a> {
    fn new(scenario: &Scenario, model: &'a Model) -> Result<Self> {
        let layout = &model.layout;
        let yaw = start_yaw(scenario);
        let goal_yaw = scenario.goal.yaw.unwrap_or(yaw);
        let pose = |xy: [f64; 2], yaw: f64| standing_pose(&model.nominal, &model.ground, xy, yaw);
        let start = pose(scenario.start.position, yaw);
        ensure_reach(model, &start, scenario.start.position)?;
        let first = pulled_back(&model.spaces.base, &start)?;
        let mut last = pulled_back(&model.spaces.base, &pose(scenario.goal.position, goal_yaw))?;
        last[5] = first[5] + wrapped(last[5] - first[5]);

        let horizon = layout.intervals as f64 * layout.time_step;
        let swings = || layout.feet.iter().flat_map(|f| &f.swings).map(|s| s.swing);
        let first_lift_off = swings().map(|s| s.start).reduce(f64::min);
        let last_touch_down = swings().map(|s| s.end).reduce(f64::max);
        let depart = first_lift_off.map_or(0.0, |k| k * layout.time_step - LEAD).max(0.0);
        let arrive = last_touch_down.map_or(horizon, |k| k * layout.time_step + LEAD).min(horizon);
        Ok(Self { model, ends: [first, last], yaw: [yaw, goal_yaw], travel: [depart, arrive] })
    }

    /// The base at time t, s, in the variables.
    fn at(&self, t: f64) -> [f64; 6] {
        let [first, last] = &self.ends;
        let u = progress(t, self.travel[0], self.travel[1]);
        if self.model.spaces.base.is_warped() {
            // A straight line in F; the ground is flat there.
            return std::array::from_fn(|d| first[d] + u * (last[d] - first[d]));
        }
        // A straight line seen from above, standing on the ground at every instant.
        let xy = [0, 1].map(|c| first[c] + u * (last[c] - first[c]));
        let heading = self.yaw[0] + u * wrapped(self.yaw[1] - self.yaw[0]);
        let pose: Pose = standing_pose(&self.model.nominal, &self.model.ground, xy, heading);
        let angles = euler_angles(&pose.rotation);
        [xy[0], xy[1], pose.position.z, angles.x, angles.y, first[5] + wrapped(angles.z - first[5])]
    }
}

/// Heading at the start: the scenario's, or toward the goal.
pub fn start_yaw(scenario: &Scenario) -> f64 {
    scenario.start.yaw.unwrap_or_else(|| {
        let d = [0, 1].map(|c| scenario.goal.position[c] - scenario.start.position[c]);
        if d[0].hypot(d[1]) < 1e-9 { 0.0 } else { d[1].atan2(d[0]) }
    })
}

/// Fraction of the way covered at time t: constant speed with parabolic ends between `from` and `to`.
fn progress(t: f64, from: f64, to: f64) -> f64 {
    let duration = to - from;
    let ramp = (RAMP_FRACTION * duration).min(LONGEST_RAMP);
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

fn set_base(path: &BasePath, model: &Model, x: &mut [f64]) {
    let layout = &model.layout;
    for block in 0..layout.base_blocks {
        // Block b is control point b + 2, whose Greville abscissa is knot b + 1; the outer ones are at rest.
        let t = match block {
            0 => 0.0,
            b if b + 1 == layout.base_blocks => layout.intervals as f64 * layout.time_step,
            b => (b + 1) as f64 * layout.base_knot_spacing(),
        };
        x[6 * block..6 * block + 6].copy_from_slice(&path.at(t));
    }
    x[..6].copy_from_slice(&path.ends[0]);
}

/// Puts each foothold under the base where it is in the middle of the stance; `[foot][stance]`.
fn set_footholds(path: &BasePath, model: &Model, x: &mut [f64]) -> Vec<Vec<Vector3<f64>>> {
    let layout = &model.layout;
    let last = layout.intervals as f64;
    let middle = |s: &Stance| {
        if s.start == 0.0 {
            0.0
        } else if s.end == last {
            last
        } else {
            0.5 * (s.start + s.end)
        }
    };
    let mut footholds = Vec::new();
    for (i, foot) in layout.feet.iter().enumerate() {
        let on_ground = foot.stances.iter().map(|stance| {
            let foothold = foothold_under(model, i, &path.at(middle(&stance.stance) * layout.time_step));
            x[stance.foothold.first()..][..3].copy_from_slice(foothold.as_slice());
            foothold
        });
        footholds.push(on_ground.collect());
    }
    footholds
}

/// Evenly spaced control points from foothold to foothold, lifted to the apex.
fn set_swings(apex: f64, footholds: &[Vec<Vector3<f64>>], model: &Model, x: &mut [f64]) {
    for (foot, footholds) in model.layout.feet.iter().zip(footholds) {
        for (swing, ends) in foot.swings.iter().zip(footholds.windows(2)) {
            if let Some(lift_off) = swing.switches {
                x[lift_off..lift_off + 2].copy_from_slice(&switches::guessed(&swing.swing));
            }
            for c in 0..SWING_CONTROL_POINTS {
                let fraction = (c + 1) as f64 / (SWING_CONTROL_POINTS + 1) as f64;
                let mut point = ends[0] + (ends[1] - ends[0]) * fraction;
                point.z = if model.spaces.feet.is_warped() {
                    apex
                } else {
                    apex + point.z.max(model.ground.height(point.x, point.y))
                };
                x[swing.control_points + 3 * c..][..3].copy_from_slice(point.as_slice());
            }
        }
    }
}

/// Upright forces, equal for all feet that stand.
fn set_forces(footholds: &[Vec<Vector3<f64>>], model: &Model, x: &mut [f64]) {
    let bearing = bearing_feet(model);
    for (foot, footholds) in model.layout.feet.iter().zip(footholds) {
        for (stance, foothold) in foot.stances.iter().zip(footholds) {
            let jacobian = model.spaces.feet.jet(foothold, Order::First).jacobian;
            let up = jacobian
                .try_inverse()
                .map_or_else(Vector3::z, |inverse: Matrix3<f64>| inverse * Vector3::z());
            for (k, node) in stance.free_forces() {
                for &(variable, _) in &node.terms {
                    x[variable..][..3].copy_from_slice((up / bearing[k]).as_slice());
                }
            }
        }
    }
}

/// How many feet bear the weight at each sample, at least one; a foot near a switch counts as the activation of its force.
fn bearing_feet(model: &Model) -> Vec<f64> {
    let layout = &model.layout;
    let activation = |i: usize, k: usize| {
        layout.force(i, k).map_or(0.0, |(j, _)| {
            let swings = &layout.feet[i].swings;
            let switch = |j: Option<usize>, which: usize| {
                let swing = swings.get(j?)?;
                swing.switches.map(|_| switches::guessed(&swing.swing)[which])
            };
            switches::activation(k, switch(j.checked_sub(1), 1), switch(Some(j), 0))
        })
    };
    let total = |k: usize| (0..model.feet()).map(|i| activation(i, k)).sum::<f64>();
    (0..=layout.intervals).map(|k| total(k).max(1.0)).collect()
}

/// Where foot `i` would stand under a base with variables y, in the space of the variables.
fn foothold_under(model: &Model, i: usize, y: &[f64; 6]) -> Vector3<f64> {
    let (point, turn) = model.spaces.base.pose(y, false);
    let q = point.position + turn.rotation * model.nominal[i];
    match &model.spaces.feet {
        Space::Direct => Vector3::new(q.x, q.y, model.ground.height(q.x, q.y)),
        Space::Warped(map) => {
            let [x, y] = map.ground_inverse([q.x, q.y]).unwrap_or_else(|_| without_preimage(model, i, y, &q));
            Vector3::new(x, y, 0.0)
        }
    }
}

/// A place in F for a foothold q that has no preimage, such as one outside the map's box: with the base in F, the nominal offset
/// scaled like lengths there; else q itself.
fn without_preimage(model: &Model, i: usize, y: &[f64; 6], q: &Vector3<f64>) -> [f64; 2] {
    if !model.spaces.base.is_warped() {
        return [q.x, q.y];
    }
    let jacobian = model.spaces.base.jet(&Vector3::new(y[0], y[1], y[2]), Order::First).jacobian;
    let scale = jacobian.determinant().abs().cbrt();
    let offset = euler(&Vector3::new(0.0, 0.0, y[5])).rotation * model.nominal[i] / scale;
    [y[0] + offset.x, y[1] + offset.y]
}

fn wrapped(angle: f64) -> f64 {
    angle - (angle / std::f64::consts::TAU).round() * std::f64::consts::TAU
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
}
