//! The uniform cubic B-spline along one axis: weights, their extension beyond the ends, and interpolation.

use crate::bspline::uniform_cubic;

/// Beyond an end the second derivative fades out over this length, m.
pub const CURVATURE_FADE: f64 = 0.2;
/// Beyond an end the slope fades out over this length, m; farther out, h is constant along the axis.
pub const SLOPE_FADE: f64 = 0.4;

/// One axis of the grid: nodes at `origin + i·spacing`, 0 ≤ i < count, and count + 2 spline coefficients.
#[derive(Clone, Copy, Debug, PartialEq)]
pub(super) struct Axis {
    pub origin: f64,
    pub spacing: f64,
    pub count: usize,
    /// 1 / spacing, so that evaluation does not divide.
    pub rate: f64,
}

/// The four coefficients that matter at a point start at `first`; their sum weighted by `weights[k]` is the k-th derivative.
pub(super) struct Weights<const ORDERS: usize> {
    pub first: usize,
    pub weights: [[f64; 4]; ORDERS],
}

impl Axis {
    pub fn new(origin: f64, spacing: f64, count: usize) -> Self {
        Self { origin, spacing, count, rate: 1.0 / spacing }
    }

    pub fn end(&self) -> f64 {
        self.origin + self.spacing * (self.count - 1) as f64
    }

    /// Weights of the value and the derivatives up to order `ORDERS` − 1 ≤ 3 at x, which may lie beyond the ends.
    #[inline]
    pub fn weights<const ORDERS: usize>(&self, x: f64) -> Weights<ORDERS> {
        let u = (x - self.origin) * self.rate;
        let last = (self.count - 1) as f64;
        // A NaN ends up in the first cell with NaN weights.
        let first = (u as usize).min(self.count - 2);
        if u < 0.0 {
            Weights { first: 0, weights: self.beyond(0.0, x - self.origin) }
        } else if u > last {
            Weights { first, weights: self.beyond(1.0, x - self.end()) }
        } else {
            Weights { first, weights: self.inside(u - first as f64) }
        }
    }

    /// Weights at the local coordinate s ∈ [0, 1] of a cell.
    #[inline]
    fn inside<const ORDERS: usize>(&self, s: f64) -> [[f64; 4]; ORDERS] {
        let basis = uniform_cubic(s);
        let mut weights = [[0.0; 4]; ORDERS];
        let mut scale = 1.0;
        for (row, values) in weights.iter_mut().zip(basis) {
            *row = values.map(|b| b * scale);
            scale *= self.rate;
        }
        weights
    }

    /// Weights at the signed distance t beyond the end whose cell-local coordinate is `s` (0 or 1).
    ///
    /// With value a, slope b and second derivative c at the end, the extension is a + b P(t) + c Q(t); it joins C²
    /// because P = t + O(t³), Q = t²/2 + O(t³), and it is constant once both have faded out:
    ///
    /// P' = (1 − τ)²(1 + 2τ), τ = |t| / `SLOPE_FADE`;  Q = t²/2 (1 − τ)³, τ = |t| / `CURVATURE_FADE`.
    #[cold]
    fn beyond<const ORDERS: usize>(&self, s: f64, t: f64) -> [[f64; 4]; ORDERS] {
        let [value, slope, curvature] = self.inside::<3>(s);
        let (sign, distance) = (t.signum(), t.abs());
        let p = slope_fade(distance);
        let q = curvature_fade(distance);
        let mut weights = [[0.0; 4]; ORDERS];
        // P(−t) = −P(t) and Q(−t) = Q(t): each derivative in t flips the sign once more.
        let mut parity = 1.0;
        for (order, row) in weights.iter_mut().enumerate() {
            for k in 0..4 {
                let constant = if order == 0 { value[k] } else { 0.0 };
                row[k] = constant + parity * (sign * slope[k] * p[order] + curvature[k] * q[order]);
            }
            parity *= sign;
        }
        weights
    }
}

/// P and its first three derivatives at t ≥ 0: P = L(τ − τ³ + τ⁴/2), constant L/2 from τ = 1 on.
fn slope_fade(t: f64) -> [f64; 4] {
    const L: f64 = SLOPE_FADE;
    if t >= L {
        return [0.5 * L, 0.0, 0.0, 0.0];
    }
    let s = t / L;
    [
        L * s * (1.0 - s * s * (1.0 - 0.5 * s)),
        (1.0 - s) * (1.0 - s) * (1.0 + 2.0 * s),
        -6.0 * s * (1.0 - s) / L,
        -6.0 * (1.0 - 2.0 * s) / (L * L),
    ]
}

/// Q and its first three derivatives at t ≥ 0: Q = L²/2 τ²(1 − τ)³, zero from τ = 1 on.
fn curvature_fade(t: f64) -> [f64; 4] {
    const L: f64 = CURVATURE_FADE;
    if t >= L {
        return [0.0; 4];
    }
    let s = t / L;
    let r = 1.0 - s;
    [
        0.5 * L * L * s * s * r * r * r,
        0.5 * L * s * r * r * (2.0 - 5.0 * s),
        r * (1.0 + s * (-8.0 + 10.0 * s)),
        (-9.0 + s * (36.0 - 30.0 * s)) / L,
    ]
}

/// Spline coefficients c₋₁ … cₙ (shifted by one) of many lines at once, not-a-knot at both ends.
///
/// Interpolation requires cᵢ₋₁ + 4cᵢ + cᵢ₊₁ = 6 sᵢ. Not-a-knot (no jump of the third derivative at node 1) requires
/// δ⁴c₁ = 0. With the first three equations this gives c₁ = (8s₁ − s₀ − s₂)/6 directly, and likewise at the other end. The
/// remaining system is tridiagonal and diagonally dominant; c₀ and c₋₁ follow from the equations at nodes 1 and 0.
pub(super) struct Interpolation {
    count: usize,
    /// The superdiagonal of the eliminated system for c₂ … cₙ₋₃.
    upper: Vec<f64>,
}

impl Interpolation {
    /// For lines of `count` ≥ 4 nodes.
    pub fn new(count: usize) -> Self {
        let mut upper = vec![0.0; count];
        for i in 2..count.saturating_sub(2) {
            upper[i] = 1.0 / (4.0 - upper[i - 1]);
        }
        Self { count, upper }
    }

    /// Solves `lines` interleaved lines: node i of line l is `samples[i * lines + l]`; the result has count + 2 nodes.
    pub fn solve(&self, lines: usize, samples: &[f64]) -> Vec<f64> {
        let n = self.count;
        let mut c = vec![0.0; (n + 2) * lines];
        let s = |i: usize, l: usize| samples[i * lines + l];
        let at = |i: usize| i + 1; // coefficient i is stored at i + 1
        for l in 0..lines {
            c[at(1) * lines + l] = (8.0 * s(1, l) - s(0, l) - s(2, l)) / 6.0;
            c[at(n - 2) * lines + l] = (8.0 * s(n - 2, l) - s(n - 3, l) - s(n - 1, l)) / 6.0;
        }
        for i in 2..n - 2 {
            for l in 0..lines {
                let below = c[at(i - 1) * lines + l];
                c[at(i) * lines + l] = (6.0 * s(i, l) - below) * self.upper[i];
            }
        }
        for i in (2..n - 2).rev() {
            for l in 0..lines {
                let above = c[at(i + 1) * lines + l];
                c[at(i) * lines + l] -= self.upper[i] * above;
            }
        }
        // The two outer coefficients at either end.
        for l in 0..lines {
            let get = |c: &[f64], i: usize| c[i * lines + l];
            c[lines + l] = 6.0 * s(1, l) - 4.0 * get(&c, 2) - get(&c, 3);
            c[l] = 6.0 * s(0, l) - 4.0 * get(&c, 1) - get(&c, 2);
            c[n * lines + l] = 6.0 * s(n - 2, l) - 4.0 * get(&c, n - 1) - get(&c, n - 2);
            c[(n + 1) * lines + l] = 6.0 * s(n - 1, l) - 4.0 * get(&c, n) - get(&c, n - 1);
        }
        c
    }
}
