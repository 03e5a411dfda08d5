//! The clamped cubic B-spline of a swinging foot. (That of the base is uniform, see `bspline.rs`.)

/// Number of free control points of a swing. The two on each side of them are at the footholds.
pub const SWING_CONTROL_POINTS: usize = 3;
/// Number of knot intervals of a swing.
pub const SWING_INTERVALS: usize = SWING_CONTROL_POINTS + 1;
/// Number of distinct control points of a swing: a foothold, the free ones, the next foothold.
pub const SWING_POINTS: usize = SWING_CONTROL_POINTS + 2;

/// The basis of a swing at u ∈ [0, 1], and its first and second derivatives with respect to u, by distinct control point. The two
/// basis functions of each foothold are added up, so that the foot lifts off and touches down with zero velocity.
pub fn swing_basis(u: f64) -> [[f64; SWING_POINTS]; 3] {
    clamped_cubic(u).map(|b| [b[0] + b[1], b[2], b[3], b[4], b[5] + b[6]])
}

/// All basis functions of a cubic B-spline at u ∈ [0, 1], and their first and second derivatives. The [`SWING_INTERVALS`] knot
/// intervals are equal and the end knots fourfold, so that the spline starts and ends at its outer control points.
fn clamped_cubic(u: f64) -> [Vec<f64>; 3] {
    let intervals = SWING_INTERVALS;
    let knots: Vec<f64> =
        (0..intervals + 7).map(|i| (i.saturating_sub(3).min(intervals)) as f64 / intervals as f64).collect();
    let u = u.clamp(0.0, 1.0);
    let span = 3 + ((u * intervals as f64) as usize).min(intervals - 1);
    let mut constant = vec![0.0; knots.len() - 1];
    constant[span] = 1.0;
    let linear = raised(&knots, 1, &constant, u);
    let quadratic = raised(&knots, 2, &linear, u);
    let cubic = raised(&knots, 3, &quadratic, u);
    let first = differentiated(&knots, 3, &quadratic);
    let second = differentiated(&knots, 3, &differentiated(&knots, 2, &linear));
    [cubic, first, second]
}

/// The basis functions of degree `p` from those of degree p − 1 (Cox–de Boor).
fn raised(knots: &[f64], p: usize, lower: &[f64], u: f64) -> Vec<f64> {
    let ratio = |a: f64, b: f64| if b > 0.0 { a / b } else { 0.0 };
    (0..knots.len() - 1 - p)
        .map(|i| {
            ratio(u - knots[i], knots[i + p] - knots[i]) * lower[i]
                + ratio(knots[i + p + 1] - u, knots[i + p + 1] - knots[i + 1]) * lower[i + 1]
        })
        .collect()
}

/// The derivatives of the basis functions of degree `p` from (derivatives of) those of degree p − 1:
/// N'_{i,p} = p (N_{i,p−1}/(k_{i+p} − k_i) − N_{i+1,p−1}/(k_{i+p+1} − k_{i+1})).
fn differentiated(knots: &[f64], p: usize, lower: &[f64]) -> Vec<f64> {
    let term = |j: usize| {
        let width = knots[j + p] - knots[j];
        if width > 0.0 { lower[j] / width } else { 0.0 }
    };
    (0..knots.len() - 1 - p).map(|i| p as f64 * (term(i) - term(i + 1))).collect()
}

/// [`swing_basis`] as a polynomial for each knot interval, which is fast to evaluate.
#[derive(Clone, Debug)]
pub struct SwingBasis {
    /// `coefficients[interval][m][power]` of the distance in u from the start of the interval.
    coefficients: [[[f64; 4]; SWING_POINTS]; SWING_INTERVALS],
}

impl SwingBasis {
    /// From the values and derivatives at the knots.
    pub fn new() -> Self {
        let width = 1.0 / SWING_INTERVALS as f64;
        let knots: Vec<[[f64; SWING_POINTS]; 3]> =
            (0..=SWING_INTERVALS).map(|i| swing_basis(i as f64 * width)).collect();
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

    /// The weights and their first and second derivatives at u, which is clamped to [0, 1].
    pub fn at(&self, u: f64) -> [[f64; SWING_POINTS]; 3] {
        let u = u.clamp(0.0, 1.0);
        let i = ((u * SWING_INTERVALS as f64) as usize).min(SWING_INTERVALS - 1);
        let s = u - i as f64 / SWING_INTERVALS as f64;
        let mut weights = [[0.0; SWING_POINTS]; 3];
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
    fn the_clamped_basis_sums_to_one_and_its_derivatives_match_differences() {
        for i in 1..40 {
            let u = f64::from(i) / 40.0 + 0.003;
            let e = 1e-6;
            let b = clamped_cubic(u);
            let (p, m) = (clamped_cubic(u + e), clamped_cubic(u - e));
            assert_eq!(b[0].len(), 7);
            assert!((b[0].iter().sum::<f64>() - 1.0).abs() < 1e-13);
            for k in 0..7 {
                assert!(((p[0][k] - m[0][k]) / (2.0 * e) - b[1][k]).abs() < 1e-7, "u {u} k {k}");
                assert!(((p[1][k] - m[1][k]) / (2.0 * e) - b[2][k]).abs() < 1e-6, "u {u} k {k}");
            }
        }
    }

    #[test]
    fn the_polynomials_are_the_basis() {
        let basis = SwingBasis::new();
        for i in 0..=40 {
            let u = f64::from(i) / 40.0;
            let (found, expected) = (basis.at(u), swing_basis(u));
            for derivative in 0..3 {
                for m in 0..SWING_POINTS {
                    let error = found[derivative][m] - expected[derivative][m];
                    assert!(error.abs() < 1e-11, "u {u}, {derivative}, {m}");
                }
            }
        }
        assert_eq!(basis.at(-0.3)[0], [1.0, 0.0, 0.0, 0.0, 0.0]);
    }

    #[test]
    fn a_clamped_spline_starts_and_ends_at_rest_if_its_outer_points_coincide() {
        for (u, outer) in [(0.0, [0, 1]), (1.0, [5, 6])] {
            let b = clamped_cubic(u);
            let inner: f64 =
                (0..7).filter(|k| !outer.contains(k)).map(|k| b[0][k].abs() + b[1][k].abs()).sum();
            assert!(inner < 1e-14, "value and velocity depend on the outer two points alone");
        }
    }
}
