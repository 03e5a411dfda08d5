//! What the joints bear, and what the motors have to do.

use nalgebra::Vector3;

use super::BodyMotion;
use crate::leg::body::spin;
use crate::leg::chain::ByJoint;
use crate::nlp::model::GRAVITY;
use crate::trajectory::sampling;

impl BodyMotion<'_> {
    /// What the joints of a leg bear at the n-th end of a step without a force at the foot, N m.
    pub(super) fn joint_loads(&self, i: usize, n: usize) -> ByJoint<f64> {
        let Some(chain) = &self.body.legs[i].chain else { return ByJoint::new() };
        let first = self.body.first_link(i);
        let at = |n: usize, l: usize| {
            self.positions[n] + self.rotations[n] * (self.postures[n].centers[l] - self.postures[n].shift)
        };
        let turn = |n: usize, l: usize| self.rotations[n] * self.postures[n].rotations[l];
        let inner = n > 0 && n + 1 < self.postures.len();
        let (posture, r) = (&self.postures[n], &self.rotations[n]);
        let origin =
            |j: usize| self.positions[n] + r * (Vector3::from(posture.joints[i].origin[j]) - posture.shift);
        // Of each link: the force that accelerates it and bears its weight, where it acts, and the rate of its spin.
        let loads: Vec<_> = chain
            .joints
            .iter()
            .enumerate()
            .map(|(j, joint)| {
                let l = first + j;
                let (mut acceleration, mut rate) = (Vector3::z() * GRAVITY, Vector3::zeros());
                if inner {
                    acceleration += (at(n + 1, l) - at(n, l) * 2.0 + at(n - 1, l)) / self.step.powi(2);
                    let spins =
                        [n - 1, n].map(|n| spin(&[turn(n, l), turn(n + 1, l)], &joint.inertia, self.step));
                    rate = (spins[1] - spins[0]) / self.step;
                }
                (acceleration * joint.mass, at(n, l), rate)
            })
            .collect();
        let load = |j: usize| {
            let moment: Vector3<f64> =
                loads[j..].iter().map(|(force, place, rate)| (place - origin(j)).cross(force) + rate).sum();
            (r * Vector3::from(posture.joints[i].axis[j])).dot(&moment)
        };
        (0..loads.len()).map(load).collect()
    }

    /// The torques of the motors at the ends of the steps for the forces of the variables x, foot by foot, N m:
    ///
    /// ```text
    ///   τ_j = g_j − a_j · ((p_i − o_j) × f_i)
    /// ```
    ///
    /// with g_j what the joint bears without the force ([`Self::joint_loads`]), a_j and o_j its axis and a point of it. Accelerations are
    /// averages over the two steps beside an end, and so is f.
    pub(super) fn motor_torques(&self, x: &[f64]) -> Vec<ByJoint<f64>> {
        let (layout, unit) = (&self.model.layout, self.model.mass * GRAVITY);
        let (feet, ends) = (self.contacts.len(), self.postures.len());
        let forces: Vec<Vec<Vector3<f64>>> = (0..feet)
            .map(|i| {
                let at = |n: usize| n as f64 / self.fine as f64;
                let force = |n| sampling::foot(layout, &self.model.spaces.feet, x, i, at(n)).force * unit;
                (0..ends).map(force).collect()
            })
            .collect();
        let mut torques = Vec::with_capacity(ends * feet);
        for n in 0..ends {
            for (i, force) in forces.iter().enumerate() {
                let (before, after) = (n.saturating_sub(1), (n + 1).min(ends - 1));
                let mean = (force[before] + force[n] * 4.0 + force[after]) / 6.0;
                let local = self.rotations[n].tr_mul(&mean);
                let (r, joints) = (self.foot_in_base(i, n), &self.postures[n].joints[i]);
                let loads = self.joint_loads(i, n);
                let torque = |(j, load): (usize, f64)| {
                    let [axis, origin] = [joints.axis[j], joints.origin[j]].map(Vector3::from);
                    load - axis.dot(&(r - origin).cross(&local))
                };
                torques.push(loads.into_iter().enumerate().map(torque).collect());
            }
        }
        torques
    }
}
