//! Numeric inverse kinematics of a leg of three to seven joints with any axes, with exact first and second derivatives.
//!
//! The joint angles q for the center of the foot c are those that minimize
//!
//! ```text
//!   ½ |F(q) − c|² + ½ ε² Σ wᵢ (qᵢ − stanceᵢ)²,   wᵢ = 1/hᵢ²
//! ```
//!
//! with F the forward kinematics and hᵢ half the range of joint i. Within reach, the second term moves the foot by less than a thousandth of
//! the leg's length, and of all postures of a leg of more than three joints it chooses the one nearest to the stance. Out of reach, or where
//! the leg is stretched, it makes q a smooth function of c all the same: an iterate may be anywhere.
//!
//! Derivatives: with M the second derivatives at the minimum, ∂q/∂c = M⁻¹ (∂F/∂q)ᵀ. From angles that carry these, a Newton step
//! q ← q − M⁻¹ g(q, c) with M fixed gives the second derivatives, too (g is the gradient; each such step raises the order of the error by
//! one).

use nalgebra::{SMatrix, SVector, Vector3};

use super::chain::{ByJoint, Chain, MOST_JOINTS, Placed};
use super::jet::Scalar;

/// ε in lengths of the leg.
const ROUNDING: f64 = 4e-3;
/// Least and greatest hᵢ, rad.
const HALF_RANGE: [f64; 2] = [0.3, std::f64::consts::PI];
/// How far from its target a foot that is reached may be, in lengths of the leg.
const REACHED: f64 = 3e-3;
/// Most steps of the minimization, and the size of the last one, rad: its error is the square of that.
const STEPS: usize = 60;
const CONVERGED: f64 = 1e-9;
/// Of the minimizations before with larger ε²: by which factors, and the size of their last steps, rad.
const LARGER: [f64; 4] = [2000.0, 200.0, 25.0, 3.0];
const NEAR: f64 = 0.03;
/// Most a joint turns in one step, rad.
const LARGEST_TURN: f64 = 0.6;

/// A matrix with a row and a column for each joint; those of joints that a leg does not have are those of the unit matrix.
type Square = SMatrix<f64, MOST_JOINTS, MOST_JOINTS>;
/// A number for each joint, zero for those that a leg does not have.
type Column = SVector<f64, MOST_JOINTS>;

/// A leg whose inverse kinematics is computed numerically. Lengths in m, base frame, origin at the center of mass.
#[derive(Clone, Debug, PartialEq)]
pub struct Serial {
    chain: Chain,
    /// Joint angles in the nominal stance, rad: of all postures for a foot, the one that is reached from there is taken.
    stance: ByJoint<f64>,
    /// ε² wᵢ, m².
    weights: ByJoint<f64>,
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
#[derive(Clone, Debug)]
pub struct SerialPosture<'a, T> {
    angles: ByJoint<T>,
    placed: Placed<T>,
    contact: [T; 3],
    leg: &'a Serial,
}

/// The function that is minimized, at some joint angles.
struct Function {
    value: f64,
    gradient: Column,
    /// M.
    second: Square,
    /// ∂F/∂q by joint.
    columns: ByJoint<Vector3<f64>>,
}

impl Serial {
    /// Of a chain that stands with the joint angles `stance`, rad; none if its last joint turns the foot on the spot.
    pub fn new(chain: &Chain, stance: &[f64], foot_radius: f64) -> Option<Self> {
        let last = chain.joints.len() - 1;
        let axis = chain.joints[last].axis;
        let knee = axis * axis.dot(&chain.foot);
        let shank = (chain.foot - knee).norm();
        let length = chain.length();
        if shank < 1e-2 * length {
            return None;
        }
        let along = (chain.foot - knee) / shank;
        let mut across = axis.cross(&along);
        let placed = chain.place::<f64>(stance);
        let hip = Vector3::from(placed.origin[last - 1]) - Vector3::from(placed.point(last, &knee));
        let out = Vector3::from(placed.point(last, &across)) - Vector3::from(placed.origin[last]);
        if out.dot(&hip) > 0.0 {
            across = -across;
        }
        let weight = |range: [f64; 2]| {
            let half = (0.5 * (range[1] - range[0])).clamp(HALF_RANGE[0], HALF_RANGE[1]);
            (ROUNDING * length / half).powi(2)
        };
        Some(Self {
            stance: stance.iter().copied().collect(),
            weights: chain.joints.iter().map(|joint| weight(joint.range)).collect(),
            chain: chain.clone(),
            foot_radius,
            length,
            shank,
            knee,
            along,
            across,
        })
    }

    /// Whether there are joint angles for the contact point r, regardless of joint limits.
    pub fn reaches(&self, r: [f64; 3]) -> bool {
        let center = self.center(r);
        let (q, ..) = self.minimum(&center.into());
        let off = Vector3::from(self.chain.foot(&q.as_slice()[..self.joints()])) - Vector3::from(center);
        off.norm() < REACHED * self.length
    }

    /// The posture for the contact point r, base frame from the center of mass.
    pub fn posture<T: Scalar>(&self, r: [T; 3]) -> SerialPosture<'_, T> {
        let center = self.center(r);
        let (q, inverse, columns) = self.minimum(&Vector3::from(center.map(|c| c.value())));
        let moved = center.map(|c| c + -c.value());
        let start: ByJoint<T> = (0..self.joints())
            .map(|i| {
                let by_center: Vector3<f64> =
                    columns.iter().enumerate().map(|(j, column)| column * inverse[(i, j)]).sum();
                moved[0] * by_center[0] + moved[1] * by_center[1] + moved[2] * by_center[2] + q[i]
            })
            .collect();
        let gradient = self.gradient(&start, center);
        let angles: ByJoint<T> = (0..self.joints())
            .map(|i| {
                let steps = gradient.iter().enumerate().map(|(j, g)| *g * inverse[(i, j)]);
                steps.fold(start[i], |angle, step| angle - step)
            })
            .collect();
        SerialPosture { placed: self.chain.place(&angles), angles, contact: r, leg: self }
    }

    fn joints(&self) -> usize {
        self.chain.joints.len()
    }

    /// The center of the foot over the contact point r.
    fn center<T: Scalar>(&self, [x, y, z]: [T; 3]) -> [T; 3] {
        [x, y, z + self.foot_radius]
    }

    /// g = (∂F/∂q)ᵀ (F − c) + ε² w (q − stance).
    fn gradient<T: Scalar>(&self, q: &[T], center: [T; 3]) -> ByJoint<T> {
        let placed = self.chain.place(q);
        let foot = placed.point(self.joints() - 1, &self.chain.foot);
        let off: [T; 3] = std::array::from_fn(|c| foot[c] - center[c]);
        (0..self.joints())
            .map(|j| {
                let column = placed.moved_by(j, foot);
                column[0] * off[0]
                    + column[1] * off[1]
                    + column[2] * off[2]
                    + (q[j] + -self.stance[j]) * self.weights[j]
            })
            .collect()
    }

    /// The function at the angles q, with ε² times `more`.
    fn function(&self, q: &Column, center: &Vector3<f64>, more: f64) -> Function {
        let placed = self.chain.place::<f64>(&q.as_slice()[..self.joints()]);
        let foot = placed.point(self.joints() - 1, &self.chain.foot);
        let off = Vector3::from(foot) - center;
        let columns: ByJoint<Vector3<f64>> =
            (0..self.joints()).map(|j| placed.moved_by(j, foot).into()).collect();
        let (mut value, mut gradient) = (0.5 * off.norm_squared(), Column::zeros());
        let mut second = Square::identity();
        for (i, column) in columns.iter().enumerate() {
            let (turned, weight) = (q[i] - self.stance[i], self.weights[i] * more);
            value += 0.5 * weight * turned * turned;
            gradient[i] = column.dot(&off) + weight * turned;
            for (j, other) in columns[..=i].iter().enumerate() {
                // ∂²F/∂qⱼ∂qᵢ = aⱼ × ∂F/∂qᵢ for j ≤ i.
                let curved = Vector3::from(placed.axis[j]).cross(column).dot(&off);
                second[(i, j)] = column.dot(other) + curved;
                second[(j, i)] = second[(i, j)];
            }
            second[(i, i)] += weight;
        }
        Function { value, gradient, second, columns }
    }

    /// Least eigenvalue of M that counts.
    fn least(&self) -> f64 {
        0.1 * self.weights.iter().copied().fold(f64::INFINITY, f64::min)
    }

    /// The joint angles of the minimum, and there M⁻¹ and ∂F/∂q.
    ///
    /// From the stance on, a leg of more than three joints is led there by larger ε: with the final one alone, it would have to follow the
    /// narrow valley F(q) = c by small steps.
    fn minimum(&self, center: &Vector3<f64>) -> (Column, Square, ByJoint<Vector3<f64>>) {
        let mut q = Column::zeros();
        q.as_mut_slice()[..self.joints()].copy_from_slice(&self.stance);
        if self.joints() > 3 {
            for more in LARGER {
                self.downhill(&mut q, center, more, NEAR);
            }
        }
        self.downhill(&mut q, center, 1.0, CONVERGED);
        let Function { second, columns, .. } = self.function(&q, center, 1.0);
        (q, inverse(&second, self.least()), columns)
    }

    /// Newton's method with steps that lower the value, until one is smaller than `last`.
    fn downhill(&self, q: &mut Column, center: &Vector3<f64>, more: f64, last: f64) {
        let mut here = self.function(q, center, more);
        for _ in 0..STEPS {
            let mut step = -(inverse(&here.second, self.least() * more) * here.gradient);
            step *= (LARGEST_TURN / step.amax()).min(1.0);
            if step.amax() < last {
                *q += step;
                break;
            }
            let mut next = self.function(&(*q + step), center, more);
            // Rounding may keep the last steps from lowering the value.
            while next.value > here.value * (1.0 + 1e-14) && step.amax() > CONVERGED {
                step *= 0.5;
                next = self.function(&(*q + step), center, more);
            }
            *q += step;
            here = next;
        }
    }
}

/// The inverse of a symmetric matrix with its eigenvalues made at least `least`, by size.
fn inverse(matrix: &Square, least: f64) -> Square {
    if (matrix - Square::identity() * least).cholesky().is_some()
        && let Some(factored) = matrix.cholesky()
    {
        return factored.inverse();
    }
    let eigen = matrix.symmetric_eigen();
    let inverted = eigen.eigenvalues.map(|value| 1.0 / value.abs().max(least));
    eigen.eigenvectors * Square::from_diagonal(&inverted) * eigen.eigenvectors.transpose()
}

impl<T: Scalar> SerialPosture<'_, T> {
    /// The angles of the joints as the robot's file counts them, rad.
    pub fn joint_angles(&self) -> ByJoint<T> {
        self.angles.clone()
    }

    /// A point of the shank, base frame from the center of mass, m, given along the line from the knee to the center of the foot, and
    /// across it toward the outside of the bend.
    pub fn on_shank(&self, [along, across]: [f64; 2]) -> [T; 3] {
        let Serial { knee, along: forward, across: out, .. } = &self.leg;
        self.placed.point(self.leg.joints() - 1, &(knee + forward * along + out * across))
    }

    /// A point fixed to the link of joint j, base frame from the center of mass, m, given from that joint at zero joint angles.
    pub fn on_link(&self, j: usize, local: &Vector3<f64>) -> [T; 3] {
        self.placed.point(j, local)
    }

    /// ∂r/∂q, m: the derivatives of the contact point, base frame, with respect to the joint angles, one vector for each joint.
    pub fn jacobian(&self) -> ByJoint<[T; 3]> {
        (0..self.leg.joints()).map(|j| self.placed.moved_by(j, self.contact)).collect()
    }
}

#[cfg(test)]
mod tests {
    use nalgebra::{DMatrix, DVector};

    use super::*;
    use crate::leg::chain::tests::leg;
    use crate::leg::jet::Jet;

    const ROLL: [f64; 3] = [1.0, 0.0, 0.0];
    const PITCH: [f64; 3] = [0.0, 1.0, 0.0];
    const YAW: [f64; 3] = [0.0, 0.0, 1.0];
    /// Axes, and the joint angles of a stance.
    const LEGS: [(&[[f64; 3]], &[f64]); 9] = [
        (&[YAW, PITCH, PITCH], &[0.1, -0.7, 1.3]),
        (&[ROLL, PITCH, PITCH], &[0.1, -0.7, 1.3]),
        (&[PITCH, ROLL, [0.0, -1.0, 0.0]], &[-0.7, 0.1, -1.3]),
        (&[[1.0, 0.2, 0.1], [0.1, 1.0, 0.0], [0.0, 1.0, 0.3]], &[0.1, -0.7, 1.3]),
        (&[ROLL, PITCH, PITCH, PITCH], &[0.1, -0.7, 1.3, -0.5]),
        (&[[1.0, 0.2, 0.1], [0.1, 1.0, 0.0], [0.0, 1.0, 0.3], [0.3, -1.0, 0.0]], &[0.1, -0.7, 1.3, 0.4]),
        (&[YAW, ROLL, PITCH, PITCH, PITCH], &[0.1, 0.0, -0.7, 1.3, -0.5]),
        (&[YAW, ROLL, PITCH, PITCH, PITCH, ROLL], &[0.1, 0.0, -0.7, 1.3, -0.5, 0.1]),
        (&[ROLL, PITCH, YAW, PITCH, YAW, PITCH, ROLL], &[0.1, -0.6, 0.1, 1.2, 0.1, -0.5, 0.1]),
    ];
    const RADIUS: f64 = 0.02;

    fn near(stance: &[f64], amount: f64) -> impl Iterator<Item = Vec<f64>> {
        let turns = [
            [1.0, 0.5, -0.4, 0.6, -0.2, 0.5, 0.3],
            [-0.6, -1.0, 0.7, -0.5, 0.4, 0.2, -0.7],
            [0.3, 0.8, 1.0, 0.2, -0.6, -0.9, 0.5],
        ];
        turns.into_iter().map(move |turn| stance.iter().zip(turn).map(|(q, t)| q + amount * t).collect())
    }

    #[test]
    fn postures_invert_forward_kinematics() {
        for (axes, stance) in LEGS {
            let chain = leg(axes);
            let serial = Serial::new(&chain, stance, RADIUS).unwrap();
            for q in near(stance, 0.4) {
                let contact = Vector3::from(chain.foot(&q)) - Vector3::z() * RADIUS;
                assert!(serial.reaches(contact.into()));
                let posture = serial.posture::<f64>(contact.into());
                if q.len() == 3 {
                    for (found, expected) in posture.joint_angles().into_iter().zip(&q) {
                        assert!((found - expected).abs() < 2e-3, "{found} {expected} for {axes:?} {q:?}");
                    }
                }
                let foot = Vector3::from(posture.on_shank([serial.shank, 0.0])) - Vector3::z() * RADIUS;
                assert!((foot - contact).norm() < 1e-3);
            }
        }
    }

    /// No motion of the joints that leaves the foot where it is leads nearer to the stance, by the weights of the joints' ranges.
    #[test]
    fn of_all_postures_the_one_nearest_to_the_stance_is_taken() {
        for (axes, stance) in LEGS.into_iter().filter(|(axes, _)| axes.len() > 3) {
            let mut chain = leg(axes);
            for (j, joint) in chain.joints.iter_mut().enumerate() {
                joint.range = [-0.5 - 0.3 * j as f64, 0.5 + 0.2 * j as f64];
            }
            let serial = Serial::new(&chain, stance, RADIUS).unwrap();
            for q in near(stance, 0.3) {
                let contact = Vector3::from(chain.foot(&q)) - Vector3::z() * RADIUS;
                let posture = serial.posture::<f64>(contact.into());
                let found = posture.joint_angles();
                let placed = chain.place::<f64>(&found);
                let foot = chain.foot::<f64>(&found);
                let jacobian = DMatrix::from_fn(3, q.len(), |c, j| placed.moved_by(j, foot)[c]);
                let pull = |q: &[f64]| {
                    DVector::from_fn(q.len(), |j, _| {
                        let [low, high] = chain.joints[j].range;
                        (q[j] - stance[j]) / (0.5 * (high - low)).powi(2)
                    })
                };
                // Without its part along the rows of ∂F/∂q.
                let inner = |v: DVector<f64>| {
                    let rows = &jacobian * jacobian.transpose();
                    let along = rows.try_inverse().unwrap() * (&jacobian * &v);
                    (&v - jacobian.transpose() * along).norm()
                };
                assert!(inner(pull(&found)) < 2e-3 * pull(&found).norm(), "{axes:?} {q:?}: {found:?}");
                let distance = |q: &[f64]| {
                    pull(q).iter().zip(q.iter().zip(stance)).map(|(p, (q, s))| p * (q - s)).sum::<f64>()
                };
                assert!(distance(&found) < distance(&q) + 1e-3, "{axes:?} {q:?}: {found:?}");
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
                near(stance, 0.4).map(|q| chain.foot::<f64>(&q).into()).collect();
            let hip = Vector3::from(chain.place::<f64>(stance).origin[1]);
            points.push(hip + (points[0] - hip) * 1.6);
            for point in points {
                let all = |p: &Vector3<f64>| -> Vec<Jet> {
                    let posture = serial.posture(Jet::variables(p));
                    let corner = posture.on_shank([0.06, 0.1]);
                    let link = posture.on_link(1, &Vector3::new(0.1, 0.05, -0.2));
                    posture
                        .joint_angles()
                        .into_iter()
                        .chain(corner)
                        .chain(link)
                        .chain(posture.jacobian().into_iter().flatten())
                        .collect()
                };
                let jets = all(&point);
                let step = 1e-5;
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
                let numbers = found.joint_angles().into_iter().chain(found.jacobian().into_iter().flatten());
                assert!(numbers.into_iter().all(f64::is_finite));
            }
            assert!(!serial.reaches([0.3, -0.1, -2.0]) && !serial.reaches([2.0, 1.0, 1.0]));
        }
    }
}
