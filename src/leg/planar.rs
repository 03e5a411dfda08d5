//! Closed-form inverse kinematics of a leg with hip abduction (HAA), hip flexion (HFE) and knee flexion (KFE), the latter two about parallel
//! axes across that of the former. With HAA about x and the others about y when not abducted, as most four-legged robots have them:
//!
//! ```text
//!   d = r − hip + (0, 0, foot_radius)         center of the foot from the hip, base frame
//!   h = √(d_y² + d_z² − l²) + e               its distance below the HFE axis in the plane of the leg
//!   cos κ = (d_x² + h² − a² − b²)/(2ab)       κ: angle of the knee, 0 when straight
//!   d_x = a sin φ + b sin(φ + κ),  h = a cos φ + b cos(φ + κ)      φ: angle of the thigh from straight down toward +x
//! ```
//!
//! with l, a, b the lateral offset, thigh and shank, e the height of the HFE axis above the HAA axis at zero angles (for most robots 0), and
//! r the contact point. The center of the foot is assumed one radius above r along the base's z axis. It is really along the normal of the
//! ground; the error is the radius times the angle between the two.
//!
//! Legs with other axes, such as those of insects (HAA about z), have the same form in axes of their own: x along HAA, y along HFE, both at zero
//! joint angles, and z such that the leg hangs down.
//!
//! Out of reach, square roots are rounded off so that all functions stay smooth: an iterate may be anywhere.

use std::f64::consts::TAU;

use nalgebra::{Matrix3, Vector3};

use super::chain::Chain;
use super::jet::Scalar;

/// Rounding of sin²κ. At κ = 0.35, the least angle in the reach boxes, it changes sin κ by 0.02 %.
const SINE_ROUNDING: f64 = 5e-3;
/// Rounding of h², in squared lengths of the leg: it matters only where the foot is within a few centimeters of the HAA axis.
const DROP_ROUNDING: f64 = 2.7e-4;
/// How far the axes of a chain may be from x, y and y of the leg, rad, for the closed form to hold.
const STRAIGHT: f64 = 1e-6;

/// Geometry of a leg whose inverse kinematics has a closed form. Lengths in m, in the leg's axes, origin at the center of mass.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Planar {
    /// The leg's axes in the base frame, in rows; none where they are the base's.
    pub frame: Option<Matrix3<f64>>,
    /// x of the HFE axis, y and z of the HAA axis.
    pub hip: [f64; 3],
    /// e: the HFE axis above the HAA axis at zero angles.
    pub rise: f64,
    /// l: lateral offset of the center of the foot from the HAA axis, toward +y.
    pub lateral: f64,
    /// a: HFE to KFE in the plane of the leg.
    pub thigh: f64,
    /// b: KFE to the center of the foot in the plane of the leg.
    pub shank: f64,
    /// +1 if the shank points further forward than the thigh, −1 if it points further back.
    pub bend: f64,
    /// From the contact point to the center of the foot.
    pub lift: [f64; 3],
    /// How the joints of the model count their angles.
    pub counting: Counting,
}

/// From the angles of the closed form to those of the joints: q = sign · (zero − angle) for HFE and KFE.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Counting {
    /// +1 for joints about +x and +y, −1 for those about −x and −y.
    pub sign: [f64; 3],
    /// φ and κ at zero joint angles, rad.
    pub zero: [f64; 2],
    /// Middle of each joint's range, rad: an angle is given within half a turn of it.
    pub middle: [f64; 3],
}

impl Default for Counting {
    /// Joints about +x and +y that are zero where the leg hangs straight down.
    fn default() -> Self {
        Self { sign: [1.0; 3], zero: [0.0; 2], middle: [0.0; 3] }
    }
}

/// The joint angles of a leg and the places of its parts, in the leg's axes.
#[derive(Clone, Copy, Debug)]
pub struct PlanarPosture<'a, T> {
    /// sin and cos of the angle of abduction.
    abduction: [T; 2],
    /// The center of the foot in the plane of the leg from the HFE axis: forward, down.
    foot: [T; 2],
    /// The knee, likewise.
    knee: [T; 2],
    /// sin φ, cos φ.
    thigh: [T; 2],
    /// sin κ, cos κ.
    bent: [T; 2],
    leg: &'a Planar,
}

/// A smooth positive substitute for √u, where u may be negative.
fn rounded_root<T: Scalar>(u: T, rounding: f64) -> T {
    ((u + (u * u + rounding * rounding).sqrt()) * 0.5).sqrt()
}

impl Planar {
    /// The closed form of a chain of three joints whose knee bends as at the joint angles `stance`; none if the axis of the first is not across
    /// those of the other two, which are parallel.
    pub fn of_chain(chain: &Chain, stance: &[f64], foot_radius: f64) -> Option<Self> {
        let [first, second, third] = &chain.joints[..] else { return None };
        let frame = axes(chain, stance);
        let turned = |v: Vector3<f64>| frame.map_or(v, |frame| frame * v);
        let sign = [turned(first.axis).x, turned(second.axis).y, turned(third.axis).y].map(f64::signum);
        let expected = [Vector3::x(), Vector3::y(), Vector3::y()];
        let aligned = chain.joints.iter().zip(expected).zip(sign);
        if aligned
            .into_iter()
            .any(|((joint, axis), sign)| (turned(joint.axis) - axis * sign).norm() > STRAIGHT)
        {
            return None;
        }
        let (haa, hfe) = (turned(first.position), turned(second.position));
        let (thigh, shank) = (turned(third.position), turned(chain.foot));
        let from_down = |v: Vector3<f64>| v.x.atan2(-v.z);
        let turn = wrapped(from_down(shank) - from_down(thigh), 0.0);
        let bent = wrapped(turn - sign[2] * stance[2], 0.0);
        let middle = [first, second, third].map(|joint| 0.5 * (joint.range[0] + joint.range[1]));
        Some(Self {
            frame,
            hip: [haa.x + hfe.x, haa.y, haa.z],
            rise: hfe.z,
            lateral: hfe.y + thigh.y + shank.y,
            thigh: thigh.x.hypot(thigh.z),
            shank: shank.x.hypot(shank.z),
            bend: if bent < 0.0 { -1.0 } else { 1.0 },
            lift: turned(Vector3::z() * foot_radius).into(),
            counting: Counting { sign, zero: [from_down(thigh), turn], middle },
        })
    }

    /// A vector of the base frame in the leg's axes.
    fn in_leg<T: Scalar>(&self, v: [T; 3]) -> [T; 3] {
        self.frame.map_or(v, |frame| rotated(&frame, v))
    }

    /// A vector in the leg's axes in the base frame.
    fn in_base<T: Scalar>(&self, v: [T; 3]) -> [T; 3] {
        self.frame.map_or(v, |frame| rotated(&frame.transpose(), v))
    }

    /// The center of the foot from the hip in the leg's axes, for the contact point r in the base frame.
    fn foot_from_hip<T: Scalar>(&self, r: [T; 3]) -> [T; 3] {
        let r = self.in_leg(r);
        std::array::from_fn(|c| r[c] + (self.lift[c] - self.hip[c]))
    }

    /// Whether there are joint angles for the contact point r, regardless of joint limits.
    pub fn reaches(&self, r: [f64; 3]) -> bool {
        let [x, y, z] = self.foot_from_hip(r);
        let drop = y * y + z * z - self.lateral * self.lateral;
        let distance = x.hypot(drop.max(0.0).sqrt() + self.rise);
        drop > 0.0 && distance < self.thigh + self.shank && distance > (self.thigh - self.shank).abs()
    }

    /// The posture for the contact point r, base frame from the center of mass.
    pub fn posture<T: Scalar>(&self, r: [T; 3]) -> PlanarPosture<'_, T> {
        let (a, b, l) = (self.thigh, self.shank, self.lateral);
        let [x, y, z] = self.foot_from_hip(r);
        let drop = rounded_root(y * y + z * z + -l * l, DROP_ROUNDING * (a + b) * (a + b));
        // (y, z) = (l cos α + drop sin α, l sin α − drop cos α).
        let scale = (drop * drop + l * l).recip();
        let abduction = [(drop * y + z * l) * scale, (y * l - drop * z) * scale];
        let h = drop + self.rise;
        let cos = (x * x + h * h + (-a * a - b * b)) * (0.5 / (a * b));
        let sin = rounded_root(-(cos * cos) + 1.0, SINE_ROUNDING) * self.bend;
        // x = A sin φ + B cos φ, h = A cos φ − B sin φ.
        let (along, across) = (cos * b + a, sin * b);
        let scale = (along * along + across * across).recip();
        let thigh = [(along * x - across * h) * scale, (along * h + across * x) * scale];
        PlanarPosture {
            abduction,
            foot: [x, h],
            knee: thigh.map(|c| c * a),
            thigh,
            bent: [sin, cos],
            leg: self,
        }
    }
}

/// The axes of a leg of three joints, in rows, where they are not the base's.
fn axes(chain: &Chain, stance: &[f64]) -> Option<Matrix3<f64>> {
    let along = |axis: Vector3<f64>, other: Vector3<f64>| axis.cross(&other).norm() < STRAIGHT;
    let [first, second] = [0, 1].map(|j| chain.joints[j].axis);
    if along(first, Vector3::x()) && along(second, Vector3::y()) {
        return None;
    }
    let mut angles = stance.to_vec();
    angles[0] = 0.0;
    let foot = Vector3::from(chain.foot(&angles)) - chain.joints[0].position;
    let up = first.cross(&second);
    let side = if up.dot(&foot) > 0.0 { -second } else { second };
    Some(Matrix3::from_rows(&[first, side, first.cross(&side)].map(|axis| axis.transpose())))
}

fn rotated<T: Scalar>(frame: &Matrix3<f64>, v: [T; 3]) -> [T; 3] {
    std::array::from_fn(|i| v[0] * frame[(i, 0)] + v[1] * frame[(i, 1)] + v[2] * frame[(i, 2)])
}

/// An angle within half a turn of another.
fn wrapped(angle: f64, near: f64) -> f64 {
    angle - TAU * ((angle - near) / TAU).round()
}

impl<T: Scalar> PlanarPosture<'_, T> {
    /// The angles φ and κ, rad; their rates are those of HFE and KFE, up to the sign.
    pub fn swing_angles(&self) -> [T; 2] {
        [self.thigh[0].atan2(self.thigh[1]), self.bent[0].atan2(self.bent[1])]
    }

    /// The angles of the joints as the robot's file counts them, rad.
    pub fn joint_angles(&self) -> [T; 3] {
        let Counting { sign, zero, middle } = self.leg.counting;
        let [sin, cos] = self.abduction;
        let [thigh, bent] = self.swing_angles();
        let counted = [sin.atan2(cos), -thigh + zero[0], -bent + zero[1]];
        std::array::from_fn(|j| {
            let angle = counted[j] * sign[j];
            angle + (wrapped(angle.value(), middle[j]) - angle.value())
        })
    }

    /// Whether the first joint is an abduction about the base's x axis.
    pub fn abducts(&self) -> bool {
        self.leg.frame.is_none()
    }

    /// A vector in the plane of the leg, given by its forward and down components, in the leg's axes.
    fn out_of_plane(&self, [forward, down]: [T; 2]) -> [T; 3] {
        let [sin, cos] = self.abduction;
        [forward, down * sin, -(down * cos)]
    }

    /// A point of the shank, base frame from the center of mass, m, given along the line from the knee to
    /// the center of the foot, and across it toward the outside of the bend.
    pub fn on_shank(&self, [along, across]: [f64; 2]) -> [T; 3] {
        let [forward, down] = [0, 1].map(|c| (self.foot[c] - self.knee[c]) * (1.0 / self.leg.shank));
        let across = across * self.leg.bend;
        let point = [
            self.knee[0] + forward * along + down * across,
            self.knee[1] + down * along + -(forward * across),
        ];
        let [x, y, z] = self.out_of_plane([point[0], point[1] + -self.leg.rise]);
        let [sin, cos] = self.abduction;
        let Planar { hip, lateral: l, .. } = *self.leg;
        self.leg.in_base([x + hip[0], y + cos * l + hip[1], z + sin * l + hip[2]])
    }

    /// ∂r/∂q, m: the derivatives of the contact point, base frame, with respect to HAA, HFE and KFE, one vector for each joint. With a
    /// massless leg, a force f of the ground at the contact point, base frame, requires the torques −(∂r/∂q)ᵀ f.
    pub fn jacobian(&self) -> [[T; 3]; 3] {
        let [sin, cos] = self.abduction;
        let [x, h] = self.foot;
        let Planar { lateral: l, lift, rise, counting, .. } = *self.leg;
        // The contact point relative to the HAA axis.
        let drop = h + -rise;
        let y = cos * l + drop * sin + -lift[1];
        let z = sin * l - drop * cos + -lift[2];
        let zero = y * 0.0;
        // axis × (v − lift) with axis = (0, cos α, sin α).
        let about = |v: [T; 2]| {
            let [_, up_y, up_z] = self.out_of_plane([zero, v[0]]);
            [sin * lift[1] - v[1] - cos * lift[2], up_y - sin * lift[0], up_z + cos * lift[0]]
        };
        let [knee_x, knee_h] = self.knee;
        let columns = [[zero, -z, y], about([x, h]), about([x - knee_x, h - knee_h])];
        std::array::from_fn(|j| self.leg.in_base(columns[j].map(|entry| entry * counting.sign[j])))
    }
}

#[cfg(test)]
mod tests {
    use nalgebra::{Rotation3, Vector3};

    use super::*;
    use crate::leg::chain::tests::leg as leg_of;

    const RADIUS: f64 = 0.03;
    const LEG: Planar = Planar {
        frame: None,
        hip: [0.3, -0.1, 0.05],
        rise: 0.0,
        lateral: -0.2,
        thigh: 0.28,
        shank: 0.33,
        bend: -1.0,
        lift: [0.0, 0.0, RADIUS],
        counting: Counting { sign: [1.0; 3], zero: [0.0; 2], middle: [0.0; 3] },
    };
    /// A point of the shank.
    const CORNER: [f64; 2] = [0.06, 0.1];

    /// The center of the foot and the knee by forward kinematics: q = HAA, thigh from straight down, knee.
    fn forward(leg: &Planar, q: [f64; 3]) -> (Vector3<f64>, Vector3<f64>) {
        let turn = |angle: f64| Rotation3::from_axis_angle(&Vector3::y_axis(), -angle);
        let haa = Rotation3::from_axis_angle(&Vector3::x_axis(), q[0]);
        let side = Vector3::y() * leg.lateral;
        let knee = turn(q[1]) * (Vector3::z() * -leg.thigh);
        let foot = knee + turn(q[1] + q[2]) * (Vector3::z() * -leg.shank);
        let hip = Vector3::from(leg.hip);
        (hip + haa * (side + foot), hip + haa * (side + knee))
    }

    #[test]
    fn postures_invert_forward_kinematics() {
        for bend in [1.0, -1.0] {
            let leg = Planar { bend, ..LEG };
            for q in [[0.2, 0.6, 1.2], [-0.4, 0.3, 0.5], [0.1, 0.7, 1.9], [0.0, 0.9, 2.3]] {
                let q = [q[0], -bend * q[1], bend * q[2]];
                let (center, knee) = forward(&leg, q);
                let below = -Vector3::z() * RADIUS;
                let contact = center + below;
                assert!(leg.reaches(contact.into()));
                let found = leg.posture::<f64>(contact.into());
                let [thigh, bent] = found.swing_angles();
                assert!(
                    (thigh - q[1]).abs() < 1e-3 && (bent - q[2]).abs() < 1e-3,
                    "{thigh} {bent} for {q:?}"
                );
                assert!((Vector3::from(found.on_shank([0.0; 2])) - knee).norm() < 1e-3);
                // HFE and KFE rotate against the angles from straight down; the contact point rotates with the foot.
                let axis = Rotation3::from_axis_angle(&Vector3::x_axis(), q[0]) * Vector3::y();
                let step = 1e-6;
                for (j, column) in found.jacobian().into_iter().enumerate() {
                    let moved = |sign: f64| {
                        let mut q = q;
                        q[j] += sign * step;
                        forward(&leg, q).0
                    };
                    let sign = if j == 0 { 1.0 } else { -1.0 };
                    let center = (moved(1.0) - moved(-1.0)) * (sign / (2.0 * step));
                    let expected = center + if j == 0 { Vector3::x() } else { axis }.cross(&below);
                    assert!((Vector3::from(column) - expected).norm() < 1e-3, "joint {j} at {q:?}");
                }
            }
        }
    }

    #[test]
    fn the_closed_form_of_a_chain_has_the_angles_of_its_joints() {
        for axes in [
            [[1.0, 0.0, 0.0], [0.0, 1.0, 0.0], [0.0, 1.0, 0.0]],
            [[-1.0, 0.0, 0.0], [0.0, -1.0, 0.0], [0.0, 1.0, 0.0]],
            // The legs of insects, on both sides, and a hip that is tilted forward.
            [[0.0, 0.0, 1.0], [-0.6, 0.8, 0.0], [-0.6, 0.8, 0.0]],
            [[0.0, 0.0, -1.0], [-0.6, -0.8, 0.0], [0.6, 0.8, 0.0]],
            [[0.8, 0.0, 0.6], [0.0, 1.0, 0.0], [0.0, -1.0, 0.0]],
        ] {
            let mut chain = leg_of(&axes);
            chain.joints[1].position.z = 0.03;
            let yaws = axes[0][0] == 0.0;
            if yaws {
                // Out to the side, so that no knee bends the foot under the first axis or is straight.
                let out = Vector3::from(axes[1]).cross(&Vector3::z());
                chain.joints[1].position = out * 0.2;
                chain.joints[2].position = out * 0.2 - Vector3::z() * 0.02;
            }
            for q in [[0.2, 0.3, 1.2], [-0.4, -0.2, -1.1], [0.1, 0.3, 0.9]] {
                let leg = Planar::of_chain(&chain, &q, 0.02).unwrap();
                let contact = Vector3::from(chain.foot(&q)) - Vector3::z() * 0.02;
                assert!(leg.reaches(contact.into()));
                let posture = leg.posture::<f64>(contact.into());
                for (found, expected) in posture.joint_angles().into_iter().zip(q) {
                    assert!((found - expected).abs() < 2e-3, "{found} {expected} for {q:?}");
                }
                let placed = chain.place::<f64>(&posture.joint_angles());
                for (j, column) in posture.jacobian().into_iter().enumerate() {
                    let expected = Vector3::from(placed.moved_by(j, contact.into()));
                    assert!((Vector3::from(column) - expected).norm() < 2e-3, "joint {j} at {q:?}");
                }
                let knee = Vector3::from(posture.on_shank([0.0; 2]));
                let axis = chain.joints[2].axis;
                let plane = axis * chain.foot.dot(&axis);
                assert!((knee - Vector3::from(placed.point(2, &plane))).norm() < 1e-3);
            }
        }
        let skewed = leg_of(&[[0.6, 0.8, 0.0], [0.0, 1.0, 0.0], [0.0, 1.0, 0.0]]);
        assert!(Planar::of_chain(&skewed, &[0.0; 3], 0.02).is_none());
    }

    #[test]
    fn points_of_the_shank_keep_their_distances() {
        let (contact, knee) = forward(&LEG, [0.2, 0.5, -1.2]);
        let contact = contact - Vector3::z() * RADIUS;
        let at = |point: [f64; 2]| Vector3::from(LEG.posture::<f64>(contact.into()).on_shank(point));
        assert!((at([LEG.shank, 0.0]) - (contact + Vector3::z() * RADIUS)).norm() < 1e-3);
        let corner = at(CORNER);
        assert!(((corner - knee).norm() - CORNER[0].hypot(CORNER[1])).abs() < 1e-3);
        // The knee of this leg points forward and its shank back and down, so the outside is behind the line.
        assert!(corner.x < at([CORNER[0], 0.0]).x);
    }

    #[test]
    fn out_of_reach_everything_is_finite() {
        for r in [[0.3, -0.1, -2.0], [0.3, -0.1, 0.02], [0.3, -0.3, 0.02], [2.0, 1.0, 1.0]] {
            assert!(!LEG.reaches(r));
            let found = LEG.posture::<f64>(r);
            let numbers = found
                .swing_angles()
                .into_iter()
                .chain(found.on_shank([0.0; 2]))
                .chain(found.jacobian().concat());
            assert!(numbers.into_iter().all(f64::is_finite));
        }
    }
}
