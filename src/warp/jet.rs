//! φ and its derivatives at one point.

/// φ and its derivatives at one point of F.
#[derive(Clone, Copy, Debug)]
pub struct WarpJet {
    /// φ(x̄), m.
    pub position: [f64; 3],
    /// J: `jacobian[c][d]` = ∂φ_c/∂x̄_d.
    pub jacobian: [[f64; 3]; 3],
    /// `second[c][s]`: second derivatives of φ_c, s over (xx, xy, xz, yy, yz, zz), 1/m.
    pub second: [[f64; 6]; 3],
    /// `third[c][s]`: third derivatives of φ_c, s over (xxx, xxy, xxz, xyy, xyz, xzz, yyy, yyz, yzz, zzz), 1/m²
    /// (piecewise continuous only).
    pub third: [[f64; 10]; 3],
}

impl WarpJet {
    /// All zero.
    pub(super) const ZERO: WarpJet =
        WarpJet { position: [0.0; 3], jacobian: [[0.0; 3]; 3], second: [[0.0; 6]; 3], third: [[0.0; 10]; 3] };

    /// ∂J/∂x̄_d: `[c][e]` = ∂²φ_c/∂x̄_e∂x̄_d, 1/m.
    #[inline]
    pub fn jacobian_derivative(&self, d: usize) -> [[f64; 3]; 3] {
        std::array::from_fn(|c| std::array::from_fn(|e| self.second[c][SECOND[d][e]]))
    }

    /// ∂²J/∂x̄_d∂x̄_e: `[c][f]` = ∂³φ_c/∂x̄_f∂x̄_d∂x̄_e, 1/m².
    #[inline]
    pub fn jacobian_second_derivative(&self, d: usize, e: usize) -> [[f64; 3]; 3] {
        std::array::from_fn(|c| std::array::from_fn(|f| self.third[c][THIRD[d][e][f]]))
    }
}

/// Index of ∂²/∂x̄_d∂x̄_e in (xx, xy, xz, yy, yz, zz).
pub(super) const SECOND: [[usize; 3]; 3] = [[0, 1, 2], [1, 3, 4], [2, 4, 5]];
/// Index of ∂³/∂x̄_d∂x̄_e∂x̄_f in (xxx, xxy, xxz, xyy, xyz, xzz, yyy, yyz, yzz, zzz).
pub(super) const THIRD: [[[usize; 3]; 3]; 3] =
    [[[0, 1, 2], [1, 3, 4], [2, 4, 5]], [[1, 3, 4], [3, 6, 7], [4, 7, 8]], [[2, 4, 5], [4, 7, 8], [5, 8, 9]]];

/// Index, among the derivatives of its order, of the one taken `y` times along y, `z` times along z and otherwise along x. These are
/// sorted by falling power of x, then of y.
pub(super) fn derivative_index(y: usize, z: usize) -> usize {
    (y + z) * (y + z + 1) / 2 + z
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn tables_and_formula_agree() {
        for d in 0..3 {
            for e in 0..3 {
                let count = |axes: &[usize], axis| axes.iter().filter(|&&a| a == axis).count();
                let index = |axes: &[usize]| derivative_index(count(axes, 1), count(axes, 2));
                assert_eq!(SECOND[d][e], index(&[d, e]));
                for f in 0..3 {
                    assert_eq!(THIRD[d][e][f], index(&[d, e, f]));
                }
            }
        }
    }
}
