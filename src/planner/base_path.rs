//! Where the base is guessed to be at each time: a straight line in the space of its variables. Footholds are chosen along it.

use nalgebra::{Vector2, Vector3};

use super::retiming::{Corridor, retimed};
use super::standing::{Pose, ensure_reach, pulled_back, standing_pose};
use crate::Result;
use crate::nlp::Model;
use crate::scenario::Scenario;
use crate::terrain::Patch;
use crate::trajectory::Stance;
use crate::trajectory::rotation::euler_angles;

/// The base departs this long before the first swing, and arrives this long after the last one, s.
const LEAD: f64 = 0.2;
/// Time in which the base speeds up and slows down: this fraction of its travel time, …
const RAMP_FRACTION: f64 = 0.2;
/// … but at most this long, s.
const LONGEST_RAMP: f64 = 0.8;

/// Where the base is guessed to be at each time.
#[derive(Clone)]
pub struct BasePath<'a> {
    model: &'a Model,
    /// Poses at the start and at the goal, in the variables.
    pub ends: [[f64; 6]; 2],
    /// Heading at the start and at the goal, ambient, rad.
    yaw: [f64; 2],
    /// When the base departs and when it arrives, s.
    travel: [f64; 2],
    /// Length of the way, m; a turn counts as the way of the feet. At least a millimeter.
    pub length: f64,
    /// Fraction of the way covered at each sample, if not by steady travel.
    timing: Option<Vec<f64>>,
}

/// A path shorter than this, m, is not worth another timing.
const SHORTEST: f64 = 0.2;
/// The reach box is narrowed by this fraction: the optimized base is not quite where it is guessed.
pub const REACH_MARGIN: f64 = 0.1;

impl<'a> BasePath<'a> {
    /// From the start to the goal of a scenario.
    ///
    /// # Errors
    /// When a pose has no preimage under the map, or a foot cannot reach the ground at the start.
    pub fn new(scenario: &Scenario, model: &'a Model) -> Result<Self> {
        let layout = &model.layout;
        let yaw = scenario.start_yaw();
        let goal_yaw = scenario.goal.yaw.unwrap_or(yaw);
        let pose = |xy: [f64; 2], yaw: f64| standing_pose(&model.nominal, &model.surfaces.posture, xy, yaw);
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
        let [from, to] = [scenario.start.position, scenario.goal.position];
        let feet = model.nominal.iter().map(|n| n.xy().norm()).fold(0.0, f64::max);
        let turn = wrapped(goal_yaw - yaw).abs() * feet;
        let path = Self {
            model,
            ends: [first, last],
            yaw: [yaw, goal_yaw],
            travel: [depart, arrive],
            length: ((to[0] - from[0]).hypot(to[1] - from[1]) + turn).max(1e-3),
            timing: None,
        };
        if model.patches.is_empty() {
            return Ok(path);
        }
        let centers = |patches: &Vec<Patch>| patches.iter().map(|patch| patch.center).collect();
        Ok(path.retimed(&model.patches.iter().map(centers).collect::<Vec<_>>()))
    }

    /// The same way in another time, so that the feet reach their footholds: `footholds[foot][stance]`, x and y.
    pub fn retimed(&self, footholds: &[Vec<[f64; 2]>]) -> Self {
        let layout = &self.model.layout;
        let steady = |k: usize| progress(k as f64 * layout.time_step, self.travel[0], self.travel[1]);
        let [from, to] = [0.0, 1.0].map(|u| self.pose_on_way(u).position.xy());
        let length = (to - from).norm();
        let timing = (length > SHORTEST).then(|| {
            let nominal: Vec<f64> = (0..=layout.intervals).map(|k| length * steady(k)).collect();
            let corridors = self.corridors(footholds, &from, &((to - from) / length));
            let s = retimed(&nominal, &corridors, layout.time_step);
            s.into_iter().map(|s| s / length).collect()
        });
        Self { timing, ..self.clone() }
    }

    /// How long the base travels, s.
    pub fn travel_time(&self) -> f64 {
        (self.travel[1] - self.travel[0]).max(self.model.layout.time_step)
    }

    /// How far the base is on its way at time t, s, when it travels steadily, m.
    pub fn steady(&self, t: f64) -> f64 {
        self.length * progress(t, self.travel[0], self.travel[1])
    }

    /// A horizontal unit vector across the way: to the left of the heading in its middle.
    pub fn sideways(&self) -> [f64; 2] {
        let left = self.pose_on_way(0.5).rotation.column(1).xy().normalize();
        [left.x, left.y]
    }

    /// For each stance, from where to where the base can be along the way.
    fn corridors(
        &self,
        footholds: &[Vec<[f64; 2]>],
        from: &Vector2<f64>,
        along: &Vector2<f64>,
    ) -> Vec<Corridor> {
        let layout = &self.model.layout;
        let mut corridors = Vec::new();
        for (i, (foot, footholds)) in layout.feet.iter().zip(footholds).enumerate() {
            let reach = &self.model.reach[i];
            for (stance, foothold) in foot.stances.iter().zip(footholds) {
                let s = &stance.stance;
                let heading = self.pose(0.5 * (s.start + s.end) * layout.time_step).rotation;
                let in_world = |v: [f64; 3]| (heading * Vector3::from(v)).xy();
                let center = Vector2::from(*foothold) - in_world(reach.center) - from;
                let half: f64 = (0..2)
                    .map(|d| {
                        let mut side = [0.0; 3];
                        side[d] = (1.0 - REACH_MARGIN) * reach.half_size[d];
                        in_world(side).dot(along).abs()
                    })
                    .fold(0.0, f64::max);
                let at = center.dot(along);
                let samples = [s.start.ceil() as usize, s.end.floor() as usize];
                corridors.push(Corridor { samples, range: [at - half, at + half] });
            }
        }
        corridors
    }

    /// The pose at time t, s, ambient.
    pub fn pose(&self, t: f64) -> Pose {
        self.pose_on_way(self.progress(t))
    }

    /// The base at time t, s, in the variables.
    pub fn at(&self, t: f64) -> [f64; 6] {
        self.on_way(self.progress(t))
    }

    /// Fraction of the way covered at time t, s.
    fn progress(&self, t: f64) -> f64 {
        let Some(timing) = &self.timing else { return progress(t, self.travel[0], self.travel[1]) };
        let k = (t / self.model.layout.time_step).clamp(0.0, (timing.len() - 1) as f64);
        let before = (k as usize).min(timing.len() - 2);
        timing[before] + (k - before as f64) * (timing[before + 1] - timing[before])
    }

    /// The pose after a fraction u of the way, ambient.
    pub fn pose_on_way(&self, u: f64) -> Pose {
        let (point, turn) = self.model.spaces.base.pose(&self.on_way(u), false);
        Pose { position: point.position, rotation: turn.rotation }
    }

    /// The base after a fraction u of the way, in the variables.
    fn on_way(&self, u: f64) -> [f64; 6] {
        let [first, last] = &self.ends;
        if self.model.spaces.base.is_warped() {
            // A straight line in F; the ground is flat there.
            return std::array::from_fn(|d| first[d] + u * (last[d] - first[d]));
        }
        // A straight line seen from above, standing on the ground at every instant.
        let xy = [0, 1].map(|c| first[c] + u * (last[c] - first[c]));
        let heading = self.yaw[0] + u * wrapped(self.yaw[1] - self.yaw[0]);
        let pose: Pose = standing_pose(&self.model.nominal, &self.model.surfaces.posture, xy, heading);
        let angles = euler_angles(&pose.rotation);
        [xy[0], xy[1], pose.position.z, angles.x, angles.y, first[5] + wrapped(angles.z - first[5])]
    }
}

/// When a stance is halfway over, in samples; where it begins or ends with the motion, that end, at which the base is at rest.
pub fn middle(stance: &Stance, last: f64) -> f64 {
    if stance.start == 0.0 {
        0.0
    } else if stance.end == last {
        last
    } else {
        0.5 * (stance.start + stance.end)
    }
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
