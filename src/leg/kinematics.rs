//! Inverse kinematics of a leg with hip abduction (HAA, about x), hip flexion (HFE) and knee flexion (KFE, both about y when not abducted).
//!
//! ```text
//!   d = r − hip + (0, 0, foot_radius)         center of the foot from the hip, base frame
//!   h = √(d_y² + d_z² − l²)                   its distance below the HAA axis in the plane of the leg
//!   cos κ = (d_x² + h² − a² − b²)/(2ab)       κ: angle of the knee, 0 when straight
//!   d_x = a sin φ + b sin(φ + κ),  h = a cos φ + b cos(φ + κ)      φ: angle of the thigh from straight down toward +x
//! ```
//!
//! with l, a, b the lateral offset, thigh and shank, and r the contact point. The center of the foot is assumed one radius above r along
//! the base's z axis. It is really along the normal of the ground; the error is the radius times the angle between the two.
//!
//! Out of reach, square roots are rounded off so that all functions stay smooth: an iterate may be anywhere.

use schemars::JsonSchema;
use serde::{Deserialize, Serialize};

use super::jet::Scalar;

/// Rounding of sin²κ. At κ = 0.35, the least angle in the reach boxes, it changes sin κ by 0.02 %.
const SINE_ROUNDING: f64 = 5e-3;
/// Rounding of h², m²: it matters only where the foot is within a few centimeters of the HAA axis.
const DROP_ROUNDING: f64 = 1e-4;

/// Geometry and motors of a leg. Lengths in m, base frame, origin at the center of mass.
#[derive(Clone, Copy, Debug, PartialEq, Serialize, Deserialize, JsonSchema)]
#[serde(deny_unknown_fields)]
pub struct Leg {
    /// x of the HFE axis, y and z of the HAA axis.
    pub hip: [f64; 3],
    /// Lateral offset of the center of the foot from the HAA axis, toward +y.
    pub lateral: f64,
    /// HFE to KFE in the plane of the leg.
    #[schemars(range(min = 0.01, max = 10.0))]
    pub thigh: f64,
    /// KFE to the center of the foot in the plane of the leg.
    #[schemars(range(min = 0.01, max = 10.0))]
    pub shank: f64,
    /// Of the parts around the KFE axis.
    #[schemars(range(min = 0.0, max = 1.0))]
    pub knee_radius: f64,
    /// The outermost corner of the shank from the KFE axis: along the line to the center of the foot, and across it toward the outside of
    /// the bend.
    pub corner: [f64; 2],
    /// The upper end of the axis of the shank's tube, in the coordinates of `corner`; the axis leads to the center of the foot. Default:
    /// the knee.
    #[serde(default)]
    pub tube: [f64; 2],
    /// Radius of that tube; default: that of the foot.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    #[schemars(range(min = 0.0, max = 1.0))]
    pub tube_radius: Option<f64>,
    /// +1 if the shank points further forward than the thigh, −1 if it points further back.
    pub bend: f64,
    /// Of the foot, m.
    #[schemars(range(min = 0.001, max = 1.0))]
    pub foot_radius: f64,
    /// Greatest speed of each joint, rad/s.
    #[schemars(range(min = 0.01, max = 1000.0))]
    pub speed_limit: f64,
    /// Greatest torque of HAA, HFE and KFE, N m.
    #[schemars(inner(range(min = 0.01, max = 1e6)))]
    pub torque_limit: [f64; 3],
}

/// The joint angles of a leg and the places of its parts, base frame.
#[derive(Clone, Copy, Debug)]
pub struct LegPosture<T> {
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
    lateral: f64,
    shank: f64,
    bend: f64,
    radius: f64,
    hip: [f64; 3],
}

/// A smooth positive substitute for √u, where u may be negative.
fn rounded_root<T: Scalar>(u: T, rounding: f64) -> T {
    ((u + (u * u + rounding * rounding).sqrt()) * 0.5).sqrt()
}

impl Leg {
    /// Whether there are joint angles for the contact point r, regardless of joint limits.
    pub fn reaches(&self, r: [f64; 3]) -> bool {
        let [x, y, z] =
            std::array::from_fn(|c| r[c] - self.hip[c] + if c == 2 { self.foot_radius } else { 0.0 });
        let drop = y * y + z * z - self.lateral * self.lateral;
        let distance = (x * x + drop).sqrt();
        drop > 0.0 && distance < self.thigh + self.shank && distance > (self.thigh - self.shank).abs()
    }

    /// The posture for the contact point r, base frame from the center of mass.
    pub fn posture<T: Scalar>(&self, r: [T; 3]) -> LegPosture<T> {
        let (a, b, l) = (self.thigh, self.shank, self.lateral);
        let x = r[0] + -self.hip[0];
        let y = r[1] + -self.hip[1];
        let z = r[2] + (self.foot_radius - self.hip[2]);
        let h = rounded_root(y * y + z * z + -l * l, DROP_ROUNDING);
        // (y, z) = (l cos α + h sin α, l sin α − h cos α).
        let scale = (h * h + l * l).recip();
        let abduction = [(h * y + z * l) * scale, (y * l - h * z) * scale];
        let cos = (x * x + h * h + (-a * a - b * b)) * (0.5 / (a * b));
        let sin = rounded_root(-(cos * cos) + 1.0, SINE_ROUNDING) * self.bend;
        // x = A sin φ + B cos φ, h = A cos φ − B sin φ.
        let (along, across) = (cos * b + a, sin * b);
        let scale = (along * along + across * across).recip();
        let thigh = [(along * x - across * h) * scale, (along * h + across * x) * scale];
        LegPosture {
            abduction,
            foot: [x, h],
            knee: thigh.map(|c| c * a),
            thigh,
            bent: [sin, cos],
            lateral: l,
            shank: b,
            bend: self.bend,
            radius: self.foot_radius,
            hip: self.hip,
        }
    }
}

impl<T: Scalar> LegPosture<T> {
    /// The angles φ and κ, rad; their rates are those of HFE and KFE.
    pub fn angles(&self) -> [T; 2] {
        [self.thigh[0].atan2(self.thigh[1]), self.bent[0].atan2(self.bent[1])]
    }

    /// A vector in the plane of the leg, given by its forward and down components, in the base frame.
    fn in_base(&self, [forward, down]: [T; 2]) -> [T; 3] {
        let [sin, cos] = self.abduction;
        [forward, down * sin, -(down * cos)]
    }

    /// The knee, base frame from the center of mass, m. It has the lateral offset of the foot.
    pub fn knee(&self) -> [T; 3] {
        self.on_shank([0.0, 0.0])
    }

    /// A point of the shank, base frame from the center of mass, m, given in the coordinates of [`Leg::corner`].
    pub fn on_shank(&self, [along, across]: [f64; 2]) -> [T; 3] {
        let [forward, down] = [0, 1].map(|c| (self.foot[c] - self.knee[c]) * (1.0 / self.shank));
        let across = across * self.bend;
        let point = [
            self.knee[0] + forward * along + down * across,
            self.knee[1] + down * along + -(forward * across),
        ];
        let [x, y, z] = self.in_base(point);
        let [sin, cos] = self.abduction;
        let l = self.lateral;
        [x + self.hip[0], y + cos * l + self.hip[1], z + sin * l + self.hip[2]]
    }

    /// ∂r/∂q, m: the derivatives of the contact point, base frame, with respect to HAA, HFE and KFE, one vector for each joint. With a
    /// massless leg, a force f of the ground at the contact point, base frame, requires the torques −(∂r/∂q)ᵀ f.
    pub fn jacobian(&self) -> [[T; 3]; 3] {
        let [sin, cos] = self.abduction;
        let [x, h] = self.foot;
        let (l, radius) = (self.lateral, self.radius);
        // The contact point relative to the HAA axis; the radius is along the base's z axis.
        let y = cos * l + h * sin;
        let z = sin * l - h * cos + -radius;
        let zero = y * 0.0;
        // axis × (v − radius ẑ) with axis = (0, cos α, sin α).
        let about = |v: [T; 2]| {
            let [_, up_y, up_z] = self.in_base([zero, v[0]]);
            [-v[1] - cos * radius, up_y, up_z]
        };
        let [knee_x, knee_h] = self.knee;
        [[zero, -z, y], about([x, h]), about([x - knee_x, h - knee_h])]
    }
}

#[cfg(test)]
mod tests {
    use nalgebra::{Rotation3, Vector3};

    use super::*;

    const LEG: Leg = Leg {
        hip: [0.3, -0.1, 0.05],
        lateral: -0.2,
        thigh: 0.28,
        shank: 0.33,
        knee_radius: 0.06,
        corner: [0.06, 0.1],
        tube: [0.0, 0.0],
        tube_radius: None,
        bend: -1.0,
        foot_radius: 0.03,
        speed_limit: 10.0,
        torque_limit: [40.0; 3],
    };

    /// The center of the foot and the knee by forward kinematics: q = HAA, thigh from straight down, knee.
    fn forward(leg: &Leg, q: [f64; 3]) -> (Vector3<f64>, Vector3<f64>) {
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
            let leg = Leg { bend, ..LEG };
            for q in [[0.2, 0.6, 1.2], [-0.4, 0.3, 0.5], [0.1, 0.7, 1.9], [0.0, 0.9, 2.3]] {
                let q = [q[0], -bend * q[1], bend * q[2]];
                let (center, knee) = forward(&leg, q);
                let below = -Vector3::z() * leg.foot_radius;
                let contact = center + below;
                assert!(leg.reaches(contact.into()));
                let found = leg.posture::<f64>(contact.into());
                let [thigh, bent] = found.angles();
                assert!(
                    (thigh - q[1]).abs() < 1e-3 && (bent - q[2]).abs() < 1e-3,
                    "{thigh} {bent} for {q:?}"
                );
                assert!((Vector3::from(found.knee()) - knee).norm() < 1e-3);
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
    fn points_of_the_shank_keep_their_distances() {
        let (contact, knee) = forward(&LEG, [0.2, 0.5, -1.2]);
        let contact = contact - Vector3::z() * LEG.foot_radius;
        let at = |point: [f64; 2]| Vector3::from(LEG.posture::<f64>(contact.into()).on_shank(point));
        assert!((at([LEG.shank, 0.0]) - (contact + Vector3::z() * LEG.foot_radius)).norm() < 1e-3);
        let corner = at(LEG.corner);
        assert!(((corner - knee).norm() - LEG.corner[0].hypot(LEG.corner[1])).abs() < 1e-3);
        // The knee of this leg points forward and its shank back and down, so the outside is behind the line.
        assert!(corner.x < at([LEG.corner[0], 0.0]).x);
    }

    #[test]
    fn out_of_reach_everything_is_finite() {
        for r in [[0.3, -0.1, -2.0], [0.3, -0.1, 0.02], [0.3, -0.3, 0.02], [2.0, 1.0, 1.0]] {
            assert!(!LEG.reaches(r));
            let found = LEG.posture::<f64>(r);
            let numbers = found.angles().into_iter().chain(found.knee()).chain(found.jacobian().concat());
            assert!(numbers.into_iter().all(f64::is_finite));
        }
    }
}
