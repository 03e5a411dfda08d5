//! Cubic B-spline bases in one variable: uniform (the base) and clamped (swinging feet).

/// Number of free control points of a swing; the outer two on each side are the footholds.
pub const SWING_CONTROL_POINTS: usize = 3;
/// Knot intervals of a swing.
pub const SWING_INTERVALS: usize = SWING_CONTROL_POINTS + 1;

/// The four weights of a uniform cubic B-spline and their first and second derivatives at u ∈ [0, 1] of a knot interval
/// (in units of the knot spacing).
pub fn uniform_cubic(u: f64) -> [[f64; 4]; 3] {
    let v = 1.0 - u;
    [
        [
            v * v * v / 6.0,
            (3.0 * u * u * u - 6.0 * u * u + 4.0) / 6.0,
            (-3.0 * u * u * u + 3.0 * u * u + 3.0 * u + 1.0) / 6.0,
            u * u * u / 6.0,
        ],
        [-v * v / 2.0, (9.0 * u * u - 12.0 * u) / 6.0, (-9.0 * u * u + 6.0 * u + 3.0) / 6.0, u * u / 2.0],
        [v, 3.0 * u - 2.0, 1.0 - 3.0 * u, u],
    ]
}

/// Values and first and second derivatives, with respect to u ∈ [0, 1], of all `intervals + 3` basis functions of a cubic
/// B-spline on equal intervals whose end knots are fourfold, so that it starts and ends at its outer control points.
pub fn clamped_cubic(intervals: usize, u: f64) -> [Vec<f64>; 3] {
    let knots: Vec<f64> =
        (0..intervals + 7).map(|i| (i.saturating_sub(3).min(intervals)) as f64 / intervals as f64).collect();
    let u = u.clamp(0.0, 1.0);
    let span = 3 + ((u * intervals as f64) as usize).min(intervals - 1);
    // Cox–de Boor from degree 0 to 3; `levels[p]` holds all functions of degree p.
    let mut levels: Vec<Vec<f64>> = vec![vec![0.0; knots.len() - 1]];
    levels[0][span] = 1.0;
    for p in 1..=3 {
        let lower = &levels[p - 1];
        let level = (0..knots.len() - 1 - p)
            .map(|i| {
                let ratio = |a: f64, b: f64| if b > 0.0 { a / b } else { 0.0 };
                ratio(u - knots[i], knots[i + p] - knots[i]) * lower[i]
                    + ratio(knots[i + p + 1] - u, knots[i + p + 1] - knots[i + 1]) * lower[i + 1]
            })
            .collect();
        levels.push(level);
    }
    // N'_{i,p} = p (N_{i,p-1}/(k_{i+p} - k_i) - N_{i+1,p-1}/(k_{i+p+1} - k_{i+1})).
    let derivative = |lower: &[f64], p: usize| -> Vec<f64> {
        (0..knots.len() - 1 - p)
            .map(|i| {
                let term = |j: usize| {
                    let width = knots[j + p] - knots[j];
                    if width > 0.0 { lower[j] / width } else { 0.0 }
                };
                p as f64 * (term(i) - term(i + 1))
            })
            .collect()
    };
    let first = derivative(&levels[2], 3);
    let second = derivative(&derivative(&levels[1], 2), 3);
    [levels.pop().expect("four levels"), first, second]
}

/// The spline of a swing, collapsed onto (foothold, three control points, next foothold): each foothold is the outer two
/// control points of its side. A polynomial a knot interval, so that it can be evaluated without allocation.
#[derive(Clone, Debug)]
pub struct SwingBasis {
    /// `coefficients[interval][m][power]` of the local time, in units of u.
    coefficients: [[[f64; 4]; 5]; SWING_INTERVALS],
}

impl SwingBasis {
    /// From the values and derivatives at the knots.
    pub fn new() -> Self {
        let width = 1.0 / SWING_INTERVALS as f64;
        let knots: Vec<[[f64; 5]; 3]> = (0..=SWING_INTERVALS)
            .map(|i| clamped_cubic(SWING_INTERVALS, i as f64 * width))
            .map(|levels| levels.map(|b| [b[0] + b[1], b[2], b[3], b[4], b[5] + b[6]]))
            .collect();
        Self {
            coefficients: std::array::from_fn(|i| {
                let (left, right) = (&knots[i], &knots[i + 1]);
                std::array::from_fn(|m| {
                    let third = (right[2][m] - left[2][m]) / width;
                    [left[0][m], left[1][m], 0.5 * left[2][m], third / 6.0]
                })
            }),
        }
    }

    /// The five weights and their first and second derivatives at u, which counts as 0 before the swing and as 1 after it.
    pub fn at(&self, u: f64) -> [[f64; 5]; 3] {
        let u = u.clamp(0.0, 1.0);
        let i = ((u * SWING_INTERVALS as f64) as usize).min(SWING_INTERVALS - 1);
        let s = u - i as f64 / SWING_INTERVALS as f64;
        let mut weights = [[0.0; 5]; 3];
        for (m, [c0, c1, c2, c3]) in self.coefficients[i].into_iter().enumerate() {
            weights[0][m] = c0 + s * (c1 + s * (c2 + s * c3));
            weights[1][m] = c1 + s * (2.0 * c2 + s * 3.0 * c3);
            weights[2][m] = 2.0 * c2 + s * 6.0 * c3;
        }
        weights
    }
}

impl Default for SwingBasis {
    fn default() -> Self {
        Self::new()
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn both_bases_sum_to_one_and_match_differences() {
        for i in 0..=20 {
            let u = f64::from(i) / 20.0;
            let b = uniform_cubic(u);
            assert!((b[0].iter().sum::<f64>() - 1.0).abs() < 1e-14);
            let e = 1e-6;
            let (p, m) = (uniform_cubic(u + e), uniform_cubic(u - e));
            for k in 0..4 {
                assert!(((p[0][k] - m[0][k]) / (2.0 * e) - b[1][k]).abs() < 1e-8);
                assert!(((p[1][k] - m[1][k]) / (2.0 * e) - b[2][k]).abs() < 1e-8);
            }
        }
        for i in 1..40 {
            let u = f64::from(i) / 40.0 + 0.003;
            let e = 1e-6;
            let b = clamped_cubic(4, u);
            let (p, m) = (clamped_cubic(4, u + e), clamped_cubic(4, u - e));
            assert_eq!(b[0].len(), 7);
            assert!((b[0].iter().sum::<f64>() - 1.0).abs() < 1e-13);
            for k in 0..7 {
                assert!(((p[0][k] - m[0][k]) / (2.0 * e) - b[1][k]).abs() < 1e-7, "u {u} k {k}");
                assert!(((p[1][k] - m[1][k]) / (2.0 * e) - b[2][k]).abs() < 1e-6, "u {u} k {k}");
            }
        }
    }

    #[test]
    fn the_collapsed_basis_is_the_clamped_one() {
        let basis = SwingBasis::new();
        for i in 0..=40 {
            let u = f64::from(i) / 40.0;
            let (short, long) = (basis.at(u), clamped_cubic(SWING_INTERVALS, u));
            for derivative in 0..3 {
                let b = &long[derivative];
                let expected = [b[0] + b[1], b[2], b[3], b[4], b[5] + b[6]];
                for m in 0..5 {
                    assert!((short[derivative][m] - expected[m]).abs() < 1e-11, "u {u}, {derivative}, {m}");
                }
            }
        }
        assert_eq!(basis.at(-0.3)[0], [1.0, 0.0, 0.0, 0.0, 0.0]);
    }

    #[test]
    fn a_clamped_spline_starts_and_ends_at_rest_when_its_outer_points_coincide() {
        for (u, outer) in [(0.0, [0, 1]), (1.0, [5, 6])] {
            let b = clamped_cubic(4, u);
            let inner: f64 =
                (0..7).filter(|k| !outer.contains(k)).map(|k| b[0][k].abs() + b[1][k].abs()).sum();
            assert!(inner < 1e-14, "value and velocity depend on the outer two points alone");
        }
    }
}
