//! Rotations: ZYX Euler angles, the projection 𝒫 onto SO(3) of Eq. 12, and their derivatives as rotation vectors.
//!
//! A rotation R(y) has first derivatives ∂R/∂y_d = \[w_d\]× R, with rotation vectors w_d in the frame that R maps to, and second
//! derivatives ∂²R/∂y_d∂y_e = (\[∂_e w_d\]× + \[w_d\]× \[w_e\]×) R.

use nalgebra::{Matrix3, Vector3};

/// v ↦ \[v\]×, the matrix with \[v\]× u = v × u.
pub fn cross_matrix(v: &Vector3<f64>) -> Matrix3<f64> {
    Matrix3::new(0.0, -v.z, v.y, v.z, 0.0, -v.x, -v.y, v.x, 0.0)
}

/// A ↦ a with \[a\]× = A − Aᵀ.
pub fn skew_part(a: &Matrix3<f64>) -> Vector3<f64> {
    Vector3::new(a[(2, 1)] - a[(1, 2)], a[(0, 2)] - a[(2, 0)], a[(1, 0)] - a[(0, 1)])
}

/// A rotation R(y) and its derivatives as rotation vectors.
#[derive(Clone, Copy, Debug)]
pub struct RotationJet<const D: usize> {
    /// R.
    pub rotation: Matrix3<f64>,
    /// `first[d]` = w_d.
    pub first: [Vector3<f64>; D],
    /// `second[e][d]` = ∂_e w_d; zero where not computed.
    pub second: [[Vector3<f64>; D]; D],
}

/// R = Rz(yaw) Ry(pitch) Rx(roll) for θ = (roll, pitch, yaw).
pub fn euler(theta: &Vector3<f64>) -> RotationJet<3> {
    let (sx, cx) = theta.x.sin_cos();
    let (sy, cy) = theta.y.sin_cos();
    let (sz, cz) = theta.z.sin_cos();
    let rotation = Matrix3::new(
        cz * cy,
        cz * sy * sx - sz * cx,
        cz * sy * cx + sz * sx,
        sz * cy,
        sz * sy * sx + cz * cx,
        sz * sy * cx - cz * sx,
        -sy,
        cy * sx,
        cy * cx,
    );
    let zero = Vector3::zeros();
    RotationJet {
        rotation,
        first: [Vector3::new(cz * cy, sz * cy, -sy), Vector3::new(-sz, cz, 0.0), Vector3::z()],
        second: [
            [zero, zero, zero],
            [Vector3::new(-cz * sy, -sz * sy, -cy), zero, zero],
            [Vector3::new(-sz * cy, cz * cy, 0.0), Vector3::new(-cz, -sz, 0.0), zero],
        ],
    }
}

/// The Euler angles θ = (roll, pitch, yaw) of a rotation; the inverse of [`euler`].
pub fn euler_angles(r: &Matrix3<f64>) -> Vector3<f64> {
    Vector3::new(r[(2, 1)].atan2(r[(2, 2)]), (-r[(2, 0)]).clamp(-1.0, 1.0).asin(), r[(1, 0)].atan2(r[(0, 0)]))
}

/// Determinants up to this are projected by the singular value decomposition.
const LEAST_DETERMINANT: f64 = 1e-12;
/// The polar iteration converges quadratically, in fewer steps than this.
const POLAR_ITERATIONS: usize = 20;
/// Squared norm of a change at which the polar iteration has converged to rounding.
const POLAR_TOLERANCE: f64 = 1e-26;

/// Eq. 12: 𝒫(J), the rotation nearest to J.
///
/// For det J ≤ 0, which an infeasible iterate may meet outside the box, it is U diag(1, 1, det UVᵀ) Vᵀ with the singular value
/// decomposition J = U Σ Vᵀ.
pub fn project_to_rotation(j: &Matrix3<f64>) -> Matrix3<f64> {
    let det = j.determinant();
    if det <= LEAST_DETERMINANT { svd_rotation(j) } else { polar_rotation(j / det.cbrt()) }
}

fn svd_rotation(j: &Matrix3<f64>) -> Matrix3<f64> {
    let svd = j.svd(true, true);
    let (Some(u), Some(v_t)) = (svd.u, svd.v_t) else { return Matrix3::identity() };
    let sign = (u * v_t).determinant().signum();
    u * Matrix3::from_diagonal(&Vector3::new(1.0, 1.0, sign)) * v_t
}

/// The rotation of the polar decomposition of X, det X > 0: the limit of X ← ½(γX + X⁻ᵀ/γ).
fn polar_rotation(mut x: Matrix3<f64>) -> Matrix3<f64> {
    for _ in 0..POLAR_ITERATIONS {
        let Some(inverse) = x.try_inverse() else { break };
        let inverse_t = inverse.transpose();
        let gamma = (inverse_t.norm() / x.norm()).sqrt();
        let next = 0.5 * (gamma * x + inverse_t / gamma);
        let change = (next - x).norm_squared();
        x = next;
        if change < POLAR_TOLERANCE {
            break;
        }
    }
    x
}

/// 𝒫(J(y)) of Eq. 12 and its derivatives, given `first[d]` = ∂_d J and `second[e][d]` = ∂_e ∂_d J. Without `second`, the second
/// derivatives are zero. (Corollary IV.1, with the sign of the projection corrected.)
///
/// With J = P H: (tr H 1 − H) ω_d = skew_part(Pᵀ ∂_d J) and ∂_d P = P \[ω_d\]× = \[P ω_d\]× P.
pub fn projection(
    j: &Matrix3<f64>,
    first: &[Matrix3<f64>; 3],
    second: Option<&[[Matrix3<f64>; 3]; 3]>,
) -> RotationJet<3> {
    let p = project_to_rotation(j);
    let pt = p.transpose();
    let h = pt * j;
    let m = Matrix3::identity() * h.trace() - h;
    let m_inverse = m.try_inverse().unwrap_or_else(Matrix3::zeros);
    let a: [Matrix3<f64>; 3] = std::array::from_fn(|d| pt * first[d]);
    let omega: [Vector3<f64>; 3] = std::array::from_fn(|d| m_inverse * skew_part(&a[d]));
    let mut jet = RotationJet {
        rotation: p,
        first: std::array::from_fn(|d| p * omega[d]),
        second: [[Vector3::zeros(); 3]; 3],
    };
    if let Some(second) = second {
        for e in 0..3 {
            let turn = cross_matrix(&omega[e]);
            let dh = a[e] - turn * h;
            let dm = Matrix3::identity() * dh.trace() - dh;
            for d in 0..3 {
                let b = pt * second[e][d] - turn * a[d];
                let d_omega = m_inverse * (skew_part(&b) - dm * omega[d]);
                jet.second[e][d] = p * (omega[e].cross(&omega[d]) + d_omega);
            }
        }
    }
    jet
}

/// The product 𝒫 E of Eq. 13 as a function of six parameters: three of the projection, then three of the Euler rotation.
pub fn compose(p: &RotationJet<3>, e: &RotationJet<3>) -> RotationJet<6> {
    let zero = Vector3::zeros();
    let mut jet = RotationJet { rotation: p.rotation * e.rotation, first: [zero; 6], second: [[zero; 6]; 6] };
    for d in 0..3 {
        jet.first[d] = p.first[d];
        jet.first[3 + d] = p.rotation * e.first[d];
        for s in 0..3 {
            jet.second[s][d] = p.second[s][d];
            // ∂_s (P e_d) = [w_s]× P e_d.
            jet.second[s][3 + d] = p.first[s].cross(&jet.first[3 + d]);
            jet.second[3 + s][3 + d] = p.rotation * e.second[s][d];
        }
    }
    jet
}

#[cfg(test)]
mod tests {
    use super::*;

    /// J, ∂_d J and ∂_e ∂_d J.
    type Field = (Matrix3<f64>, [Matrix3<f64>; 3], [[Matrix3<f64>; 3]; 3]);

    /// A curved field of Jacobians J(y) with known derivatives.
    fn field(y: &Vector3<f64>) -> Field {
        let entry = |i: usize, j: usize| {
            let k = Vector3::new(0.3 + 0.2 * i as f64, 0.5 - 0.3 * j as f64, 0.1 * (i + j) as f64);
            let phase = 1.0 + i as f64 - 0.7 * j as f64;
            let (s, c) = (k.dot(y) + phase).sin_cos();
            (0.4 * s + if i == j { 1.3 } else { 0.0 }, k * (0.4 * c), k * k.transpose() * (-0.4 * s))
        };
        let j = Matrix3::from_fn(|r, c| entry(r, c).0);
        let first = std::array::from_fn(|d| Matrix3::from_fn(|r, c| entry(r, c).1[d]));
        let second =
            std::array::from_fn(|e| std::array::from_fn(|d| Matrix3::from_fn(|r, c| entry(r, c).2[(e, d)])));
        (j, first, second)
    }

    fn pose(y: &[f64; 6]) -> RotationJet<6> {
        let (j, first, second) = field(&Vector3::new(y[0], y[1], y[2]));
        compose(&projection(&j, &first, Some(&second)), &euler(&Vector3::new(y[3], y[4], y[5])))
    }

    #[test]
    fn the_projection_is_the_nearest_rotation() {
        let (j, ..) = field(&Vector3::new(0.2, -0.4, 0.9));
        let svd = j.svd(true, true);
        let expected = svd.u.expect("u") * svd.v_t.expect("v");
        assert!((project_to_rotation(&j) - expected).norm() < 1e-12);
        let reflected = Matrix3::from_diagonal(&Vector3::new(1.0, 2.0, -0.1)) * j;
        assert!((project_to_rotation(&reflected).determinant() - 1.0).abs() < 1e-12);
    }

    #[test]
    fn first_and_second_derivatives_match_central_differences() {
        let y = [0.3, -0.2, 0.5, 0.4, -0.3, 1.1];
        let jet = pose(&y);
        let step = 1e-5;
        let moved = |d: usize, s: f64| {
            let mut z = y;
            z[d] += s;
            pose(&z)
        };
        for d in 0..6 {
            let (plus, minus) = (moved(d, step), moved(d, -step));
            let difference = (plus.rotation - minus.rotation) / (2.0 * step);
            assert!((difference - cross_matrix(&jet.first[d]) * jet.rotation).norm() < 1e-9, "first {d}");
            for e in 0..6 {
                let difference = (plus.first[e] - minus.first[e]) / (2.0 * step);
                assert!((difference - jet.second[d][e]).norm() < 1e-9, "second {d} {e}");
            }
        }
    }

    #[test]
    fn euler_angles_invert_euler() {
        let theta = Vector3::new(0.3, -0.6, 2.4);
        assert!((euler_angles(&euler(&theta).rotation) - theta).norm() < 1e-12);
    }
}
