//! `[feet.leg]` of a robot file, and what it may contain.

use nalgebra::{Matrix3, Vector3};
use schemars::JsonSchema;
use serde::{Deserialize, Serialize};

use super::chain::{ByJoint, Chain, Joint, MOST_JOINTS};
use super::kinematics::{Kinematics, Leg, LinkShape, ShankShape};
use super::planar::{Counting, Planar};
use super::serial::Serial;

/// By how much an axis may differ from a unit vector.
const UNIT: f64 = 1e-3;
/// How far the foot may be from its nominal place at the angles `stance`, and a length from that of the joints, in lengths of the leg.
const AGREEMENT: f64 = 0.01;
/// By how much a principal moment may exceed the sum of the other two, as a fraction: files have rounded numbers.
const MOMENT_ROUNDING: f64 = 0.01;

/// Geometry and motors of a leg: as a chain of `joints`, or in the closed form `hip`, `lateral`, `thigh`, `shank`, `bend`, `speed_limit`,
/// `torque_limit`. Where both are given they must agree. Lengths in m, base frame, origin at the center of mass.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize, JsonSchema)]
#[serde(deny_unknown_fields)]
pub struct LegSpec {
    /// x of the HFE axis, y and z of the HAA axis.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub hip: Option<[f64; 3]>,
    /// Lateral offset of the center of the foot from the HAA axis, toward +y.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub lateral: Option<f64>,
    /// HFE to KFE in the plane of the leg.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    #[schemars(range(min = 0.01, max = 10.0))]
    pub thigh: Option<f64>,
    /// KFE to the center of the foot in the plane of the leg.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    #[schemars(range(min = 0.01, max = 10.0))]
    pub shank: Option<f64>,
    /// +1 if the shank points further forward than the thigh, −1 if it points further back.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub bend: Option<f64>,
    /// Greatest speed of each joint, rad/s.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    #[schemars(range(min = 0.01, max = 1000.0))]
    pub speed_limit: Option<f64>,
    /// Greatest torque of HAA, HFE and KFE, N m.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    #[schemars(inner(range(min = 0.01, max = 1e6)))]
    pub torque_limit: Option<[f64; 3]>,
    /// Of the parts around the axis of the last joint.
    #[schemars(range(min = 0.0, max = 1.0))]
    pub knee_radius: f64,
    /// The outermost corner of the shank from that axis: along the line to the center of the foot, and across it toward the outside of
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
    /// Of the foot, m.
    #[schemars(range(min = 0.001, max = 1.0))]
    pub foot_radius: f64,
    /// The center of the foot from the last joint at zero joint angles, m.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub foot: Option<[f64; 3]>,
    /// The joint angles that put the foot into its nominal place, rad.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    #[schemars(length(min = 2, max = 7))]
    pub stance: Option<Vec<f64>>,
    /// The joints from the base down: three to seven, or two about the base's y axis. Vectors are in axes parallel to the base's at zero
    /// joint angles. Of all postures of a leg of more than three joints for a place of its foot, plans have the one nearest to `stance`,
    /// with each angle measured in ranges of its joint.
    #[serde(default, skip_serializing_if = "Vec::is_empty")]
    #[schemars(length(max = 7))]
    pub joints: Vec<JointSpec>,
}

/// A joint of a leg and the link that it moves, with all that is fixed to that link.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize, JsonSchema)]
#[serde(deny_unknown_fields)]
pub struct JointSpec {
    /// Its name, as in the model for the replay.
    pub name: String,
    /// From the joint before (the first: from the center of mass), m.
    pub position: [f64; 3],
    /// A unit vector.
    pub axis: [f64; 3],
    /// Least and greatest angle, rad.
    pub range: [f64; 2],
    /// Greatest speed, rad/s.
    #[schemars(range(min = 0.01, max = 1000.0))]
    pub speed_limit: f64,
    /// Greatest torque, N m.
    #[schemars(range(min = 0.01, max = 1e6))]
    pub torque_limit: f64,
    /// Of the link, kg.
    #[schemars(range(min = 1e-6, max = 10000.0))]
    pub mass: f64,
    /// The link's center of mass from the joint, m.
    pub center: [f64; 3],
    /// The link's inertia about that center: xx, yy, zz, xy, xz, yz, kg m².
    pub inertia: [f64; 6],
    /// Radius of the link's parts around the line from this joint to the next, m, which keep clear of the ground; from the third joint to
    /// the last but one. The last has `knee_radius` and the other shapes of the shank. Default: they are not looked at.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    #[schemars(range(min = 0.0, max = 1.0))]
    pub radius: Option<f64>,
}

/// What a leg must not be: the key below `[feet.leg]`, empty for the table itself, and what is wrong with it.
#[derive(Clone, Debug, PartialEq, Eq)]
pub struct BadLeg {
    /// For instance `joints[1].axis`.
    pub key: String,
    /// What was given and what is allowed.
    pub what: String,
}

fn bad<T>(key: impl Into<String>, what: impl Into<String>) -> Result<T, BadLeg> {
    Err(BadLeg { key: key.into(), what: what.into() })
}

/// The keys of the closed form, all given.
struct ClosedForm {
    hip: [f64; 3],
    lateral: f64,
    thigh: f64,
    shank: f64,
    bend: f64,
    speed_limit: f64,
    torque_limit: [f64; 3],
}

impl LegSpec {
    /// The leg of a foot that stands at `nominal`, m from the center of mass.
    ///
    /// # Errors
    /// With the key that is wrong, for axes that are no unit vectors, masses and inertias that no link has, empty ranges, a stance that is
    /// out of them or not that of the foot, joints that the planner has no kinematics for, and keys that contradict each other.
    pub fn build(&self, nominal: [f64; 3]) -> Result<Leg, BadLeg> {
        let closed = self.closed_form()?;
        let leg = match (self.chain()?, &closed) {
            (Some(chain), _) => self.of_chain(chain, nominal)?,
            (None, Some(closed)) => self.of_closed_form(closed),
            (None, None) => {
                return bad("joints", "missing; a leg has two to seven joints, from the base to the foot");
            }
        };
        if let (Some(_), Some(closed)) = (&leg.chain, &closed) {
            self.agree(&leg, closed)?;
        }
        if !leg.reaches(nominal) {
            let what = "does not reach the foot's nominal position; lengths and hip are in m from the center of mass";
            return bad("", what);
        }
        Ok(leg)
    }

    /// The keys of the closed form, if any is given.
    fn closed_form(&self) -> Result<Option<ClosedForm>, BadLeg> {
        let given = [
            ("hip", self.hip.is_some()),
            ("lateral", self.lateral.is_some()),
            ("thigh", self.thigh.is_some()),
            ("shank", self.shank.is_some()),
            ("bend", self.bend.is_some()),
            ("speed_limit", self.speed_limit.is_some()),
            ("torque_limit", self.torque_limit.is_some()),
        ];
        let (
            Some(hip),
            Some(lateral),
            Some(thigh),
            Some(shank),
            Some(bend),
            Some(speed_limit),
            Some(torque_limit),
        ) = (self.hip, self.lateral, self.thigh, self.shank, self.bend, self.speed_limit, self.torque_limit)
        else {
            let missing = given.iter().find(|(_, given)| !given).map_or("", |(key, _)| key);
            let any = given.iter().any(|(_, given)| *given);
            return if any {
                bad(missing, "missing; the other keys of the closed form are given")
            } else {
                Ok(None)
            };
        };
        if bend.abs() != 1.0 {
            return bad("bend", format!("given {bend}, allowed: 1 or -1"));
        }
        Ok(Some(ClosedForm { hip, lateral, thigh, shank, bend, speed_limit, torque_limit }))
    }

    fn of_closed_form(&self, closed: &ClosedForm) -> Leg {
        let kinematics = Planar {
            frame: None,
            hip: closed.hip,
            rise: 0.0,
            lateral: closed.lateral,
            thigh: closed.thigh,
            shank: closed.shank,
            bend: closed.bend,
            lift: [0.0, 0.0, self.foot_radius],
            counting: Counting::default(),
        };
        let limits = closed.torque_limit.map(|torque| (closed.speed_limit, torque));
        self.leg(Kinematics::Planar(kinematics), None, limits.into_iter().unzip())
    }

    fn leg(
        &self,
        kinematics: Kinematics,
        chain: Option<Chain>,
        (speed_limit, torque_limit): (ByJoint<f64>, ByJoint<f64>),
    ) -> Leg {
        let shank = ShankShape {
            knee_radius: self.knee_radius,
            corner: self.corner,
            tube: self.tube,
            tube_radius: self.tube_radius.unwrap_or(self.foot_radius),
        };
        let links = chain.as_ref().map_or(Vec::new(), links);
        Leg { kinematics, chain, shank, links, foot_radius: self.foot_radius, speed_limit, torque_limit }
    }

    /// The chain of joints, if the leg has one.
    fn chain(&self) -> Result<Option<Chain>, BadLeg> {
        if self.joints.is_empty() {
            let lone = [("foot", self.foot.is_some()), ("stance", self.stance.is_some())];
            return match lone.iter().find(|(_, given)| *given) {
                Some((key, _)) => bad(*key, "given without `joints`, whose foot or angles it describes"),
                None => Ok(None),
            };
        }
        let Some(foot) = self.foot else {
            return bad("foot", "missing; the center of the foot from the last joint, m");
        };
        let mut joints = Vec::new();
        for (j, spec) in self.joints.iter().enumerate() {
            joints.push(spec.build().map_err(|e| BadLeg { key: format!("joints[{j}].{}", e.key), ..e })?);
        }
        let last = joints.len() - 1;
        if let Some(j) = (0..joints.len()).find(|j| joints[*j].radius.is_some() && !(2..last).contains(j)) {
            let what = "given, allowed: from the third joint to the last but one; the last has `knee_radius`";
            return bad(format!("joints[{j}].radius"), what);
        }
        match &mut joints[..] {
            [first, _] => {
                let hip = Joint::missing_abduction(first.position);
                first.position = Vector3::zeros();
                joints.insert(0, hip);
            }
            joints if (3..=MOST_JOINTS).contains(&joints.len()) => {}
            joints => {
                let count = joints.len();
                let what = format!("given {count}, allowed: two to {MOST_JOINTS}, from the base to the foot");
                return bad("joints", what);
            }
        }
        Ok(Some(Chain { joints, foot: foot.into() }))
    }

    /// Whether the foot moves in a plane only: a leg of two joints.
    pub fn is_sagittal(&self) -> bool {
        self.joints.len() == 2
    }

    /// The angles of the chain's joints in the nominal stance, rad.
    fn stance(&self) -> Result<Vec<f64>, BadLeg> {
        let Some(stance) = &self.stance else {
            return bad("stance", "missing; the joint angles that put the foot into its nominal place, rad");
        };
        if stance.len() != self.joints.len() {
            let what =
                format!("{} angles, allowed: one for each of the {} joints", stance.len(), self.joints.len());
            return bad("stance", what);
        }
        for (joint, angle) in self.joints.iter().zip(stance) {
            let [least, greatest] = joint.range;
            if !(least..=greatest).contains(angle) {
                let what =
                    format!("{angle} rad for {}, allowed: its range, {least} to {greatest}", joint.name);
                return bad("stance", what);
            }
        }
        let missing = self.is_sagittal().then_some(0.0);
        Ok(missing.into_iter().chain(stance.iter().copied()).collect())
    }

    fn of_chain(&self, chain: Chain, nominal: [f64; 3]) -> Result<Leg, BadLeg> {
        let stance = self.stance()?;
        let lowered = Vector3::from(nominal) + Vector3::z() * self.foot_radius;
        let off = (Vector3::from(chain.foot(&stance)) - lowered).norm();
        let length = chain.length();
        if off > AGREEMENT * length {
            let what = format!(
                "puts the foot {off:.3} m away from its nominal place; allowed: {:.3} m (one of joints, foot, stance, nominal is wrong)",
                AGREEMENT * length
            );
            return bad("stance", what);
        }
        let planar = Planar::of_chain(&chain, &stance, self.foot_radius);
        if self.is_sagittal() && planar.is_none_or(|leg| leg.frame.is_some()) {
            let what = "given two whose axes are not the base's y axis, allowed: two about y (pitch and pitch), or three to seven about any axes";
            return bad("joints", what);
        }
        let serial = || Serial::new(&chain, &stance, self.foot_radius).map(Kinematics::Serial);
        let Some(kinematics) = planar.map(Kinematics::Planar).or_else(serial) else {
            return bad("foot", "lies on the axis of the last joint, which cannot move it");
        };
        let limits = chain.joints.iter().map(|joint| (joint.speed_limit, joint.torque_limit)).unzip();
        Ok(self.leg(kinematics, Some(chain), limits))
    }

    /// Refuses keys of the closed form that contradict the joints.
    fn agree(&self, leg: &Leg, closed: &ClosedForm) -> Result<(), BadLeg> {
        let Some(found) = leg.abducting() else {
            return bad(
                "hip",
                "given with joints whose axes are not x, y, y, which it does not describe; leave it out",
            );
        };
        let most = AGREEMENT * (found.thigh + found.shank);
        let hip = (Vector3::from(closed.hip) - Vector3::from(found.hip)).norm();
        let off = |key, given: f64, found: f64| (key, (given - found).abs() > most, found);
        let relative = |key, given: f64, found: f64| (key, (given - found).abs() > AGREEMENT * found, found);
        let checks = [
            ("hip", hip > most, found.hip[0]),
            off("lateral", closed.lateral, found.lateral),
            off("thigh", closed.thigh, found.thigh),
            off("shank", closed.shank, found.shank),
            ("bend", closed.bend != found.bend, found.bend),
            relative("speed_limit", closed.speed_limit, leg.speed_limit[0]),
            relative("torque_limit", closed.torque_limit[0], leg.torque_limit[0]),
            relative("torque_limit", closed.torque_limit[1], leg.torque_limit[1]),
            relative("torque_limit", closed.torque_limit[2], leg.torque_limit[2]),
        ];
        match checks.iter().find(|(_, contradicts, _)| *contradicts) {
            Some((key, _, found)) => {
                bad(*key, format!("contradicts `joints`, which give {found:.4}; leave one of them out"))
            }
            None => Ok(()),
        }
    }
}

/// The links that could hit the ground, but the last.
fn links(chain: &Chain) -> Vec<LinkShape> {
    let pairs = chain.joints.windows(2).enumerate();
    pairs
        .filter_map(|(joint, pair)| {
            let (own, next) = (&pair[0], &pair[1].position);
            Some(LinkShape { joint, ends: [own.axis * own.axis.dot(next), *next], radius: own.radius? })
        })
        .collect()
}

impl JointSpec {
    fn build(&self) -> Result<Joint, BadLeg> {
        let axis = Vector3::from(self.axis);
        if (axis.norm() - 1.0).abs() > UNIT {
            return bad("axis", format!("given {:?}, allowed: a unit vector", self.axis));
        }
        let [least, greatest] = self.range;
        if least >= greatest {
            return bad(
                "range",
                format!("given {:?}, allowed: the least angle before the greatest", self.range),
            );
        }
        let [xx, yy, zz, xy, xz, yz] = self.inertia;
        let inertia = Matrix3::new(xx, xy, xz, xy, yy, yz, xz, yz, zz);
        let moments = inertia.symmetric_eigenvalues();
        let rounding = MOMENT_ROUNDING * moments.sum().abs();
        if moments.min() < -rounding || 2.0 * moments.max() > moments.sum() + rounding {
            let what = format!(
                "principal moments {:.3e}, {:.3e}, {:.3e} kg m², allowed: none negative, none larger than the sum of the other two",
                moments[0], moments[1], moments[2]
            );
            return bad("inertia", what);
        }
        Ok(Joint {
            position: self.position.into(),
            axis: axis.normalize(),
            range: self.range,
            speed_limit: self.speed_limit,
            torque_limit: self.torque_limit,
            mass: self.mass,
            center: self.center.into(),
            inertia,
            radius: self.radius,
        })
    }
}
