//! The clamped cubic B-spline of a swinging foot. (That of the base is uniform, see `bspline.rs`.)

/// How a swing is made of control points. The first and the last ones are the footholds, so that the foot leaves and lands at rest.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum SwingShape {
    /// Three free control points and two at each foothold: no velocity at both ends. For massless legs.
    Light,
    /// Five free control points and three at each foothold: neither velocity nor acceleration at both ends, so that no torque jumps. For
    /// legs with mass.
    Smooth,
}

impl SwingShape {
    /// Number of free control points.
    pub fn free(self) -> usize {
        match self {
            Self::Light => 3,
            Self::Smooth => 5,
        }
    }

    /// The shape with a number of free control points, if there is one.
    pub fn with_free(free: usize) -> Option<Self> {
        [Self::Light, Self::Smooth].into_iter().find(|shape| shape.free() == free)
    }

    /// How many control points are at each foothold.
    fn repeated(self) -> usize {
        match self {
            Self::Light => 2,
            Self::Smooth => 3,
        }
    }

    /// Number of distinct control points: a foothold, the free ones, the next foothold.
    pub fn points(self) -> usize {
        self.free() + 2
    }

    /// Number of knot intervals.
    pub fn intervals(self) -> usize {
        self.free() + 2 * self.repeated() - 3
    }
}

/// The basis of a swing at u ∈ [0, 1], and its first and second derivatives with respect to u, by distinct control point. The
/// basis functions of each foothold are added up.
pub fn swing_basis(shape: SwingShape, u: f64) -> [Vec<f64>; 3] {
    let (ends, free) = (shape.repeated(), shape.free());
    clamped_cubic(shape.intervals(), u).map(|b| {
        let mut by_point = vec![b[..ends].iter().sum()];
        by_point.extend_from_slice(&b[ends..ends + free]);
        by_point.push(b[ends + free..].iter().sum());
        by_point
    })
}

/// All basis functions of a cubic B-spline at u ∈ [0, 1], and their first and second derivatives. The knot
/// intervals are equal and the end knots fourfold, so that the spline starts and ends at its outer control points.
fn clamped_cubic(intervals: usize, u: f64) -> [Vec<f64>; 3] {
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
    coefficients: Vec<Vec<[f64; 4]>>,
}

impl SwingBasis {
    /// From the values and derivatives at the knots.
    pub fn new(shape: SwingShape) -> Self {
        let intervals = shape.intervals();
        let width = 1.0 / intervals as f64;
        let knots: Vec<[Vec<f64>; 3]> =
            (0..=intervals).map(|i| swing_basis(shape, i as f64 * width)).collect();
        let piece = |ends: &[[Vec<f64>; 3]]| -> Vec<[f64; 4]> {
            let (left, right) = (&ends[0], &ends[1]);
            (0..shape.points())
                .map(|m| {
                    let third = (right[2][m] - left[2][m]) / width;
                    [left[0][m], left[1][m], 0.5 * left[2][m], third / 6.0]
                })
                .collect()
        };
        Self { coefficients: knots.windows(2).map(piece).collect() }
    }

    /// The weights and their first and second derivatives at u, which is clamped to [0, 1], by distinct control point.
    pub fn at(&self, u: f64) -> impl Iterator<Item = [f64; 3]> + '_ {
        let (u, intervals) = (u.clamp(0.0, 1.0), self.coefficients.len());
        let i = ((u * intervals as f64) as usize).min(intervals - 1);
        let s = u - i as f64 / intervals as f64;
        self.coefficients[i].iter().map(move |[c0, c1, c2, c3]| {
            [c0 + s * (c1 + s * (c2 + s * c3)), c1 + s * (2.0 * c2 + s * 3.0 * c3), 2.0 * c2 + s * 6.0 * c3]
        })
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    const SHAPES: [SwingShape; 2] = [SwingShape::Light, SwingShape::Smooth];

    #[test]
    fn the_clamped_basis_sums_to_one_and_its_derivatives_match_differences() {
        for shape in SHAPES {
            let intervals = shape.intervals();
            for i in 1..40 {
                let u = f64::from(i) / 40.0 + 0.003;
                let e = 1e-6;
                let b = clamped_cubic(intervals, u);
                let (p, m) = (clamped_cubic(intervals, u + e), clamped_cubic(intervals, u - e));
                assert_eq!(b[0].len(), intervals + 3);
                assert!((b[0].iter().sum::<f64>() - 1.0).abs() < 1e-13);
                for k in 0..intervals + 3 {
                    assert!(((p[0][k] - m[0][k]) / (2.0 * e) - b[1][k]).abs() < 1e-7, "u {u} k {k}");
                    assert!(((p[1][k] - m[1][k]) / (2.0 * e) - b[2][k]).abs() < 1e-6, "u {u} k {k}");
                }
            }
        }
    }

    #[test]
    fn the_polynomials_are_the_basis() {
        for shape in SHAPES {
            let basis = SwingBasis::new(shape);
            for i in 0..=40 {
                let u = f64::from(i) / 40.0;
                let expected = swing_basis(shape, u);
                for (m, found) in basis.at(u).enumerate() {
                    for derivative in 0..3 {
                        let error = found[derivative] - expected[derivative][m];
                        assert!(error.abs() < 1e-10, "u {u}, {derivative}, {m}");
                    }
                }
            }
            let first: Vec<f64> = basis.at(-0.3).map(|weights| weights[0]).collect();
            assert_eq!((first[0], first.len()), (1.0, shape.points()));
        }
    }

    #[test]
    fn a_swing_starts_and_ends_at_rest() {
        for (shape, derivatives) in [(SwingShape::Light, 1..2), (SwingShape::Smooth, 1..3)] {
            for u in [0.0, 1.0] {
                let basis = swing_basis(shape, u);
                for derivative in derivatives.clone() {
                    assert!(basis[derivative].iter().all(|b| b.abs() < 1e-12), "{shape:?} {derivative}");
                }
            }
        }
    }
}
