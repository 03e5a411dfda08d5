//! The whole robot along the plan: trunk and links of the legs, by inverse kinematics from the plan's base and feet.
//!
//! The base's position is the center of mass of all of them, so the trunk is where the legs leave it: its point that is the center of
//! mass at the nominal stance is at p − R s. The shift s depends on the postures of the legs, and these on s.
//!
//! Of all joint angles of a leg that put its foot at c, those are taken that are nearest to the nominal stance q̄:
//!
//! ```text
//!   min ½ Σ wᵢ (qᵢ − q̄ᵢ)²  subject to  F(q) = c,   wᵢ = 1/hᵢ²
//! ```
//!
//! with hᵢ half the range of joint i. A leg of three joints has only one posture near the one before.

use arrayvec::ArrayVec;

use super::vector::{
    Turn, add, apply, cross, dot, norm, product, rotate_back, rotation, scale, solve, sub, transposed,
    turn_between,
};
use crate::leg::LegSpec;
use crate::plan::{MetaRobot, Plan};

/// Joints that a leg may have.
const MOST_JOINTS: usize = 7;
/// Joint angles are found when they put the foot this near to its place, m.
const FOUND: f64 = 1e-9;
/// Steps of Newton's method at most; one sample is near the one before it.
const STEPS: usize = 30;
/// Of one angle, rad.
const LARGEST_STEP: f64 = 0.3;
/// rad: a leg of more than three joints is at its least distance from the stance when a step is smaller.
const AT_LEAST: f64 = 1e-7;
/// Least and greatest hᵢ, rad.
const HALF_RANGE: [f64; 2] = [0.3, std::f64::consts::PI];
/// Rounds for s, each of which leaves about an eighth of the error, and the change at which they end, m.
const ROUNDS: usize = 20;
const SETTLED: f64 = 1e-9;

/// A joint and its link.
struct Joint {
    position: [f64; 3],
    axis: [f64; 3],
    /// q̄, rad.
    stance: f64,
    /// w, 1/rad².
    weight: f64,
    mass: f64,
    center: [f64; 3],
    inertia: Turn,
}

struct Leg {
    joints: Vec<Joint>,
    foot: [f64; 3],
    radius: f64,
}

/// A link in a posture: base frame, origin at the center of mass of the nominal stance.
#[derive(Clone, Copy)]
pub(super) struct Placed {
    pub mass: f64,
    pub inertia: Turn,
    pub center: [f64; 3],
    pub turn: Turn,
}

/// A point of a joint's axis, and its direction; base frame, origin as for links.
pub(super) type Axis = ([f64; 3], [f64; 3]);

/// A leg in a posture: base frame, origin at the center of mass of the nominal stance.
struct PlacedLeg {
    links: ArrayVec<Placed, MOST_JOINTS>,
    axes: ArrayVec<Axis, MOST_JOINTS>,
    /// The center of the foot.
    foot: [f64; 3],
}

/// The robot along a plan.
pub(super) struct BodyMotion {
    /// (N,) s, base frame, m.
    pub shift: Vec<[f64; 3]>,
    /// (N − 1,) the angular momentum about the center of mass halfway between samples, world frame, kg m²/s.
    pub momentum: Vec<[f64; 3]>,
    /// (N·E,) the joint angles of the legs, rad.
    pub angles: Vec<Vec<f64>>,
    /// By sample, the trunk and then the links leg by leg.
    pub links: Vec<Vec<Placed>>,
    /// By leg: the number of its first link among `links`, where the trunk is the first; one less among `axes`.
    pub first_link: Vec<usize>,
    /// By sample, leg by leg.
    pub axes: Vec<Vec<Axis>>,
    /// (N,) the orientation of the trunk.
    pub turns: Vec<Turn>,
}

impl Leg {
    fn new(spec: &LegSpec) -> Option<Self> {
        let stance = spec.stance.as_ref().filter(|stance| stance.len() == spec.joints.len())?;
        let joints = spec.joints.iter().zip(stance).map(|(joint, stance)| {
            let [xx, yy, zz, xy, xz, yz] = joint.inertia;
            let half = (0.5 * (joint.range[1] - joint.range[0])).clamp(HALF_RANGE[0], HALF_RANGE[1]);
            Joint {
                position: joint.position,
                axis: scale(1.0 / norm(joint.axis), joint.axis),
                stance: *stance,
                weight: half.powi(-2),
                mass: joint.mass,
                center: joint.center,
                inertia: [[xx, xy, xz], [xy, yy, yz], [xz, yz, zz]],
            }
        });
        let mut joints: Vec<Joint> = joints.collect();
        if let [first, _] = &mut joints[..] {
            // By a massless joint about x at the hip, the foot may be beside the plane of a leg of two joints.
            let abduction = Joint {
                position: first.position,
                axis: [1.0, 0.0, 0.0],
                stance: 0.0,
                weight: 1.0,
                mass: 0.0,
                center: [0.0; 3],
                inertia: [[0.0; 3]; 3],
            };
            first.position = [0.0; 3];
            joints.insert(0, abduction);
        }
        Some(Self { joints, foot: spec.foot?, radius: spec.foot_radius })
    }

    /// At the joint angles q.
    fn place(&self, q: &[f64]) -> PlacedLeg {
        let mut turn = [[1.0, 0.0, 0.0], [0.0, 1.0, 0.0], [0.0, 0.0, 1.0]];
        let mut at = [0.0; 3];
        let (mut links, mut axes) = (ArrayVec::new(), ArrayVec::new());
        for (joint, angle) in self.joints.iter().zip(q) {
            at = add(at, apply(&turn, joint.position));
            axes.push((at, apply(&turn, joint.axis)));
            turn = product(&turn, &rotation(scale(*angle, joint.axis)));
            let center = add(at, apply(&turn, joint.center));
            links.push(Placed { mass: joint.mass, inertia: joint.inertia, center, turn });
        }
        let foot = add(at, apply(&turn, self.foot));
        PlacedLeg { links, axes, foot }
    }

    /// The joint angles of the nominal stance, rad; zero for the joint about x that a leg of two joints lacks.
    fn stance(&self) -> Vec<f64> {
        self.joints.iter().map(|joint| joint.stance).collect()
    }

    /// Newton's method from the angles q: the leg with the center of its foot at `target`, if that is reached. The unknowns are q and the multipliers λ
    /// of
    ///
    /// ```text
    ///   W (q − q̄) + (∂F/∂q)ᵀ λ = 0,   F(q) = c
    /// ```
    fn solve(&self, target: [f64; 3], q: &mut [f64]) -> Option<PlacedLeg> {
        let n = q.len();
        let mut lambda = [0.0; 3];
        let mut last = if n > 3 { f64::INFINITY } else { 0.0 };
        for _ in 0..STEPS {
            let placed = self.place(q);
            let (axes, foot) = (&placed.axes, placed.foot);
            let miss = sub(target, foot);
            if norm(miss) < FOUND && last < AT_LEAST {
                return Some(placed);
            }
            let columns: ArrayVec<[f64; 3], MOST_JOINTS> =
                axes.iter().map(|(at, axis)| cross(*axis, sub(foot, *at))).collect();
            if let [a, b, c] = columns[..] {
                // As many equations as joints: λ does not matter.
                let determinant = dot(a, cross(b, c));
                let step = [cross(b, c), cross(c, a), cross(a, b)].map(|m| dot(m, miss) / determinant);
                let largest = step.iter().fold(0.0, |most: f64, step| most.max(step.abs()));
                let most = (largest / LARGEST_STEP).max(1.0);
                q.iter_mut().zip(step).for_each(|(angle, step)| *angle += step / most);
                continue;
            }
            let mut rows = vec![vec![0.0; n + 3]; n + 3];
            let mut right = vec![0.0; n + 3];
            for (i, joint) in self.joints.iter().enumerate() {
                for j in 0..n {
                    // ∂²F/∂qᵢ∂qⱼ = aᵢ × ∂F/∂qⱼ for i ≤ j.
                    rows[i][j] = dot(cross(axes[i.min(j)].1, columns[i.max(j)]), lambda);
                }
                rows[i][i] += joint.weight;
                for c in 0..3 {
                    (rows[i][n + c], rows[n + c][i]) = (columns[i][c], columns[i][c]);
                }
                right[i] = -joint.weight * (q[i] - joint.stance) - dot(columns[i], lambda);
            }
            right[n..].copy_from_slice(&miss);
            solve(&mut rows, &mut right);
            last = right[..n].iter().fold(0.0, |most: f64, step| most.max(step.abs()));
            let most = (last / LARGEST_STEP).max(1.0);
            q.iter_mut().chain(&mut lambda).zip(right).for_each(|(value, step)| *value += step / most);
        }
        None
    }
}

/// Σ m c of links, kg m.
fn moment(links: &[Placed]) -> [f64; 3] {
    links.iter().fold([0.0; 3], |sum, link| add(sum, scale(link.mass, link.center)))
}

impl BodyMotion {
    /// Along a plan, for the robot that it is judged by; none if the legs are massless, an error in words if the robot cannot be.
    pub fn new(plan: &Plan, robot: &MetaRobot) -> Result<Option<Self>, String> {
        if robot.legs.is_empty() {
            return Ok(None);
        }
        let (feet, samples) = (plan.foot_names.len(), plan.t.len());
        let legs: Option<Vec<Leg>> = robot.legs.iter().map(Leg::new).collect();
        let Some(legs) = legs.filter(|legs| legs.len() == feet && robot.nominal.len() == feet) else {
            return Err(
                "meta.robot.legs: not one leg for each foot, each with its joints and its foot".into()
            );
        };
        if legs.iter().any(|leg| !(3..=MOST_JOINTS).contains(&leg.joints.len())) {
            return Err(format!("meta.robot.legs: a leg has two to {MOST_JOINTS} joints"));
        }
        let most = legs.iter().map(|leg| leg.joints.len()).max();
        let stated = plan.legs.as_ref().and_then(|legs| legs.joints.as_ref());
        if stated.is_some_and(|stated| Some(stated.joints) != most) {
            return Err("joint_position: not as many joints as the legs of meta.robot.legs have".into());
        }
        let mut angles: Vec<Vec<f64>> = legs.iter().map(Leg::stance).collect();
        let Some(trunk) = trunk(robot, &legs, &mut angles) else {
            return Err(
                "meta.robot.legs: do not stand at their nominal places, or weigh more than the robot".into(),
            );
        };
        let centers = centers(plan, &legs);
        let mut shift = vec![[0.0; 3]; samples];
        let mut postures: Vec<Vec<Placed>> = Vec::with_capacity(samples);
        let (mut all_axes, mut all_angles) =
            (Vec::with_capacity(samples), Vec::with_capacity(samples * feet));
        let mut here = [0.0; 3];
        // How many samples in a row had postures, and the one before the last.
        let (mut in_a_row, mut last) = (0, (here, angles.clone()));
        for n in 0..samples {
            let (earlier, posture) = std::mem::replace(&mut last, (here, angles.clone()));
            if in_a_row >= 2 {
                // Shift and angles go on changing as they did.
                here = add(here, sub(here, earlier));
                let changes = angles.iter_mut().flatten().zip(posture.into_iter().flatten());
                changes.for_each(|(angle, before)| *angle += *angle - before);
            }
            let from_center = |e: usize| {
                let world = sub(centers[n * feet + e], plan.base_position[n]);
                rotate_back(plan.base_quaternion_wxyz[n], world)
            };
            let (mut links, mut axes) = (Vec::new(), Vec::new());
            let mut found = true;
            for _ in 0..ROUNDS {
                (links, axes) = (vec![trunk], Vec::new());
                for (e, leg) in legs.iter().enumerate() {
                    let placed = leg.solve(add(from_center(e), here), &mut angles[e]);
                    found &= placed.is_some();
                    let placed = placed.unwrap_or_else(|| leg.place(&angles[e]));
                    links.extend(placed.links);
                    axes.extend(placed.axes);
                }
                let next = scale(1.0 / robot.mass, moment(&links));
                let change = norm(sub(next, here));
                here = next;
                if change < SETTLED {
                    break;
                }
            }
            if !found {
                // Out of reach: no law that needs the posture holds.
                (here, angles) = ([0.0; 3], legs.iter().map(Leg::stance).collect());
            }
            in_a_row = if found { in_a_row + 1 } else { 0 };
            shift[n] = if found { here } else { [f64::NAN; 3] };
            all_angles.extend(angles.iter().cloned());
            all_axes.push(axes);
            postures.push(links);
        }
        let turns: Vec<Turn> = plan.base_quaternion_wxyz.iter().map(|q| matrix(*q)).collect();
        let step = plan.t[samples - 1] / (samples - 1) as f64;
        let momentum = (1..samples)
            .map(|n| {
                let at = |n: usize, l: usize| apply(&turns[n], sub(postures[n][l].center, shift[n]));
                (0..postures[n].len()).fold([0.0; 3], |sum, l| {
                    let [a, b] = [at(n - 1, l), at(n, l)];
                    let link = postures[n][l];
                    let orbit = scale(0.5 * link.mass / step, cross(add(a, b), sub(b, a)));
                    let [before, after] = [n - 1, n].map(|n| product(&turns[n], &postures[n][l].turn));
                    add(add(sum, orbit), spin(&link.inertia, &before, &after, step))
                })
            })
            .collect();
        let first_link = (0..feet).map(|e| 1 + legs[..e].iter().map(|leg| leg.joints.len()).sum::<usize>());
        Ok(Some(Self {
            shift,
            momentum,
            angles: all_angles,
            links: postures,
            first_link: first_link.collect(),
            axes: all_axes,
            turns,
        }))
    }
}

/// The angular momentum of a body about its center that turns from `before` to `after` in `step` s.
pub(super) fn spin(inertia: &Turn, before: &Turn, after: &Turn, step: f64) -> [f64; 3] {
    let speed = scale(1.0 / step, turn_between(before, after));
    let at = |turn: &Turn| apply(turn, apply(inertia, apply(&transposed(turn), speed)));
    scale(0.5, add(at(before), at(after)))
}

/// What the links leave of the robot's mass, center of mass and inertia at the nominal stance; leaves the angles of that stance behind.
fn trunk(robot: &MetaRobot, legs: &[Leg], angles: &mut [Vec<f64>]) -> Option<Placed> {
    let mut links = Vec::new();
    for ((leg, nominal), q) in legs.iter().zip(&robot.nominal).zip(angles) {
        links.extend(leg.solve(add(*nominal, [0.0, 0.0, leg.radius]), q)?.links);
    }
    let mass = robot.mass - links.iter().map(|link| link.mass).sum::<f64>();
    if mass <= 0.0 {
        return None;
    }
    let center = scale(-1.0 / mass, moment(&links));
    let unit = [[1.0, 0.0, 0.0], [0.0, 1.0, 0.0], [0.0, 0.0, 1.0]];
    let trunk = Placed { mass, inertia: [[0.0; 3]; 3], center, turn: unit };
    let mut inertia = robot.inertia;
    for link in links.iter().chain([&trunk]) {
        let c = link.center;
        let own = product(&product(&link.turn, &link.inertia), &transposed(&link.turn));
        for (i, row) in inertia.iter_mut().enumerate() {
            for (j, entry) in row.iter_mut().enumerate() {
                let diagonal = if i == j { dot(c, c) } else { 0.0 };
                *entry -= own[i][j] + link.mass * (diagonal - c[i] * c[j]);
            }
        }
    }
    Some(Placed { inertia, ..trunk })
}

/// The centers of the feet. (N·E,)
fn centers(plan: &Plan, legs: &[Leg]) -> Vec<[f64; 3]> {
    let center = |(place, at): (&[f64; 3], usize)| {
        let (n, e) = (at / legs.len(), at % legs.len());
        add(*place, scale(legs[e].radius, center_direction(plan, n, e)))
    };
    plan.foot_position.iter().zip(0..).map(center).collect()
}

/// From the contact point of foot `e` at sample `n` to its center: along the normal in stance; in swing, along a direction that turns smoothly
/// from one normal to the next.
pub(super) fn center_direction(plan: &Plan, n: usize, e: usize) -> [f64; 3] {
    let (feet, samples) = (plan.foot_names.len(), plan.t.len());
    let standing = |n: usize| plan.foot_contact[n * feet + e];
    let normal = |n: usize| plan.foot_normal[n * feet + e];
    if standing(n) {
        return normal(n);
    }
    let before = (0..n).rev().find(|&n| standing(n));
    let after = (n..samples).find(|&n| standing(n));
    let (Some(before), Some(after)) = (before, after) else { return normal(n) };
    let [lift_off, touch_down] = plan.swing_at(e, plan.t[n]).unwrap_or([plan.t[before], plan.t[after]]);
    let u = (plan.t[n] - lift_off) / (touch_down - lift_off);
    let s = u * u * u * (10.0 - 15.0 * u + 6.0 * u * u);
    let between = add(scale(1.0 - s, normal(before)), scale(s, normal(after)));
    scale(1.0 / norm(between), between)
}

/// The rotation matrix of a unit quaternion.
fn matrix([w, x, y, z]: [f64; 4]) -> Turn {
    [
        [1.0 - 2.0 * (y * y + z * z), 2.0 * (x * y - w * z), 2.0 * (x * z + w * y)],
        [2.0 * (x * y + w * z), 1.0 - 2.0 * (x * x + z * z), 2.0 * (y * z - w * x)],
        [2.0 * (x * z - w * y), 2.0 * (y * z + w * x), 1.0 - 2.0 * (x * x + y * y)],
    ]
}
