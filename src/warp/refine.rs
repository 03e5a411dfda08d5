//! The same map on a finer grid: knots are inserted in the middle of all cells, which leaves φ unchanged.

use super::spline::WarpMap;

impl WarpMap {
    /// φ on a grid with all cells halved along the chosen axes.
    pub(super) fn refined(&self, halve: [bool; 3]) -> WarpMap {
        let mut shape = self.cells().map(|n| n + 3);
        let mut points = self.control_points().to_vec();
        for axis in 0..3 {
            if halve[axis] {
                points = refined_along(&points, shape, axis);
                shape[axis] = 2 * shape[axis] - 3;
            }
        }
        let cell = std::array::from_fn(|d| if halve[d] { 0.5 } else { 1.0 } * self.cell()[d]);
        WarpMap::new(shape.map(|n| n - 3), self.origin(), cell, points)
    }
}

/// New control points are means of two old ones in the middle of cells, and means of three with weights 1 : 6 : 1 at knots.
fn refined_along(points: &[[f64; 3]], shape: [usize; 3], axis: usize) -> Vec<[f64; 3]> {
    let stride: usize = shape[axis + 1..].iter().product();
    let fine = 2 * shape[axis] - 3;
    let mut out = Vec::with_capacity(points.len() / shape[axis] * fine);
    for block in points.chunks_exact(shape[axis] * stride) {
        for m in 0..fine {
            let k = m.div_ceil(2);
            for s in 0..stride {
                let p = |k: usize| block[k * stride + s];
                out.push(std::array::from_fn(|c| {
                    if m % 2 == 0 {
                        0.5 * (p(k)[c] + p(k + 1)[c])
                    } else {
                        (p(k - 1)[c] + 6.0 * p(k)[c] + p(k + 1)[c]) / 8.0
                    }
                }));
            }
        }
    }
    out
}

#[cfg(test)]
mod tests {
    use super::super::spline::Order;
    use super::*;
    use crate::scenario::MapSpec;

    #[test]
    fn refinement_leaves_the_map_unchanged_inside() {
        let spec = MapSpec { cells: Some([6, 5, 4]), ..MapSpec::default() };
        let mut map = WarpMap::flat([-1.0, 2.0, 0.0, 2.0], &spec).unwrap();
        for (i, p) in map.control_points_mut().iter_mut().enumerate() {
            p[i % 3] += (1.3 * i as f64).sin();
        }
        for halve in [[true; 3], [true, false, true]] {
            let fine = map.refined(halve);
            for i in 0..100 {
                let t = |k: f64| (0.5 + 0.5 * (k * f64::from(i)).sin()).clamp(0.0, 1.0);
                let x = [-1.0 + 3.0 * t(1.1), 2.0 * t(1.7), 2.5 * t(2.3)];
                let (a, b) = (map.jet(x, Order::Second), fine.jet(x, Order::Second));
                for c in 0..3 {
                    assert!((a.position[c] - b.position[c]).abs() < 1e-12);
                    for s in 0..6 {
                        assert!((a.second[c][s] - b.second[c][s]).abs() < 1e-8);
                    }
                }
            }
        }
    }
}
