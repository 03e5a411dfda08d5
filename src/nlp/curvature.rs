//! Second derivatives of the nodes themselves. Every term of the Lagrangian accumulates its derivatives with respect to the
//! ambient quantities, first ([`NodeCurvature`]) and second ([`LocalForms`]); once all have, these are pulled back to the variables, once
//! for each node.

use nalgebra::{Matrix3, Vector3};

use super::local_forms::LocalForms;
use super::model::Model;
use super::sink::Sink;
use super::state::{FootNode, State};
use super::tangent::{PoseTangent, Tangent};
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
    /// ∂²L/∂(ambient quantities)² at one instant each.
    pub forms: LocalForms,
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
            forms: LocalForms::new(state),
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
        self.forms.clear();
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
        self.forms.merge(&other.forms);
    }

    /// Adds part `part` of the Hessian, after all terms have accumulated their weights and forms: 0 the base, 1 the nodes that depend
    /// on switches, 2 the feet and forces.
    pub fn scatter(&self, part: usize, model: &Model, state: &State, sink: &mut Sink) {
        match part {
            0 => self.scatter_bases(model, state, sink),
            1 => self.scatter_switches(model, state, sink),
            _ => self.scatter_feet(model, state, sink),
        }
    }

    fn scatter_bases(&self, model: &Model, state: &State, sink: &mut Sink) {
        for k in 0..state.base.len() {
            let weights = (&self.base_position[k], &self.base_rotation[k]);
            self.scatter_base(model, state, Instant::Sample(k), weights, sink);
        }
        for k in 0..state.base_between.len() {
            let (position, rotation) = &self.base_between[k];
            self.scatter_base(model, state, Instant::Between(k), (position, rotation), sink);
        }
    }

    /// Adds ∂L/∂p · ∂²p, ⟨∂L/∂R, ∂²R⟩ and the form in the pose.
    fn scatter_base(
        &self,
        model: &Model,
        state: &State,
        instant: Instant,
        (by_position, by_rotation): (&Vector3<f64>, &Matrix3<f64>),
        sink: &mut Sink,
    ) {
        let base = state.base_at(instant);
        let (pose, form) = (PoseTangent::new(model, state, instant), self.forms.pose(instant));
        // ⟨Λ, ∂_d ∂_e R⟩ with Q = Λ Rᵀ: ∂_e w_d · skew(Q) + w_eᵀ Q w_d − (w_d · w_e) tr Q.
        let q = by_rotation * base.rotation().transpose();
        let (axis, trace) = (skew_part(&q), q.trace());
        let w = &base.turn.first;
        for d in 0..6 {
            for e in 0..=d {
                let mut value = base.turn.second[e][d].dot(&axis) + w[e].dot(&(q * w[d]))
                    - w[d].dot(&w[e]) * trace
                    + pose.second(&form, d, e);
                if d < 3 {
                    value += by_position.dot(&base.point.first[e].column(d));
                }
                sink.own(pose.node, d, e, value);
            }
        }
    }

    fn scatter_feet(&self, model: &Model, state: &State, sink: &mut Sink) {
        for i in 0..model.feet() {
            for j in 0..model.layout.feet[i].stances.len() {
                self.scatter_stance(model, state, i, j, sink);
            }
            for k in 0..state.base.len() {
                self.scatter_swing(model, state, i, Instant::Sample(k), sink);
            }
            for k in 0..state.swings_between[i].len() {
                self.scatter_swing(model, state, i, Instant::Between(k), sink);
            }
            for (n, at) in state.swing_points[i].iter().enumerate() {
                let point = &state.points[i][n].point;
                own(&at.node, &pulled_back(point, &self.points[i][n], &Matrix3::zeros()), sink);
            }
        }
    }

    /// What depends on a moving foot at an instant.
    fn scatter_swing(&self, model: &Model, state: &State, i: usize, instant: Instant, sink: &mut Sink) {
        if let Phase::Swing(_) = model.layout.phase_at(i, instant) {
            let (foot, form) = (state.foot(model, i, instant), self.forms.foot(i, instant));
            let weight = match instant {
                Instant::Sample(k) => &self.swings[i][k],
                Instant::Between(k) => &self.swings_between[i][k],
            };
            let node = state.foot_node(i, instant);
            own(node, &pulled_back(&foot.point, weight, &form.foot), sink);
            let pose = PoseTangent::new(model, state, instant);
            pose.cross(&form.turn_foot, &form.base_foot, &Tangent::foot(model, foot, node), sink);
        }
    }

    /// What depends on the foothold of a stance, and on the forces there.
    fn scatter_stance(&self, model: &Model, state: &State, i: usize, j: usize, sink: &mut Sink) {
        let (contact, stance) = (&state.contacts[i][j], &model.layout.feet[i].stances[j]);
        let (foothold, tangent) = (&stance.foothold, Tangent::foot(model, contact, &stance.foothold));
        let mut form = Matrix3::zeros();
        let stands = |&instant: &Instant| model.layout.phase_at(i, instant) == Phase::Stance(j);
        let within = |time: f64| time.clamp(0.0, model.layout.intervals as f64) as usize;
        let samples = within(stance.stance.start.floor())..=within(stance.stance.end.ceil());
        let between =
            (0..state.swings_between[i].len()).filter(|k| samples.contains(k)).map(Instant::Between);
        for instant in samples.clone().map(Instant::Sample).chain(between).filter(stands) {
            let local = self.forms.foot(i, instant);
            form += local.foot;
            let pose = PoseTangent::new(model, state, instant);
            pose.cross(&local.turn_foot, &local.base_foot, &tangent, sink);
        }
        let mut total = pulled_back(&contact.point, &self.contacts[i][j], &form);
        for (k, full) in stance.free_forces() {
            let Some(timed) = &state.force_nodes[i][k] else { continue };
            let (mut weight, full_weight) = (self.forces[i][k], &self.full_forces[i][k]);
            if timed.is_timed() {
                let warped = &state.warped_full_forces[i][k];
                total += force_curvature(model, contact, (foothold, full), warped, full_weight, sink);
            } else {
                weight += full_weight;
            }
            let warped = &state.warped_forces[i][k];
            total += force_curvature(model, contact, (foothold, &timed.node), warped, &weight, sink);
            total += self.scatter_force(model, state, (i, j, k), &timed.node, sink);
        }
        own(foothold, &total, sink);
    }

    /// The form that couples a force with the pose, the foot and the foothold; returns what is due to the foothold alone.
    fn scatter_force(
        &self,
        model: &Model,
        state: &State,
        (i, j, k): (usize, usize, usize),
        node: &LinearNode,
        sink: &mut Sink,
    ) -> Matrix3<f64> {
        let form = &self.forms.forces[i][k];
        let contact = &state.contacts[i][j];
        let foothold = &model.layout.feet[i].stances[j].foothold;
        let force = Tangent::force(model, contact, node);
        let by_foothold = Tangent::force_by_foothold(model, contact, foothold, &state.warped_forces[i][k]);
        let pose = PoseTangent::new(model, state, Instant::Sample(k));
        let (turn, base) = (form.turn.transpose(), form.base.transpose());
        let legs = model.legs[i].is_some();
        for change in [&force, &by_foothold] {
            pose.cross(&turn, &base, change, sink);
            if legs {
                let foot = Tangent::foot(model, state.foot(model, i, k), state.foot_node(i, k));
                change.cross(&form.foot, &foot, sink);
            }
        }
        force.cross(&form.foothold, &Tangent::foot(model, contact, foothold), sink);
        let mixed = by_foothold.matrix().tr_mul(&form.foothold) * contact.point.jacobian;
        mixed + mixed.transpose()
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

/// Second derivatives in the components of a node: those of weight · φ, and a form in the change of φ.
fn pulled_back(point: &PointJet, weight: &Vector3<f64>, form: &Matrix3<f64>) -> Matrix3<f64> {
    let curved = Matrix3::from_fn(|d, e| weight.dot(&point.first[e].column(d)));
    curved + point.jacobian.tr_mul(&(form * point.jacobian))
}

/// Adds second derivatives in the components of one node.
fn own(node: &LinearNode, second: &Matrix3<f64>, sink: &mut Sink) {
    for d in 0..3 {
        for e in 0..=d {
            sink.own(node, d, e, second[(d, e)]);
        }
    }
}

/// Weight · ∂²f of a force f = J(c̄) f̄: adds ∂²f/∂c̄∂f̄ = ∂J and returns ∂²f/∂c̄² = ∂²J f̄.
fn force_curvature(
    model: &Model,
    contact: &FootNode,
    (foothold, node): (&LinearNode, &LinearNode),
    warped: &Vector3<f64>,
    weight: &Vector3<f64>,
    sink: &mut Sink,
) -> Matrix3<f64> {
    if !model.spaces.feet.is_warped() {
        return Matrix3::zeros();
    }
    let point = &contact.point;
    for e in 0..3 {
        let row = point.first[e].tr_mul(weight);
        for d in 0..3 {
            sink.pair((foothold, e), (node, d), row[d]);
        }
    }
    Matrix3::from_fn(|e, d| weight.dot(&(point.second[e][d] * warped)))
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
