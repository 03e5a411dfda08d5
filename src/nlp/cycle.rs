//! What a cyclic motion repeats: the end is the start, turned and shifted.

use nalgebra::{Rotation3, Vector3};

use crate::scenario::Scenario;
use crate::terrain::Surfaces;

/// By what the end of a cyclic motion differs from its start. World frame.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Cycle {
    /// About the vertical, rad, to the left.
    pub turn: f64,
    /// A place at the start, m, …
    pub from: Vector3<f64>,
    /// … and where it is at the end.
    pub to: Vector3<f64>,
}

impl Cycle {
    /// That of a scenario; none where the motion is not cyclic.
    pub fn of(scenario: &Scenario, surfaces: &Surfaces) -> Option<Self> {
        let on_ground = |[x, y]: [f64; 2]| Vector3::new(x, y, surfaces.feet.height(x, y));
        scenario.gait.periodic.then(|| Self {
            turn: scenario.turn().unwrap_or(0.0),
            from: on_ground(scenario.start.position),
            to: on_ground(scenario.goal.position),
        })
    }

    /// A direction, velocity or force at the start as it is at the end.
    pub fn turned(&self, vector: &Vector3<f64>) -> Vector3<f64> {
        Rotation3::from_axis_angle(&Vector3::z_axis(), self.turn) * vector
    }

    /// A place at the start as it is at the end.
    pub fn moved(&self, place: &Vector3<f64>) -> Vector3<f64> {
        self.to + self.turned(&(place - self.from))
    }
}
