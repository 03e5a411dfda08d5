//! Torque limits of the joints of a standing leg.
//!
//! ```text
//!   −fraction ≤ ((∂r/∂q)ᵀ Rᵀ f − g) / torque_limit ≤ fraction,  r = Rᵀ(p_i − p) + s
//! ```
//!
//! g is what the joint bears for the links below it, their weight and inertia: a known function of time, zero for massless legs
//! ([`crate::nlp::leg_terms`]). Legs that the robot's file does not describe have no rows.
//!
//! Rows: each joint for each free force; fraction of the limit. That of the abduction that a leg of two joints lacks is zero.

use nalgebra::{Matrix3, Vector3};

use super::margins;
use crate::leg::chain::ByJoint;
use crate::leg::jet::{Jet, Scalar};
use crate::nlp::contact_force::{ForceSample, force_samples};
use crate::nlp::curvature::NodeCurvature;
use crate::nlp::foot_in_base;
use crate::nlp::model::GRAVITY;
use crate::nlp::sink::Sink;
use crate::nlp::tangent::Tangent;
use crate::nlp::term::{Constraint, RowPlace};
use crate::nlp::{Model, State};
use crate::trajectory::Instant;
use crate::trajectory::rotation::cross_matrix;

/// Name of the block.
pub const JOINT_TORQUE: &str = "joint torque";

/// Torques of standing legs.
#[derive(Clone, Debug)]
pub struct JointTorque {
    places: Vec<ForceSample>,
    /// First row of each place, and the number of rows.
    offsets: Vec<usize>,
}

impl JointTorque {
    /// For every force of a leg whose geometry is known.
    pub fn new(model: &Model) -> Self {
        let places = force_samples(model, |i| model.legs[i].is_some());
        let mut offsets = vec![0];
        for at in &places {
            offsets.push(offsets[offsets.len() - 1] + model.leg(at.foot).joints());
        }
        Self { places, offsets }
    }

    /// The places with their first rows.
    fn numbered(&self) -> impl Iterator<Item = (ForceSample, usize)> {
        self.places.iter().copied().zip(self.offsets.iter().copied())
    }
}

/// ∂r/∂q by joint, each times m g over the joint's torque limit.
fn columns<T: Scalar>(model: &Model, foot: usize, r: [T; 3]) -> ByJoint<[T; 3]> {
    let leg = model.leg(foot);
    let mut columns = leg.posture(r).jacobian();
    for (column, limit) in columns.iter_mut().zip(&leg.torque_limit) {
        *column = column.map(|entry| entry * (model.mass * GRAVITY / limit));
    }
    columns
}

/// The same with derivatives, f in the base frame, and f.
fn parts(
    model: &Model,
    state: &State,
    ForceSample { foot: i, sample: k, .. }: ForceSample,
) -> (ByJoint<[Jet; 3]>, Vector3<f64>, Vector3<f64>) {
    let columns = columns(model, i, Jet::variables(&foot_in_base::value(model, state, (i, k))));
    let f = state.forces[i][k];
    (columns, state.base[k].rotation().tr_mul(&f), f)
}

fn values(column: &[Jet; 3]) -> Vector3<f64> {
    Vector3::from_fn(|c, _| column[c].value)
}

/// How Rᵀ f changes: with the orientation of the base, the force's own variables, and the foothold through J.
fn tangents<'a>(
    model: &'a Model,
    state: &'a State,
    ForceSample { foot: i, stance: j, sample: k }: ForceSample,
) -> (Tangent<'a>, [Tangent<'a>; 2]) {
    let contact = &state.contacts[i][j];
    let foothold = &model.layout.feet[i].stances[j].foothold;
    let (_, node) = state.force_node(model, i, k).expect("a force sample is that of a free force");
    let own = Tangent::force(model, contact, node);
    let by_foothold = Tangent::force_by_foothold(model, contact, foothold, &state.warped_forces[i][k]);
    (Tangent::turn(model, &state.base[k], &model.layout.base[k]), [own, by_foothold])
}

impl Constraint for JointTorque {
    fn name(&self) -> &'static str {
        JOINT_TORQUE
    }

    fn rows(&self) -> usize {
        self.offsets[self.places.len()]
    }

    fn bounds(&self, model: &Model, lower: &mut [f64], upper: &mut [f64]) {
        let limit = margins::JOINT_TORQUE - model.tighter.joint_torque;
        lower.fill(-limit);
        upper.fill(limit);
    }

    fn values(&self, model: &Model, state: &State, out: &mut [f64]) {
        for (ForceSample { foot: i, sample: k, .. }, first) in self.numbered() {
            let leg = model.leg(i);
            let columns = columns(model, i, foot_in_base::value(model, state, (i, k)).into());
            let local = state.base[k].rotation().tr_mul(&state.forces[i][k]);
            let own = model.leg_terms.joint_torque(i, k);
            for (j, column) in columns.into_iter().enumerate() {
                let borne = own.get(j).map_or(0.0, |torque| torque / leg.torque_limit[j]);
                out[first + j] = Vector3::from(column).dot(&local) - borne;
            }
        }
    }

    fn jacobian(&self, model: &Model, state: &State, first: usize, sink: &mut Sink) {
        for (at, offset) in self.numbered() {
            let ForceSample { foot: i, sample: k, .. } = at;
            let (columns, local, f) = parts(model, state, at);
            let (turn, forces) = tangents(model, state, at);
            for (j, column) in columns.iter().enumerate() {
                let row = first + offset + j;
                let by_r: Vector3<f64> = (0..3).map(|c| column[c].first * local[c]).sum();
                foot_in_base::add_derivative(model, state, (i, k), &by_r, &mut sink.row(row));
                // d(Rᵀ f) = Rᵀ ([f] δ + df).
                let world = state.base[k].rotation() * values(column);
                turn.add_along(&-f.cross(&world), &mut sink.row(row));
                for force in &forces {
                    force.add_along(&world, &mut sink.row(row));
                }
            }
        }
    }

    fn hessian(
        &self,
        model: &Model,
        state: &State,
        multipliers: &[f64],
        curvature: &mut NodeCurvature,
        _sink: &mut Sink,
    ) {
        for (at, first) in self.numbered() {
            let ForceSample { foot: i, sample: k, .. } = at;
            let (columns, local, f) = parts(model, state, at);
            let sum: [Jet; 3] = std::array::from_fn(|c| {
                let weighted = |j: usize| columns[j][c] * multipliers[first + j];
                (1..columns.len()).fold(weighted(0), |sum, j| sum + weighted(j))
            });
            // In r alone.
            let torque = sum[0] * local.x + sum[1] * local.y + sum[2] * local.z;
            foot_in_base::add_quadratic(model, state, (i, k), &torque.second, curvature);
            foot_in_base::add_curvature(model, state, (i, k), &torque.first, curvature);
            // In Rᵀ f alone: λ · Rᵀ f, with the mixed form (δ × Rλ) · df = dfᵀ [Rλ]ᵀ δ.
            let r = state.base[k].rotation();
            let lambda = values(&sum);
            let world = r * lambda;
            curvature.base_rotation[k] += f * lambda.transpose();
            curvature.forces[i][k] += world;
            // In both: (change of r)ᵀ B (change of Rᵀ f), with R (change of r) = [arm] δ + dp_i − dp and
            // R (change of Rᵀ f) = [f] δ + df.
            let by_r = Matrix3::from_fn(|d, c| sum[c].first[d]);
            let b = r * by_r * r.transpose();
            let at = (i, Instant::Sample(k));
            let arm = cross_matrix(&foot_in_base::arm(model, state, at));
            let cross = cross_matrix(&f);
            let form = curvature.forms.foot_mut(i, at.1);
            let turns = arm.transpose() * b * cross;
            form.pose.turn += turns + turns.transpose();
            form.pose.turn_base -= (b * cross).transpose();
            form.turn_foot += (b * cross).transpose();
            let form = &mut curvature.forms.forces[i][k];
            form.turn += cross_matrix(&world).transpose() + b.transpose() * arm;
            form.base -= b.transpose();
            form.foot += b.transpose();
        }
    }

    fn place(&self, row: usize) -> RowPlace {
        self.places[self.offsets.partition_point(|&first| first <= row) - 1].place()
    }
}
