//! The warp φ: F → A, a tri-cubic B-spline whose bottom face is the terrain.

mod assembly;
mod axis;
mod barrier;
mod basis;
mod bottom;
mod build;
mod cache;
mod density;
mod distance;
mod gauss_newton;
mod inverse;
mod lanes;
mod lbfgs;
mod line_search;
mod local_global;
mod preconditioner;
mod problem;
mod refine;
mod report;
mod shear;
mod singular;
mod spline;

pub use build::{MapProgress, build};
pub use cache::{build_cached, default_cache_dir};
pub use report::{Distribution, EnergyHistory, MapReport, RejectedMap};
pub use spline::{MapGrid, Order, WarpMap};

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

impl WarpJet {
    /// ∂J/∂x̄_d: `[c][e]` = ∂²φ_c/∂x̄_e∂x̄_d, 1/m.
    pub fn jacobian_derivative(&self, d: usize) -> [[f64; 3]; 3] {
        std::array::from_fn(|c| std::array::from_fn(|e| self.second[c][derivative_slot(&[d, e])]))
    }

    /// ∂²J/∂x̄_d∂x̄_e: `[c][f]` = ∂³φ_c/∂x̄_f∂x̄_d∂x̄_e, 1/m².
    pub fn jacobian_second_derivative(&self, d: usize, e: usize) -> [[f64; 3]; 3] {
        std::array::from_fn(|c| std::array::from_fn(|f| self.third[c][derivative_slot(&[d, e, f])]))
    }
}

/// Where the derivative along `axes` (0, 1, 2 for x, y, z, in any order) stands among the symmetric derivatives of its order.
pub fn derivative_slot(axes: &[usize]) -> usize {
    // Derivatives of one order are sorted by falling power of x, then of y: with m of them not along x, 1 + … + m stand before.
    let beyond_x = axes.iter().filter(|&&axis| axis > 0).count();
    let along_z = axes.iter().filter(|&&axis| axis > 1).count();
    beyond_x * (beyond_x + 1) / 2 + along_z
}
