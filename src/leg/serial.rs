//! Numeric inverse kinematics of a leg of three joints with any axes, with exact first and second derivatives.
//!
//! The joint angles q for the center of the foot c are those that minimize
//!
//! ```text
//!   ½ |F(q) − c|² + ½ ε² |q − stance|²
//! ```
//!
//! with F the forward kinematics. The second term is negligible within reach, where it moves the foot by less than a thousandth of the leg's
//! length. Out of reach, or where the leg is stretched, it makes q a smooth function of c all the same: an iterate may be anywhere.
//!
//! Derivatives: with the inverse M⁻¹ of the second derivatives at the minimum held fixed, the Newton steps q ← q − M⁻¹ g(q, c) in numbers that
//! carry derivatives give the first derivatives of q(c) in one step and the second in two (g is the gradient; each step raises the order
//! of the error by one).

use nalgebra::{Matrix3, Vector3};

use super::chain::{Chain, JOINTS, Placed};
use super::jet::Scalar;

/// ε in lengths of the leg.
const ROUNDING: f64 = 4e-3;
/// How far from its target a foot that is reached may be, in lengths of the leg.
const REACHED: f64 = 3e-3;
/// Most steps of the minimization, and the relative size of the last one.
const STEPS: usize = 60;
const CONVERGED: f64 = 1e-13;
/// Most a joint turns in one step, rad.
const LARGEST_TURN: f64 = 0.6;

/// A leg whose inverse kinematics is computed numerically. Lengths in m, base frame, origin at the center of mass.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Serial {
    chain: Chain,
    /// Joint angles in the nominal stance, rad: of all postures for a foot, the one that is reached from there is taken.
    stance: [f64; JOINTS],
    foot_radius: f64,
    /// Of the stretched leg.
    length: f64,
    /// From the last joint's axis to the center of the foot, across that axis.
    pub(super) shank: f64,
    /// The point of that axis next to the foot, the direction to the foot, and the direction out of the bend; from the last joint.
    knee: Vector3<f64>,
    along: Vector3<f64>,
    across: Vector3<f64>,
}

/// The joint angles of a leg and the places of its links, base frame.
#[derive(Clone, Copy, Debug)]
pub struct SerialPosture<T> {
    angles: [T; JOINTS],
    placed: Placed<T>,
    contact: [T; 3],
    leg: Serial,
}

impl Serial {
    /// Of a chain that stands with the joint angles `stance`, rad; none if its last joint turns the foot on the spot.
    pub fn new(chain: &Chain, stance: [f64; JOINTS], foot_radius: f64) -> Option<Self> {
        let axis = chain.joints[JOINTS - 1].axis;
        let knee = axis * axis.dot(&chain.foot);
        let shank = (chain.foot - knee).norm();
        let length =
            chain.joints[1..].iter().map(|joint| joint.position.norm()).sum::<f64>() + chain.foot.norm();
        if shank < 1e-2 * length {
            return None;
        }
        let along = (chain.foot - knee) / shank;
        let mut across = axis.cross(&along);
        let placed = chain.place::<f64>(stance);
        let hip = Vector3::from(placed.origin[1]) - Vector3::from(placed.point(JOINTS - 1, &knee));
        let out = Vector3::from(placed.point(JOINTS - 1, &across)) - Vector3::from(placed.origin[JOINTS - 1]);
        if out.dot(&hip) > 0.0 {
            across = -across;
        }
        Some(Self { chain: *chain, stance, foot_radius, length, shank, knee, along, across })
    }

    /// Whether there are joint angles for the contact point r, regardless of joint limits.
    pub fn reaches(&self, r: [f64; 3]) -> bool {
        let center = self.center(r).map(|c| c.value());
        let (q, _) = self.minimum(&center.into());
        let off = Vector3::from(self.chain.foot::<f64>(q.into())) - Vector3::from(center);
        off.norm() < REACHED * self.length
    }

    /// The posture for the contact point r, base frame from the center of mass.
    pub fn posture<T: Scalar>(&self, r: [T; 3]) -> SerialPosture<T> {
        let center = self.center(r);
        let (q, inverse) = self.minimum(&Vector3::from(center.map(|c| c.value())));
        let mut angles: [T; JOINTS] = std::array::from_fn(|j| center[0] * 0.0 + q[j]);
        for _ in 0..2 {
            let gradient = self.gradient(angles, center);
            angles = std::array::from_fn(|i| {
                let step = gradient[0] * inverse[(i, 0)]
                    + gradient[1] * inverse[(i, 1)]
                    + gradient[2] * inverse[(i, 2)];
                angles[i] - step
            });
        }
        SerialPosture { angles, placed: self.chain.place(angles), contact: r, leg: *self }
    }

    /// The center of the foot over the contact point r.
    fn center<T: Scalar>(&self, [x, y, z]: [T; 3]) -> [T; 3] {
        [x, y, z + self.foot_radius]
    }

    fn weight(&self) -> f64 {
        (ROUNDING * self.length).powi(2)
    }

    /// g = (∂F/∂q)ᵀ (F − c) + ε² (q − stance).
    fn gradient<T: Scalar>(&self, q: [T; JOINTS], center: [T; 3]) -> [T; JOINTS] {
        let placed = self.chain.place(q);
        let foot = placed.point(JOINTS - 1, &self.chain.foot);
        let off: [T; 3] = std::array::from_fn(|c| foot[c] - center[c]);
        std::array::from_fn(|j| {
            let column = placed.moved_by(j, foot);
            column[0] * off[0]
                + column[1] * off[1]
                + column[2] * off[2]
                + (q[j] + -self.stance[j]) * self.weight()
        })
    }

    /// The function that is minimized, its gradient and its second derivatives.
    fn function(&self, q: &Vector3<f64>, center: &Vector3<f64>) -> (f64, Vector3<f64>, Matrix3<f64>) {
        let placed = self.chain.place::<f64>((*q).into());
        let foot = placed.point(JOINTS - 1, &self.chain.foot);
        let off = Vector3::from(foot) - center;
        let turned = q - Vector3::from(self.stance);
        let columns: [Vector3<f64>; JOINTS] = std::array::from_fn(|j| placed.moved_by(j, foot).into());
        let jacobian = Matrix3::from_columns(&columns);
        let value = 0.5 * off.norm_squared() + 0.5 * self.weight() * turned.norm_squared();
        let gradient = jacobian.tr_mul(&off) + turned * self.weight();
        // ∂²F/∂qᵢ∂qⱼ = aᵢ × ∂F/∂qⱼ for i ≤ j.
        let curved =
            Matrix3::from_fn(|i, j| Vector3::from(placed.axis[i.min(j)]).cross(&columns[i.max(j)]).dot(&off));
        let second = jacobian.tr_mul(&jacobian) + curved + Matrix3::identity() * self.weight();
        (value, gradient, second)
    }

    /// The joint angles of the minimum, and the inverse of the second derivatives there. Newton's method, downhill from the stance.
    fn minimum(&self, center: &Vector3<f64>) -> (Vector3<f64>, Matrix3<f64>) {
        let mut q = Vector3::from(self.stance);
        let (mut value, mut gradient, mut second) = self.function(&q, center);
        for _ in 0..STEPS {
            let mut step = -(inverse(&second, self.weight()) * gradient);
            step *= (LARGEST_TURN / step.amax()).min(1.0);
            if step.amax() < CONVERGED {
                break;
            }
            let mut next = self.function(&(q + step), center);
            // Rounding may keep the last steps from lowering the value.
            while next.0 > value * (1.0 + 1e-14) && step.amax() > 1e-9 {
                step *= 0.5;
                next = self.function(&(q + step), center);
            }
            q += step;
            (value, gradient, second) = next;
        }
        (q, inverse(&second, self.weight()))
    }
}

/// The inverse of a symmetric matrix with its eigenvalues made at least a tenth of `weight`, by size.
fn inverse(matrix: &Matrix3<f64>, weight: f64) -> Matrix3<f64> {
    let eigen = matrix.symmetric_eigen();
    let inverted = eigen.eigenvalues.map(|value| 1.0 / value.abs().max(0.1 * weight));
    eigen.eigenvectors * Matrix3::from_diagonal(&inverted) * eigen.eigenvectors.transpose()
}

impl<T: Scalar> SerialPosture<T> {
    /// The angles of the joints as the robot's file counts them, rad.
    pub fn joint_angles(&self) -> [T; JOINTS] {
        self.angles
    }

    /// A point of the shank, base frame from the center of mass, m, given along the line from the knee to the center of the foot, and
    /// across it toward the outside of the bend.
    pub fn on_shank(&self, [along, across]: [f64; 2]) -> [T; 3] {
        let Serial { knee, along: forward, across: out, .. } = &self.leg;
        self.placed.point(JOINTS - 1, &(knee + forward * along + out * across))
    }

    /// ∂r/∂q, m: the derivatives of the contact point, base frame, with respect to the joint angles, one vector for each joint.
    pub fn jacobian(&self) -> [[T; 3]; JOINTS] {
        std::array::from_fn(|j| self.placed.moved_by(j, self.contact))
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::leg::chain::tests::leg;
    use crate::leg::jet::Jet;

    /// Axes, and the joint angles of a stance.
    const LEGS: [([[f64; 3]; 3], [f64; 3]); 4] = [
        // yaw, pitch, pitch
        ([[0.0, 0.0, 1.0], [0.0, 1.0, 0.0], [0.0, 1.0, 0.0]], [0.1, -0.7, 1.3]),
        // roll, pitch, pitch
        ([[1.0, 0.0, 0.0], [0.0, 1.0, 0.0], [0.0, 1.0, 0.0]], [0.1, -0.7, 1.3]),
        // pitch, roll, pitch
        ([[0.0, 1.0, 0.0], [1.0, 0.0, 0.0], [0.0, -1.0, 0.0]], [-0.7, 0.1, -1.3]),
        ([[1.0, 0.2, 0.1], [0.1, 1.0, 0.0], [0.0, 1.0, 0.3]], [0.1, -0.7, 1.3]),
    ];
    const RADIUS: f64 = 0.02;

    fn near(stance: [f64; 3], amount: f64) -> impl Iterator<Item = [f64; 3]> {
        [[1.0, 0.5, -0.4], [-0.6, -1.0, 0.7], [0.3, 0.8, 1.0]]
            .into_iter()
            .map(move |turn| std::array::from_fn(|j| stance[j] + amount * turn[j]))
    }

    #[test]
    fn postures_invert_forward_kinematics() {
        for (axes, stance) in LEGS {
            let chain = leg(axes);
            let serial = Serial::new(&chain, stance, RADIUS).unwrap();
            for q in near(stance, 0.4) {
                let contact = Vector3::from(chain.foot(q)) - Vector3::z() * RADIUS;
                assert!(serial.reaches(contact.into()));
                let posture = serial.posture::<f64>(contact.into());
                for (found, expected) in posture.joint_angles().into_iter().zip(q) {
                    assert!((found - expected).abs() < 2e-3, "{found} {expected} for {axes:?} {q:?}");
                }
                let foot = Vector3::from(posture.on_shank([serial.shank, 0.0])) - Vector3::z() * RADIUS;
                assert!((foot - contact).norm() < 1e-3);
            }
        }
    }

    /// In reach, at its edge and beyond.
    #[test]
    fn derivatives_match_differences() {
        for (axes, stance) in LEGS {
            let chain = leg(axes);
            let serial = Serial::new(&chain, stance, RADIUS).unwrap();
            let mut points: Vec<Vector3<f64>> =
                near(stance, 0.4).map(|q| chain.foot::<f64>(q).into()).collect();
            let hip = Vector3::from(chain.place::<f64>(stance).origin[1]);
            points.push(hip + (points[0] - hip) * 1.6);
            for point in points {
                let all = |p: &Vector3<f64>| -> Vec<Jet> {
                    let posture = serial.posture(Jet::variables(p));
                    let corner = posture.on_shank([0.06, 0.1]);
                    posture
                        .joint_angles()
                        .into_iter()
                        .chain(corner)
                        .chain(posture.jacobian().concat())
                        .collect()
                };
                let step = 1e-5;
                let jets = all(&point);
                for d in 0..3 {
                    let mut moved = [point, point];
                    moved[0][d] += step;
                    moved[1][d] -= step;
                    let [up, down] = moved.map(|p| all(&p));
                    for (jet, (up, down)) in jets.iter().zip(up.iter().zip(&down)) {
                        let first = (up.value - down.value) / (2.0 * step);
                        let second = (up.first - down.first) / (2.0 * step);
                        let size = 1.0 + jet.first.norm();
                        assert!((jet.first[d] - first).abs() < 1e-6 * size, "{axes:?}: {jet:?} {first}");
                        let size = 1.0 + jet.second.norm();
                        assert!(
                            (jet.second.column(d) - second).norm() < 1e-5 * size,
                            "{axes:?}: {jet:?} {second}"
                        );
                    }
                }
            }
        }
    }

    #[test]
    fn out_of_reach_everything_is_finite() {
        for (axes, stance) in LEGS {
            let serial = Serial::new(&leg(axes), stance, RADIUS).unwrap();
            for r in [[0.3, -0.1, -2.0], [0.3, -0.1, 0.02], [0.3, -0.3, 0.02], [2.0, 1.0, 1.0]] {
                let found = serial.posture::<f64>(r);
                let numbers = found.joint_angles().into_iter().chain(found.jacobian().concat());
                assert!(numbers.into_iter().all(f64::is_finite));
            }
            assert!(!serial.reaches([0.3, -0.1, -2.0]) && !serial.reaches([2.0, 1.0, 1.0]));
        }
    }
}
