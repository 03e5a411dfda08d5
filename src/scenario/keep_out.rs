//! `[[keep_out]]`: where no foot may stand.

use schemars::JsonSchema;
use serde::{Deserialize, Serialize};

/// `[[keep_out]]`.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize, JsonSchema)]
#[serde(deny_unknown_fields)]
pub struct KeepOutSpec {
    /// Its corners in order around it, x and y, m; it need not be convex.
    #[schemars(length(min = 3, max = 1000))]
    pub polygon: Vec<[f64; 2]>,
}

impl KeepOutSpec {
    /// Distance of a place from the polygon, m; inside negative.
    pub fn distance(&self, [x, y]: [f64; 2]) -> f64 {
        let corners = &self.polygon;
        let (mut nearest, mut inside) = (f64::INFINITY, false);
        for (n, &[ax, ay]) in corners.iter().enumerate() {
            let [bx, by] = corners[(n + 1) % corners.len()];
            let (dx, dy) = (bx - ax, by - ay);
            let square = dx * dx + dy * dy;
            let u =
                if square > 0.0 { (((x - ax) * dx + (y - ay) * dy) / square).clamp(0.0, 1.0) } else { 0.0 };
            nearest = nearest.min((ax + u * dx - x).hypot(ay + u * dy - y));
            if (ay > y) != (by > y) && x < ax + (y - ay) / dy * dx {
                inside = !inside;
            }
        }
        if inside { -nearest } else { nearest }
    }

    /// Twice its area, m².
    pub(super) fn doubled_area(&self) -> f64 {
        let corners = &self.polygon;
        let cross = |n: usize| {
            let ([ax, ay], [bx, by]) = (corners[n], corners[(n + 1) % corners.len()]);
            ax * by - ay * bx
        };
        (0..corners.len()).map(cross).sum::<f64>().abs()
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn distances_from_a_polygon_that_is_not_convex() {
        let corner = KeepOutSpec {
            polygon: vec![[0.0, 0.0], [2.0, 0.0], [2.0, 1.0], [1.0, 1.0], [1.0, 2.0], [0.0, 2.0]],
        };
        for (place, distance) in [
            ([0.5, 0.5], -0.5),
            ([1.5, 1.5], 0.5),
            ([3.0, 0.5], 1.0),
            ([-1.0, -1.0], 2.0_f64.sqrt()),
            ([0.5, 1.9], -0.1),
        ] {
            assert!((corner.distance(place) - distance).abs() < 1e-12, "{place:?}");
        }
        assert_eq!(corner.doubled_area(), 6.0);
    }
}
