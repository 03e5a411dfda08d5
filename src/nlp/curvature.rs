//! Second derivatives of the nodes themselves. Every term of the Lagrangian accumulates its derivatives with respect to the
//! ambient quantities; once all have, the nodes' own second derivatives are added with these weights.

use nalgebra::{Matrix3, Vector3};

use super::model::Model;
use super::sink::Sink;
use super::state::{BaseNode, FootNode, State};
use crate::trajectory::layout::Phase;
use crate::trajectory::rotation::skew_part;
use crate::trajectory::space::PointJet;
use crate::trajectory::switches::TimedNode;
use crate::trajectory::{Instant, LinearNode};

/// ∂L/∂(ambient quantities) of a Lagrangian term: the weights of the nodes' own second derivatives.
#[derive(Clone, Debug)]
pub struct NodeCurvature {
    /// ∂L/∂p by sample.
    pub base_position: Vec<Vector3<f64>>,
    /// ∂L/∂R by sample.
    pub base_rotation: Vec<Matrix3<f64>>,
    /// ∂L/∂p and ∂L/∂R halfway from each sample to the next, as in [`State::base_between`].
    pub base_between: Vec<(Vector3<f64>, Matrix3<f64>)>,
    /// ∂L/∂p_i, `[foot][stance]`.
    pub contacts: Vec<Vec<Vector3<f64>>>,
    /// ∂L/∂p_i, `[foot][k]`.
    pub swings: Vec<Vec<Vector3<f64>>>,
    /// ∂L/∂p_i, as in [`State::swings_between`].
    pub swings_between: Vec<Vec<Vector3<f64>>>,
    /// ∂L/∂p_i, `[foot]` and as in [`State::points`].
    pub points: Vec<Vec<Vector3<f64>>>,
    /// ∂L/∂f_i, `[foot][k]`.
    pub forces: Vec<Vec<Vector3<f64>>>,
    /// ∂L/∂(J ḡ_i), `[foot][k]`.
    pub full_forces: Vec<Vec<Vector3<f64>>>,
    /// ∂L/∂f̄_i beyond what goes through f_i, `[foot][k]`.
    pub warped_forces: Vec<Vec<Vector3<f64>>>,
}

impl NodeCurvature {
    /// Number of parts of [`Self::scatter`].
    pub const PARTS: usize = 3;

    /// All zero.
    pub fn new(state: &State) -> Self {
        let zeros = |v: &Vec<Vec<FootNode>>| v.iter().map(|f| vec![Vector3::zeros(); f.len()]).collect();
        Self {
            base_position: vec![Vector3::zeros(); state.base.len()],
            base_rotation: vec![Matrix3::zeros(); state.base.len()],
            base_between: vec![(Vector3::zeros(), Matrix3::zeros()); state.base_between.len()],
            contacts: zeros(&state.contacts),
            swings: zeros(&state.swings),
            swings_between: zeros(&state.swings_between),
            points: zeros(&state.points),
            forces: state.forces.clone(),
            full_forces: state.forces.clone(),
            warped_forces: state.forces.clone(),
        }
    }

    /// Back to zero.
    pub fn clear(&mut self) {
        self.base_position.fill(Vector3::zeros());
        self.base_rotation.fill(Matrix3::zeros());
        self.base_between.fill((Vector3::zeros(), Matrix3::zeros()));
        for list in [
            &mut self.contacts,
            &mut self.swings,
            &mut self.swings_between,
            &mut self.points,
            &mut self.forces,
            &mut self.full_forces,
            &mut self.warped_forces,
        ] {
            for foot in list {
                foot.fill(Vector3::zeros());
            }
        }
    }

    /// Adds ∂L/∂p_i of a foot at an instant.
    pub fn add_foot(&mut self, model: &Model, foot: usize, instant: impl Into<Instant>, value: Vector3<f64>) {
        let instant = instant.into();
        match (model.layout.phase_at(foot, instant), instant) {
            (Phase::Stance(j), _) => self.contacts[foot][j] += value,
            (Phase::Swing(_), Instant::Sample(k)) => self.swings[foot][k] += value,
            (Phase::Swing(_), Instant::Between(k)) => self.swings_between[foot][k] += value,
        }
    }

    /// Adds ∂L/∂p and ∂L/∂R of the base at an instant.
    pub fn add_base(&mut self, instant: Instant, position: &Vector3<f64>, rotation: &Matrix3<f64>) {
        let (by_position, by_rotation) = match instant {
            Instant::Sample(k) => (&mut self.base_position[k], &mut self.base_rotation[k]),
            Instant::Between(k) => {
                let (by_position, by_rotation) = &mut self.base_between[k];
                (by_position, by_rotation)
            }
        };
        *by_position += position;
        *by_rotation += rotation;
    }

    /// Adds the weights that another instance has accumulated.
    pub fn merge(&mut self, other: &Self) {
        fn sum<T: Copy + std::ops::AddAssign>(to: &mut [T], from: &[T]) {
            to.iter_mut().zip(from).for_each(|(to, from)| *to += *from);
        }
        sum(&mut self.base_position, &other.base_position);
        sum(&mut self.base_rotation, &other.base_rotation);
        for (to, from) in self.base_between.iter_mut().zip(&other.base_between) {
            to.0 += from.0;
            to.1 += from.1;
        }
        for (to, from) in [
            (&mut self.contacts, &other.contacts),
            (&mut self.swings, &other.swings),
            (&mut self.swings_between, &other.swings_between),
            (&mut self.points, &other.points),
            (&mut self.forces, &other.forces),
            (&mut self.full_forces, &other.full_forces),
            (&mut self.warped_forces, &other.warped_forces),
        ] {
            to.iter_mut().zip(from).for_each(|(to, from)| sum(to, from));
        }
    }

    /// Adds part `part` of Σ ∂L/∂(node) · ∂²(node)/∂(variables)² to the sink, after all terms have added their weights: 0 the
    /// base, 1 the nodes that depend on switches, 2 the feet.
    pub fn scatter(&self, part: usize, model: &Model, state: &State, sink: &mut Sink) {
        match part {
            0 => self.scatter_bases(model, state, sink),
            1 => self.scatter_switches(model, state, sink),
            _ if model.spaces.feet.is_warped() => self.scatter_feet(model, state, sink),
            _ => {}
        }
    }

    fn scatter_bases(&self, model: &Model, state: &State, sink: &mut Sink) {
        let layout = &model.layout;
        for (k, base) in state.base.iter().enumerate() {
            scatter_base(model, base, &layout.base[k], &self.base_position[k], &self.base_rotation[k], sink);
        }
        for (k, base) in state.base_between.iter().enumerate() {
            let (position, rotation) = &self.base_between[k];
            scatter_base(model, base, &layout.base_between[k], position, rotation, sink);
        }
    }

    /// The part of the feet and forces that is due to φ.
    fn scatter_feet(&self, model: &Model, state: &State, sink: &mut Sink) {
        let layout = &model.layout;
        let position = |sink: &mut Sink, node: &LinearNode, point: &PointJet, weight: &Vector3<f64>| {
            for d in 0..3 {
                for e in 0..=d {
                    sink.own(node, d, e, weight.dot(&point.first[e].column(d)));
                }
            }
        };
        for (i, foot) in layout.feet.iter().enumerate() {
            for (j, stance) in foot.stances.iter().enumerate() {
                let point = &state.contacts[i][j].point;
                let foothold = &stance.foothold;
                position(sink, foothold, point, &self.contacts[i][j]);
                // f = J(c̄) f̄: ∂²f/∂c̄∂f̄ = ∂J, ∂²f/∂c̄² = ∂²J f̄, the latter summed over the stance's samples first.
                let mut total = Matrix3::zeros();
                let mut force =
                    |sink: &mut Sink, node: &LinearNode, warped: &Vector3<f64>, weight: &Vector3<f64>| {
                        for e in 0..3 {
                            let row = point.first[e].transpose() * weight;
                            for d in 0..3 {
                                sink.pair((foothold, e), (node, d), row[d]);
                                total[(e, d)] += weight.dot(&(point.second[e][d] * warped));
                            }
                        }
                    };
                for (k, full) in stance.free_forces() {
                    let Some(timed) = &state.force_nodes[i][k] else { continue };
                    let (mut weight, full_weight) = (self.forces[i][k], &self.full_forces[i][k]);
                    if timed.is_timed() {
                        force(sink, full, &state.warped_full_forces[i][k], full_weight);
                    } else {
                        weight += full_weight;
                    }
                    force(sink, &timed.node, &state.warped_forces[i][k], &weight);
                }
                for d in 0..3 {
                    for e in 0..=d {
                        sink.own(foothold, d, e, total[(e, d)]);
                    }
                }
            }
            for (k, timed) in state.foot_nodes[i].iter().enumerate() {
                if let Phase::Swing(_) = layout.phase[i][k] {
                    position(sink, &timed.node, &state.swings[i][k].point, &self.swings[i][k]);
                }
            }
            for (k, timed) in state.foot_nodes_between[i].iter().enumerate() {
                if let Phase::Swing(_) = layout.phase_at(i, Instant::Between(k)) {
                    let point = &state.swings_between[i][k].point;
                    position(sink, &timed.node, point, &self.swings_between[i][k]);
                }
            }
            for (n, at) in state.swing_points[i].iter().enumerate() {
                position(sink, &at.node, &state.points[i][n].point, &self.points[i][n]);
            }
        }
    }

    /// The part that is due to nodes whose weights depend on switches.
    fn scatter_switches(&self, model: &Model, state: &State, sink: &mut Sink) {
        let layout = &model.layout;
        for i in 0..layout.feet.len() {
            for (k, timed) in state.foot_nodes[i].iter().enumerate().filter(|(_, t)| t.is_timed()) {
                let weight = state.swings[i][k].point.jacobian.tr_mul(&self.swings[i][k]);
                scatter_timed(timed, &weight, sink);
            }
            let between = state.foot_nodes_between[i].iter().enumerate();
            for (k, timed) in between.filter(|(_, t)| t.is_timed()) {
                let jacobian = &state.swings_between[i][k].point.jacobian;
                scatter_timed(timed, &jacobian.tr_mul(&self.swings_between[i][k]), sink);
            }
            for (k, timed) in state.force_nodes[i].iter().enumerate() {
                let Some(timed) = timed.as_ref().filter(|t| t.is_timed()) else { continue };
                let Some((j, _)) = layout.force(i, k) else { continue };
                let jacobian = &state.contacts[i][j].point.jacobian;
                let weight = jacobian.tr_mul(&self.forces[i][k]) + self.warped_forces[i][k];
                scatter_timed(timed, &weight, sink);
            }
        }
    }
}

/// Adds ∂L/∂p · ∂²p and ⟨∂L/∂R, ∂²R⟩ of the base.
fn scatter_base(
    model: &Model,
    base: &BaseNode,
    node: &LinearNode,
    by_position: &Vector3<f64>,
    by_rotation: &Matrix3<f64>,
    sink: &mut Sink,
) {
    // ⟨Λ, ∂_d ∂_e R⟩ with Q = Λ Rᵀ: ∂_e w_d · skew(Q) + w_eᵀ Q w_d − (w_d · w_e) tr Q.
    let q = by_rotation * base.rotation().transpose();
    let (axis, trace) = (skew_part(&q), q.trace());
    let w = &base.turn.first;
    let first = if model.spaces.base.is_warped() { 0 } else { 3 };
    for d in first..6 {
        for e in first..=d {
            let mut value =
                base.turn.second[e][d].dot(&axis) + w[e].dot(&(q * w[d])) - w[d].dot(&w[e]) * trace;
            if d < 3 {
                value += by_position.dot(&base.point.first[e].column(d));
            }
            sink.own(node, d, e, value);
        }
    }
}

/// Adds weight · ∂²y of a node y whose weights depend on switches.
fn scatter_timed(timed: &TimedNode, weight: &Vector3<f64>, sink: &mut Sink) {
    for (t, &(switch, _)) in timed.node.times.iter().enumerate() {
        for (m, &(variable, _)) in timed.node.terms.iter().enumerate() {
            for d in 0..3 {
                let v = variable + d;
                sink.add(v.max(switch), v.min(switch), weight[d] * timed.mixed[m][t]);
            }
        }
        for (s, &(other, _)) in timed.node.times[..=t].iter().enumerate() {
            let second = Vector3::from(timed.second[t + s]);
            sink.add(switch.max(other), switch.min(other), weight.dot(&second));
        }
    }
}
