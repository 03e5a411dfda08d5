//! Singular value decompositions of 3×3 matrices, several at once.

use super::lanes::{LANES, Lanes};

/// J = U diag(σ) Vᵀ with rotations U and V (flat, row by row), σ₀ ≥ σ₁ ≥ |σ₂|, and σ₂ with the sign of det J. Then U Vᵀ is the
/// rotation nearest to J, whatever that sign: the closed form of Eq. 12 in Corollary IV.1, corrected for det J < 0.
#[derive(Clone, Copy, Debug)]
pub(super) struct Singular {
    pub u: [Lanes; 9],
    pub sigma: [Lanes; 3],
    pub v: [Lanes; 9],
}

/// Sweeps of Jacobi's method; on 3×3 matrices it has converged before the fifth.
const SWEEPS: usize = 5;
/// Keeps quotients finite for matrices of rank one or zero, whose rotation is undefined anyway.
const TINY: f64 = 1e-150;

impl Singular {
    /// By Jacobi's method on JᵀJ. Small singular values have an error of √ε relative to the largest, which is enough for an energy.
    #[inline]
    pub fn of(j: &[Lanes; 9]) -> Singular {
        let mut v = [0, 0, 0, 0, 0, 0, 0, 0, 0].map(|_: i32| Lanes::ZERO);
        for i in 0..3 {
            v[4 * i] = Lanes::splat(1.0);
        }
        let product = |a: usize, b: usize| j[a] * j[b] + j[3 + a] * j[3 + b] + j[6 + a] * j[6 + b];
        let mut c = [0, 1, 2, 3, 4, 5, 6, 7, 8].map(|i| product(i / 3, i % 3));
        for _ in 0..SWEEPS {
            for (p, q, r) in [(0, 1, 2), (0, 2, 1), (1, 2, 0)] {
                rotate(&mut c, &mut v, p, q, r);
            }
        }
        let mut squares = [c[0], c[4], c[8]];
        for (p, q) in [(0, 1), (0, 2), (1, 2)] {
            sort(&mut squares, &mut v, p, q);
        }
        let image = |k: usize| -> [Lanes; 3] {
            std::array::from_fn(|i| j[3 * i] * v[k] + j[3 * i + 1] * v[3 + k] + j[3 * i + 2] * v[6 + k])
        };
        let (first, second, third) = (image(0), image(1), image(2));
        let (a, largest) = normalized(first);
        let along = dot(&a, &second);
        let (b, middle) = normalized(std::array::from_fn(|i| second[i] - along * a[i]));
        let normal = [a[1] * b[2] - a[2] * b[1], a[2] * b[0] - a[0] * b[2], a[0] * b[1] - a[1] * b[0]];
        let least = dot(&normal, &third);
        let mut u = v;
        for i in 0..3 {
            (u[3 * i], u[3 * i + 1], u[3 * i + 2]) = (a[i], b[i], normal[i]);
        }
        Singular { u, sigma: [largest, middle, least], v }
    }

    /// U Vᵀ.
    #[inline]
    pub fn rotation(&self) -> [Lanes; 9] {
        let Singular { u, v, .. } = self;
        let entry = |i: usize, j: usize| {
            u[3 * i] * v[3 * j] + u[3 * i + 1] * v[3 * j + 1] + u[3 * i + 2] * v[3 * j + 2]
        };
        [0, 1, 2, 3, 4, 5, 6, 7, 8].map(|at| entry(at / 3, at % 3))
    }
}

/// The Jacobi rotation in the plane of p and q that makes C_pq zero.
#[inline]
fn rotate(c: &mut [Lanes; 9], v: &mut [Lanes; 9], p: usize, q: usize, r: usize) {
    let off = 2.0 * c[3 * p + q];
    let difference = c[4 * q] - c[4 * p];
    let root = (difference * difference + off * off).map(f64::sqrt);
    let sign = difference.map(|d| if d < 0.0 { -1.0 } else { 1.0 });
    let tangent = sign * off / (sign * difference + root + Lanes::splat(TINY));
    let cosine = (Lanes::splat(1.0) + tangent * tangent).map(|x| 1.0 / x.sqrt());
    let sine = tangent * cosine;
    let half = 0.5 * tangent * off;
    c[4 * p] = c[4 * p] - half;
    c[4 * q] += half;
    c[3 * p + q] = Lanes::ZERO;
    let (a, b) = (c[3 * p.min(r) + p.max(r)], c[3 * q.min(r) + q.max(r)]);
    c[3 * p.min(r) + p.max(r)] = cosine * a - sine * b;
    c[3 * q.min(r) + q.max(r)] = sine * a + cosine * b;
    for i in 0..3 {
        let (a, b) = (v[3 * i + p], v[3 * i + q]);
        v[3 * i + p] = cosine * a - sine * b;
        v[3 * i + q] = sine * a + cosine * b;
    }
}

/// Swaps columns p and q of V where the former belongs to the smaller value, and negates one so that V stays a rotation.
#[inline]
fn sort(squares: &mut [Lanes; 3], v: &mut [Lanes; 9], p: usize, q: usize) {
    for l in 0..LANES {
        if squares[p].0[l] < squares[q].0[l] {
            (squares[p].0[l], squares[q].0[l]) = (squares[q].0[l], squares[p].0[l]);
            for i in 0..3 {
                (v[3 * i + p].0[l], v[3 * i + q].0[l]) = (v[3 * i + q].0[l], -v[3 * i + p].0[l]);
            }
        }
    }
}

#[inline]
fn dot(a: &[Lanes; 3], b: &[Lanes; 3]) -> Lanes {
    a[0] * b[0] + a[1] * b[1] + a[2] * b[2]
}

/// The direction and the length of a vector.
#[inline]
fn normalized(a: [Lanes; 3]) -> ([Lanes; 3], Lanes) {
    let length = dot(&a, &a).map(f64::sqrt);
    let inverse = length.map(|x| 1.0 / x.max(TINY));
    (a.map(|x| inverse * x), length)
}

#[cfg(test)]
mod tests {
    use super::*;
    use nalgebra::Matrix3;

    fn matrix(lanes: &[Lanes; 9], l: usize) -> Matrix3<f64> {
        Matrix3::from_fn(|r, c| lanes[3 * r + c].0[l])
    }

    #[test]
    fn it_decomposes_regular_folded_and_repeated_values() {
        let wave = |k: usize| (0.9 * k as f64 + 0.3).sin();
        for trial in 0..50 {
            let mut j: [Lanes; 9] =
                std::array::from_fn(|i| Lanes(std::array::from_fn(|l| wave(36 * trial + 9 * l + i))));
            if trial % 5 == 0 {
                // Scaled rotations, where any basis serves.
                let (s, c) = (trial as f64).sin_cos();
                let turn = [c, -s, 0.0, s, c, 0.0, 0.0, 0.0, 1.0];
                j = std::array::from_fn(|i| Lanes::splat(1.7 * turn[i]));
            }
            let found = Singular::of(&j);
            let rotation = found.rotation();
            for l in 0..LANES {
                let (u, v, whole) = (matrix(&found.u, l), matrix(&found.v, l), matrix(&j, l));
                let sigma = found.sigma.map(|s| s.0[l]);
                assert!((u.determinant() - 1.0).abs() < 1e-12 && (v.determinant() - 1.0).abs() < 1e-12);
                assert!((u * Matrix3::from_diagonal(&sigma.into()) * v.transpose() - whole).norm() < 1e-7);
                assert!(sigma[0] + 1e-9 >= sigma[1] && sigma[1] + 1e-9 >= sigma[2].abs(), "{sigma:?}");
                let product: f64 = sigma.iter().product();
                assert!((product - whole.determinant()).abs() < 1e-7);
                // The nearest rotation beats others nearby.
                let best = (matrix(&rotation, l) - whole).norm();
                for k in 0..6 {
                    let turn =
                        nalgebra::Rotation3::new(nalgebra::Vector3::from_fn(|i, _| 0.1 * wave(7 * k + i)));
                    assert!((turn.matrix() * matrix(&rotation, l) - whole).norm() >= best - 1e-12);
                }
            }
        }
    }

    #[test]
    fn matrices_without_rank_stay_finite() {
        let mut j = [Lanes::ZERO; 9];
        for found in [Singular::of(&j), {
            j[4] = Lanes::splat(2.0);
            Singular::of(&j)
        }] {
            assert!(found.rotation().iter().all(|r| r.0.iter().all(|v| v.is_finite())));
        }
    }
}
