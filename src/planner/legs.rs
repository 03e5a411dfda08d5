//! What the legs' own mass adds to the laws, from a motion.
//!
//! Along the motion, inverse kinematics gives the postures, and these the shift s of the center of mass and the angular momentum L about
//! it, in fine steps of time δ. All rates are differences over such steps. A row of Euler's law at sample k is the law averaged with the
//! hat function Λ_k, and the average of a rate is a difference of means of L over whole intervals:
//!
//! ```text
//!   ∫ Λ_k L̇ dt / Δt = (mean of L over [t_k, t_k+1] − mean of L over [t_k−1, t_k]) / Δt
//! ```
//!
//! Neither needs the accelerations of the feet, which jump at lift-off and touch-down.

mod joints;

use std::f64::consts::TAU;

use nalgebra::{Matrix3, Rotation3, Vector3};

use crate::leg::Leg;
use crate::leg::body::{Body, Posture, spin};
use crate::leg::chain::ByJoint;
use crate::nlp::leg_terms::FootInertia;
use crate::nlp::model::GRAVITY;
use crate::nlp::{LegTerms, Model};
use crate::scenario::Law;
use crate::trajectory::LinearNode;
use crate::trajectory::layout::{Layout, Phase, solve_tridiagonal};
use crate::trajectory::rotation::{euler, euler_angles, skew_part};
use crate::trajectory::sampling;
use crate::trajectory::switches::ramp;
use crate::warp::Order;

/// What the legs' mass adds to a law along the motion x; none for massless legs.
pub fn terms(model: &Model, x: &[f64], law: Law) -> Option<LegTerms> {
    BodyMotion::new(model, x, COARSE).map(|body| body.terms(law))
}

/// Fine steps in a time step with which plans are sampled.
pub const FINE: usize = 10;
/// The same between two solves.
const COARSE: usize = 4;
/// By how far a foot is moved to find the momentum of its velocity, m.
const NUDGE: f64 = 1e-5;

/// What follows from the legs' mass, at the ends of fine steps.
#[derive(Clone, Debug)]
pub struct LegMotion {
    /// s, base frame, m.
    pub shift: Vec<Vector3<f64>>,
    /// Of the whole robot about its center of mass; world frame, kg m²/s.
    pub angular_momentum: Vec<Vector3<f64>>,
    /// Of each foot's leg, from the base down, foot by foot at each end, rad.
    pub joint_position: Vec<ByJoint<f64>>,
    /// Of the motors, likewise, N m.
    pub joint_torque: Vec<ByJoint<f64>>,
}

/// A motion of the whole robot in fine steps.
pub struct BodyMotion<'a> {
    model: &'a Model,
    body: &'a Body,
    /// Steps in a time step.
    fine: usize,
    /// δ, s.
    step: f64,
    /// R at the ends of the steps.
    rotations: Vec<Matrix3<f64>>,
    /// p.
    positions: Vec<Vector3<f64>>,
    /// (p̄, θ̄).
    variables: Vec<[f64; 6]>,
    /// Contact points by foot, m.
    contacts: Vec<Vec<Vector3<f64>>>,
    /// From a contact point to the center of its foot, by foot, m.
    centers: Vec<Vec<Vector3<f64>>>,
    postures: Vec<Posture>,
}

impl<'a> BodyMotion<'a> {
    /// Of the variables x, with `fine` steps in a time step, an even number; none for massless legs.
    pub fn new(model: &'a Model, x: &[f64], fine: usize) -> Option<Self> {
        let body = model.body.as_ref()?;
        let mut layout = model.layout.clone();
        layout.freeze(x);
        let count = layout.intervals * fine + 1;
        let mut motion = Self {
            model,
            body,
            fine,
            step: layout.time_step / fine as f64,
            rotations: Vec::with_capacity(count),
            positions: Vec::with_capacity(count),
            variables: Vec::with_capacity(count),
            contacts: Vec::new(),
            centers: Vec::new(),
            postures: Vec::with_capacity(count),
        };
        for n in 0..count {
            let y = layout.base_node(n as f64 / fine as f64, 0).value::<6>(x);
            let (point, turn) = model.spaces.base.pose(&y, false);
            motion.positions.push(point.position);
            motion.rotations.push(turn.rotation);
            motion.variables.push(y);
        }
        for i in 0..model.feet() {
            let contacts = contacts(model, &layout, i, x, fine);
            motion.centers.push(centers(model, &layout, (i, fine), &body.legs[i], &contacts));
            motion.contacts.push(contacts);
        }
        for n in 0..count {
            // The shift changes smoothly.
            let shift = |back: usize| n.checked_sub(back).map(|n| motion.postures[n].shift);
            let guess = match [shift(1), shift(2), shift(3)] {
                [Some(one), Some(two), Some(three)] => (one - two) * 3.0 + three,
                [Some(one), ..] => one,
                _ => Vector3::zeros(),
            };
            motion.postures.push(motion.posture(n, &motion.rotations[n], guess));
        }
        Some(motion)
    }

    /// The whole robot with its base turned to `rotation` at the n-th end of a step.
    fn posture(&self, n: usize, rotation: &Matrix3<f64>, guess: Vector3<f64>) -> Posture {
        let from_base =
            |i: usize| rotation.tr_mul(&(self.contacts[i][n] + self.centers[i][n] - self.positions[n]));
        let feet: Vec<Vector3<f64>> = (0..self.contacts.len()).map(from_base).collect();
        self.body.posture_about_center(&feet, guess)
    }

    /// r: a contact point as the trunk sees it, m.
    fn foot_in_base(&self, i: usize, n: usize) -> Vector3<f64> {
        self.rotations[n].tr_mul(&(self.contacts[i][n] - self.positions[n])) + self.postures[n].shift
    }

    /// How the rows depend on the accelerations of the swinging feet: by the angular momentum of a foot's velocity.
    fn inertia(&self) -> Vec<FootInertia> {
        let layout = &self.model.layout;
        let unit = layout.time_step.powi(2) * self.model.mass * GRAVITY;
        let swings = |i: usize, k: usize| matches!(layout.phase[i][k], Phase::Swing(_));
        let mut terms = Vec::new();
        for k in 1..layout.intervals {
            let (n, r) = (k * self.fine, self.rotations[k * self.fine]);
            for i in (0..self.contacts.len()).filter(|&i| (k - 1..=k + 1).any(|k| swings(i, k))) {
                let mut feet: Vec<Vector3<f64>> = (0..self.contacts.len())
                    .map(|i| self.foot_in_base(i, n) + r.tr_mul(&self.centers[i][n]))
                    .collect();
                let here = self.body.posture(&feet);
                let columns: [Vector3<f64>; 3] = std::array::from_fn(|c| {
                    let before = feet[i];
                    feet[i][c] += NUDGE;
                    let moved = self.body.posture(&feet);
                    feet[i] = before;
                    self.body.angular_momentum([(&here, &r), (&moved, &r)], NUDGE)
                });
                terms.push(FootInertia { sample: k, foot: i, form: Matrix3::from_columns(&columns) / unit });
            }
        }
        terms
    }

    /// What follows from the legs' mass at the ends of the steps, x being the motion's variables. The robot is at rest at both ends.
    pub fn samples(&self, x: &[f64]) -> LegMotion {
        let momenta = self.angular_momenta();
        let mut angular_momentum = vec![Vector3::zeros(); self.postures.len()];
        for (n, pair) in momenta.windows(2).enumerate() {
            angular_momentum[n + 1] = (pair[0] + pair[1]) * 0.5;
        }
        LegMotion {
            shift: self.postures.iter().map(|posture| posture.shift).collect(),
            angular_momentum,
            joint_position: self.postures.iter().flat_map(|posture| posture.angles.iter().cloned()).collect(),
            joint_torque: self.motor_torques(x),
        }
    }

    /// The ends of the n-th step.
    fn ends(&self, n: usize) -> [(&Posture, &Matrix3<f64>); 2] {
        [n, n + 1].map(|n| (&self.postures[n], &self.rotations[n]))
    }

    /// The angular momentum about the center of mass in the middle of each step, world frame, kg m²/s.
    fn angular_momenta(&self) -> Vec<Vector3<f64>> {
        (0..self.postures.len() - 1).map(|n| self.body.angular_momentum(self.ends(n), self.step)).collect()
    }

    /// What the legs' mass adds to the rows of a law.
    pub fn terms(&self, law: Law) -> LegTerms {
        let intervals = self.model.layout.intervals;
        let inertia = self.inertia();
        let mut torque = self.torques(law);
        for term in &inertia {
            let bent = term.stencil().map(|(k, weight)| self.foot_in_base(term.foot, k * self.fine) * weight);
            torque[term.sample] -= term.form * bent.iter().sum::<Vector3<f64>>();
        }
        LegTerms {
            shift: (0..=intervals).map(|k| self.postures[k * self.fine].shift).collect(),
            shift_between: (0..intervals)
                .map(|k| self.postures[k * self.fine + self.fine / 2].shift)
                .collect(),
            torque,
            inertia,
            joint_torque: (0..self.contacts.len())
                .map(|i| (0..=intervals).map(|k| self.joint_loads(i, k * self.fine)).collect())
                .collect(),
        }
    }

    /// [`LegTerms::torque`]. With the centered law, it is all that the law's own left side lacks; with the others, which are laws at the
    /// samples, what a rigid body lacks.
    fn torques(&self, law: Law) -> Vec<Vector3<f64>> {
        let model = self.model;
        let (intervals, time_step) = (model.layout.intervals, model.layout.time_step);
        let unit = model.mass * GRAVITY;
        let s = model.second_moment;
        let inertia = Matrix3::identity() * s.trace() - s;
        let mut momenta = self.angular_momenta();
        if law != Law::Pcdm {
            for (n, momentum) in momenta.iter_mut().enumerate() {
                *momentum -= spin(&[self.rotations[n], self.rotations[n + 1]], &inertia, self.step);
            }
        }
        let means: Vec<Vector3<f64>> = momenta
            .chunks_exact(self.fine)
            .map(|step| step.iter().sum::<Vector3<f64>>() / self.fine as f64)
            .collect();
        let mut torques = vec![[0.0; 3]; intervals + 1];
        for k in 1..intervals {
            let mut torque = (means[k] - means[k - 1]) / (time_step * unit);
            if law == Law::Pcdm {
                let r = |k: usize| self.rotations[k * self.fine];
                let own = skew_part(&((r(k + 1) + r(k - 1)) * s * r(k).transpose()));
                torque -= own / (time_step.powi(2) * unit);
            }
            torques[k] = torque.into();
        }
        if law != Law::Pcdm {
            // From averages over hats to the values at the samples of a function that is linear between them.
            solve_tridiagonal(2.0 / 3.0, 1.0 / 6.0, &mut torques[1..intervals]);
        }
        torques.into_iter().map(Vector3::from).collect()
    }

    /// By how much Euler's law is missed at the ends of the steps by the forces of the variables x, averaged over the two steps beside
    /// each; world frame, N m. Zero at the first and the last.
    fn residuals(&self, torques: &[Vector3<f64>]) -> Vec<Vector3<f64>> {
        let momenta = self.angular_momenta();
        let mut residuals = vec![Vector3::zeros(); self.postures.len()];
        for n in 1..momenta.len() {
            let torque = (torques[n - 1] + torques[n] * 4.0 + torques[n + 1]) / 6.0;
            residuals[n] = (momenta[n] - momenta[n - 1]) / self.step - torque;
        }
        residuals
    }

    /// The torque of the forces of the variables x about the center of mass at the ends of the steps, world frame, N m.
    fn torques_of_forces(&self, x: &[f64]) -> Vec<Vector3<f64>> {
        let (layout, unit) = (&self.model.layout, self.model.mass * GRAVITY);
        let mut torques = vec![Vector3::zeros(); self.postures.len()];
        for i in 0..self.contacts.len() {
            for (n, torque) in torques.iter_mut().enumerate() {
                let k = n as f64 / self.fine as f64;
                let foot = sampling::foot(layout, &self.model.spaces.feet, x, i, k);
                *torque += (foot.position - self.positions[n]).cross(&foot.force) * unit;
            }
        }
        for (n, torque) in torques.iter_mut().enumerate() {
            let (k, u) = (n / self.fine, (n % self.fine) as f64 / self.fine as f64);
            let point = |point: &Vector3<f64>| self.rotations[n] * (point - self.postures[n].shift);
            for (k, weight) in [(k, 1.0 - u), (k + 1, u)] {
                let applied = self.model.applied(k).iter();
                *torque +=
                    applied.map(|[force, at]| point(at).cross(force)).sum::<Vector3<f64>>() * (weight * unit);
            }
        }
        torques
    }

    /// Turns the base between the samples such that Euler's law holds there, and returns the motion with knots at all ends of steps.
    ///
    /// The rows of the law balance averages over two time steps. The legs' momentum changes faster than that, but forces are linear between
    /// samples. What is left turns the trunk to and fro by less than a milliradian, as it would turn a real one. In each time step,
    ///
    /// ```text
    ///   (J_n+½ (θ_n+1 − θ_n) − J_n−½ (θ_n − θ_n−1)) / δ² = −ρ_n,   θ = 0 at the samples,
    /// ```
    ///
    /// is solved for small turns θ, with ρ the residual less the function of time that is linear between samples and has the same averages,
    /// and J the angular momentum of a turn of the base alone. None where the base's knots are not those of the samples, and where the turns are not small; then this motion is spoiled.
    pub fn settle(&mut self, x: &[f64]) -> Option<(Layout, Vec<f64>)> {
        let layout = &self.model.layout;
        let inertias: Vec<Matrix3<f64>> =
            (0..=layout.intervals).map(|k| self.turning_inertia(k * self.fine)).collect();
        let torques = self.torques_of_forces(x);
        let given = self.rotations.clone();
        for _ in 0..SETTLING_ROUNDS {
            let residuals = self.oscillation(&torques);
            for k in 0..layout.intervals {
                let first = k * self.fine;
                let turns =
                    small_turns([&inertias[k], &inertias[k + 1]], &residuals[first + 1..first + self.fine])?;
                if turns.iter().any(|turn| turn.norm() * self.step.powi(2) > LARGEST_TURN) {
                    return None;
                }
                for (n, turn) in (first + 1..).zip(turns) {
                    self.rotations[n] = Rotation3::new(turn * self.step.powi(2)).matrix() * self.rotations[n];
                    let guess = self.postures[n].shift;
                    self.postures[n] = self.posture(n, &self.rotations[n], guess);
                }
            }
        }
        let values: Vec<[f64; 6]> = (0..given.len())
            .map(|n| {
                let mut y = self.variables[n];
                // R = 𝒫(J) R(θ̄), and 𝒫(J) is that of the place.
                let turned =
                    euler(&Vector3::new(y[3], y[4], y[5])).rotation * given[n].tr_mul(&self.rotations[n]);
                for (angle, new) in y[3..].iter_mut().zip(&euler_angles(&turned)) {
                    *angle += (new - *angle) - TAU * ((new - *angle) / TAU).round();
                }
                y
            })
            .collect();
        layout.with_fine_base(x, self.fine, &values)
    }

    /// J at the n-th end of a step: from the angular velocity of the base to the angular momentum, while the feet stay where they are; world
    /// frame, kg m².
    fn turning_inertia(&self, n: usize) -> Matrix3<f64> {
        let (posture, r) = (&self.postures[n], &self.rotations[n]);
        let columns: [Vector3<f64>; 3] = std::array::from_fn(|c| {
            let mut turn = Vector3::zeros();
            turn[c] = NUDGE;
            let turned = Rotation3::new(turn).matrix() * r;
            let moved = self.posture(n, &turned, posture.shift);
            self.body.angular_momentum([(posture, r), (&moved, &turned)], NUDGE)
        });
        Matrix3::from_columns(&columns)
    }

    /// ρ: the residual of Euler's law without its averages over the rows' hats; world frame, N m.
    fn oscillation(&self, torques: &[Vector3<f64>]) -> Vec<Vector3<f64>> {
        let mut residuals = self.residuals(torques);
        let intervals = self.model.layout.intervals;
        let fine = self.fine as f64;
        let hat = |j: i32| 1.0 - f64::from(j.abs()) / fine;
        // The function that is linear between samples and has the same sums.
        let reach = self.fine as i32 - 1;
        let mut linear = vec![[0.0; 3]; intervals + 1];
        for k in 1..intervals {
            let at = |j: i32| residuals[(k as i32 * self.fine as i32 + j) as usize];
            linear[k] = (-reach..=reach).map(|j| at(j) * hat(j)).sum::<Vector3<f64>>().into();
        }
        let own = (2.0 * fine * fine + 1.0) / (3.0 * fine);
        let beside = (fine * fine - 1.0) / (6.0 * fine);
        solve_tridiagonal(own, beside, &mut linear[1..intervals]);
        for (n, residual) in residuals.iter_mut().enumerate() {
            let (k, part) = (n / self.fine, (n % self.fine) as f64 / fine);
            let next = linear.get(k + 1).copied().unwrap_or_default();
            *residual -= Vector3::from(linear[k]) * (1.0 - part) + Vector3::from(next) * part;
        }
        residuals
    }
}

/// A larger turn, rad, is not a vibration: some leg is out of reach.
const LARGEST_TURN: f64 = 0.05;
/// J hardly changes with the turns.
const SETTLING_ROUNDS: usize = 2;

/// θ_n / δ² of [`BodyMotion::settle`] at the inner ends of the steps of an interval, from J at its own ends, linear in between, and ρ at the
/// inner ones: Gauss's elimination by blocks. None if J is singular.
fn small_turns(inertias: [&Matrix3<f64>; 2], residuals: &[Vector3<f64>]) -> Option<Vec<Vector3<f64>>> {
    let steps = residuals.len() + 1;
    let part = |n: usize| (n as f64 + 0.5) / steps as f64;
    let between: Vec<Matrix3<f64>> =
        (0..steps).map(|n| inertias[0] * (1.0 - part(n)) + inertias[1] * part(n)).collect();
    let mut eliminated: Vec<(Matrix3<f64>, Vector3<f64>)> = Vec::with_capacity(residuals.len());
    for (n, residual) in residuals.iter().enumerate() {
        let (left, right) = (between[n], between[n + 1]);
        let (mut diagonal, mut value) = (left + right, *residual);
        if let Some((above, known)) = eliminated.last() {
            diagonal -= left * above;
            value += left * known;
        }
        let inverse = diagonal.try_inverse()?;
        eliminated.push((inverse * right, inverse * value));
    }
    let mut turns = vec![Vector3::zeros(); residuals.len()];
    let mut next = Vector3::zeros();
    for (turn, (above, known)) in turns.iter_mut().zip(eliminated).rev() {
        next = known + above * next;
        *turn = next;
    }
    Some(turns)
}

/// The contact points of a foot, m.
fn contacts(model: &Model, layout: &Layout, i: usize, x: &[f64], fine: usize) -> Vec<Vector3<f64>> {
    let place =
        |node: &LinearNode| model.spaces.feet.jet(&Vector3::from(node.value::<3>(x)), Order::First).position;
    let foot = &layout.feet[i];
    let footholds: Vec<Vector3<f64>> = foot.stances.iter().map(|stance| place(&stance.foothold)).collect();
    (0..=layout.intervals * fine)
        .map(|n| {
            let k = n as f64 / fine as f64;
            let lifted = foot.swings.iter().filter(|s| s.swing.start < k).count();
            match foot.swings[..lifted].last() {
                Some(swing) if k < swing.swing.end => place(&layout.foot_node(i, k, 0)),
                _ => footholds[lifted],
            }
        })
        .collect()
}

/// From the contact points to the centers of the foot: along the ground's normal in stance; in swing, turned smoothly from one to the next.
fn centers(
    model: &Model,
    layout: &Layout,
    (i, fine): (usize, usize),
    leg: &Leg,
    contacts: &[Vector3<f64>],
) -> Vec<Vector3<f64>> {
    let foot = &layout.feet[i];
    let normals: Vec<Vector3<f64>> = foot
        .stances
        .iter()
        .enumerate()
        .map(|(j, stance)| {
            let place = contacts[(stance.stance.start * fine as f64).ceil() as usize];
            match model.patch(i, j) {
                Some(patch) => patch.normal(),
                None => model.surfaces.feet.normal(place.x, place.y),
            }
            .into()
        })
        .collect();
    (0..contacts.len())
        .map(|n| {
            let k = n as f64 / fine as f64;
            let lifted = foot.swings.iter().filter(|s| s.swing.start < k).count();
            let normal = match lifted.checked_sub(1).map(|j| (j, foot.swings[j].swing)) {
                Some((j, swing)) if k < swing.end => {
                    let fraction = ramp((k - swing.start) / (swing.end - swing.start))[0];
                    (normals[j] * (1.0 - fraction) + normals[j + 1] * fraction).normalize()
                }
                _ => normals[lifted],
            };
            normal * leg.foot_radius
        })
        .collect()
}
