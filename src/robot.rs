//! A robot as the centroidal model sees it: one rigid body and a reach box per foot.

use std::path::Path;

use nalgebra::Matrix3;
use schemars::JsonSchema;
use serde::{Deserialize, Serialize};

use crate::leg::Leg;
use crate::scenario::RobotSpec;
use crate::scenario::document::Document;
use crate::{Error, Result};

/// The robots that come with the program: name and content of `robots/NAME.toml`.
const SHIPPED: &[(&str, &str)] = &[
    ("anymal_towr", include_str!("../robots/anymal_towr.toml")),
    ("anymal_b", include_str!("../robots/anymal_b.toml")),
    ("anymal_c", include_str!("../robots/anymal_c.toml")),
];

/// An axis-aligned box in the base frame, origin at the centre of mass, m.
#[derive(Clone, Copy, Debug, PartialEq, Serialize, Deserialize, JsonSchema)]
#[serde(deny_unknown_fields)]
pub struct Box3 {
    /// Centre, m.
    pub center: [f64; 3],
    /// Half of the edge lengths, m.
    #[schemars(inner(range(min = 0.001, max = 10.0)))]
    pub half_size: [f64; 3],
}

/// One foot.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize, JsonSchema)]
#[serde(deny_unknown_fields)]
pub struct Foot {
    /// `LF`, `RF`, `LH`, `RH` for ANYmal.
    pub name: String,
    /// Where the foot stands at rest, base frame, m from the centre of mass.
    pub nominal: [f64; 3],
    /// The reachable box 𝓡ᵢ of Eq. 4.
    pub reach: Box3,
    /// The leg, where it is known: joints then keep their speeds and torques.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub leg: Option<Leg>,
}

/// Mass, inertia and reach of a robot (`robots/NAME.toml`).
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize, JsonSchema)]
#[serde(deny_unknown_fields)]
pub struct Robot {
    /// Name, as in `robots/NAME.toml`.
    pub name: String,
    /// Where the figures come from.
    pub source: String,
    /// Total mass, kg.
    #[schemars(range(min = 0.1, max = 10000.0))]
    pub mass: f64,
    /// Inertia about the centre of mass in the base frame at the nominal stance, kg m².
    pub inertia: [[f64; 3]; 3],
    /// Length of a gait's cycle where the scenario names none, s; 1 s if the robot's file names none either.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    #[schemars(range(min = 0.1, max = 20.0))]
    pub gait_cycle: Option<f64>,
    /// The torso's box, for clearance over the ground.
    pub torso: Box3,
    /// The feet, in the order of the plan's `foot_names`.
    #[schemars(length(min = 1, max = 16))]
    pub feet: Vec<Foot>,
}

impl Robot {
    /// The robot that a scenario names: a shipped one, or a file relative to `base_dir`. Refuses unknown names, figures
    /// that no rigid body has, and adhesive feet that the robot lacks.
    pub fn load(spec: &RobotSpec, base_dir: &Path) -> Result<Self> {
        let document = match &spec.file {
            Some(file) => Document::read(&base_dir.join(file))?.0,
            None => match SHIPPED.iter().find(|(name, _)| *name == spec.name) {
                Some((name, text)) => Document::parse(&format!("robots/{name}.toml"), text)?,
                None => {
                    let what = "unknown; a robot of your own is given as robot.file = \"path.toml\"";
                    return Err(Error::input(format!(
                        "robot.name = \"{}\": {what}; available: {}",
                        spec.name,
                        Self::shipped().join(", ")
                    )));
                }
            },
        };
        let robot = Self::from_document(&document)?;
        for (i, foot) in spec.adhesive_feet.iter().enumerate() {
            let names: Vec<&str> = robot.feet.iter().map(|f| f.name.as_str()).collect();
            let what = match () {
                () if !names.contains(&foot.as_str()) => format!("is not a foot of {}", robot.name),
                () if spec.adhesive_feet[..i].contains(foot) => "is there twice".into(),
                () => continue,
            };
            return Err(Error::input(format!(
                "robot.adhesive_feet: \"{foot}\" {what}; its feet: {}",
                names.join(", ")
            )));
        }
        Ok(robot)
    }

    /// Names of the shipped robots.
    pub fn shipped() -> Vec<&'static str> {
        SHIPPED.iter().map(|(name, _)| *name).collect()
    }

    fn from_document(document: &Document) -> Result<Self> {
        let robot: Self = document.typed()?;
        let inertia = Matrix3::from_fn(|i, j| robot.inertia[i][j]);
        let refuse = |what: String| Err(document.error("inertia", what));
        let size = inertia.norm();
        if (inertia - inertia.transpose()).norm() > 1e-6 * size {
            return refuse(format!("given {:?}, allowed: a symmetric matrix", robot.inertia));
        }
        // The principal moments of a body: each is positive and at most the sum of the other two.
        let moments = inertia.symmetric_eigenvalues();
        let largest = moments.max();
        if moments.min() <= 0.0 {
            return refuse(format!(
                "principal moments {:.4?} kg m², allowed: all positive",
                moments.as_slice()
            ));
        }
        if 2.0 * largest > moments.sum() * (1.0 + 1e-6) {
            let what = "allowed: none larger than the sum of the other two (no body has such an inertia)";
            return refuse(format!("principal moments {:.4?} kg m², {what}", moments.as_slice()));
        }
        for (i, foot) in robot.feet.iter().enumerate() {
            let key = format!("feet[{i}]");
            if foot.name.is_empty() || robot.feet[..i].iter().any(|other| other.name == foot.name) {
                let what = format!("given \"{}\", allowed: a name that no other foot has", foot.name);
                return Err(document.error(&format!("{key}.name"), what));
            }
            if !foot.reach.contains(foot.nominal) {
                return Err(document.error(&format!("{key}.nominal"), "lies outside the foot's reach box"));
            }
            if let Some(leg) = &foot.leg {
                if leg.bend.abs() != 1.0 {
                    let what = format!("given {}, allowed: 1 or -1", leg.bend);
                    return Err(document.error(&format!("{key}.leg.bend"), what));
                }
                if !leg.reaches(foot.nominal) {
                    let what = "does not reach the foot's nominal place; lengths and hip are in m from the centre of mass";
                    return Err(document.error(&format!("{key}.leg"), what));
                }
            }
        }
        Ok(robot)
    }
}

impl Box3 {
    /// Whether a point lies in the box (borders included).
    pub fn contains(&self, point: [f64; 3]) -> bool {
        (0..3).all(|axis| (point[axis] - self.center[axis]).abs() <= self.half_size[axis])
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    fn changed(from: &str, to: &str) -> Result<Robot> {
        let text = SHIPPED[0].1;
        assert!(text.contains(from), "{from} is not in the shipped file");
        Robot::from_document(&Document::parse("robot.toml", &text.replacen(from, to, 1))?)
    }

    #[test]
    fn every_shipped_robot_loads_under_its_name() {
        for name in Robot::shipped() {
            let spec = RobotSpec { name: name.into(), ..Default::default() };
            assert_eq!(Robot::load(&spec, Path::new(".")).unwrap().name, name);
        }
    }

    #[test]
    fn impossible_bodies_are_refused() {
        for (from, to, expected) in [
            ("mass = 29.5 ", "mass = -1.0 ", "robot.toml:4: mass: given -1.0"),
            ("[ 0.946438,", "[ 9.46438,", "none larger than the sum"),
            ("[ 0.946438,", "[ -0.946438,", "all positive"),
            ("-0.000938112, 0.00595386", "0.1, 0.00595386", "symmetric"),
            ("\"RF\"", "\"LF\"", "no other foot"),
            ("nominal = [0.34, 0.19, -0.42]", "nominal = [1.34, 0.19, -0.42]", "outside the foot's reach"),
            (
                "half_size = [0.32, 0.14, 0.10]",
                "half_size = [0.32, 0.0, 0.10]",
                "torso.half_size[1]: given 0.0",
            ),
        ] {
            let message = changed(from, to).expect_err(to).to_string();
            assert!(message.contains(expected), "{message}");
        }
    }

    #[test]
    fn unknown_names_say_what_there_is() {
        let spec = RobotSpec { name: "spot".into(), ..Default::default() };
        let message = Robot::load(&spec, Path::new(".")).unwrap_err().to_string();
        assert!(message.contains("anymal_towr"), "{message}");
        let adhesive_feet = vec!["LF".into(), "XX".into()];
        let spec = RobotSpec { name: "anymal_towr".into(), adhesive_feet, ..Default::default() };
        let message = Robot::load(&spec, Path::new(".")).unwrap_err().to_string();
        assert!(message.contains("\"XX\" is not a foot") && message.contains("LF, RF, LH, RH"), "{message}");
    }
}
