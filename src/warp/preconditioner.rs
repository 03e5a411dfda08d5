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
    scratch: [Vec<f64>; 2],
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
        let component = |c: usize| Component::new(&pencils, &free[c], stiffness(c));
        Ok(Preconditioner {
            components: [component(0)?, component(1)?, component(2)?],
            scratch: [Vec::new(), Vec::new()],
        })
    }

    /// `v` ← K⁻¹ `v`, for vectors (component, x, y, z) in C order.
    pub fn apply(&mut self, v: &mut [f64]) {
        let length = v.len() / 3;
        let [a, b] = &mut self.scratch;
        for (component, v) in self.components.iter().zip(v.chunks_exact_mut(length)) {
            let modes = tensor_product(&component.transposed, v, a, b);
            for (m, inverse) in modes.iter_mut().zip(&component.inverse) {
                *m *= inverse;
            }
            let modes = std::mem::take(a);
            let mut back = Vec::new();
            v.copy_from_slice(tensor_product(&component.vectors, &modes, &mut back, b));
            *a = back;
        }
    }
}

impl Component {
    /// From stiffness and mass matrix, free indices and stiffness by axis.
    fn new(
        pencils: &[[DMatrix<f64>; 2]; 3],
        free: &[Range<usize>; 3],
        stiffness: [f64; 3],
    ) -> Result<Component> {
        let eigen = |d: usize| -> Result<(DMatrix<f64>, Vec<f64>)> {
            let (vectors, values) = eigen(&pencils[d], &free[d])?;
            Ok((vectors, values.iter().map(|l| stiffness[d] * l.max(0.0)).collect()))
        };
        let ((v0, values0), (v1, values1), (v2, values2)) = (eigen(0)?, eigen(1)?, eigen(2)?);
        let all = values0.iter().chain(&values1).chain(&values2);
        let least = LEAST_EIGENVALUE * all.fold(0.0, |a: f64, b| a.max(*b));
        let mut inverse = Vec::with_capacity(values0.len() * values1.len() * values2.len());
        for a in &values0 {
            for b in &values1 {
                inverse.extend(values2.iter().map(|c| 1.0 / (a + b + c).max(least)));
            }
        }
        let vectors = [v0, v1, v2];
        Ok(Component { transposed: std::array::from_fn(|d| vectors[d].transpose()), vectors, inverse })
    }
}

/// Writes (A₀⊗A₁⊗A₂) u to `out`, by way of `scratch`.
fn tensor_product<'a>(
    matrices: &[DMatrix<f64>; 3],
    u: &[f64],
    out: &'a mut Vec<f64>,
    scratch: &mut Vec<f64>,
) -> &'a mut [f64] {
    let [n0, n1, n2] = [0, 1, 2].map(|d| matrices[d].ncols());
    let [m0, m1, m2] = [0, 1, 2].map(|d| matrices[d].nrows());
    // nalgebra is column-major: an (x, y, z) array in C order is a matrix with a row for each z and a column for each (x, y).
    out.resize(m2 * n1 * n0, 0.0);
    DMatrixViewMut::from_slice(out, m2, n1 * n0).gemm(
        1.0,
        &matrices[2],
        &DMatrixView::from_slice(u, n2, n1 * n0),
        0.0,
    );
    scratch.resize(m2 * m1 * n0, 0.0);
    let across = matrices[1].transpose();
    for (source, target) in out.chunks_exact(m2 * n1).zip(scratch.chunks_exact_mut(m2 * m1)) {
        DMatrixViewMut::from_slice(target, m2, m1).gemm(
            1.0,
            &DMatrixView::from_slice(source, m2, n1),
            &across,
            0.0,
        );
    }
    out.resize(m2 * m1 * m0, 0.0);
    let across = matrices[0].transpose();
    DMatrixViewMut::from_slice(out, m2 * m1, m0).gemm(
        1.0,
        &DMatrixView::from_slice(scratch, m2 * m1, n0),
        &across,
        0.0,
    );
    out
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

/// Solves K v = λ M v on the free coefficients: V (n × free) with VᵀMV = 1, and λ.
fn eigen([stiffness, mass]: &[DMatrix<f64>; 2], free: &Range<usize>) -> Result<(DMatrix<f64>, Vec<f64>)> {
    let block = |m: &DMatrix<f64>| m.view((free.start, free.start), (free.len(), free.len())).into_owned();
    let singular = || Error::Internal("the mass matrix of the warp map is not positive definite".into());
    let lower = block(mass).cholesky().ok_or_else(singular)?.unpack();
    let half = lower.solve_lower_triangular(&block(stiffness)).ok_or_else(singular)?;
    let whole = lower.solve_lower_triangular(&half.transpose()).ok_or_else(singular)?;
    let eigen = SymmetricEigen::new(0.5 * (&whole + whole.transpose()));
    let vectors = lower.tr_solve_lower_triangular(&eigen.eigenvectors).ok_or_else(singular)?;
    let mut padded = DMatrix::zeros(mass.nrows(), free.len());
    padded.view_mut((free.start, 0), (free.len(), free.len())).copy_from(&vectors);
    Ok((padded, eigen.eigenvalues.iter().copied().collect()))
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
