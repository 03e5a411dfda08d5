//! Legs of four to seven joints: planned, written, read and checked.

use warpgait::check::check;
use warpgait::plan::Plan;
use warpgait::robot::{Robot, RobotSpec};

use crate::common::chains::robot;
use crate::common::solved_in;

fn walk(terrain: &str, extra: &str) -> String {
    format!(
        "horizon = 3.0\n[robot]\nfile = \"chains.toml\"\n[terrain]\n{terrain}\n\
         [start]\nposition = [0.0, 0.0]\n[goal]\nposition = [0.25, 0.0]\n{extra}"
    )
}

const FLAT: &str = "kind = \"flat\"";
const FORMULA: &str =
    "kind = \"formula\"\nexpression = \"0.015*sin(6*x)*cos(5*y)\"\nextent = [-1.0, 1.5, -1.0, 1.0]";

#[test]
fn every_law_holds_in_a_walk_on_legs_of_many_joints() {
    for (counts, terrain, legs) in [
        ([4; 4], FORMULA, "massive"),
        ([4; 4], FLAT, "massless"),
        ([5; 4], FLAT, "massive"),
        ([6; 4], FORMULA, "massive"),
        ([7; 4], FLAT, "massive"),
        ([3, 4, 5, 6], FLAT, "massive"),
    ] {
        let folder = tempfile::tempdir().unwrap();
        robot(folder.path(), counts);
        let (motion, plan) =
            solved_in(folder.path(), &walk(terrain, &format!("[physics]\nlegs = \"{legs}\"")));
        assert!(motion.solved, "{counts:?} {legs}: {}", motion.status);
        let file = folder.path().join("a.plan.npz");
        plan.write(&file).unwrap();
        let read = Plan::read(&file).unwrap();
        let joints = read.legs.as_ref().and_then(|legs| legs.joints.as_ref()).map(|joints| joints.joints);
        assert_eq!(joints, (legs == "massive").then(|| counts.into_iter().max().unwrap()));
        let report = check(&read).unwrap();
        let failed: Vec<_> = report.rows.iter().filter(|row| !row.passed).collect();
        assert!(failed.is_empty(), "{counts:?} {legs}: {failed:?}");
    }
}

#[test]
fn joints_of_another_posture_or_number_are_found_by_the_check() {
    let folder = tempfile::tempdir().unwrap();
    robot(folder.path(), [5; 4]);
    let (_, plan) = solved_in(folder.path(), &walk(FLAT, ""));
    let law = |plan: &Plan, name: &str| {
        let report = check(plan).unwrap();
        report.rows.into_iter().find(|row| row.name == name).expect("the law").passed
    };
    assert!(law(&plan, "joint_position"));
    let mut other = plan.clone();
    let joints = other.legs.as_mut().unwrap().joints.as_mut().unwrap();
    joints.position[20 * 100 + 3] += 2e-3;
    assert!(!law(&other, "joint_position"));
    // A stance that is not that of the file: the feet are where they were, but the postures are others.
    let mut other = plan.clone();
    other.meta.robot.legs[1].stance.as_mut().unwrap()[3] += 0.05;
    assert!(check(&other).is_err() || !law(&other, "joint_position"));
    let mut other = plan;
    let joints = other.legs.as_mut().unwrap().joints.as_mut().unwrap();
    joints.joints = 4;
    joints.position.truncate(joints.position.len() / 5 * 4);
    joints.torque.truncate(joints.torque.len() / 5 * 4);
    assert!(check(&other).is_err());
}

#[test]
fn what_no_leg_of_many_joints_has_is_refused() {
    let folder = tempfile::tempdir().unwrap();
    let file = robot(folder.path(), [4, 5, 6, 7]);
    let text = std::fs::read_to_string(&file).unwrap();
    for (from, to, expected) in [
        (
            "radius = 0.02\n[[feet.leg",
            "radius = -0.02\n[[feet.leg",
            "feet[0].leg.joints[2].radius: given -0.02",
        ),
        (
            "[[feet.leg.joints]]\nname = \"LF_1\"",
            "radius = 0.1\n[[feet.leg.joints]]\nname = \"LF_1\"",
            "feet[0].leg.joints[0].radius: given, allowed: from the third joint to the last but one",
        ),
        ("foot = [0.0, 0.0, -0.12]", "foot = [0.0, 0.12, 0.0]", "feet[0].leg.stance: puts the foot"),
        (
            "stance = [0.0, 1.0,",
            "stance = [0.0, 0.0, 1.0,",
            "feet[0].leg.stance: 5 angles, allowed: one for each of the 4",
        ),
    ] {
        assert!(text.contains(from), "{from}");
        std::fs::write(&file, text.replacen(from, to, 1)).unwrap();
        let spec = RobotSpec { file: Some("chains.toml".into()), ..Default::default() };
        let message = Robot::load(&spec, folder.path()).unwrap_err().to_string();
        assert!(message.contains(expected) && !message.contains('\n'), "{message}");
    }
}
