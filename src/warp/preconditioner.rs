//! The inverse of a stiffness matrix on the tensor grid, by fast diagonalization.
//!
//! For small deviations from a conformal map, and without the coupling of the components, every energy is that of a stiffness a across
//! and b along axis c for component c (`Density::stiffness`). On a tensor grid whose weights are products,
//!
//!   K_c = a₀ K⊗M⊗M + a₁ M⊗K⊗M + a₂ M⊗M⊗K,
//!
//! and with the solutions of K v = λ M v on each axis (VᵀMV = 1), K_c⁻¹ = V (a₀λ₀ + a₁λ₁ + a₂λ₂)⁻¹ Vᵀ, V = V₀⊗V₁⊗V₂.

use std::ops::Range;

use nalgebra::{DMatrix, DMatrixView, DMatrixViewMut, SymmetricEigen};

use super::axis::Sample;
use crate::{Error, Result};

/// K_c⁻¹ for the three components.
pub(super) struct Preconditioner {
    components: [Component; 3],
    scratch: [Vec<f64>; 3],
}

/// K_c⁻¹ for one component.
struct Component {
    /// V by axis (n × free); rows of fixed coefficients are zero.
    vectors: [DMatrix<f64>; 3],
    /// Vᵀ by axis.
    transposed: [DMatrix<f64>; 3],
    /// 1/(a₀λ₀ + a₁λ₁ + a₂λ₂), (free₀, free₁, free₂) in C order.
    inverse: Vec<f64>,
}

/// Least eigenvalue of K_c relative to the greatest. A component that is fixed nowhere has a null space; this keeps the inverse
/// finite there.
const LEAST_EIGENVALUE: f64 = 1e-9;

impl Preconditioner {
    /// `samples` are the points of each axis with their weights; `free[c][d]` are the indices along axis d at which component c is free;
    /// `[across, along]` is the stiffness of component c across and along axis c.
    ///
    /// # Errors
    /// Internal, if a mass matrix is not positive definite (because its weights are not positive).
    pub fn new(
        samples: [&[Sample]; 3],
        free: [[Range<usize>; 3]; 3],
        [across, along]: [f64; 2],
    ) -> Result<Preconditioner> {
        let pencils = samples.map(pencil);
        let stiffness = |c: usize| std::array::from_fn(|d| if c == d { along } else { across });
        // By axis, the solutions for its ranges of free indices: components have most of them in common.
        let mut solved: [Vec<(&Range<usize>, Modes)>; 3] = Default::default();
        for range in &free {
            for d in 0..3 {
                if solved[d].iter().all(|(known, _)| **known != range[d]) {
                    solved[d].push((&range[d], Modes::new(&pencils[d], &range[d])?));
                }
            }
        }
        let component = |c: usize| {
            let modes = std::array::from_fn(|d| solved[d].iter().find(|(known, _)| **known == free[c][d]));
            let modes = modes.map(|found| found.map(|(_, modes)| modes).expect("solved above"));
            Component::new(modes, stiffness(c))
        };
        Ok(Preconditioner {
            components: [component(0), component(1), component(2)],
            scratch: Default::default(),
        })
    }

    /// `v` ← K⁻¹ `v`, for vectors (component, x, y, z) in C order.
    pub fn apply(&mut self, v: &mut [f64]) {
        let length = v.len() / 3;
        let [modes, back, scratch] = &mut self.scratch;
        for (component, v) in self.components.iter().zip(v.chunks_exact_mut(length)) {
            tensor_product(&component.transposed, &component.vectors, v, modes, scratch);
            for (m, inverse) in modes.iter_mut().zip(&component.inverse) {
                *m *= inverse;
            }
            tensor_product(&component.vectors, &component.transposed, modes, back, scratch);
            v.copy_from_slice(back);
        }
    }
}

impl Component {
    /// From the modes and the stiffness by axis.
    fn new(modes: [&Modes; 3], stiffness: [f64; 3]) -> Component {
        let values: [Vec<f64>; 3] =
            std::array::from_fn(|d| modes[d].values.iter().map(|l| stiffness[d] * l.max(0.0)).collect());
        let least = LEAST_EIGENVALUE * values.iter().flatten().fold(0.0, |a: f64, b| a.max(*b));
        let mut inverse = Vec::with_capacity(values.iter().map(Vec::len).product());
        for a in &values[0] {
            for b in &values[1] {
                inverse.extend(values[2].iter().map(|c| 1.0 / (a + b + c).max(least)));
            }
        }
        let vectors = modes.map(|m| m.vectors.clone());
        Component { transposed: std::array::from_fn(|d| vectors[d].transpose()), vectors, inverse }
    }
}

/// Writes (A₀⊗A₁⊗A₂) u to `out`, by way of `scratch`, given the three matrices and their transposes.
fn tensor_product(
    matrices: &[DMatrix<f64>; 3],
    transposed: &[DMatrix<f64>; 3],
    u: &[f64],
    out: &mut Vec<f64>,
    scratch: &mut Vec<f64>,
) {
    let [n0, n1, n2] = [0, 1, 2].map(|d| matrices[d].ncols());
    let [m0, m1, m2] = [0, 1, 2].map(|d| matrices[d].nrows());
    // nalgebra is column-major: an (x, y, z) array in C order is a matrix with a row for each z and a column for each (x, y).
    out.resize(m2 * n1 * n0, 0.0);
    let u = DMatrixView::from_slice(u, n2, n1 * n0);
    DMatrixViewMut::from_slice(out, m2, n1 * n0).gemm(1.0, &matrices[2], &u, 0.0);
    scratch.resize(m2 * m1 * n0, 0.0);
    for (source, target) in out.chunks_exact(m2 * n1).zip(scratch.chunks_exact_mut(m2 * m1)) {
        let source = DMatrixView::from_slice(source, m2, n1);
        DMatrixViewMut::from_slice(target, m2, m1).gemm(1.0, &source, &transposed[1], 0.0);
    }
    out.resize(m2 * m1 * m0, 0.0);
    let scratch = DMatrixView::from_slice(scratch, m2 * m1, n0);
    DMatrixViewMut::from_slice(out, m2 * m1, m0).gemm(1.0, &scratch, &transposed[0], 0.0);
}

/// The stiffness and the mass matrix of one axis.
fn pencil(samples: &[Sample]) -> [DMatrix<f64>; 2] {
    let n = samples.iter().map(|s| s.first + 4).max().unwrap_or(0);
    let mut stiffness = DMatrix::zeros(n, n);
    let mut mass = DMatrix::zeros(n, n);
    for s in samples {
        for i in 0..4 {
            for j in 0..4 {
                stiffness[(s.first + i, s.first + j)] += s.weight * s.slope[i] * s.slope[j];
                mass[(s.first + i, s.first + j)] += s.weight * s.value[i] * s.value[j];
            }
        }
    }
    [stiffness, mass]
}

/// The solutions of K v = λ M v on the free coefficients of one axis.
struct Modes {
    /// V (n × free) with VᵀMV = 1.
    vectors: DMatrix<f64>,
    /// λ.
    values: Vec<f64>,
}

impl Modes {
    fn new([stiffness, mass]: &[DMatrix<f64>; 2], free: &Range<usize>) -> Result<Modes> {
        let block =
            |m: &DMatrix<f64>| m.view((free.start, free.start), (free.len(), free.len())).into_owned();
        let singular = || Error::Internal("the mass matrix of the warp map is not positive definite".into());
        let lower = block(mass).cholesky().ok_or_else(singular)?.unpack();
        let half = lower.solve_lower_triangular(&block(stiffness)).ok_or_else(singular)?;
        let whole = lower.solve_lower_triangular(&half.transpose()).ok_or_else(singular)?;
        let eigen = SymmetricEigen::new(0.5 * (&whole + whole.transpose()));
        let free_vectors = lower.tr_solve_lower_triangular(&eigen.eigenvectors).ok_or_else(singular)?;
        let mut vectors = DMatrix::zeros(mass.nrows(), free.len());
        vectors.view_mut((free.start, 0), (free.len(), free.len())).copy_from(&free_vectors);
        Ok(Modes { vectors, values: eigen.eigenvalues.iter().copied().collect() })
    }
}

#[cfg(test)]
mod tests {
    use super::super::axis::{MapAxis, Rule};
    use super::*;

    #[test]
    fn it_inverts_the_assembled_stiffness_matrix() {
        let axes = [
            MapAxis { cells: 4, cell: 0.5 },
            MapAxis { cells: 5, cell: 0.4 },
            MapAxis { cells: 4, cell: 0.3 },
        ];
        let samples = axes.map(|a| a.quadrature(Rule::Lobatto));
        let [n0, n1, n2] = axes.map(|a| a.len());
        let free = [[1..n0 - 1, 0..n1, 0..n2], [0..n0, 1..n1 - 1, 0..n2], [0..n0, 0..n1, 1..n2]];
        let [across, along] = [0.5, 2.0 / 3.0];
        let mut preconditioner =
            Preconditioner::new([&samples[0], &samples[1], &samples[2]], free.clone(), [across, along])
                .unwrap();
        let [p0, p1, p2] = [0, 1, 2].map(|d| pencil(&samples[d]));
        let n = n0 * n1 * n2;
        let u: Vec<f64> = (0..3 * n).map(|i| (0.7 * i as f64).sin()).collect();
        let mut v = u.clone();
        preconditioner.apply(&mut v);
        for c in 0..3 {
            let a = [0, 1, 2].map(|d| if c == d { along } else { across });
            let matrix = p0[0].kronecker(&p1[1]).kronecker(&p2[1]) * a[0]
                + p0[1].kronecker(&p1[0]).kronecker(&p2[1]) * a[1]
                + p0[1].kronecker(&p1[1]).kronecker(&p2[0]) * a[2];
            let product = matrix * DMatrix::from_column_slice(n, 1, &v[c * n..(c + 1) * n]);
            for i in 0..n {
                let index = [i / (n1 * n2), i / n2 % n1, i % n2];
                if (0..3).all(|d| free[c][d].contains(&index[d])) {
                    assert!((product[i] - u[c * n + i]).abs() < 1e-9, "{c} {index:?}");
                } else {
                    assert_eq!(v[c * n + i], 0.0);
                }
            }
        }
    }
}
