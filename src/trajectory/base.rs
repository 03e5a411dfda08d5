//! The control points of the base's spline, in terms of variables.
//!
//! The spline is cubic, with h between its knots. At an end at rest its three outermost control points are one block of variables. At an
//! end in motion they follow from position y, velocity ẏ and acceleration ÿ there:
//!
//! ```text
//!   c₀ = y − h ẏ + h² ÿ/3,    c₁ = y − h² ÿ/6,    c₂ = y + h ẏ + h² ÿ/3,
//! ```
//!
//! with blocks y, h ẏ and h² ÿ, and likewise at the end, with the signs of h turned.

use super::node::LinearNode;
use crate::bspline::uniform_cubic;

/// Variables of velocity and acceleration at an end in motion.
pub const RATES: usize = 12;
/// Weights below this, relative to the scale of a derivative, are zero up to rounding.
const CANCELLED: f64 = 1e-14;

/// Where the variables of the base are.
#[derive(Clone, Debug, PartialEq)]
pub struct BaseSpline {
    /// Number of knot intervals.
    pub intervals: usize,
    /// h, s.
    pub spacing: f64,
    /// The first of the [`RATES`] variables h ẏ, h² ÿ at the start; none where the motion starts at rest.
    pub start: Option<usize>,
    /// The same at the end; none where the motion ends at rest.
    pub end: Option<usize>,
}

impl BaseSpline {
    /// Number of blocks of control points, which come first among the variables.
    pub fn blocks(&self) -> usize {
        self.intervals - 1
    }

    /// Number of control points.
    pub fn points(&self) -> usize {
        self.intervals + 3
    }

    /// The first of the six variables of a block, for a control point that is not between an end in motion and its neighbors.
    fn block(&self, point: usize) -> usize {
        6 * point.clamp(2, self.intervals).saturating_sub(2)
    }

    /// Control point i as a combination of blocks, 0 ≤ i < intervals + 3.
    pub fn point(&self, i: usize) -> LinearNode {
        let mut node = LinearNode::variable(self.block(i));
        let ends = [
            (self.start.filter(|_| i < 3), 1),
            (self.end.filter(|_| i >= self.intervals), self.intervals + 1),
        ];
        for (rates, middle) in ends {
            let Some(rates) = rates else { continue };
            node.push(rates, i as f64 - middle as f64);
            node.push(rates + 6, if i == middle { -1.0 / 6.0 } else { 1.0 / 3.0 });
        }
        node
    }

    /// Sets the variables to those of given control points, where these are possible.
    pub fn set(&self, points: &[[f64; 6]], x: &mut [f64]) {
        for (i, point) in points.iter().enumerate() {
            x[self.block(i)..][..6].copy_from_slice(point);
        }
        for (rates, first) in [(self.start, 0), (self.end, self.intervals)] {
            let Some(rates) = rates else { continue };
            let ([a, b, c], at) = ([0, 1, 2].map(|n| points[first + n]), self.block(first));
            for d in 0..6 {
                x[at + d] = (a[d] + 4.0 * b[d] + c[d]) / 6.0;
                x[rates + d] = 0.5 * (c[d] - a[d]);
                x[rates + 6 + d] = a[d] - 2.0 * b[d] + c[d];
            }
        }
    }

    /// The base at `knots` intervals after the start (any real number in range), or its first or second derivative in time.
    pub fn node(&self, knots: f64, derivative: usize) -> LinearNode {
        let interval = (knots.max(0.0) as usize).min(self.intervals - 1);
        let weights = uniform_cubic(knots - interval as f64)[derivative];
        let scale = self.spacing.powi(-(derivative as i32));
        let mut node = LinearNode::default();
        for (a, weight) in weights.iter().enumerate() {
            for (variable, part) in self.point(interval + a).terms {
                node.push(variable, weight * part * scale);
            }
        }
        // Where control points coincide, their weights may cancel.
        node.terms.retain(|(_, w)| w.abs() > CANCELLED * scale);
        node
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    fn moving() -> BaseSpline {
        BaseSpline { intervals: 8, spacing: 0.1, start: Some(42), end: Some(54) }
    }

    #[test]
    fn an_end_in_motion_has_its_position_velocity_and_acceleration() {
        let spline = moving();
        let mut x: Vec<f64> = (0..66).map(|v| (1.3 * f64::from(v)).sin()).collect();
        x[48..54].fill(0.02);
        let at = |knots: f64, derivative: usize| spline.node(knots, derivative).value::<6>(&x)[2];
        for (found, expected) in [
            (at(0.0, 0), x[2]),
            (at(0.0, 1), x[44] / 0.1),
            (at(0.0, 2), x[50] / 0.01),
            (at(8.0, 0), x[36 + 2]),
            (at(8.0, 1), x[56] / 0.1),
            (at(8.0, 2), x[62] / 0.01),
        ] {
            assert!((found - expected).abs() < 1e-11, "{found} {expected}");
        }
    }

    #[test]
    fn control_points_give_back_their_variables() {
        for spline in [moving(), BaseSpline { start: None, end: None, ..moving() }] {
            let x: Vec<f64> = (0..66).map(|v| (0.7 * f64::from(v)).cos()).collect();
            let points: Vec<[f64; 6]> = (0..11).map(|i| spline.point(i).value(&x)).collect();
            let mut found = vec![0.0; 66];
            spline.set(&points, &mut found);
            let used = if spline.start.is_some() { 66 } else { 42 };
            for (v, (a, b)) in found.iter().zip(&x).enumerate().take(used) {
                assert!((a - b).abs() < 1e-12, "variable {v}: {a} {b}");
            }
        }
    }
}
