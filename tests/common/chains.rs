//! Quadrupeds with legs of four to seven joints, as robot files.

use std::fmt::Write;
use std::path::{Path, PathBuf};

use nalgebra::{Matrix3, Vector3};
use warpgait::leg::chain::{Chain, Joint};

const ROLL: [f64; 3] = [1.0, 0.0, 0.0];
const PITCH: [f64; 3] = [0.0, 1.0, 0.0];
const YAW: [f64; 3] = [0.0, 0.0, 1.0];
const RADIUS: f64 = 0.02;

/// Of a leg with as many joints: axis, place from the joint before (the first: in a left leg, from the hip), and angle in the stance. The foot
/// is 0.12 m below the last joint.
fn joints(count: usize) -> Vec<([f64; 3], [f64; 3], f64)> {
    let (hip, aside) = ([0.0; 3], [0.0, 0.07, 0.0]);
    let (down, ankle) = ([0.0, 0.0, -0.22], [0.0, 0.0, -0.03]);
    let tail = [(PITCH, aside, 1.0), (PITCH, down, -1.8), (PITCH, down, 0.6)];
    match count {
        // Lower at the hip, so that the foot is as low as those of the others.
        3 => vec![(ROLL, [0.0, 0.0, -0.13], 0.0), (PITCH, aside, 0.7), (PITCH, down, -1.4)],
        4 => [vec![(ROLL, hip, 0.0)], tail.to_vec()].concat(),
        5 => [vec![(YAW, hip, 0.05), (ROLL, [0.03, 0.0, 0.0], 0.0)], tail.to_vec()].concat(),
        6 => [joints(5), vec![(ROLL, ankle, 0.05)]].concat(),
        _ => [
            vec![(ROLL, hip, 0.0)],
            tail[..2].to_vec(),
            vec![(YAW, [0.0, 0.0, -0.1], 0.1)],
            vec![(PITCH, [0.0, 0.0, -0.12], 0.6), (YAW, ankle, -0.1), (ROLL, ankle, 0.0)],
        ]
        .concat(),
    }
}

/// The chain of the leg at a hip, and its angles in the stance.
fn chain(count: usize, hip: [f64; 3]) -> (Chain, Vec<f64>) {
    let side = hip[1].signum();
    let own = joints(count);
    let of = |(j, (axis, place, angle)): (usize, &([f64; 3], [f64; 3], f64))| Joint {
        position: Vector3::new(place[0], side * place[1], place[2])
            + if j == 0 { hip.into() } else { Vector3::zeros() },
        axis: (*axis).into(),
        range: [angle - 0.8 - 0.1 * j as f64, angle + 0.9],
        speed_limit: 15.0,
        torque_limit: 60.0,
        mass: 0.15,
        center: Vector3::new(0.0, 0.0, -0.05),
        inertia: Matrix3::identity() * 4e-4,
        radius: (j >= 2 && j + 1 < count).then_some(0.02),
    };
    let joints = own.iter().enumerate().map(of).collect();
    (Chain { joints, foot: Vector3::new(0.0, 0.0, -0.12) }, own.iter().map(|joint| joint.2).collect())
}

/// Writes `chains.toml` into a folder: a robot whose legs have these numbers of joints.
pub fn robot(folder: &Path, counts: [usize; 4]) -> PathBuf {
    let mut text = String::from(
        "name = \"chains\"\nsource = \"the tests\"\nmass = 20.0\n\
         inertia = [[1.2, 0.0, 0.0], [0.0, 2.0, 0.0], [0.0, 0.0, 2.2]]\n\
         torso = { center = [0.0, 0.0, 0.02], half_size = [0.25, 0.11, 0.07] }\n",
    );
    let hips = [[0.26, 0.06, 0.03], [0.26, -0.06, 0.03], [-0.26, 0.06, 0.03], [-0.26, -0.06, 0.03]];
    for ((name, hip), count) in ["LF", "RF", "LH", "RH"].into_iter().zip(hips).zip(counts) {
        let (chain, stance) = chain(count, hip);
        let [x, y, z] = chain.foot::<f64>(&stance);
        let nominal = [x, y, z - RADIUS];
        write!(
            text,
            "[[feet]]\nname = \"{name}\"\nnominal = {nominal:?}\n\
             reach = {{ center = {nominal:?}, half_size = [0.13, 0.08, 0.06] }}\n\
             [feet.leg]\nknee_radius = 0.02\ncorner = [0.03, 0.015]\nfoot_radius = {RADIUS}\n\
             foot = [0.0, 0.0, -0.12]\nstance = {stance:?}\n"
        )
        .unwrap();
        for (j, joint) in chain.joints.iter().enumerate() {
            let [position, axis, center] = [joint.position, joint.axis, joint.center].map(<[f64; 3]>::from);
            let radius = joint.radius.map_or(String::new(), |radius| format!("radius = {radius}\n"));
            write!(
                text,
                "[[feet.leg.joints]]\nname = \"{name}_{j}\"\nposition = {position:?}\naxis = {axis:?}\n\
                 range = {:?}\nspeed_limit = {:?}\ntorque_limit = {:?}\nmass = {:?}\ncenter = {center:?}\n\
                 inertia = [4e-4, 4e-4, 4e-4, 0.0, 0.0, 0.0]\n{radius}",
                joint.range, joint.speed_limit, joint.torque_limit, joint.mass
            )
            .unwrap();
        }
    }
    let file = folder.join("chains.toml");
    std::fs::write(&file, text).unwrap();
    file
}
