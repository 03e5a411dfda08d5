//! The part of a plane on which a foot may stand.

use crate::heightfield::HeightJet;

/// A rectangle of a plane z = h + s · (p − center), turned about the vertical.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Patch {
    /// x, y of the point that the rest refers to, m.
    pub center: [f64; 2],
    /// Height of the plane there, m.
    pub height: f64,
    /// Slope of the plane along x and y.
    pub slope: [f64; 2],
    /// Heading of the rectangle's first side, rad.
    pub heading: f64,
    /// Least and greatest coordinate along the first and along the second side, from the center, m.
    pub sides: [[f64; 2]; 2],
}

impl Patch {
    /// The unit vectors along the two sides.
    pub fn axes(&self) -> [[f64; 2]; 2] {
        let (sin, cos) = self.heading.sin_cos();
        [[cos, sin], [-sin, cos]]
    }

    /// The coordinates of a place along the two sides, from the center, m.
    pub fn coordinates(&self, [x, y]: [f64; 2]) -> [f64; 2] {
        let d = [x - self.center[0], y - self.center[1]];
        self.axes().map(|axis| axis[0] * d[0] + axis[1] * d[1])
    }

    /// Whether a place is on the rectangle, seen from above.
    pub fn covers(&self, place: [f64; 2]) -> bool {
        let at = self.coordinates(place);
        (0..2).all(|c| (self.sides[c][0]..=self.sides[c][1]).contains(&at[c]))
    }

    /// The point of the rectangle that is nearest to a place, seen from above, m.
    pub fn nearest(&self, place: [f64; 2]) -> [f64; 2] {
        let at = self.coordinates(place);
        let [u, v] = [0, 1].map(|c| at[c].clamp(self.sides[c][0], self.sides[c][1]));
        let [along, across] = self.axes();
        std::array::from_fn(|c| self.center[c] + u * along[c] + v * across[c])
    }

    /// The height of the plane and its derivatives.
    pub fn jet(&self, x: f64, y: f64) -> HeightJet {
        let h = self.height + self.slope[0] * (x - self.center[0]) + self.slope[1] * (y - self.center[1]);
        HeightJet { h, d1: self.slope, ..HeightJet::default() }
    }

    /// The upward unit normal.
    pub fn normal(&self) -> [f64; 3] {
        let [x, y] = self.slope;
        let scale = 1.0 / (1.0 + x * x + y * y).sqrt();
        [-x * scale, -y * scale, scale]
    }

    /// The four corners, in order around the rectangle, m.
    pub fn corners(&self) -> [[f64; 3]; 4] {
        let [along, across] = self.axes();
        [(0, 0), (1, 0), (1, 1), (0, 1)].map(|(i, j)| {
            let (u, v) = (self.sides[0][i], self.sides[1][j]);
            let [x, y] = std::array::from_fn(|c| self.center[c] + u * along[c] + v * across[c]);
            [x, y, self.jet(x, y).h]
        })
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    /// A place beyond the corner at (u, v) along both sides.
    fn x_or_y(patch: &Patch, u: f64, v: f64, c: usize) -> f64 {
        let [along, across] = patch.axes();
        patch.center[c] + 2.0 * (u * along[c] + v * across[c])
    }

    #[test]
    fn corners_lie_on_the_plane_at_the_ends_of_the_sides() {
        let patch = Patch {
            center: [1.0, -2.0],
            height: 0.3,
            slope: [0.1, -0.2],
            heading: 0.4,
            sides: [[-0.1, 0.2], [-0.05, 0.15]],
        };
        let corners = patch.corners();
        for (corner, sides) in corners.iter().zip([[-0.1, -0.05], [0.2, -0.05], [0.2, 0.15], [-0.1, 0.15]]) {
            let [x, y, z] = *corner;
            let [u, v] = patch.coordinates([x, y]);
            let beyond = [0, 1].map(|c| x_or_y(&patch, u, v, c));
            let found = patch.nearest(beyond);
            assert!((found[0] - x).hypot(found[1] - y) < 1e-12);
            assert!((u - sides[0]).abs() < 1e-12 && (v - sides[1]).abs() < 1e-12);
            assert!((z - (0.3 + 0.1 * (x - 1.0) - 0.2 * (y + 2.0))).abs() < 1e-12);
            let n = patch.normal();
            let d = [x - 1.0, y + 2.0, z - 0.3];
            assert!((0..3).map(|c| n[c] * d[c]).sum::<f64>().abs() < 1e-12);
        }
    }
}
