//! `[[keep_out]]`: where no foot may stand, by a polygon or by a mask, which becomes its outlines (`mask.rs`).

use schemars::JsonSchema;
use serde::{Deserialize, Serialize};

/// `[[keep_out]]`.
#[derive(Clone, Debug, Default, PartialEq, Serialize, Deserialize, JsonSchema)]
#[serde(deny_unknown_fields)]
pub struct KeepOutSpec {
    /// Its corners in order around it, x and y, m; it need not be convex.
    #[serde(default, skip_serializing_if = "Vec::is_empty")]
    #[schemars(length(min = 3, max = 1000))]
    pub polygon: Vec<[f64; 2]>,
    /// Instead of a polygon, a raster of what is kept free, relative to the scenario: an image (PNG), whose pixels from half of white on count,
    /// or an array (`.npy`) of numbers or booleans, whose elements other than zero do. The first row has the largest y.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub mask: Option<String>,
    /// mask: the ground that it covers, from edge to edge: x_min, x_max, y_min, y_max, m; default: the terrain's extent.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub extent: Option<[f64; 4]>,
    /// What a mask becomes: loops around its parts, and around holes in them, x and y, m.
    #[serde(default, skip_serializing_if = "Vec::is_empty")]
    pub outlines: Vec<Vec<[f64; 2]>>,
}

impl KeepOutSpec {
    /// Distance of a place from the polygon, m; inside negative.
    pub fn distance(&self, [x, y]: [f64; 2]) -> f64 {
        let (mut nearest, mut inside) = (f64::INFINITY, false);
        for [[ax, ay], [bx, by]] in self.edges() {
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

    /// The polygon, or the outlines.
    pub fn loops(&self) -> impl Iterator<Item = &Vec<[f64; 2]>> {
        std::iter::once(&self.polygon).chain(&self.outlines).filter(|corners| !corners.is_empty())
    }

    fn edges(&self) -> impl Iterator<Item = [[f64; 2]; 2]> {
        self.loops().flat_map(|corners| {
            corners.iter().enumerate().map(|(n, a)| [*a, corners[(n + 1) % corners.len()]])
        })
    }

    /// The key that gives it.
    pub fn key(&self) -> &'static str {
        if self.outlines.is_empty() { "polygon" } else { "mask" }
    }

    /// Twice its area, m².
    pub(super) fn doubled_area(&self) -> f64 {
        self.edges().map(|[[ax, ay], [bx, by]]| ax * by - ay * bx).sum::<f64>().abs()
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn distances_from_a_polygon_that_is_not_convex() {
        let corner = KeepOutSpec {
            polygon: vec![[0.0, 0.0], [2.0, 0.0], [2.0, 1.0], [1.0, 1.0], [1.0, 2.0], [0.0, 2.0]],
            ..KeepOutSpec::default()
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
