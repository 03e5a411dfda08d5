//! A robot as the centroidal model sees it: one rigid body and a reach box per foot.

use std::path::Path;

use nalgebra::{Matrix3, Vector3};
use schemars::JsonSchema;
use serde::{Deserialize, Serialize};

use crate::digest::sha256_hex;
use crate::input::{self, Document};
use crate::leg::body::Body;
use crate::leg::{Leg, LegSpec};
use crate::{Error, Result};

/// The robots that ship with the program: name and content of `robots/NAME.toml`.
const SHIPPED: &[(&str, &str)] = &[
    ("anymal_towr", include_str!("../robots/anymal_towr.toml")),
    ("anymal_b", include_str!("../robots/anymal_b.toml")),
    ("anymal_c", include_str!("../robots/anymal_c.toml")),
    ("a1", include_str!("../robots/a1.toml")),
    ("b1", include_str!("../robots/b1.toml")),
    ("biped_towr", include_str!("../robots/biped_towr.toml")),
    ("go1", include_str!("../robots/go1.toml")),
    ("go2", include_str!("../robots/go2.toml")),
    ("hexapod", include_str!("../robots/hexapod.toml")),
    ("hyq", include_str!("../robots/hyq.toml")),
    ("laikago", include_str!("../robots/laikago.toml")),
    ("monoped_towr", include_str!("../robots/monoped_towr.toml")),
    ("solo12", include_str!("../robots/solo12.toml")),
    ("solo8", include_str!("../robots/solo8.toml")),
];

/// Least half of an edge of a reach box, m, for a robot of ANYmal's size: more than the planner's margins take off it.
pub const LEAST_REACH: f64 = 0.02;
/// The same for the width of the box of a leg of two joints, whose foot moves in a plane: its play there.
pub const LEAST_PLAY: f64 = 0.002;
/// Standing height of the ANYmals, m; sizes of robots are multiples of the step.
const ANYMAL_HEIGHT: f64 = 0.43;
const SIZE_STEP: f64 = 0.05;
/// Characters of the longest name, of a robot or a foot.
const LONGEST_NAME: usize = 100;
/// Radius of a foot, in standing heights, where it is not known.
const TYPICAL_FOOT: f64 = 0.07;

/// The size in ANYmals of a robot with a standing height, m.
pub fn size_of(standing_height: f64) -> f64 {
    (standing_height / ANYMAL_HEIGHT / SIZE_STEP).round().max(1.0) * SIZE_STEP
}

/// `[robot]` of a scenario.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize, JsonSchema)]
#[serde(deny_unknown_fields, default)]
pub struct RobotSpec {
    /// Name of a shipped robot.
    pub name: String,
    /// A robot file instead, relative to the scenario.
    pub file: Option<String>,
    /// Names of the feet that may pull on the ground.
    pub adhesive_feet: Vec<String>,
}

impl Default for RobotSpec {
    fn default() -> Self {
        Self { name: "anymal_b".into(), file: None, adhesive_feet: Vec::new() }
    }
}

/// An axis-aligned box in the base frame, origin at the center of mass, m.
#[derive(Clone, Copy, Debug, PartialEq, Serialize, Deserialize, JsonSchema)]
#[serde(deny_unknown_fields)]
pub struct Box3 {
    /// Center, m.
    pub center: [f64; 3],
    /// Half of the edge lengths, m.
    #[schemars(inner(range(min = 0.001, max = 10.0)))]
    pub half_size: [f64; 3],
}

/// One foot.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize, JsonSchema)]
#[serde(deny_unknown_fields)]
pub struct Foot {
    /// Its name; `LF`, `RF`, `LH`, `RH` for ANYmal.
    pub name: String,
    /// Where the foot stands at rest, base frame, m from the center of mass.
    pub nominal: [f64; 3],
    /// The reachable box 𝓡ᵢ of Eq. 4.
    pub reach: Box3,
    /// The leg, if known: the limits of its joints' speeds and torques then hold.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub leg: Option<LegSpec>,
}

impl Foot {
    /// The leg, if the file describes it. (A robot whose file describes a leg that cannot be is not loaded.)
    pub fn leg(&self) -> Option<Leg> {
        self.leg.as_ref().and_then(|leg| leg.build(self.nominal).ok())
    }

    /// Whether the foot moves in a plane of the base only.
    pub fn is_sagittal(&self) -> bool {
        self.leg.as_ref().is_some_and(LegSpec::is_sagittal)
    }
}

/// Mass, inertia and reach of a robot (`robots/NAME.toml`).
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize, JsonSchema)]
#[serde(deny_unknown_fields)]
pub struct Robot {
    /// Name, as in `robots/NAME.toml`.
    pub name: String,
    /// Where the values come from.
    pub source: String,
    /// Total mass, kg.
    #[schemars(range(min = 0.1, max = 10000.0))]
    pub mass: f64,
    /// Inertia about the center of mass in the base frame at the nominal stance, kg m².
    pub inertia: [[f64; 3]; 3],
    /// Duration of a gait's cycle if the scenario gives none, s; 1 s if the robot's file gives none either.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    #[schemars(range(min = 0.1, max = 20.0))]
    pub gait_cycle: Option<f64>,
    /// The torso's box, for its clearance above the ground.
    pub torso: Box3,
    /// The feet, in the order of the plan's `foot_names`.
    #[schemars(length(min = 1, max = 16))]
    pub feet: Vec<Foot>,
    /// Height of the center of mass above the feet at rest without a payload, m, where there is one.
    #[serde(skip)]
    pub bare_height: Option<f64>,
    /// Name as given in the scenario and SHA-256 (hexadecimal) of the file it was read from; none for a shipped robot.
    #[serde(skip)]
    pub input: Option<(String, String)>,
}

impl Robot {
    /// The robot that a scenario names: a shipped one, or a file relative to `base_dir`.
    ///
    /// # Errors
    /// For unknown names, files that cannot be read or have unknown or missing keys, and values that no rigid body or leg has.
    pub fn load(spec: &RobotSpec, base_dir: &Path) -> Result<Self> {
        if let Some(file) = &spec.file {
            let (document, text) = Document::read(&base_dir.join(file)).map_err(|e| match e {
                Error::Io { .. } => Error::key("robot.file", e),
                other => other,
            })?;
            let input = Some((file.clone(), sha256_hex(text)));
            return Ok(Self { input, ..Self::from_document(&document)? });
        }
        let Some((name, text)) = SHIPPED.iter().find(|(name, _)| *name == spec.name) else {
            let shipped = Self::shipped();
            let guess = input::closest(&spec.name, &shipped)
                .map_or(String::new(), |name| format!("did you mean \"{name}\"? "));
            let what = format!(
                "given \"{}\", which does not ship with warpgait; {guess}allowed: {}, or a file of your own as robot.file = \"path.toml\"",
                spec.name,
                shipped.join(", ")
            );
            return Err(Error::key("robot.name", what));
        };
        Self::from_document(&Document::parse(&format!("robots/{name}.toml"), text)?)
    }

    /// Names of the shipped robots.
    pub fn shipped() -> Vec<&'static str> {
        SHIPPED.iter().map(|(name, _)| *name).collect()
    }

    /// Names of its feet, in their order.
    pub fn foot_names(&self) -> Vec<&str> {
        self.feet.iter().map(|foot| foot.name.as_str()).collect()
    }

    /// The robot with a point mass, kg, fixed to its trunk, base frame, m. The base frame moves to the new center of mass.
    ///
    /// ```text
    ///   c = m_p r / (m + m_p),   I' = I + m S(c) + m_p S(r − c),   S(v) = |v|² 1 − v vᵀ;   all places less c
    /// ```
    ///
    /// # Errors
    /// [`Error::Key`] where the legs cannot be those of such a robot.
    pub fn with_payload(mut self, payload: f64, position: [f64; 3]) -> Result<Self> {
        let (mass, place) = (self.mass, Vector3::from(position));
        let center = place * (payload / (mass + payload));
        let spread = |v: &Vector3<f64>| Matrix3::identity() * v.norm_squared() - v * v.transpose();
        let inertia = Matrix3::from_fn(|i, j| self.inertia[i][j])
            + spread(&center) * mass
            + spread(&(place - center)) * payload;
        self.bare_height = Some(self.standing_height());
        self.mass += payload;
        self.inertia = std::array::from_fn(|i| std::array::from_fn(|j| inertia[(i, j)]));
        let shift = |point: &mut [f64; 3]| (0..3).for_each(|c| point[c] -= center[c]);
        shift(&mut self.torso.center);
        for foot in &mut self.feet {
            shift(&mut foot.nominal);
            shift(&mut foot.reach.center);
            if let Some(leg) = &mut foot.leg {
                leg.hip.iter_mut().for_each(shift);
                leg.joints.first_mut().into_iter().for_each(|joint| shift(&mut joint.position));
                leg.build(foot.nominal).map_err(|e| Error::key("payload", e.what))?;
            }
        }
        match self.build_body() {
            Some(Err(what)) => Err(Error::key("payload", what)),
            _ => Ok(self),
        }
    }

    /// Trunk and links, where the file has the joints of every leg. (A robot that cannot have such links is not loaded.)
    pub fn body(&self) -> Option<Body> {
        self.build_body()?.ok()
    }

    fn build_body(&self) -> Option<std::result::Result<Body, String>> {
        let legs: Vec<Option<Leg>> = self.feet.iter().map(Foot::leg).collect();
        let nominal: Vec<Vector3<f64>> = self.feet.iter().map(|foot| foot.nominal.into()).collect();
        Body::new(self.mass, Matrix3::from_fn(|i, j| self.inertia[i][j]), &legs, &nominal)
    }

    /// Whether it can only go straight ahead or back: some of its feet move in planes of the base.
    pub fn is_sagittal(&self) -> bool {
        self.feet.iter().any(Foot::is_sagittal)
    }

    /// Height of the center of mass above the feet at rest, m.
    pub fn standing_height(&self) -> f64 {
        -self.feet.iter().map(|foot| foot.nominal[2]).sum::<f64>() / self.feet.len() as f64
    }

    /// The robot's size in ANYmals, by its standing height: 1 for all ANYmals. Clearances and margins are proportional to it.
    pub fn size(&self) -> f64 {
        size_of(self.bare_height.unwrap_or_else(|| self.standing_height()))
    }

    /// The unit of its times: how long it takes to fall or to swing like a pendulum, in those of ANYmal.
    pub fn time_scale(&self) -> f64 {
        self.size().sqrt()
    }

    /// Radius of the largest foot, m; a typical one for the robot's height if its file describes no leg.
    pub fn foot_radius(&self) -> f64 {
        self.largest(|leg| leg.foot_radius).unwrap_or(TYPICAL_FOOT * self.standing_height())
    }

    /// Radius of the largest knee, m, as for the feet; upper joints count as well.
    pub fn knee_radius(&self) -> f64 {
        let upper = |leg: &LegSpec| leg.joints.iter().filter_map(|joint| joint.radius).fold(0.0, f64::max);
        self.largest(|leg| leg.knee_radius.max(upper(leg)))
            .unwrap_or(2.0 * TYPICAL_FOOT * self.standing_height())
    }

    /// The largest of a length of the legs; none if it is zero, or no leg is described.
    fn largest(&self, length: impl Fn(&LegSpec) -> f64) -> Option<f64> {
        self.feet
            .iter()
            .filter_map(|foot| foot.leg.as_ref())
            .map(length)
            .reduce(f64::max)
            .filter(|l| *l > 0.0)
    }

    fn from_document(document: &Document) -> Result<Self> {
        let robot: Self = input::read_as(document)?;
        if !is_name(&robot.name) {
            return Err(document.error("name", no_name(&robot.name)));
        }
        let inertia = Matrix3::from_fn(|i, j| robot.inertia[i][j]);
        let refuse = |what: String| Err(document.error("inertia", what));
        let size = inertia.norm();
        if (inertia - inertia.transpose()).norm() > 1e-6 * size {
            return refuse(format!("given {:?}, allowed: a symmetric matrix", robot.inertia));
        }
        // Each principal moment of a rigid body is positive and at most the sum of the other two.
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
        let size = robot.size().min(1.0);
        for (i, foot) in robot.feet.iter().enumerate() {
            let key = format!("feet[{i}]");
            if foot.name.is_empty() || robot.feet[..i].iter().any(|other| other.name == foot.name) {
                let what = format!("given \"{}\", allowed: a name that no other foot has", foot.name);
                return Err(document.error(&format!("{key}.name"), what));
            }
            if !is_name(&foot.name) {
                return Err(document.error(&format!("{key}.name"), no_name(&foot.name)));
            }
            let least =
                |axis: usize| size * if axis == 1 && foot.is_sagittal() { LEAST_PLAY } else { LEAST_REACH };
            if let Some(axis) = (0..3).find(|&axis| foot.reach.half_size[axis] < least(axis)) {
                let (given, least) = (foot.reach.half_size[axis], least(axis));
                let what = format!(
                    "given {given}, allowed: at least {least} m; the planner keeps a margin inside the box"
                );
                return Err(document.error(&format!("{key}.reach.half_size[{axis}]"), what));
            }
            if !foot.reach.contains(foot.nominal) {
                return Err(document.error(&format!("{key}.nominal"), "lies outside the foot's reach box"));
            }
            if let Some(leg) = &foot.leg {
                leg.build(foot.nominal).map_err(|e| {
                    let dot = if e.key.is_empty() { "" } else { "." };
                    document.error(&format!("{key}.leg{dot}{}", e.key), e.what)
                })?;
            }
        }
        if let Some(Err(what)) = robot.build_body() {
            return Err(document.error("mass", what));
        }
        Ok(robot)
    }
}

/// Whether a text can be the name of a robot or a foot. Names of robots become names of files, and must not lead to others.
pub fn is_name(name: &str) -> bool {
    let plain = !name.contains(|c: char| c.is_control() || matches!(c, '/' | '\\' | ':'));
    plain && !name.is_empty() && !name.starts_with('.') && name.chars().count() <= LONGEST_NAME
}

fn no_name(given: &str) -> String {
    format!(
        "given {given:?}, allowed: 1 to {LONGEST_NAME} characters without /, \\ and :, and no dot at the start"
    )
}

impl Box3 {
    /// Whether a point lies in the box, its surface included.
    pub fn contains(&self, point: [f64; 3]) -> bool {
        (0..3).all(|axis| (point[axis] - self.center[axis]).abs() <= self.half_size[axis])
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    fn changed(from: &str, to: &str) -> Result<Robot> {
        changed_in(SHIPPED[0].1, from, to)
    }

    fn changed_in(text: &str, from: &str, to: &str) -> Result<Robot> {
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
            ("name = \"anymal_towr\"", "name = \"../anymal_c\"", "robot.toml:2: name: given \"../anymal_c\""),
            ("name = \"LF\"", "name = \"\\u001b[2J\"", "feet[0].name: given \"\\u{1b}[2J\""),
            (
                "half_size = [0.15, 0.10, 0.10]",
                "half_size = [0.15, 0.01, 0.10]",
                "feet[0].reach.half_size[1]: given 0.01",
            ),
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
    fn impossible_legs_are_refused() {
        let anymal_c = SHIPPED[2].1;
        let closed = "[feet.leg]\nhip = [0.3688, 0.1041, 0.0506]\nlateral = 0.1972\nthigh = 0.2850\nshank = 0.3275\nbend = 1.0\n\
                      speed_limit = 7.5\ntorque_limit = [80.0, 80.0, 80.0]\n";
        assert!(changed_in(anymal_c, "[feet.leg]\n", closed).is_ok(), "both descriptions of a leg");
        for (from, to, expected) in [
            ("axis = [1.000000, 0.000000,", "axis = [1.100000, 0.000000,", "leg.joints[0].axis: given [1.1"),
            ("axis = [1.000000, 0.000000,", "axis = [0.000000, 1.000000,", "leg.stance: puts the foot"),
            ("mass = 2.781", "mass = -2.781", "leg.joints[0].mass: given -2.781"),
            ("[0.00329553,", "[0.00029553,", "leg.joints[0].inertia: principal moments"),
            ("[0.00329553,", "[-0.00329553,", "leg.joints[0].inertia: principal moments"),
            ("range = [-0.7200, 0.4900]", "range = [0.7200, -0.4900]", "leg.joints[0].range: given"),
            ("range = [-0.7200, 0.4900]", "range = [0.7200, 0.9900]", "leg.stance: -0.1393 rad for LF_HAA"),
            ("stance = [-0.1393,", "stance = [0.1393,", "leg.stance: puts the foot"),
            ("stance = [-0.1393,", "# [-0.1393,", "leg.stance: missing"),
            ("foot = [0.087950,", "# [0.087950,", "leg.foot: missing"),
            ("[feet.leg]\n", "[feet.leg]\nthigh = 0.3\n", "leg.hip: missing"),
            ("[feet.leg]\n", &closed.replace("0.2850", "0.2950"), "leg.thigh: contradicts `joints`"),
            ("[feet.leg]\n", &closed.replace("7.5", "8.5"), "leg.speed_limit: contradicts"),
            ("[feet.leg]\n", &closed.replace("bend = 1.0", "bend = -1.0"), "leg.bend: contradicts"),
            ("[feet.leg]\n", &closed.replace("bend = 1.0", "bend = 0.5"), "leg.bend: given 0.5"),
        ] {
            let message = changed_in(anymal_c, from, to).expect_err(to).to_string();
            assert!(message.contains(&format!("feet[0].{expected}")), "{message}");
        }
        let end = anymal_c.find("[[feet.leg.joints]]\nname = \"LF_KFE\"").unwrap();
        let next = end + anymal_c[end..].find("\n[[feet]]").unwrap();
        let two = format!("{}{}", &anymal_c[..end], &anymal_c[next..]);
        let message = changed_in(&two, "LF", "LF").unwrap_err().to_string();
        assert!(message.contains("leg.stance: 3 angles, allowed: one for each of the 2 joints"), "{message}");
    }

    #[test]
    fn impossible_legs_of_two_joints_are_refused() {
        let solo8 = include_str!("../robots/solo8.toml");
        for (from, to, expected) in [
            (", 0.0011, ", ", 0.0005, ", "reach.half_size[1]: given 0.0005"),
            (
                "axis = [0.000000, 1.000000, 0.000000]",
                "axis = [0.010000, 0.999950, 0.000000]",
                "leg.joints: given two whose axes",
            ),
            ("stance = [0.9", "stance = [0.0, 0.9", "leg.stance: 3 angles, allowed: one for each of the 2"),
            ("stance = [0.9", "stance = [-0.9", "leg.stance: puts the foot"),
        ] {
            let message = changed_in(solo8, from, to).expect_err(to).to_string();
            assert!(message.contains(&format!("feet[0].{expected}")), "{message}");
        }
    }

    /// The joint angles of a foot in its plane are those of the two joints; beside the plane, nothing breaks.
    #[test]
    fn a_leg_of_two_joints_inverts_its_kinematics() {
        let robot = changed_in(include_str!("../robots/solo8.toml"), "solo8", "solo8").unwrap();
        assert!(robot.is_sagittal() && !changed_in(SHIPPED[2].1, "LF", "LF").unwrap().is_sagittal());
        for foot in &robot.feet {
            let leg = foot.leg().unwrap();
            let chain = leg.chain.as_ref().unwrap();
            let [thigh, knee] = foot.leg.as_ref().unwrap().stance.clone().unwrap()[..] else { panic!() };
            for turn in [0.0, 0.2, -0.2] {
                let q = [0.0, thigh + turn, knee - 0.5 * turn];
                let contact = Vector3::from(chain.foot::<f64>(&q)) - Vector3::z() * leg.foot_radius;
                assert!((contact.y - foot.nominal[1]).abs() < 1e-4, "in its plane");
                let posture = leg.posture::<f64>(contact.into());
                for (found, expected) in posture.joint_angles().into_iter().zip(q) {
                    assert!((found - expected).abs() < 2e-3, "{found} {expected}");
                }
                // The structure bears a force across the plane: the two joints feel nothing of it.
                let columns = posture.jacobian();
                assert!(columns[1][1].abs() < 1e-3 && columns[2][1].abs() < 1e-3, "{columns:?}");
                let beside = leg.posture::<f64>([contact.x, contact.y + 0.01, contact.z]);
                assert!(beside.joint_angles().into_iter().all(f64::is_finite));
            }
        }
    }

    /// Files of earlier versions have no joints.
    #[test]
    fn a_leg_in_closed_form_is_that_of_its_joints() {
        let anymal_c = SHIPPED[2].1;
        let start = anymal_c.find("foot = [0.087950").unwrap();
        let end = start + anymal_c[start..].find("\n[[feet]]").unwrap();
        let closed = "hip = [0.3688, 0.1041, 0.0506]\nlateral = 0.1972\nthigh = 0.2850\nshank = 0.3275\nbend = 1.0\n\
                      speed_limit = 7.5\ntorque_limit = [80.0, 80.0, 80.0]\n";
        let text = format!("{}{closed}{}", &anymal_c[..start], &anymal_c[end..]);
        let robot = changed_in(&text, "LF", "LF").unwrap();
        let [old, new] =
            [&robot, &changed_in(anymal_c, "LF", "LF").unwrap()].map(|r| r.feet[0].leg().unwrap());
        for r in [[0.389, 0.240, -0.429], [0.25, 0.1, -0.4], [0.5, 0.3, -0.35]] {
            let parts = |leg: &Leg| {
                let posture = leg.posture::<f64>(r);
                posture.swing_angles().into_iter().chain(posture.on_shank([0.1, 0.05])).collect::<Vec<_>>()
            };
            let [old, new] = [parts(&old), parts(&new)];
            for (a, b) in old.iter().zip(&new) {
                assert!((a - b).abs() < 1e-3, "{a} {b}");
            }
        }
    }

    #[test]
    fn unknown_names_are_refused_with_those_that_exist() {
        let spec = RobotSpec { name: "anymal_tower".into(), ..Default::default() };
        let message = Robot::load(&spec, Path::new(".")).unwrap_err().to_string();
        assert!(message.contains("did you mean \"anymal_towr\"?"), "{message}");
        assert!(Robot::shipped().iter().all(|name| message.contains(name)), "{message}");
    }

    #[test]
    fn the_digest_of_a_file_is_that_of_what_was_read() {
        let folder = tempfile::tempdir().unwrap();
        std::fs::write(folder.path().join("r.toml"), SHIPPED[0].1).unwrap();
        let spec = RobotSpec { file: Some("r.toml".into()), ..Default::default() };
        let robot = Robot::load(&spec, folder.path()).unwrap();
        assert_eq!(robot.input, Some(("r.toml".into(), sha256_hex(SHIPPED[0].1))));
    }
}
