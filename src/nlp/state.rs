//! The ambient nodes at the present x: evaluated once for each new x, read by every constraint and cost.

use nalgebra::{Matrix3, Vector3};

use super::model::Model;
use super::sink::Sink;
use crate::heightfield::HeightJet;
use crate::trajectory::LinearNode;
use crate::trajectory::layout::Phase;
use crate::trajectory::rotation::{RotationJet, skew_part};
use crate::trajectory::space::PointJet;
use crate::warp::Order;

/// The base at a sample.
#[derive(Clone, Copy, Debug)]
pub struct BaseNode {
    /// p = φ(p̄) and its derivatives with respect to p̄.
    pub point: PointJet,
    /// R = 𝒫(J(p̄)) R(θ̄) and its derivatives with respect to (p̄, θ̄).
    pub turn: RotationJet<6>,
}

impl BaseNode {
    /// p.
    pub fn position(&self) -> Vector3<f64> {
        self.point.position
    }

    /// R.
    pub fn rotation(&self) -> &Matrix3<f64> {
        &self.turn.rotation
    }
}

/// A foot on or over the ground.
#[derive(Clone, Copy, Debug)]
pub struct FootNode {
    /// φ of its variables.
    pub point: PointJet,
    /// The ground under it.
    pub ground: HeightJet,
}

impl FootNode {
    /// Vertical distance to the ground, m, and its derivative with respect to the ambient position.
    pub fn gap(&self) -> (f64, Vector3<f64>) {
        (self.point.position.z - self.ground.h, Vector3::new(-self.ground.d1[0], -self.ground.d1[1], 1.0))
    }
}

/// All nodes at one x.
#[derive(Clone, Debug)]
pub struct State {
    /// By sample.
    pub base: Vec<BaseNode>,
    /// By sample, (p̄, θ̄) and its first and second derivatives in time.
    pub base_motion: Vec<[[f64; 6]; 3]>,
    /// `contacts[foot][stance]`.
    pub contacts: Vec<Vec<FootNode>>,
    /// `swings[foot][k]`; stale where the foot stands.
    pub swings: Vec<Vec<FootNode>>,
    /// `apexes[foot][swing]`: the middle of each swing.
    pub apexes: Vec<Vec<FootNode>>,
    /// Variables of the apexes.
    pub apex_nodes: Vec<Vec<LinearNode>>,
    /// `warped_forces[foot][k]`, f̄ in m g.
    pub warped_forces: Vec<Vec<Vector3<f64>>>,
    /// `forces[foot][k]`, f = J f̄ in m g.
    pub forces: Vec<Vec<Vector3<f64>>>,
}

impl State {
    /// Room for all nodes of a model.
    pub fn new(model: &Model) -> Self {
        let layout = &model.layout;
        let zero = Matrix3::zeros();
        let point = PointJet {
            position: Vector3::zeros(),
            jacobian: Matrix3::identity(),
            first: [zero; 3],
            second: [[zero; 3]; 3],
        };
        let turn = RotationJet {
            rotation: Matrix3::identity(),
            first: [Vector3::zeros(); 6],
            second: [[Vector3::zeros(); 6]; 6],
        };
        let foot = FootNode { point, ground: HeightJet::default() };
        let samples = layout.intervals + 1;
        let feet = model.feet();
        Self {
            base: vec![BaseNode { point, turn }; samples],
            base_motion: vec![[[0.0; 6]; 3]; samples],
            contacts: layout.feet.iter().map(|f| vec![foot; f.stances.len()]).collect(),
            swings: vec![vec![foot; samples]; feet],
            apexes: layout.feet.iter().map(|f| vec![foot; f.swings.len()]).collect(),
            apex_nodes: layout
                .feet
                .iter()
                .enumerate()
                .map(|(i, f)| (0..f.swings.len()).map(|j| layout.swing_node(i, j, 0.5, 0)).collect())
                .collect(),
            warped_forces: vec![vec![Vector3::zeros(); samples]; feet],
            forces: vec![vec![Vector3::zeros(); samples]; feet],
        }
    }

    /// Evaluates all nodes at x; with what second derivatives of constraints need when `curved`.
    pub fn update(&mut self, model: &Model, x: &[f64], curved: bool) {
        let layout = &model.layout;
        let order = if curved { Order::Third } else { Order::Second };
        let foot_at = |node: &LinearNode, order: Order| {
            let point = model.space.jet(&Vector3::from(node.value::<3>(x)), order);
            FootNode { point, ground: model.ground.jet(point.position.x, point.position.y) }
        };
        for (k, node) in layout.base.iter().enumerate() {
            let y = node.value::<6>(x);
            let (point, turn) = model.space.pose(&y, curved);
            self.base[k] = BaseNode { point, turn };
            self.base_motion[k] = [y, layout.base_rates[k][0].value(x), layout.base_rates[k][1].value(x)];
        }
        for (i, foot) in layout.feet.iter().enumerate() {
            for (stance, contact) in foot.stances.iter().zip(&mut self.contacts[i]) {
                *contact = foot_at(&stance.foothold, order);
                for (k, node) in stance.free_forces() {
                    let force = Vector3::from(node.value::<3>(x));
                    self.warped_forces[i][k] = force;
                    self.forces[i][k] = contact.point.jacobian * force;
                }
            }
            let order = if curved { Order::Second } else { Order::First };
            for (k, node) in layout.foot_nodes[i].iter().enumerate() {
                if let Phase::Swing(_) = layout.phase[i][k] {
                    self.swings[i][k] = foot_at(node, order);
                }
            }
            for (node, apex) in self.apex_nodes[i].iter().zip(&mut self.apexes[i]) {
                *apex = foot_at(node, order);
            }
        }
    }

    /// A foot at a sample, in stance or in swing.
    pub fn foot(&self, model: &Model, foot: usize, k: usize) -> &FootNode {
        match model.layout.phase[foot][k] {
            Phase::Stance(j) => &self.contacts[foot][j],
            Phase::Swing(_) => &self.swings[foot][k],
        }
    }
}

/// ∂L/∂(ambient quantities) of a Lagrangian term: the weights of the nodes' own second derivatives.
#[derive(Clone, Debug)]
pub struct Curvature {
    /// ∂L/∂p by sample.
    pub base_position: Vec<Vector3<f64>>,
    /// ∂L/∂R by sample.
    pub base_rotation: Vec<Matrix3<f64>>,
    /// ∂L/∂p_i, `[foot][stance]`.
    pub contacts: Vec<Vec<Vector3<f64>>>,
    /// ∂L/∂p_i, `[foot][k]`.
    pub swings: Vec<Vec<Vector3<f64>>>,
    /// ∂L/∂p_i, `[foot][swing]`.
    pub apexes: Vec<Vec<Vector3<f64>>>,
    /// ∂L/∂f_i, `[foot][k]`.
    pub forces: Vec<Vec<Vector3<f64>>>,
}

impl Curvature {
    /// All zero.
    pub fn new(state: &State) -> Self {
        let zeros = |v: &Vec<Vec<FootNode>>| v.iter().map(|f| vec![Vector3::zeros(); f.len()]).collect();
        Self {
            base_position: vec![Vector3::zeros(); state.base.len()],
            base_rotation: vec![Matrix3::zeros(); state.base.len()],
            contacts: zeros(&state.contacts),
            swings: zeros(&state.swings),
            apexes: zeros(&state.apexes),
            forces: state.forces.clone(),
        }
    }

    /// Back to zero.
    pub fn clear(&mut self) {
        self.base_position.fill(Vector3::zeros());
        self.base_rotation.fill(Matrix3::zeros());
        for list in [&mut self.contacts, &mut self.swings, &mut self.apexes, &mut self.forces] {
            for foot in list {
                foot.fill(Vector3::zeros());
            }
        }
    }

    /// Adds ∂L/∂p_i of a foot at a sample.
    pub fn add_foot(&mut self, model: &Model, foot: usize, k: usize, value: Vector3<f64>) {
        match model.layout.phase[foot][k] {
            Phase::Stance(j) => self.contacts[foot][j] += value,
            Phase::Swing(_) => self.swings[foot][k] += value,
        }
    }

    /// Says Σ ∂L/∂(node) · ∂²(node)/∂(variables)² to the sink, after all constraints have added their weights.
    pub fn say(&self, model: &Model, state: &State, sink: &mut Sink) {
        let layout = &model.layout;
        for (k, base) in state.base.iter().enumerate() {
            let node = &layout.base[k];
            // ⟨Λ, ∂_d ∂_e R⟩ with Q = Λ Rᵀ: ∂_e w_d · skew(Q) + w_eᵀ Q w_d − (w_d · w_e) tr Q.
            let q = self.base_rotation[k] * base.rotation().transpose();
            let (axis, trace) = (skew_part(&q), q.trace());
            let w = &base.turn.first;
            let first = if model.space.is_warped() { 0 } else { 3 };
            for d in first..6 {
                for e in first..=d {
                    let mut value =
                        base.turn.second[e][d].dot(&axis) + w[e].dot(&(q * w[d])) - w[d].dot(&w[e]) * trace;
                    if d < 3 {
                        value += self.base_position[k].dot(&base.point.first[e].column(d));
                    }
                    sink.own(node, d, e, value);
                }
            }
        }
        if !model.space.is_warped() {
            return;
        }
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
                for (k, force) in stance.free_forces() {
                    let weight = self.forces[i][k];
                    for e in 0..3 {
                        let row = point.first[e].transpose() * weight;
                        for d in 0..3 {
                            sink.pair((foothold, e), (force, d), row[d]);
                            total[(e, d)] += weight.dot(&(point.second[e][d] * state.warped_forces[i][k]));
                        }
                    }
                }
                for d in 0..3 {
                    for e in 0..=d {
                        sink.own(foothold, d, e, total[(e, d)]);
                    }
                }
            }
            for (k, node) in layout.foot_nodes[i].iter().enumerate() {
                if let Phase::Swing(_) = layout.phase[i][k] {
                    position(sink, node, &state.swings[i][k].point, &self.swings[i][k]);
                }
            }
            for (j, node) in state.apex_nodes[i].iter().enumerate() {
                position(sink, node, &state.apexes[i][j].point, &self.apexes[i][j]);
            }
        }
    }
}

/// How an ambient vector (a position, a force, the rotation vector of a turn) changes with the components of a node:
/// component d of the node moves it by `columns[d]`, d in `first..last`.
#[derive(Clone, Copy, Debug)]
pub struct Tangent<'a> {
    /// The node.
    pub node: &'a LinearNode,
    columns: [Vector3<f64>; 6],
    first: usize,
    last: usize,
    /// Column d is the unit vector d.
    identity: bool,
}

impl<'a> Tangent<'a> {
    /// Of φ at a node.
    pub fn position(model: &Model, point: &PointJet, node: &'a LinearNode) -> Self {
        Self::matrix(node, &point.jacobian, !model.space.is_warped())
    }

    /// Of the orientation of the base.
    pub fn turn(model: &Model, base: &BaseNode, node: &'a LinearNode) -> Self {
        let first = if model.space.is_warped() { 0 } else { 3 };
        Self { node, columns: base.turn.first, first, last: 6, identity: false }
    }

    /// Of a force J f̄ with its own variables.
    pub fn force(model: &Model, contact: &FootNode, node: &'a LinearNode) -> Self {
        Self::matrix(node, &contact.point.jacobian, !model.space.is_warped())
    }

    /// Of a force J f̄ with its foothold; empty where J is constant.
    pub fn force_by_foothold(
        model: &Model,
        contact: &FootNode,
        node: &'a LinearNode,
        warped: &Vector3<f64>,
    ) -> Self {
        let mut columns = [Vector3::zeros(); 6];
        for d in 0..3 {
            columns[d] = contact.point.first[d] * warped;
        }
        Self { node, columns, first: 0, last: if model.space.is_warped() { 3 } else { 0 }, identity: false }
    }

    fn matrix(node: &'a LinearNode, matrix: &Matrix3<f64>, identity: bool) -> Self {
        let mut columns = [Vector3::zeros(); 6];
        for d in 0..3 {
            columns[d] = matrix.column(d).into();
        }
        Self { node, columns, first: 0, last: 3, identity }
    }

    /// Says the derivatives of a row that changes by `by` · (change of the vector).
    pub fn row(&self, row: usize, by: &Vector3<f64>, sink: &mut Sink) {
        for d in self.first..self.last {
            sink.node(row, self.node, d, by.dot(&self.columns[d]));
        }
    }

    /// Says the derivatives of a row that changes by `scale` times the change of component `c` of the vector.
    pub fn component(&self, row: usize, c: usize, scale: f64, sink: &mut Sink) {
        for d in self.first..self.last {
            if !self.identity || c == d {
                sink.node(row, self.node, d, scale * self.columns[d][c]);
            }
        }
    }

    /// Says the second derivatives of the bilinear form aᵀ B b in the changes a of this vector and b of another.
    pub fn cross(&self, form: &Matrix3<f64>, other: &Tangent, sink: &mut Sink) {
        for d in self.first..self.last {
            let left = form.tr_mul(&self.columns[d]);
            for e in other.first..other.last {
                sink.pair((self.node, d), (other.node, e), left.dot(&other.columns[e]));
            }
        }
    }

    /// Says the second derivatives of the quadratic form ½ aᵀ Q a in the change a of this vector, Q symmetric.
    pub fn quadratic(&self, form: &Matrix3<f64>, sink: &mut Sink) {
        for d in self.first..self.last {
            let left = form * self.columns[d];
            for e in self.first..=d {
                sink.own(self.node, d, e, left.dot(&self.columns[e]));
            }
        }
    }
}
