//! Whether the ground repeats itself under a cyclic motion: what is at the goal must be as at the start, turned and shifted.

use nalgebra::Vector3;

use crate::nlp::Cycle;
use crate::robot::Robot;
use crate::scenario::Scenario;
use crate::terrain::Surfaces;
use crate::{Error, Result};

/// By how much heights may differ, m, for a robot of ANYmal's size.
const SAME: f64 = 1e-3;
/// Distance of the places that are compared, m, for a robot of ANYmal's size.
const SPACING: f64 = 0.05;

/// Refuses a cyclic motion over ground that is not the same at the goal as at the start, as far as the feet reach.
///
/// # Errors
/// [`Error::Key`] with a place where it differs.
pub fn ensure_repeats(scenario: &Scenario, robot: &Robot, surfaces: &Surfaces) -> Result<()> {
    let Some(cycle) = Cycle::of(scenario, surfaces) else { return Ok(()) };
    let reach = robot.feet.iter().map(|foot| {
        let far = |c: usize| foot.reach.center[c].abs() + foot.reach.half_size[c];
        far(0).hypot(far(1))
    });
    let reach = reach.fold(0.0, f64::max);
    let count = (reach / (robot.size() * SPACING)).ceil() as i32;
    let [x_min, x_max, y_min, y_max] = surfaces.feet.extent();
    let inside = |q: &Vector3<f64>| (x_min..=x_max).contains(&q.x) && (y_min..=y_max).contains(&q.y);
    let mut worst = (0.0, Vector3::zeros());
    for i in -count..=count {
        for j in -count..=count {
            let offset = Vector3::new(f64::from(i), f64::from(j), 0.0) * (reach / f64::from(count));
            let mut place = cycle.from + offset;
            place.z = surfaces.feet.height(place.x, place.y);
            let moved = cycle.moved(&place);
            if offset.norm() > reach || !inside(&place) || !inside(&moved) {
                continue;
            }
            let off = (surfaces.feet.height(moved.x, moved.y) - moved.z).abs();
            if off > worst.0 {
                worst = (off, place);
            }
        }
    }
    if worst.0 <= SAME * robot.size() {
        return Ok(());
    }
    let (off, place) = worst;
    let what = format!(
        "the ground at the goal is not as at the start: by {:.0} mm for the place ({:.2}, {:.2}); allowed: ground that repeats itself, such as a plane, or a goal one wavelength away",
        1e3 * off,
        place.x,
        place.y
    );
    Err(Error::key("gait.periodic", what))
}
