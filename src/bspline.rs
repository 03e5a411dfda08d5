//! The uniform cubic B-spline on one cell, for all splines of the planner.

/// The highest derivative that is not zero.
pub(crate) const DEGREE: usize = 3;

/// The four basis functions that overlap a cell of unit size, and their derivatives up to the third, at t ∈ [0, 1] of the cell:
/// `[derivative][function]`.
#[inline]
pub(crate) fn uniform_cubic(t: f64) -> [[f64; 4]; DEGREE + 1] {
    let r = 1.0 - t;
    [
        [
            r * r * r / 6.0,
            ((3.0 * t - 6.0) * t * t + 4.0) / 6.0,
            (((3.0 - 3.0 * t) * t + 3.0) * t + 1.0) / 6.0,
            t * t * t / 6.0,
        ],
        [-r * r / 2.0, (3.0 * t - 4.0) * t / 2.0, ((2.0 - 3.0 * t) * t + 1.0) / 2.0, t * t / 2.0],
        [r, 3.0 * t - 2.0, 1.0 - 3.0 * t, t],
        [-1.0, 3.0, -3.0, 1.0],
    ]
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn the_basis_sums_to_one_and_its_derivatives_match_central_differences() {
        for i in 0..=20 {
            let t = f64::from(i) / 20.0;
            let step = 1e-6;
            let [at, ahead, behind] = [t, t + step, t - step].map(uniform_cubic);
            assert!((at[0].iter().sum::<f64>() - 1.0).abs() < 1e-14);
            for m in 0..DEGREE {
                for k in 0..4 {
                    let slope = (ahead[m][k] - behind[m][k]) / (2.0 * step);
                    assert!((slope - at[m + 1][k]).abs() < 1e-8, "derivative {m} of function {k} at {t}");
                }
            }
        }
    }
}
