//! Energy densities that are distances, ½‖J − T(J)‖², of J from a target matrix.

use super::density::Density;
use super::lanes::Lanes;
use super::singular::Singular;
use crate::scenario::MapScale;

/// ρ = ½‖J − T‖², T a function of J. Such an energy does not prevent folding.
#[derive(Clone, Copy, Debug)]
pub(super) enum Distance {
    /// T = 1, the Dirichlet energy of the displacement φ − x̄, whose minimizers are harmonic.
    Identity,
    /// T = U Vᵀ, the nearest rotation.
    Rotation,
    /// T = s U Vᵀ, a scaled rotation: half the paper's ρ of Eq. 6 with μ = 0.
    Similarity(MapScale),
}

/// The scale s of the target: |Σ|^⅓ as printed in the paper, or tr Σ/3, which minimizes ‖Σ − s 1‖².
#[inline]
pub(super) fn scale(kind: MapScale, sigma: &[Lanes; 3]) -> Lanes {
    match kind {
        MapScale::Trace => (1.0 / 3.0) * (sigma[0] + sigma[1] + sigma[2]),
        MapScale::Determinant => (sigma[0] * sigma[1] * sigma[2]).map(|d| d.abs().cbrt()),
    }
}

impl Density for Distance {
    /// ρ and J − T. By the envelope theorem this is ∂ρ/∂J if T is the nearest matrix of its kind. For |Σ|^⅓ it is not, and
    /// J − T is the derivative with T frozen, which is all that Algorithm 1 needs.
    #[inline]
    fn at(&self, j: &[Lanes; 9]) -> (Lanes, [Lanes; 9]) {
        let mut gradient = *j;
        if let Distance::Identity = self {
            for i in 0..3 {
                gradient[4 * i] = gradient[4 * i] - Lanes::splat(1.0);
            }
        } else {
            let singular = Singular::of(j);
            let scale = match self {
                Distance::Similarity(kind) => scale(*kind, &singular.sigma),
                _ => Lanes::splat(1.0),
            };
            for (g, r) in gradient.iter_mut().zip(singular.rotation()) {
                *g = *g - scale * r;
            }
        }
        (half_square(&gradient), gradient)
    }

    /// That of ½‖∇u‖² for harmonic maps and for Algorithm 1, which freezes T; that of ½‖sym ∇u‖² for rotations.
    fn stiffness(&self) -> [f64; 2] {
        match self {
            Distance::Rotation => [0.5, 1.0],
            _ => [1.0, 1.0],
        }
    }

    /// Laplace's equation needs a constant weight.
    fn weight(&self, z: f64, torso: f64) -> f64 {
        match self {
            Distance::Identity => 1.0,
            _ => super::density::weight(z, torso),
        }
    }

    fn face_weight(&self) -> f64 {
        match self {
            Distance::Identity => 0.0,
            _ => super::density::FACE_WEIGHT,
        }
    }

    fn may_fold(&self) -> bool {
        true
    }
}

/// ½‖J‖², whose energy has the stiffness matrix times the coefficients as its gradient.
#[derive(Clone, Copy, Debug)]
pub(super) struct Norm;

impl Density for Norm {
    #[inline]
    fn at(&self, j: &[Lanes; 9]) -> (Lanes, [Lanes; 9]) {
        (half_square(j), *j)
    }
}

#[inline]
fn half_square(j: &[Lanes; 9]) -> Lanes {
    let mut sum = j[0] * j[0];
    for v in &j[1..] {
        sum += *v * *v;
    }
    0.5 * sum
}

#[cfg(test)]
mod tests {
    use super::super::density::tests::{gradient_error, value};
    use super::*;

    const TURNED: [f64; 9] = [1.1, 0.3, -0.2, 0.1, 0.8, 0.25, -0.4, 0.2, 1.3];
    const FOLDED: [f64; 9] = [1.1, 0.3, -0.2, 0.1, 0.8, 0.25, -0.4, 0.2, -0.7];

    #[test]
    fn gradients_match_central_differences_also_where_space_folds() {
        for density in [Distance::Identity, Distance::Rotation, Distance::Similarity(MapScale::Trace)] {
            for j in [TURNED, FOLDED] {
                let error = gradient_error(density, j);
                assert!(error < 1e-8, "{density:?} {error}");
            }
        }
        assert!(gradient_error(Norm, TURNED) < 1e-8);
    }

    #[test]
    fn they_are_zero_where_they_should_be() {
        let (s, c) = 0.7_f64.sin_cos();
        let turn = [c, -s, 0.0, s, c, 0.0, 0.0, 0.0, 1.0];
        let one = [1.0, 0.0, 0.0, 0.0, 1.0, 0.0, 0.0, 0.0, 1.0];
        assert!(value(Distance::Rotation, turn).abs() < 1e-13);
        assert!(value(Distance::Identity, one) == 0.0 && value(Distance::Identity, turn) > 0.1);
        for kind in [MapScale::Trace, MapScale::Determinant] {
            assert!(value(Distance::Similarity(kind), turn.map(|v| 2.5 * v)).abs() < 1e-12);
        }
        assert!(value(Distance::Rotation, turn.map(|v| 2.5 * v)) > 3.0);
    }

    #[test]
    fn the_trace_gives_the_nearer_scale() {
        for j in [TURNED, FOLDED] {
            let [trace, determinant] =
                [MapScale::Trace, MapScale::Determinant].map(|kind| value(Distance::Similarity(kind), j));
            assert!(trace < determinant, "{trace} {determinant}");
        }
    }
}
