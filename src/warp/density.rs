//! Energy densities of the map: what makes a Jacobian cost something.

/// Points that are evaluated at once.
pub(super) const LANES: usize = 4;
/// One number at each of these points.
pub(super) type Lanes = [f64; LANES];

/// An energy density ρ(J). Jacobians are flat: `[3 c + d]` = ∂φ_c/∂x̄_d.
pub(super) trait Density: Copy {
    /// ρ and ∂ρ/∂J at one point; ρ is infinite where J is not allowed. Free of branches, so that compilers can do a few at once.
    fn at(&self, jacobian: [f64; 9]) -> (f64, [f64; 9]);
}

/// The scale-invariant mean of the squared singular values, ρ = ¼(‖J‖² / det^⅔ − 3): zero where J is a scaled rotation
/// (by the inequality of the means), infinite where space would fold.
#[derive(Clone, Copy, Debug)]
pub(super) struct Mips;

impl Density for Mips {
    #[inline(always)]
    fn at(&self, j: [f64; 9]) -> (f64, [f64; 9]) {
        let cofactor = cofactors(&j);
        let det = j[0] * cofactor[0] + j[1] * cofactor[1] + j[2] * cofactor[2];
        let norm = j.iter().map(|v| v * v).sum::<f64>();
        let root = inverse_cube_root(det.max(MIN_DET));
        let scale = root * root;
        let energy = 0.25 * (norm * scale - 3.0);
        // ∂/∂J of ‖J‖² det^(−⅔) is 2 det^(−⅔) (J − ‖J‖²/(3 det) cof J).
        let pull = norm * scale * root / 3.0;
        let gradient = std::array::from_fn(|i| 0.5 * scale * (j[i] - pull * cofactor[i]));
        (if det > MIN_DET { energy } else { f64::INFINITY }, gradient)
    }
}

/// cof J = ∂ det J / ∂J.
#[inline(always)]
fn cofactors(j: &[f64; 9]) -> [f64; 9] {
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

/// det J.
#[inline(always)]
pub(super) fn determinant(j: &[f64; 9]) -> f64 {
    let cofactor = cofactors(j);
    j[0] * cofactor[0] + j[1] * cofactor[1] + j[2] * cofactor[2]
}

/// Determinants up to here count as folded; it keeps the powers below within range.
const MIN_DET: f64 = 1e-12;

/// x^(−⅓) for 1e-12 ≤ x ≤ 1e30, to rounding: a guess from the exponent, sharpened by Newton's method y ← y(4 − x y³)/3.
#[inline(always)]
fn inverse_cube_root(x: f64) -> f64 {
    // The bits of a float are close to a linear function of its logarithm; this constant makes the error even.
    let guess = f32::from_bits(0x54a2_1d2a - (x as f32).to_bits() / 3);
    let mut y = f64::from(guess);
    for _ in 0..4 {
        y *= (4.0 - x * y * y * y) * (1.0 / 3.0);
    }
    y
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn inverse_cube_roots_are_exact_to_rounding() {
        let mut x = 1.1e-12;
        while x < 1e12 {
            let exact = 1.0 / f64::cbrt(x);
            assert!((inverse_cube_root(x) / exact - 1.0).abs() < 1e-14, "{x}");
            x *= 1.037;
        }
    }

    #[test]
    fn mips_is_zero_on_scaled_rotations_and_infinite_on_folds() {
        let (s, c) = 0.7_f64.sin_cos();
        let turned = [3.0 * c, -3.0 * s, 0.0, 3.0 * s, 3.0 * c, 0.0, 0.0, 0.0, 3.0];
        let (energy, gradient) = Mips.at(turned);
        assert!(energy.abs() < 1e-14 && gradient.iter().all(|g| g.abs() < 1e-14));
        let (folded, _) = Mips.at([1.0, 0.0, 0.0, 0.0, 1.0, 0.0, 0.0, 0.0, -1.0]);
        assert_eq!(folded, f64::INFINITY);
    }

    #[test]
    fn mips_gradient_matches_central_differences() {
        let j = [1.1, 0.3, -0.2, 0.1, 0.8, 0.25, -0.4, 0.2, 1.3];
        let (_, gradient) = Mips.at(j);
        for i in 0..9 {
            let at = |step: f64| {
                let mut moved = j;
                moved[i] += step;
                Mips.at(moved).0
            };
            let slope = (at(1e-5) - at(-1e-5)) / 2e-5;
            assert!((slope - gradient[i]).abs() < 1e-9, "{i}");
        }
    }
}
