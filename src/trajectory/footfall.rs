//! The order in which the feet of a gait lift off, for any number of feet.
//!
//! Feet are told apart by where they stand at rest, not by their names: the side of the trunk, and the row from front to back.
//!
//! | gait | feet lift off |
//! | --- | --- |
//! | walk, wave | one after the other: those on the left from hind to front, then those on the right |
//! | trot, flying-trot, tripod | every second foot of each side with the others of the opposite side: diagonal pairs, tripods |
//! | pace | all feet of a side |
//! | bound | row by row |
//! | hop, pronk | all at once |

use crate::robot::Robot;
use crate::scenario::GaitKind;
use crate::{Error, Result};

/// Feet closer to the middle than this fraction of the widest stand on neither side.
const MIDDLE: f64 = 0.05;

/// Where a foot stands at rest.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
struct Place {
    /// Its row on its side, from the front.
    row: usize,
    /// Whether it is on the right; feet in the middle count as left.
    right: bool,
}

/// The lift-off of each foot, as a fraction of the cycle, in the robot's order of feet.
///
/// # Errors
/// [`Error::Key`] with the key `kind` of the section, for a gait that so many feet cannot have.
pub(super) fn lift_offs(kind: GaitKind, robot: &Robot) -> Result<Vec<f64>> {
    let places = places(robot);
    let feet = places.len();
    let rows = places.iter().map(|place| place.row + 1).max().unwrap_or(1);
    ensure_possible(kind, feet, rows)?;
    let fraction = |n: usize, of: usize| n as f64 / of as f64;
    let phase = |place: &Place| match kind {
        GaitKind::Walk | GaitKind::Wave => {
            let before = places.iter().filter(|other| {
                (other.right, std::cmp::Reverse(other.row)) < (place.right, std::cmp::Reverse(place.row))
            });
            fraction(before.count(), feet)
        }
        GaitKind::Trot | GaitKind::FlyingTrot | GaitKind::Tripod => {
            fraction((place.row + usize::from(place.right)) % 2, 2)
        }
        GaitKind::Pace => fraction(usize::from(place.right), 2),
        GaitKind::Bound => fraction(place.row, rows),
        GaitKind::Hop | GaitKind::Pronk | GaitKind::Stand | GaitKind::Custom => 0.0,
    };
    Ok(places.iter().map(phase).collect())
}

/// Refuses gaits that so many feet, in so many rows, cannot have.
fn ensure_possible(kind: GaitKind, feet: usize, rows: usize) -> Result<()> {
    let Some(need) = lacking(kind, feet, rows) else { return Ok(()) };
    let allowed = GaitKind::ALL.into_iter().filter(|kind| lacking(*kind, feet, rows).is_none());
    let names: Vec<String> = allowed.map(|kind| kind.to_string()).collect();
    let what = format!(
        "given \"{kind}\", which needs {need}; the robot has {feet} in {rows} from front to back, allowed for it: {}",
        names.join(", ")
    );
    Err(Error::key("kind", what))
}

/// What a gait needs, if so many feet in so many rows do not have it.
fn lacking(kind: GaitKind, feet: usize, rows: usize) -> Option<&'static str> {
    match kind {
        GaitKind::Walk | GaitKind::Wave | GaitKind::Trot | GaitKind::FlyingTrot | GaitKind::Pace => {
            (feet < 2).then_some("two feet or more")
        }
        GaitKind::Bound => (rows < 2).then_some("feet in front and behind"),
        GaitKind::Tripod => (feet < 6).then_some("six feet or more"),
        GaitKind::Hop | GaitKind::Pronk | GaitKind::Stand | GaitKind::Custom => None,
    }
}

/// Rows from front to back on each side, by the feet's places at rest.
fn places(robot: &Robot) -> Vec<Place> {
    let at: Vec<[f64; 3]> = robot.feet.iter().map(|foot| foot.nominal).collect();
    let widest = at.iter().map(|p| p[1].abs()).fold(0.0, f64::max);
    let right = |p: &[f64; 3]| p[1] < -MIDDLE * widest;
    at.iter()
        .enumerate()
        .map(|(i, place)| {
            let in_front = |(j, other): (usize, &[f64; 3])| {
                right(other) == right(place) && (other[0] > place[0] || (other[0] == place[0] && j < i))
            };
            Place {
                row: at.iter().enumerate().filter(|&(j, other)| in_front((j, other))).count(),
                right: right(place),
            }
        })
        .collect()
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::robot::RobotSpec;

    /// A robot with feet at these places.
    fn robot(feet: &[[f64; 2]]) -> Robot {
        let spec = RobotSpec { name: "anymal_towr".into(), ..Default::default() };
        let mut robot = Robot::load(&spec, ".".as_ref()).expect("a robot");
        let foot = robot.feet[0].clone();
        robot.feet = feet
            .iter()
            .map(|[x, y]| {
                let mut foot = foot.clone();
                foot.nominal = [*x, *y, -0.4];
                foot
            })
            .collect();
        robot
    }

    /// As many rows of two feet.
    fn rows(count: usize) -> Robot {
        let feet: Vec<[f64; 2]> =
            (0..count).flat_map(|r| [[-0.3 * r as f64, 0.2], [-0.3 * r as f64, -0.2]]).collect();
        robot(&feet)
    }

    #[test]
    fn four_feet_step_as_they_are_known_to() {
        for (kind, expected) in [
            (GaitKind::Walk, [0.25, 0.75, 0.0, 0.5]),
            (GaitKind::Wave, [0.25, 0.75, 0.0, 0.5]),
            (GaitKind::Trot, [0.0, 0.5, 0.5, 0.0]),
            (GaitKind::FlyingTrot, [0.0, 0.5, 0.5, 0.0]),
            (GaitKind::Pace, [0.0, 0.5, 0.0, 0.5]),
            (GaitKind::Bound, [0.0, 0.0, 0.5, 0.5]),
            (GaitKind::Pronk, [0.0; 4]),
        ] {
            assert_eq!(lift_offs(kind, &rows(2)).expect("a gait"), expected, "{kind}");
        }
    }

    #[test]
    fn the_order_is_that_of_the_places_and_not_of_the_file() {
        let mixed = robot(&[[-0.3, -0.2], [0.3, 0.2], [0.3, -0.2], [-0.3, 0.2]]);
        assert_eq!(lift_offs(GaitKind::Walk, &mixed).expect("a gait"), [0.5, 0.25, 0.75, 0.0]);
    }

    #[test]
    fn any_number_of_feet_can_walk() {
        for count in 1..=4 {
            let mut found = lift_offs(GaitKind::Walk, &rows(count)).expect("a gait");
            found.sort_by(f64::total_cmp);
            let expected: Vec<f64> = (0..2 * count).map(|n| n as f64 / (2 * count) as f64).collect();
            assert_eq!(found, expected);
        }
        let tripod = lift_offs(GaitKind::Tripod, &rows(3)).expect("a gait");
        assert_eq!(tripod, [0.0, 0.5, 0.5, 0.0, 0.0, 0.5]);
        assert_eq!(lift_offs(GaitKind::Hop, &robot(&[[0.0, 0.0]])).expect("a gait"), [0.0]);
        assert_eq!(lift_offs(GaitKind::Trot, &rows(1)).expect("a gait"), [0.0, 0.5]);
    }

    #[test]
    fn what_the_feet_cannot_do_is_refused_with_what_they_can() {
        for (kind, robot) in
            [(GaitKind::Tripod, rows(2)), (GaitKind::Bound, rows(1)), (GaitKind::Walk, robot(&[[0.0, 0.0]]))]
        {
            let message = lift_offs(kind, &robot).unwrap_err().to_string();
            let list = message.split("allowed for it: ").nth(1).expect("a list");
            assert!(
                list.contains("hop") && !list.split(", ").any(|name| name == kind.to_string()),
                "{message}"
            );
        }
    }
}
