//! Where the base is guessed to be at each time: along its way, straight in the space of its variables where the way is straight. Footholds
//! are chosen along it.

use nalgebra::{Vector2, Vector3};

use super::pace::{Pace, interpolated};
use super::retiming::{Corridor, retimed};
use super::standing::{Pose, allowed, ensure_ground_at_goal, ensure_reach, pulled_back, standing_pose};
use super::start;
use super::way::{Place, Way};
use crate::Result;
use crate::nlp::Model;
use crate::nlp::model::Visit;
use crate::scenario::{PostureSpec, Scenario, wrapped};
use crate::terrain::Patch;
use crate::trajectory::rotation::euler_angles;

/// The base departs this long before the first swing, and arrives this long after the last one, s, for a robot of ANYmal's size.
const LEAD: f64 = 0.2;
/// Longest time in which it speeds up and slows down, s, likewise.
const LONGEST_RAMP: f64 = 0.8;
/// Distance of the poses at which it is looked up which footholds are within reach, m, for a robot of ANYmal's size.
const PROBES: f64 = 0.02;
/// A foot that moves less than this fraction of the way counts as one that does.
const LEAST_GAIN: f64 = 0.25;

/// Where the base is guessed to be at each time.
#[derive(Clone)]
pub struct BasePath<'a> {
    model: &'a Model,
    /// Poses at the start and at the goal, in the variables.
    pub ends: [[f64; 6]; 2],
    way: Way,
    posture: PostureSpec,
    /// The base in the variables at each place of a way that is not straight, if the variables are not ambient.
    bent: Option<Vec<[f64; 6]>>,
    pace: Pace,
    /// Length of the way, m; a turn counts as the way of the feet. At least a millimeter.
    pub length: f64,
    /// Fraction of the way covered at each sample, if not by steady travel.
    timing: Option<Vec<f64>>,
}

/// How a foot at its nominal place moves while the base goes along its way.
#[derive(Clone, Copy, Debug)]
pub struct FootMotion {
    /// Unit vector, base frame.
    pub in_base: Vector2<f64>,
    /// Unit vector, world frame.
    pub in_world: Vector2<f64>,
    /// Way of the foot for one of the base.
    pub gain: f64,
}

impl FootMotion {
    /// Half the length of a box in this direction, as a way of the base, m.
    pub fn half_chord(&self, half_size: &[f64; 3]) -> f64 {
        (0..2).map(|c| half_size[c] / self.in_base[c].abs()).fold(f64::INFINITY, f64::min) / self.gain
    }

    /// Half the length of a box across this direction, m.
    pub fn half_across(&self, half_size: &[f64; 3]) -> f64 {
        (0..2).map(|c| half_size[1 - c] / self.in_base[c].abs()).fold(f64::INFINITY, f64::min)
    }

    /// How far a vector of the base frame leads in this direction, as a way of the base, m.
    pub fn along(&self, x: f64, y: f64) -> f64 {
        self.in_base.dot(&Vector2::new(x, y)) / self.gain
    }
}

/// A path shorter than this, m, for a robot of ANYmal's size, is not worth another timing.
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
        let feet = model.nominal.iter().map(|n| n.xy().norm()).fold(0.0, f64::max);
        let way = Way::new(scenario, &model.surfaces.bends, model.size, feet);
        let standing = |[x, y, heading]: Place, height: Option<f64>| {
            let pose = standing_pose(&model.nominal, &model.surfaces.posture, [x, y], heading);
            allowed(pose, &model.nominal, model.size, &scenario.posture, height)
        };
        let in_variables = |place: Place| pulled_back(&model.spaces.base, &standing(place, None));
        let [start, goal] = [way.at(0.0), way.at(way.length)];
        let pose = start::pose(scenario, standing(start, None));
        ensure_reach(scenario, model, &pose)?;
        let first = pulled_back(&model.spaces.base, &pose)?;
        let unwound = |mut y: [f64; 6], heading: f64| {
            let expected = first[5] + heading - start[2];
            y[5] = expected + wrapped(y[5] - expected);
            y
        };
        let arrived = standing(goal, scenario.goal.height);
        ensure_ground_at_goal(model, &arrived, scenario.goal.position)?;
        let last = pulled_back(&model.spaces.base, &arrived)?;
        let last = unwound(last, goal[2]);
        let bent = (model.spaces.base.is_warped() && !way.is_straight()).then(|| {
            way.places().map(|(_, place)| Ok(unwound(in_variables(*place)?, place[2]))).collect::<Result<_>>()
        });

        let horizon = layout.intervals as f64 * layout.time_step;
        let swings = || layout.feet.iter().flat_map(|f| &f.swings).map(|s| s.swing);
        let first_lift_off = swings().map(|s| s.start).reduce(f64::min);
        let last_touch_down = swings().map(|s| s.end).reduce(f64::max);
        let lead = model.time_scale() * LEAD;
        let depart = first_lift_off.map_or(0.0, |k| k * layout.time_step - lead).max(0.0);
        let arrive = last_touch_down.map_or(horizon, |k| k * layout.time_step + lead).min(horizon);
        let stops: Vec<(f64, f64)> = scenario
            .stops()
            .iter()
            .zip(&way.stops)
            .filter_map(|(stop, at)| Some((stop.time?, *at)))
            .collect();
        let path = Self {
            model,
            posture: scenario.posture.clone(),
            ends: [first, last],
            length: way.length,
            pace: match model.cycle {
                Some(_) => Pace::even(horizon, way.length, layout.time_step),
                None => {
                    let longest_ramp = model.time_scale() * LONGEST_RAMP;
                    Pace::new(
                        [depart, arrive],
                        longest_ramp,
                        way.length,
                        &stops,
                        layout.intervals,
                        layout.time_step,
                    )
                }
            },
            bent: bent.transpose()?,
            way,
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
        let timing = (self.length > self.model.size * SHORTEST).then(|| {
            let nominal: Vec<f64> =
                (0..=layout.intervals).map(|k| self.steady(k as f64 * layout.time_step)).collect();
            let s = retimed(&nominal, &self.corridors(footholds), &self.pace.pins, layout.time_step);
            s.into_iter().map(|s| s / self.length).collect()
        });
        Self { timing, ..self.clone() }
    }

    /// When the stops of a scenario are passed.
    pub fn visits(&self, scenario: &Scenario) -> Vec<Visit> {
        let layout = &self.model.layout;
        let passed = |at: f64| {
            let s = |k: usize| self.length * self.progress(k as f64 * layout.time_step);
            (0..=layout.intervals).min_by(|&a, &b| (s(a) - at).abs().total_cmp(&(s(b) - at).abs()))
        };
        let distance = scenario.goal.waypoint_distance;
        let visit = |(stop, at): (crate::scenario::Stop, &f64)| {
            let given = stop.time.map(|time| (time / layout.time_step).round() as usize);
            Visit { sample: given.or(passed(*at)).unwrap_or(0), stop, distance }
        };
        scenario.stops().into_iter().zip(&self.way.stops).map(visit).collect()
    }

    /// How long the base travels, s.
    pub fn travel_time(&self) -> f64 {
        self.pace.travel_time()
    }

    /// How far the base is on its way at time t, s, when it travels steadily, m.
    pub fn steady(&self, t: f64) -> f64 {
        self.pace.at(t)
    }

    /// How a foot moves after a fraction u of the way.
    pub fn foot_motion(&self, foot: usize, u: f64) -> FootMotion {
        // Over as much as the foot reaches: on stairs, the base pitches from one probe to the next.
        let step = (self.model.reach[foot].half_size[0] / self.length).min(0.5);
        let nominal = self.model.nominal[foot];
        let place = |u: f64| {
            let pose = self.pose_on_way(u);
            (pose.position + pose.rotation * nominal).xy()
        };
        let moved = place(u + 0.5 * step) - place(u - 0.5 * step);
        let rotation = self.pose_on_way(u).rotation;
        let gain = moved.norm() / (step * self.length);
        let in_world = if gain > 1e-6 { moved.normalize() } else { rotation.column(0).xy().normalize() };
        let in_base = rotation.tr_mul(&Vector3::new(in_world.x, in_world.y, 0.0)).xy().normalize();
        FootMotion { in_base, in_world, gain: gain.max(LEAST_GAIN) }
    }

    /// For each stance, from where to where the base can be along the way: as far as the foothold is within reach, around the place
    /// that is best.
    fn corridors(&self, footholds: &[Vec<[f64; 2]>]) -> Vec<Corridor> {
        let layout = &self.model.layout;
        let count = (self.length / (self.model.size * PROBES)).ceil().max(2.0) as usize;
        let poses: Vec<Pose> = (0..=count).map(|n| self.pose_on_way(n as f64 / count as f64)).collect();
        let mut corridors = Vec::new();
        for (i, (foot, footholds)) in layout.feet.iter().zip(footholds).enumerate() {
            let reach = &self.model.reach[i];
            for (stance, [x, y]) in foot.stances.iter().zip(footholds) {
                let s = &stance.stance;
                let wanted =
                    self.steady(0.5 * (s.start + s.end) * layout.time_step) / self.length * count as f64;
                // How far the foothold is out of the box, m.
                let out = |n: usize| {
                    let pose = &poses[n];
                    // Horizontally from the middle of the box, which is ahead of or behind the base where that is pitched.
                    let middle = pose.position + pose.rotation * Vector3::from(reach.center);
                    let local = pose.rotation.tr_mul(&Vector3::new(x - middle.x, y - middle.y, 0.0));
                    let beyond =
                        |d: usize| (local[d].abs() - (1.0 - REACH_MARGIN) * reach.half_size[d]).max(0.0);
                    beyond(0).hypot(beyond(1))
                };
                let outs: Vec<f64> = (0..=count).map(out).collect();
                let better = |a: &usize, b: &usize| {
                    let cost = |n: usize| (outs[n], (n as f64 - wanted).abs());
                    cost(*a).partial_cmp(&cost(*b)).unwrap_or(std::cmp::Ordering::Equal)
                };
                let best = (0..=count).min_by(better).unwrap_or(0);
                let within = |n: &usize| outs[*n] <= outs[best];
                let first = (0..=best).rev().take_while(within).last().unwrap_or(best);
                let last = (best..=count).take_while(within).last().unwrap_or(best);
                let at = |n: usize| self.length * n as f64 / count as f64;
                // Beyond its ends, where the base does not go, the box may reach farther.
                let range = [
                    if first == 0 { f64::NEG_INFINITY } else { at(first) },
                    if last == count { f64::INFINITY } else { at(last) },
                ];
                let samples = [s.start.ceil() as usize, s.end.floor() as usize];
                corridors.push(Corridor { samples, range });
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
        match &self.timing {
            Some(timing) => interpolated(timing, t / self.model.layout.time_step),
            None => self.steady(t) / self.length,
        }
    }

    /// The pose after a fraction u of the way, ambient.
    pub fn pose_on_way(&self, u: f64) -> Pose {
        let (point, turn) = self.model.spaces.base.pose(&self.on_way(u), false);
        Pose { position: point.position, rotation: turn.rotation }
    }

    /// The base after a fraction u of the way, in the variables.
    fn on_way(&self, u: f64) -> [f64; 6] {
        let [first, last] = &self.ends;
        if let Some(bent) = &self.bent {
            let (n, part) = self.way.piece(u * self.length);
            return std::array::from_fn(|d| bent[n][d] + part * (bent[n + 1][d] - bent[n][d]));
        }
        if self.model.spaces.base.is_warped() {
            // A straight line in F; the ground is flat there.
            return std::array::from_fn(|d| first[d] + u * (last[d] - first[d]));
        }
        // Seen from above along the way, standing on the ground at every instant.
        let [x, y, heading] = self.way.at(u * self.length);
        let pose = standing_pose(&self.model.nominal, &self.model.surfaces.posture, [x, y], heading);
        let pose = allowed(pose, &self.model.nominal, self.model.size, &self.posture, None);
        let angles = euler_angles(&pose.rotation);
        let expected = first[5] + heading - self.way.at(0.0)[2];
        [x, y, pose.position.z, angles.x, angles.y, expected + wrapped(angles.z - expected)]
    }
}
