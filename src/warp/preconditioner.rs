//! The inverse of a stiffness matrix on the tensor grid by fast diagonalization.
//!
//! Every energy here is, for small deviations from a conformal map and but for what couples the components, like stiffnesses of
//! a across and b along axis c for component c (`Density::stiffness`). On a tensor grid with weights that are products,
//!
//!   K_c = a₀ K⊗M⊗M + a₁ M⊗K⊗M + a₂ M⊗M⊗K,
//!
//! and with K v = λ M v solved on each axis (VᵀMV = 1), K_c⁻¹ = V (a₀λ₀ + a₁λ₁ + a₂λ₂)⁻¹ Vᵀ, V = V₀⊗V₁⊗V₂.

use nalgebra::{DMatrix, DMatrixView, DMatrixViewMut, SymmetricEigen};

use super::axis::Sample;
use crate::{Error, Result};

/// K_c⁻¹ for the three components.
pub(super) struct Preconditioner {
    components: [Component; 3],
    scratch: [Vec<f64>; 2],
}

struct Component {
    /// By axis (n × free), rows of fixed coefficients zero.
    vectors: [DMatrix<f64>; 3],
    transposed: [DMatrix<f64>; 3],
    /// 1/(a₀λ₀ + a₁λ₁ + a₂λ₂), (free₀, free₁, free₂) in C order.
    inverse: Vec<f64>,
}

impl Preconditioner {
    /// `samples` carry the weights; `free[c][d]`: which coefficients of component c may move along axis d;
    /// `[across, along]`: the stiffness of component c across and along axis c.
    ///
    /// # Errors
    /// Internal, when a mass matrix is not positive definite (weights that are not).
    pub fn new(
        samples: [&[Sample]; 3],
        free: [[std::ops::Range<usize>; 3]; 3],
        [across, along]: [f64; 2],
    ) -> Result<Preconditioner> {
        let pencils = samples.map(pencil);
        let mut components = Vec::with_capacity(3);
        for (c, free) in free.iter().enumerate() {
            let mut vectors = Vec::with_capacity(3);
            let mut values = Vec::with_capacity(3);
            for d in 0..3 {
                let (v, lambda) = eigen(&pencils[d], &free[d])?;
                let stiffness = if c == d { along } else { across };
                vectors.push(v);
                values.push(lambda.iter().map(|l| stiffness * l.max(0.0)).collect::<Vec<f64>>());
            }
            let mut inverse = Vec::with_capacity(values.iter().map(Vec::len).product());
            let greatest = values.iter().flatten().fold(0.0, |a: f64, b| a.max(*b));
            for a in &values[0] {
                for b in &values[1] {
                    // A component that nothing pins would have a null space: the floor leaves it movable.
                    inverse.extend(values[2].iter().map(|c| 1.0 / (a + b + c).max(1e-9 * greatest)));
                }
            }
            let vectors: [DMatrix<f64>; 3] =
                vectors.try_into().map_err(|_| Error::Internal("three axes".into()))?;
            components.push(Component {
                transposed: std::array::from_fn(|d| vectors[d].transpose()),
                vectors,
                inverse,
            });
        }
        let components = components.try_into().map_err(|_| Error::Internal("three components".into()))?;
        Ok(Preconditioner { components, scratch: [Vec::new(), Vec::new()] })
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

/// (A₀⊗A₁⊗A₂) u in `out`, with `scratch` for what is between.
fn tensor_product<'a>(
    matrices: &[DMatrix<f64>; 3],
    u: &[f64],
    out: &'a mut Vec<f64>,
    scratch: &mut Vec<f64>,
) -> &'a mut [f64] {
    let [n0, n1, n2] = [0, 1, 2].map(|d| matrices[d].ncols());
    let [m0, m1, m2] = [0, 1, 2].map(|d| matrices[d].nrows());
    // nalgebra is column-major: a C-ordered (x, y, z) array is a matrix with z down and (x, y) across.
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

/// Stiffness and mass matrix of one axis.
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

/// K v = λ M v on the free coefficients: V (n × free) with VᵀMV = 1, and λ.
fn eigen(
    [stiffness, mass]: &[DMatrix<f64>; 2],
    free: &std::ops::Range<usize>,
) -> Result<(DMatrix<f64>, Vec<f64>)> {
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
    use super::super::axis::{Axis, Rule};
    use super::*;

    #[test]
    fn it_inverts_the_stiffness_matrix_written_out() {
        let axes = [Axis { cells: 4, cell: 0.5 }, Axis { cells: 5, cell: 0.4 }, Axis { cells: 4, cell: 0.3 }];
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
