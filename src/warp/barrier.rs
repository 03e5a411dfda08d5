//! The paper's energy density with its barrier (the ρ of Eq. 6), and the Gauss–Newton part of its second derivative.

use super::density::{Density, MIN_DET, cofactors, determinant};
use super::distance;
use super::lanes::Lanes;
use super::singular::Singular;
use crate::scenario::MapScale;

/// Weight μ of the barrier. Over flat ground, where nothing holds the top face, it stretches space by ¾ μ.
const BARRIER_WEIGHT: f64 = 1e-3;

/// ρ = ½‖J − s U Vᵀ‖² − μ log det J, infinite where space folds: half the paper's ρ of Eq. 6 (so μ is half
/// the paper's), with s in place of |Σ|^⅓.
#[derive(Clone, Copy, Debug)]
pub(super) struct Barrier {
    pub scale: MapScale,
}

impl Density for Barrier {
    /// s does not depend on U and V, so ∂ρ/∂J = J − s U Vᵀ − (tr Σ − 3s) ∂s/∂J − μ J⁻ᵀ. The third term is zero for s = tr Σ/3;
    /// for s = |Σ|^⅓, ∂s/∂J = s J⁻ᵀ/3.
    #[inline]
    fn at(&self, j: &[Lanes; 9]) -> (Lanes, [Lanes; 9]) {
        let singular = Singular::of(j);
        let [a, b, c] = singular.sigma;
        let scale = distance::scale(self.scale, &singular.sigma);
        let cofactor = cofactors(j);
        let det = determinant(j, &cofactor);
        let inverse = det.map(|d| if d > MIN_DET { 1.0 / d } else { 0.0 });
        let excess = match self.scale {
            MapScale::Trace => Lanes::ZERO,
            MapScale::Determinant => (1.0 / 3.0) * scale * (a + b + c - 3.0 * scale),
        };
        let pull = inverse * (excess + Lanes::splat(BARRIER_WEIGHT));
        let rotation = singular.rotation();
        let mut gradient = *j;
        let mut energy = det.map(|d| if d > MIN_DET { -BARRIER_WEIGHT * d.ln() } else { f64::INFINITY });
        for i in 0..9 {
            let difference = j[i] - scale * rotation[i];
            energy += 0.5 * (difference * difference);
            gradient[i] = difference - pull * cofactor[i];
        }
        (energy, gradient)
    }
}

/// The Gauss–Newton approximation of ∂²ρ/∂J², positive semidefinite, in the bases U and V.
///
/// With M̂ = UᵀMV for a change M of J, the residual Σ − s changes by D diag(M̂), D_ij = δ_ij − ∂s/∂σ_j. Off the diagonal, its
/// symmetric part changes by that of M̂, and its skew part by (1 − 2s/(σ_i + σ_j)) times that of M̂, since U Vᵀ rotates with J. Of
/// the barrier's curvature μ J⁻ᵀMᵀJ⁻ᵀ, the nonnegative parts are kept: μ/σ_i² and, for the symmetric part, μ/(σ_i σ_j).
#[derive(Clone, Copy, Debug)]
pub(super) struct BarrierCurvature {
    u: [Lanes; 9],
    v: [Lanes; 9],
    /// DᵀD + μ Σ⁻², flat.
    diagonal: [Lanes; 9],
    /// Half the factors of the symmetric part, in the order of [`PAIRS`].
    symmetric: [Lanes; 3],
    /// Half the factors of the skew part.
    skew: [Lanes; 3],
}

/// Entries above the diagonal.
const PAIRS: [(usize, usize); 3] = [(0, 1), (0, 2), (1, 2)];

impl Barrier {
    /// The curvature at J, which must not be folded, plus `damping` times that of the relative change M̂_ij²/(σ_i σ_j), which
    /// restrains the points that are about to fold and leaves the others free.
    #[inline]
    pub fn curvature(&self, j: &[Lanes; 9], damping: f64) -> BarrierCurvature {
        let Singular { u, sigma, v } = Singular::of(j);
        let scale = distance::scale(self.scale, &sigma);
        let inverse = sigma.map(|s| s.map(|s| 1.0 / s.max(MIN_DET)));
        let slope = match self.scale {
            MapScale::Trace => [Lanes::splat(1.0 / 3.0); 3],
            MapScale::Determinant => inverse.map(|i| (1.0 / 3.0) * scale * i),
        };
        let hold = BARRIER_WEIGHT + damping;
        let mut diagonal = [Lanes::ZERO; 9];
        for i in 0..3 {
            for k in 0..3 {
                // DᵀD = 1 − 1 sᵀ − s 1ᵀ + 3 s sᵀ, with s the slopes.
                diagonal[3 * i + k] = 3.0 * slope[i] * slope[k] - slope[i] - slope[k];
            }
            diagonal[4 * i] += Lanes::splat(1.0) + hold * inverse[i] * inverse[i];
        }
        let symmetric = PAIRS.map(|(i, k)| 0.5 * (Lanes::splat(1.0) + hold * inverse[i] * inverse[k]));
        let skew = PAIRS.map(|(i, k)| {
            let factor = Lanes::splat(1.0) - 2.0 * scale / (sigma[i] + sigma[k]).map(|s| s.max(MIN_DET));
            0.5 * (factor * factor + damping * inverse[i] * inverse[k])
        });
        BarrierCurvature { u, v, diagonal, symmetric, skew }
    }
}

impl BarrierCurvature {
    /// The curvature times a change of J.
    #[inline]
    pub fn times(&self, change: &[Lanes; 9]) -> [Lanes; 9] {
        let m = product(&transposed(&self.u), &product(change, &self.v));
        let mut out = [Lanes::ZERO; 9];
        for i in 0..3 {
            for k in 0..3 {
                out[4 * i] += self.diagonal[3 * i + k] * m[4 * k];
            }
        }
        for (at, (i, k)) in PAIRS.into_iter().enumerate() {
            let (a, b) = (m[3 * i + k], m[3 * k + i]);
            let (symmetric, skew) = (self.symmetric[at] * (a + b), self.skew[at] * (a - b));
            out[3 * i + k] = symmetric + skew;
            out[3 * k + i] = symmetric - skew;
        }
        product(&self.u, &product(&out, &transposed(&self.v)))
    }
}

#[inline]
fn transposed(a: &[Lanes; 9]) -> [Lanes; 9] {
    [a[0], a[3], a[6], a[1], a[4], a[7], a[2], a[5], a[8]]
}

#[inline]
fn product(a: &[Lanes; 9], b: &[Lanes; 9]) -> [Lanes; 9] {
    let entry = |i: usize, k: usize| a[3 * i] * b[k] + a[3 * i + 1] * b[3 + k] + a[3 * i + 2] * b[6 + k];
    [0, 1, 2, 3, 4, 5, 6, 7, 8].map(|at| entry(at / 3, at % 3))
}

#[cfg(test)]
mod tests {
    use super::super::density::tests::{gradient_error, value};
    use super::*;

    const BENT: [f64; 9] = [1.1, 0.3, -0.2, 0.1, 0.8, 0.25, -0.4, 0.2, 1.3];

    #[test]
    fn gradients_match_central_differences() {
        for scale in [MapScale::Trace, MapScale::Determinant] {
            let error = gradient_error(Barrier { scale }, BENT);
            assert!(error < 1e-8, "{scale:?} {error}");
        }
    }

    #[test]
    fn folds_cost_infinitely_much() {
        let folded = [1.0, 0.0, 0.0, 0.0, 1.0, 0.0, 0.0, 0.0, -1.0];
        assert_eq!(value(Barrier { scale: MapScale::Trace }, folded), f64::INFINITY);
    }

    /// Gauss–Newton is exact where the residual is small, that is, at a nearly conformal J, except for the barrier's skew part.
    #[test]
    fn curvature_matches_differences_of_the_gradient_near_conformal_maps() {
        let (s, c) = 0.7_f64.sin_cos();
        let mut j = [c, -s, 0.0, s, c, 0.0, 0.0, 0.0, 1.0].map(|v| 1.3 * v);
        j[1] += 1e-5;
        for scale in [MapScale::Trace, MapScale::Determinant] {
            let density = Barrier { scale };
            let curvature = density.curvature(&j.map(Lanes::splat), 0.0);
            for i in 0..9 {
                let gradient = |step: f64| {
                    let mut moved = j;
                    moved[i] += step;
                    density.at(&moved.map(Lanes::splat)).1
                };
                let (ahead, behind) = (gradient(1e-5), gradient(-1e-5));
                let mut unit = [Lanes::ZERO; 9];
                unit[i] = Lanes::splat(1.0);
                let times = curvature.times(&unit);
                for k in 0..9 {
                    let slope = (ahead[k].0[0] - behind[k].0[0]) / 2e-5;
                    assert!(
                        (slope - times[k].0[0]).abs() < 2e-3,
                        "{scale:?} {i} {k}: {slope} {}",
                        times[k].0[0]
                    );
                }
            }
        }
    }

    fn matrix(density: Barrier, j: [f64; 9], damping: f64) -> nalgebra::DMatrix<f64> {
        let curvature = density.curvature(&j.map(Lanes::splat), damping);
        nalgebra::DMatrix::from_fn(9, 9, |r, c| {
            let mut unit = [Lanes::ZERO; 9];
            unit[c] = Lanes::splat(1.0);
            curvature.times(&unit)[r].0[2]
        })
    }

    /// For a diagonal J, the relative change is Σ M_ij²/(σ_i σ_j).
    #[test]
    fn damping_penalizes_relative_changes() {
        let sigma = [1.5, 1.0, 0.1];
        let j = [sigma[0], 0.0, 0.0, 0.0, sigma[1], 0.0, 0.0, 0.0, sigma[2]];
        let density = Barrier { scale: MapScale::Trace };
        let added = matrix(density, j, 0.25) - matrix(density, j, 0.0);
        for r in 0..9 {
            for c in 0..9 {
                let expected = if r == c { 0.25 / (sigma[r / 3] * sigma[r % 3]) } else { 0.0 };
                assert!((added[(r, c)] - expected).abs() < 1e-9, "{r} {c}: {} {expected}", added[(r, c)]);
            }
        }
    }

    #[test]
    fn curvature_is_symmetric_and_positive_semidefinite() {
        for scale in [MapScale::Trace, MapScale::Determinant] {
            let matrix = matrix(Barrier { scale }, BENT, 0.0);
            assert!((&matrix - matrix.transpose()).norm() < 1e-12);
            assert!(matrix.symmetric_eigenvalues().min() > -1e-12);
        }
    }
}
