//! The way of the base as a line seen from above, with a heading at each place: straight from stop to stop, with rounded corners.
//!
//! Between two headings that are given, the heading turns with the line and, beyond that, evenly along it; so a robot that starts out
//! along the line follows it forward, and one that starts across it goes sideways around the bends. Distances on the way are those of the
//! base, and a turn counts as the way of the feet, so that a turn on the spot is a way as well.

use crate::scenario::{Scenario, wrapped};

/// Half the length within which a corner is rounded, m, for a robot of ANYmal's size.
const ROUNDING: f64 = 0.25;
/// Distance of the places of a way with corners, m, for a robot of ANYmal's size; more on ways longer than [`MOST`] of them.
const SPACING: f64 = 0.02;
/// Places of a way with corners, at most.
const MOST: f64 = 4000.0;
/// The shortest way, m.
const SHORTEST: f64 = 1e-3;

/// x and y, m, and the heading, rad, which does not wrap.
pub type Place = [f64; 3];

/// A line seen from above with headings.
#[derive(Clone, Debug)]
pub struct Way {
    places: Vec<Place>,
    /// How far each place is along the way, m.
    along: Vec<f64>,
    /// How far each stop of the scenario is, m.
    pub stops: Vec<f64>,
    /// Of all of it, at least a millimeter.
    pub length: f64,
}

impl Way {
    /// The way of a scenario for a robot of a size, whose feet are so far from its middle, m. It bends before each stop, and before the goal.
    pub fn new(scenario: &Scenario, bends: &[Vec<[f64; 2]>], size: f64, feet: f64) -> Self {
        let corners = Corners::of(scenario, bends);
        let distance = |a: &Place, b: &Place| (b[0] - a[0]).hypot(b[1] - a[1]) + feet * (b[2] - a[2]).abs();
        let (places, stops) = match corners.places.len() {
            2 => (corners.places, Vec::new()),
            _ => rounded(&corners, size, distance),
        };
        let mut along = vec![0.0];
        for pair in places.windows(2) {
            along.push(along[along.len() - 1] + distance(&pair[0], &pair[1]));
        }
        let length = along[along.len() - 1].max(SHORTEST);
        Self { stops: stops.into_iter().map(|n| along[n]).collect(), places, along, length }
    }

    /// The places between which the way is straight.
    pub fn places(&self) -> impl Iterator<Item = (f64, &Place)> {
        self.along.iter().copied().zip(&self.places)
    }

    /// Whether it goes straight from start to goal, and turns evenly.
    pub fn is_straight(&self) -> bool {
        self.places.len() == 2
    }

    /// The number of the piece s along the way, m, and the fraction of it before s; beyond the ends more than all of it.
    pub fn piece(&self, s: f64) -> (usize, f64) {
        let last = self.places.len() - 2;
        let n = self.along.partition_point(|along| *along <= s).saturating_sub(1).min(last);
        let piece = self.along[n + 1] - self.along[n];
        // A way without length is at its start as well as at its end.
        (n, if piece > 0.0 { (s - self.along[n]) / piece } else { s / self.length })
    }

    /// The place s along the way, m; beyond its ends, straight on.
    pub fn at(&self, s: f64) -> Place {
        let (n, u) = self.piece(s);
        let [a, b] = [self.places[n], self.places[n + 1]];
        std::array::from_fn(|c| a[c] + u * (b[c] - a[c]))
    }
}

/// The line before its corners are rounded: where it bends, two places with different headings.
struct Corners {
    places: Vec<Place>,
    /// Which of them are the scenario's stops.
    stops: Vec<usize>,
}

impl Corners {
    fn of(scenario: &Scenario, bends: &[Vec<[f64; 2]>]) -> Self {
        let stops = scenario.stops();
        // All points, and at which of them there is a stop.
        let (mut points, mut stop_at) = (vec![scenario.start.position], Vec::new());
        for n in 0..=stops.len() {
            points.extend(bends.get(n).into_iter().flatten());
            stop_at.extend(stops.get(n).map(|_| points.len()));
            points.push(stops.get(n).map_or(scenario.goal.position, |stop| stop.position));
        }
        let last = points.len() - 1;
        let directions = directions(&points);
        let mut along = vec![0.0];
        for pair in points.windows(2) {
            let [a, b] = [pair[0], pair[1]];
            along.push(along[along.len() - 1] + (b[0] - a[0]).hypot(b[1] - a[1]));
        }
        // The points at which the heading is given, and what it is there.
        let start_yaw = scenario.start_yaw();
        let mut keys = vec![(0, Some(start_yaw))];
        keys.extend(stops.iter().zip(&stop_at).filter_map(|(stop, n)| Some((*n, Some(stop.yaw?)))));
        keys.push((last, scenario.goal_yaw()));
        let whole_turn = scenario.goal.turns.and(scenario.turn()).map(|turn| start_yaw + turn);
        let mut heading = start_yaw;
        let mut corners = Self { places: Vec::new(), stops: Vec::new() };
        for pair in keys.windows(2) {
            let [(first, _), (end, yaw)] = [pair[0], pair[1]];
            let span = along[end] - along[first];
            // What is between the heading and the direction of the line, at the first and at the last point.
            let from = heading - directions[first];
            let nearest = |yaw: f64| from + wrapped(yaw - directions[end - 1] - from);
            let to = match whole_turn.filter(|_| end == last) {
                Some(heading) => heading - directions[end - 1],
                None => yaw.map_or(from, nearest),
            };
            heading = directions[end - 1] + to;
            let offset = |n: usize| {
                let u = if span > 0.0 {
                    (along[n] - along[first]) / span
                } else {
                    (n - first) as f64 / (end - first) as f64
                };
                from + u * (to - from)
            };
            for n in first..end {
                if stop_at.contains(&n) {
                    corners.stops.push(corners.places.len());
                }
                for (m, direction) in [(n, directions[n]), (n + 1, directions[n])] {
                    corners.places.push([points[m][0], points[m][1], direction + offset(m)]);
                }
            }
        }
        corners
    }
}

/// The direction of each piece of a line, rad; pieces without a length have that of a neighbor.
fn directions(points: &[[f64; 2]]) -> Vec<f64> {
    let own: Vec<Option<f64>> = points
        .windows(2)
        .map(|pair| [0, 1].map(|c| pair[1][c] - pair[0][c]))
        .map(|[x, y]| (x.hypot(y) > 1e-9).then(|| y.atan2(x)))
        .collect();
    let mut direction = own.iter().flatten().next().copied().unwrap_or(0.0);
    own.into_iter()
        .map(|own| {
            direction += own.map_or(0.0, |own| wrapped(own - direction));
            direction
        })
        .collect()
}

/// The line at even distances, averaged over the surroundings of each place; nearer to the ends, over less. Also, which places are stops.
fn rounded(
    corners: &Corners,
    size: f64,
    distance: impl Fn(&Place, &Place) -> f64,
) -> (Vec<Place>, Vec<usize>) {
    let mut along = vec![0.0];
    for pair in corners.places.windows(2) {
        along.push(along[along.len() - 1] + distance(&pair[0], &pair[1]));
    }
    let length = along[along.len() - 1].max(SHORTEST);
    let count = (length / (size * SPACING)).ceil().clamp(2.0, MOST);
    let spacing = length / count;
    let sharp = Way { places: corners.places.clone(), along, stops: Vec::new(), length };
    let places: Vec<Place> = (0..=count as usize).map(|n| sharp.at(n as f64 * spacing)).collect();
    let mut sums = vec![[0.0; 3]];
    for place in &places {
        let before = sums[sums.len() - 1];
        sums.push(std::array::from_fn(|c| before[c] + place[c]));
    }
    let last = places.len() - 1;
    let widest = (size * ROUNDING / spacing) as usize;
    let average = |n: usize| -> Place {
        let half = widest.min(n).min(last - n);
        let (from, to) = (n - half, n + half + 1);
        std::array::from_fn(|c| (sums[to][c] - sums[from][c]) / (to - from) as f64)
    };
    let stop = |&corner: &usize| (sharp.along[corner] / spacing).round() as usize;
    ((0..=last).map(average).collect(), corners.stops.iter().map(|corner| stop(corner).min(last)).collect())
}

#[cfg(test)]
mod tests {
    use super::*;

    fn way(ends: &str) -> Way {
        let text = format!("[terrain]\nkind = \"flat\"\n{ends}");
        Way::new(&toml::from_str(&text).expect("a scenario"), &[], 1.0, 0.4)
    }

    #[test]
    fn a_turn_on_the_spot_is_a_way() {
        let way =
            way("[start]\nposition = [1, 0]\nyaw = 0.5\n[goal]\nposition = [1, 0]\nyaw = -1.0\nturns = 1");
        let turn = std::f64::consts::TAU - 1.5;
        assert!(way.is_straight() && (way.length - 0.4 * turn).abs() < 1e-12);
        assert!((way.at(way.length)[2] - 0.5 - turn).abs() < 1e-12);
        assert_eq!(way.at(0.0), [1.0, 0.0, 0.5]);
    }

    #[test]
    fn a_robot_follows_a_bend_forward_or_sideways() {
        let bend = "[goal]\nposition = [2, 2]\n[[goal.waypoints]]\nposition = [2, 0]\n";
        let forward = way(&format!("[start]\nposition = [0, 0]\n{bend}"));
        let aside = way(&format!("[start]\nposition = [0, 0]\nyaw = 1.0\n{bend}"));
        for (way, offset) in [(forward, 0.0), (aside, 1.0)] {
            assert!((way.at(0.0)[2] - offset).abs() < 1e-12);
            assert!((way.at(way.length)[2] - offset - std::f64::consts::FRAC_PI_2).abs() < 1e-4);
            let [x, y, _] = way.at(way.stops[0]);
            assert!((x - 2.0).hypot(y) < 0.1, "({x}, {y})");
            // The heading does not jump.
            let places: Vec<&Place> = way.places().map(|(_, place)| place).collect();
            assert!(places.windows(2).all(|pair| (pair[1][2] - pair[0][2]).abs() < 0.1));
        }
    }

    #[test]
    fn a_heading_at_a_way_point_holds_there_and_the_line_turns_it_from_there_on() {
        let corners = "[start]\nposition = [0, 0]\n[goal]\nposition = [0, 2]\n[[goal.waypoints]]\nposition = [2, 0]\nyaw = 0.5\n\
                       [[goal.waypoints]]\nposition = [2, 2]\n";
        let way = way(corners);
        assert!((way.at(way.stops[0])[2] - 0.5).abs() < 0.05, "{:?}", way.at(way.stops[0]));
        // The line turns by 90° at the second way-point, and the robot with it.
        let end = way.at(way.length)[2];
        assert!((end - 0.5 - std::f64::consts::FRAC_PI_2).abs() < 1e-9, "{end}");
    }

    #[test]
    fn a_circle_returns_to_its_start_once_around() {
        let way = way(
            "[start]\nposition = [0, 0]\n[goal]\nposition = [0, 0]\ncircle = { center = [0, 1], turns = -1 }",
        );
        assert_eq!(way.stops.len(), 24);
        let turned = way.at(way.length)[2] - way.at(0.0)[2];
        assert!((turned + std::f64::consts::TAU).abs() < 0.3, "{turned}");
        for (_, [x, y, _]) in way.places() {
            assert!((x.hypot(y - 1.0) - 1.0).abs() < 0.04);
        }
        assert!(way.at(way.stops[6])[0] < -0.9, "around to the right, facing -x at first");
    }
}
