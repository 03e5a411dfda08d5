//! What the way from start to goal leads over, from way-points and circles; and the headings at its ends.

use std::f64::consts::TAU;

use super::format::Scenario;
use super::goal::CircleSpec;

/// Chords of a whole circle.
const CHORDS: f64 = 24.0;
/// A shorter way, m, has no direction: the robot then heads along x.
const NO_WAY: f64 = 1e-9;

/// A place on the way.
#[derive(Clone, Debug, PartialEq)]
pub struct Stop {
    /// x, y of the base, m.
    pub position: [f64; 2],
    /// Heading, rad.
    pub yaw: Option<f64>,
    /// Height of the center of mass above the mean of the feet, m.
    pub height: Option<f64>,
    /// When the base is there, s; else it passes within [`super::GoalSpec::waypoint_distance`], after all earlier stops.
    pub time: Option<f64>,
}

impl Scenario {
    /// The places between start and goal over which the way leads, in order.
    pub fn stops(&self) -> Vec<Stop> {
        if let Some(circle) = &self.goal.circle {
            return arc(circle, self.start.position, self.goal.position);
        }
        let stop = |w: &super::WaypointSpec| Stop {
            position: w.position,
            yaw: w.yaw,
            height: w.height,
            time: w.time,
        };
        self.goal.waypoints.iter().map(stop).collect()
    }

    /// Heading at the start, rad: the one given, or toward the first way-point or the goal.
    pub fn start_yaw(&self) -> f64 {
        self.start.yaw.unwrap_or_else(|| {
            let from = self.start.position;
            let places = self.stops().into_iter().map(|stop| stop.position).chain([self.goal.position]);
            let mut ways = places.map(|to| [0, 1].map(|c| to[c] - from[c]));
            ways.find(|[x, y]| x.hypot(*y) >= NO_WAY).map_or(0.0, |[x, y]| y.atan2(x))
        })
    }

    /// Heading at the end, rad, where it is a constraint.
    pub fn goal_yaw(&self) -> Option<f64> {
        self.goal.yaw.or(self.goal.turns.map(|_| self.start_yaw()))
    }

    /// By how much the heading changes from start to end, rad, to the left, where [`Self::goal_yaw`] is given.
    pub fn turn(&self) -> Option<f64> {
        let turn = wrapped(self.goal_yaw()? - self.start_yaw());
        Some(turn + TAU * f64::from(self.goal.turns.unwrap_or(0)))
    }

    /// Length of the straight lines from the start over all way-points to the goal, m.
    pub fn way_length(&self) -> f64 {
        let places = self.stops().into_iter().map(|stop| stop.position).chain([self.goal.position]);
        let add = |(length, from): (f64, [f64; 2]), to: [f64; 2]| {
            (length + (to[0] - from[0]).hypot(to[1] - from[1]), to)
        };
        places.fold((0.0, self.start.position), add).0
    }
}

impl CircleSpec {
    /// Radius at a place, m, and its direction from the center, rad.
    fn polar(&self, place: [f64; 2]) -> (f64, f64) {
        let [x, y] = [0, 1].map(|c| place[c] - self.center[c]);
        (x.hypot(y), y.atan2(x))
    }

    /// The angle from the start around the center to the goal, rad: of all that end there, the one nearest to the given turns.
    pub(super) fn angle(&self, start: [f64; 2], goal: [f64; 2]) -> f64 {
        let shortest = wrapped(self.polar(goal).1 - self.polar(start).1);
        match self.turns {
            Some(turns) => shortest + TAU * (turns - shortest / TAU).round(),
            None if shortest.abs() < 1e-6 => TAU,
            None => shortest,
        }
    }
}

/// Places on an arc, half a chord after the start, then chord by chord; where start and goal are at different distances from the
/// center, a spiral.
fn arc(circle: &CircleSpec, start: [f64; 2], goal: [f64; 2]) -> Vec<Stop> {
    let (first, from) = circle.polar(start);
    let (last, _) = circle.polar(goal);
    let angle = circle.angle(start, goal);
    let chords = (CHORDS * angle.abs() / TAU).ceil().max(1.0);
    (0..chords as usize)
        .map(|n| (n as f64 + 0.5) / chords)
        .map(|u| {
            let (radius, (sin, cos)) = (first + u * (last - first), (from + u * angle).sin_cos());
            let [x, y] = circle.center;
            Stop { position: [x + radius * cos, y + radius * sin], yaw: None, height: None, time: None }
        })
        .collect()
}

/// An angle between −π and π.
pub fn wrapped(angle: f64) -> f64 {
    angle - (angle / TAU).round() * TAU
}
