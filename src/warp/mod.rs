//! The warp φ: F → A, a tri-cubic B-spline whose bottom face is the terrain.

/// φ and its derivatives at one point of F.
#[derive(Clone, Copy, Debug)]
pub struct WarpJet {
    /// φ(x̄), m.
    pub position: [f64; 3],
    /// `jacobian[c][d]` = ∂φ_c/∂x̄_d.
    pub jacobian: [[f64; 3]; 3],
    /// `second[c][s]`: second derivatives of φ_c, s over (xx, xy, xz, yy, yz, zz), 1/m.
    pub second: [[f64; 6]; 3],
    /// `third[c][s]`: third derivatives of φ_c, s over (xxx, xxy, xxz, xyy, xyz, xzz, yyy, yyz, yzz, zzz), 1/m²
    /// (piecewise continuous only).
    pub third: [[f64; 10]; 3],
}
