//! Energy densities ρ(J) of the map: how much a Jacobian deviates from what a method aims at.

use super::lanes::Lanes;

/// An energy density ρ(J). Jacobians are flat, `[3 c + d]` = ∂φ_c/∂x̄_d, and come for several points at once.
pub(super) trait Density: Copy {
    /// ρ and ∂ρ/∂J; ρ is infinite where J is not allowed.
    fn at(&self, jacobian: &[Lanes; 9]) -> (Lanes, [Lanes; 9]);

    /// a and b, for the preconditioner, of ½∫ (a‖∇u‖² + (b − a) Σ (∂u_c/∂x̄_c)²), the approximate energy of a small displacement u
    /// from a conformal map.
    ///
    /// By default those of ½(½‖∇u‖² + ⅙(div u)²), which is what energies of angles alone amount to.
    fn stiffness(&self) -> [f64; 2] {
        [0.5, 2.0 / 3.0]
    }

    /// Weight at the height z̄, m: greatest at the ground, and close to `torso` at the torso and above.
    fn weight(&self, z: f64, torso: f64) -> f64 {
        weight(z, torso)
    }

    /// Weight of the bottom face relative to the volume, m.
    fn face_weight(&self) -> f64 {
        FACE_WEIGHT
    }

    /// Whether a minimizer may fold where the terrain is steep.
    fn may_fold(&self) -> bool {
        false
    }
}

/// Height over which the weight falls by a factor of e, m: feet swing below it.
const WEIGHT_DECAY: f64 = 0.25;

/// The weight over z̄ of the energies that should be small where the feet are.
pub(super) fn weight(z: f64, torso: f64) -> f64 {
    (-z / WEIGHT_DECAY).exp() + torso
}

/// The face weight of these energies. At 0.7 the mean conformal error is a third larger at the ground and a thirtieth smaller at
/// torso height (`mips`, all of the benchmark's terrains except the pit).
pub(super) const FACE_WEIGHT: f64 = 1.1;

/// Determinants up to this count as folded. Also the least argument of [`inverse_cube_root`].
pub(super) const MIN_DET: f64 = 1e-12;

/// ρ = ¼(‖J‖² / det^⅔ − 3) = ¾(A/G − 1), with A and G the arithmetic and the geometric mean of the squared singular values: zero
/// where J is a scaled rotation, positive elsewhere, infinite where space folds.
#[derive(Clone, Copy, Debug)]
pub(super) struct Mips;

impl Density for Mips {
    #[inline(always)]
    fn at(&self, j: &[Lanes; 9]) -> (Lanes, [Lanes; 9]) {
        let cofactor = cofactors(j);
        let det = determinant(j, &cofactor);
        let mut norm = j[0] * j[0];
        for v in &j[1..] {
            norm += *v * *v;
        }
        let root = inverse_cube_root(det.map(|d| d.max(MIN_DET)));
        let scale = root * root;
        let ratio = norm * scale;
        let barrier = det.map(|d| if d > MIN_DET { 0.0 } else { f64::INFINITY });
        let energy = 0.25 * (ratio - Lanes::splat(3.0)) + barrier;
        // ∂/∂J of ‖J‖² det^(−⅔) is 2 det^(−⅔) (J − ‖J‖²/(3 det) cof J).
        let pull = (1.0 / 3.0) * (ratio * root);
        let half = 0.5 * scale;
        let mut gradient = cofactor;
        for i in 0..9 {
            gradient[i] = half * (j[i] - pull * cofactor[i]);
        }
        (energy, gradient)
    }
}

/// cof J = ∂ det J / ∂J.
#[inline(always)]
pub(super) fn cofactors(j: &[Lanes; 9]) -> [Lanes; 9] {
    [
        j[4] * j[8] - j[5] * j[7],
        j[5] * j[6] - j[3] * j[8],
        j[3] * j[7] - j[4] * j[6],
        j[2] * j[7] - j[1] * j[8],
        j[0] * j[8] - j[2] * j[6],
        j[1] * j[6] - j[0] * j[7],
        j[1] * j[5] - j[2] * j[4],
        j[2] * j[3] - j[0] * j[5],
        j[0] * j[4] - j[1] * j[3],
    ]
}

/// det J, given cof J.
#[inline(always)]
pub(super) fn determinant(j: &[Lanes; 9], cofactor: &[Lanes; 9]) -> Lanes {
    j[0] * cofactor[0] + j[1] * cofactor[1] + j[2] * cofactor[2]
}

/// x^(−⅓) for 1e-12 ≤ x ≤ 1e30, to rounding: a guess from the exponent, refined by Newton's method y ← y(4 − x y³)/3.
#[inline(always)]
fn inverse_cube_root(x: Lanes) -> Lanes {
    // The bits of a float are close to a linear function of its logarithm; this constant balances the error.
    const MAGIC: u32 = 0x54a2_1d2a;
    let mut y = x.map(|x| f64::from(f32::from_bits(MAGIC - (x as f32).to_bits() / 3)));
    for _ in 0..4 {
        y = (1.0 / 3.0) * y * (Lanes::splat(4.0) - x * y * (y * y));
    }
    y
}

#[cfg(test)]
pub(super) mod tests {
    use super::*;

    fn at(density: impl Density, j: [f64; 9]) -> (f64, [f64; 9]) {
        let (energy, gradient) = density.at(&j.map(Lanes::splat));
        (energy.0[1], gradient.map(|g| g.0[1]))
    }

    pub fn value(density: impl Density, j: [f64; 9]) -> f64 {
        at(density, j).0
    }

    /// The largest difference of a gradient from central differences.
    pub fn gradient_error(density: impl Density, j: [f64; 9]) -> f64 {
        let (_, gradient) = at(density, j);
        let slope = |i: usize| {
            let moved = |step: f64| {
                let mut moved = j;
                moved[i] += step;
                value(density, moved)
            };
            (moved(1e-5) - moved(-1e-5)) / 2e-5
        };
        (0..9).map(|i| (slope(i) - gradient[i]).abs()).fold(0.0, f64::max)
    }

    #[test]
    fn inverse_cube_roots_are_exact_to_rounding() {
        let mut x = 1.1e-12;
        while x < 1e12 {
            let exact = 1.0 / f64::cbrt(x);
            let error = inverse_cube_root(Lanes::splat(x)).0[0] / exact - 1.0;
            assert!(error.abs() < 1e-14, "{x}: {error}");
            x *= 1.037;
        }
    }

    #[test]
    fn mips_is_zero_on_scaled_rotations_and_infinite_on_folds() {
        let (s, c) = 0.7_f64.sin_cos();
        let (energy, gradient) = at(Mips, [3.0 * c, -3.0 * s, 0.0, 3.0 * s, 3.0 * c, 0.0, 0.0, 0.0, 3.0]);
        assert!(energy.abs() < 1e-13 && gradient.iter().all(|g| g.abs() < 1e-13));
        let (folded, _) = at(Mips, [1.0, 0.0, 0.0, 0.0, 1.0, 0.0, 0.0, 0.0, -1.0]);
        assert_eq!(folded, f64::INFINITY);
    }

    #[test]
    fn mips_gradient_matches_central_differences() {
        assert!(gradient_error(Mips, [1.1, 0.3, -0.2, 0.1, 0.8, 0.25, -0.4, 0.2, 1.3]) < 1e-9);
    }
}
