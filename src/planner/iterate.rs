//! The motion at an iteration, for those who watch. It costs nothing until it is sampled.

use std::borrow::Cow;

use crate::nlp::Model;
use crate::nlp::model::GRAVITY;
use crate::trajectory::sampling;

/// Samples a second, and how many there are at most.
const RATE: f64 = 25.0;
const MOST: f64 = 500.0;

/// The variables at an iteration, and what they are variables of.
#[derive(Clone, Copy, Debug)]
pub struct Iterate<'a> {
    /// Robot, ground, space and layout of the stage.
    pub model: &'a Model,
    /// x, the last point at which the constraints were evaluated.
    pub x: &'a [f64],
}

/// An iterate at N equally spaced times, E feet. World frame, SI units.
#[derive(Clone, Debug, Default)]
pub struct IterateSamples {
    /// (N,) s, from 0 to the horizon.
    pub t: Vec<f64>,
    /// (N,) center of mass, m.
    pub base_position: Vec<[f64; 3]>,
    /// (N,) body to world.
    pub base_quaternion_wxyz: Vec<[f64; 4]>,
    /// (N·E,) contact points, m.
    pub foot_position: Vec<[f64; 3]>,
    /// (N·E,) of the ground on the robot, N.
    pub foot_force: Vec<[f64; 3]>,
    /// (N·E,) in stance.
    pub foot_contact: Vec<bool>,
    /// (N,) x, y, z, roll, pitch, yaw of the base, m and rad, in the space of its variables.
    pub base_variables: Vec<[f64; 6]>,
    /// (N·E,) m, in the space of the feet's variables.
    pub foot_variables: Vec<[f64; 3]>,
    /// (N·E,) N, in that space.
    pub force_variables: Vec<[f64; 3]>,
}

impl Iterate<'_> {
    /// Some 25 samples a second, 500 at most.
    pub fn sampled(&self) -> IterateSamples {
        let Self { model, x } = *self;
        let mut layout = Cow::Borrowed(&model.layout);
        if layout.has_switches() {
            layout.to_mut().freeze(x);
        }
        let unit = model.mass * GRAVITY;
        let horizon = layout.intervals as f64 * layout.time_step;
        let count = (RATE * horizon).clamp(1.0, MOST).ceil() as usize;
        let mut found = IterateSamples::default();
        let mut quaternion = [1.0, 0.0, 0.0, 0.0];
        for n in 0..=count {
            let k = (n * layout.intervals) as f64 / count as f64;
            let base = sampling::base(&layout, &model.spaces.base, x, k);
            quaternion = base.quaternion_wxyz(quaternion);
            found.t.push(k * layout.time_step);
            found.base_position.push(base.position.into());
            found.base_quaternion_wxyz.push(quaternion);
            found.base_variables.push(base.variables);
            for i in 0..model.feet() {
                let foot = sampling::foot(&layout, &model.spaces.feet, x, i, k);
                found.foot_position.push(foot.position.into());
                found.foot_force.push((foot.force * unit).into());
                found.foot_contact.push(foot.contact);
                found.foot_variables.push(foot.warped_position.into());
                found.force_variables.push((foot.warped_force * unit).into());
            }
        }
        found
    }
}
