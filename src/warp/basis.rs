//! Weights of a uniform cubic B-spline along one axis (N cells of unit size, N + 3 coefficients, parameter s in cells), and their
//! extension beyond the ends.

use crate::bspline::uniform_cubic;

/// The weights along one axis at a point.
pub(super) struct AxisWeights<const M: usize> {
    /// The first of the four coefficients with a weight.
    pub first: usize,
    /// Their weights, `[derivative][coefficient]`, derivatives with respect to s.
    pub weight: [[f64; 4]; M],
    /// A translation along this axis to be added to φ, in cells, and its derivatives. Zero inside the box.
    pub shift: [f64; M],
}

/// Weights for derivatives below the M-th at parameter `s`, which may be outside [0, cells].
///
/// Outside, the spline is extruded with C² continuity: within one cell of the face, the Taylor terms of the spline fade out and a unit
/// translation along the axis fades in; beyond, φ is the face, translated. (Continuing the polynomial instead folds space within a
/// meter.) With u the distance from the face in cells, σ its sign, and b, b', b'' the weights at the face:
///
///   b(u) = b + σ a(u) b' + c(u) b'',   a' = 1 − u²(3 − 2u),   c'' = (1 − u)(1 − 3u),   shift' = 1 − a',
///
/// for u ≤ 1. Beyond, all are constant except the shift, whose slope is one.
pub(super) fn axis_weights<const M: usize>(s: f64, cells: usize) -> AxisWeights<M> {
    let inside = s.clamp(0.0, cells as f64);
    let first = (inside as usize).min(cells - 1);
    let b = uniform_cubic(inside - first as f64);
    let over = s - inside;
    if over == 0.0 {
        return AxisWeights { first, weight: std::array::from_fn(|m| b[m]), shift: [0.0; M] };
    }
    let sign = over.signum();
    let distance = over.abs();
    let u = distance.min(1.0);
    let beyond = distance > 1.0;
    let fading = |value: f64| if beyond { 0.0 } else { value };
    // Values and derivatives with respect to u.
    let a = [
        u - u * u * u * (1.0 - u / 2.0),
        fading(1.0 - u * u * (3.0 - 2.0 * u)),
        fading(-6.0 * u * (1.0 - u)),
        fading(12.0 * u - 6.0),
    ];
    let c = [
        u * u * (0.5 - u * (2.0 / 3.0 - u / 4.0)),
        fading(u * (1.0 - u) * (1.0 - u)),
        fading((1.0 - u) * (1.0 - 3.0 * u)),
        fading(6.0 * u - 4.0),
    ];
    let translation = [distance - a[0], 1.0 - a[1], -a[2], -a[3]];
    let mut weight = [[0.0; 4]; M];
    let mut shift = [0.0; M];
    for m in 0..M {
        // d/ds = σ d/du, and σ a is odd, c even.
        let odd = if m % 2 == 0 { sign } else { 1.0 };
        let even = if m % 2 == 0 { 1.0 } else { sign };
        for k in 0..4 {
            weight[m][k] = odd * a[m] * b[1][k] + even * c[m] * b[2][k];
        }
        shift[m] = odd * translation[m];
    }
    for k in 0..4 {
        weight[0][k] += b[0][k];
    }
    AxisWeights { first, weight, shift }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn basis_sums_to_one_and_reproduces_the_identity_even_outside() {
        for i in -30..=80 {
            let s = 0.1 * f64::from(i) + 0.003;
            let w = axis_weights::<4>(s, 5);
            let coefficient = |k: usize| (w.first + k) as f64 - 1.0;
            for m in 0..4 {
                let sum: f64 = w.weight[m].iter().sum();
                let identity: f64 = (0..4).map(|k| w.weight[m][k] * coefficient(k)).sum::<f64>() + w.shift[m];
                assert!((sum - f64::from(u8::from(m == 0))).abs() < 1e-13, "sum at {s}, order {m}: {sum}");
                let expected = [s, 1.0, 0.0, 0.0][m];
                assert!((identity - expected).abs() < 1e-12, "identity at {s}, order {m}: {identity}");
            }
        }
    }

    #[test]
    fn weights_are_continuous_up_to_the_second_derivative_at_the_face_and_one_cell_beyond() {
        for s in [-1.0, 0.0, 2.0, 5.0, 6.0] {
            // By coefficient, since `first` may change at a knot.
            let dense = |s: f64| {
                let w = axis_weights::<3>(s, 5);
                let mut out = [[0.0; 9]; 3];
                for m in 0..3 {
                    for k in 0..4 {
                        out[m][w.first + k] = w.weight[m][k];
                    }
                    out[m][8] = w.shift[m];
                }
                out
            };
            let (left, right) = (dense(s - 1e-9), dense(s + 1e-9));
            for m in 0..3 {
                for k in 0..9 {
                    assert!((left[m][k] - right[m][k]).abs() < 1e-7, "at {s}, order {m}, coefficient {k}");
                }
            }
        }
    }
}
