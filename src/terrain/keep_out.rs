//! Where no foot may stand because the scenario says so, as a smooth function.

use std::sync::Arc;

use crate::Result;
use crate::heightfield::Heightfield;
use crate::scenario::Scenario;

/// Distance of the samples of the function, m, for a robot of ANYmal's size.
const SPACING: f64 = 0.03;

/// The distance from all kept-out places, and how far feet stay from them.
#[derive(Clone, Debug)]
pub struct KeepOut {
    /// The distance of each place from the nearest polygon, m, negative inside: a C² spline through samples.
    pub distance: Arc<Heightfield>,
    /// Least distance of the middle of a foot, m: its radius.
    pub margin: f64,
}

impl KeepOut {
    /// Those of a scenario on a terrain, for a robot of a size with feet of a radius, m; none if it has none.
    pub(super) fn of(scenario: &Scenario, extent: [f64; 4], size: f64, radius: f64) -> Result<Option<Self>> {
        if scenario.keep_out.is_empty() {
            return Ok(None);
        }
        let nearest = |x: f64, y: f64| {
            Ok(scenario.keep_out.iter().map(|polygon| polygon.distance([x, y])).fold(f64::INFINITY, f64::min))
        };
        let distance = Arc::new(Heightfield::from_function(extent, size * SPACING, nearest)?);
        Ok(Some(Self { distance, margin: radius }))
    }

    /// Whether the middle of a foot may be at a place.
    pub fn allows(&self, [x, y]: [f64; 2]) -> bool {
        self.distance.height(x, y) >= self.margin
    }

    /// The place itself, or the nearest one, about, where a foot may stand.
    pub fn moved_out(&self, [mut x, mut y]: [f64; 2]) -> [f64; 2] {
        // The distance grows by one for each meter but near the middle of a polygon.
        for _ in 0..20 {
            let (distance, [dx, dy]) = self.distance.height_and_gradient(x, y);
            let lacking = self.margin - distance;
            if lacking <= 0.0 {
                break;
            }
            let slope = dx.hypot(dy).max(0.1);
            (x, y) = (x + 1.05 * lacking * dx / slope, y + 1.05 * lacking * dy / slope);
        }
        [x, y]
    }
}
