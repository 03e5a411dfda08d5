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
    fn a_clamped_spline_starts_and_ends_at_rest_when_its_outer_points_coincide() {
        for (u, outer) in [(0.0, [0, 1]), (1.0, [5, 6])] {
            let b = clamped_cubic(4, u);
            let inner: f64 =
                (0..7).filter(|k| !outer.contains(k)).map(|k| b[0][k].abs() + b[1][k].abs()).sum();
            assert!(inner < 1e-14, "value and velocity depend on the outer two points alone");
        }
    }
}
