//! The ambient nodes at the present x: evaluated once for each new x, read by every constraint and cost.

use nalgebra::{Matrix3, Vector3};

use super::model::Model;
use super::sink::Sink;
use crate::heightfield::HeightJet;
use crate::trajectory::layout::Phase;
use crate::trajectory::rotation::{RotationJet, skew_part};
use crate::trajectory::space::PointJet;
use crate::trajectory::spline::SwingBasis;
use crate::trajectory::switches::TimedNode;
use crate::trajectory::{Instant, Layout, LinearNode};
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

/// A point of a swing's path, wherever in time that is.
#[derive(Clone, Debug)]
pub struct SwingPoint {
    /// Which swing.
    pub swing: usize,
    /// Share of the swing that lies before it.
    pub u: f64,
    /// It is the middle, where the swing is to be highest.
    pub apex: bool,
    /// Its variables.
    pub node: LinearNode,
}

/// All nodes at one x.
#[derive(Clone, Debug)]
pub struct State {
    /// By sample.
    pub base: Vec<BaseNode>,
    /// Half way from each sample to the next; empty where the geometry of no leg is known.
    pub base_between: Vec<BaseNode>,
    /// By sample, (p̄, θ̄) and its first and second derivatives in time.
    pub base_motion: Vec<[[f64; 6]; 3]>,
    /// `contacts[foot][stance]`.
    pub contacts: Vec<Vec<FootNode>>,
    /// `swings[foot][k]`; stale where the foot stands.
    pub swings: Vec<Vec<FootNode>>,
    /// `swings_between[foot][k]`: half way from each sample to the next; empty where the leg's geometry is not known, stale
    /// where the foot stands.
    pub swings_between: Vec<Vec<FootNode>>,
    /// `points[foot]`: the middle of each swing, and where switches are variables more points of its path.
    pub points: Vec<Vec<FootNode>>,
    /// Which these are.
    pub swing_points: Vec<Vec<SwingPoint>>,
    /// `warped_forces[foot][k]`, f̄ in m g.
    pub warped_forces: Vec<Vec<Vector3<f64>>>,
    /// `forces[foot][k]`, f = J f̄ in m g.
    pub forces: Vec<Vec<Vector3<f64>>>,
    /// `warped_full_forces[foot][k]`, ḡ in m g: the variables that f̄ is a share of, see
    /// [`crate::trajectory::switches`]. The same as f̄ where durations are given.
    pub warped_full_forces: Vec<Vec<Vector3<f64>>>,
    /// `full_forces[foot][k]`, J ḡ in m g.
    pub full_forces: Vec<Vec<Vector3<f64>>>,
    /// `switches[foot][swing]`: lift-off and touch-down, in samples.
    pub switches: Vec<Vec<[f64; 2]>>,
    foot_nodes: Vec<Vec<TimedNode>>,
    foot_nodes_between: Vec<Vec<TimedNode>>,
    force_nodes: Vec<Vec<Option<TimedNode>>>,
    basis: SwingBasis,
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
        let between = |i: usize| 0..if model.legs[i].is_some() { layout.intervals } else { 0 };
        let swing_points: Vec<Vec<SwingPoint>> = (0..feet).map(|i| swing_points(layout, i)).collect();
        Self {
            base: vec![BaseNode { point, turn }; samples],
            base_between: vec![
                BaseNode { point, turn };
                (0..feet).map(|i| between(i).end).max().unwrap_or(0)
            ],
            base_motion: vec![[[0.0; 6]; 3]; samples],
            contacts: layout.feet.iter().map(|f| vec![foot; f.stances.len()]).collect(),
            swings: vec![vec![foot; samples]; feet],
            swings_between: (0..feet).map(|i| between(i).map(|_| foot).collect()).collect(),
            points: swing_points.iter().map(|points| vec![foot; points.len()]).collect(),
            swing_points,
            warped_forces: vec![vec![Vector3::zeros(); samples]; feet],
            forces: vec![vec![Vector3::zeros(); samples]; feet],
            warped_full_forces: vec![vec![Vector3::zeros(); samples]; feet],
            full_forces: vec![vec![Vector3::zeros(); samples]; feet],
            switches: layout.feet.iter().map(|f| vec![[0.0; 2]; f.swings.len()]).collect(),
            foot_nodes: (0..feet)
                .map(|i| (0..samples).map(|k| layout.timed_foot(i, Instant::Sample(k))).collect())
                .collect(),
            foot_nodes_between: (0..feet)
                .map(|i| between(i).map(|k| layout.timed_foot(i, Instant::Between(k))).collect())
                .collect(),
            force_nodes: (0..feet)
                .map(|i| (0..samples).map(|k| layout.timed_force(i, k)).collect())
                .collect(),
            basis: SwingBasis::new(),
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
        for (between, node) in self.base_between.iter_mut().zip(&layout.base_between) {
            let (point, turn) = model.space.pose(&node.value::<6>(x), curved);
            *between = BaseNode { point, turn };
        }
        for (i, foot) in layout.feet.iter().enumerate() {
            for (swing, times) in foot.swings.iter().zip(&mut self.switches[i]) {
                *times = swing.times(x);
            }
            for (stance, contact) in foot.stances.iter().zip(&mut self.contacts[i]) {
                *contact = foot_at(&stance.foothold, order);
                for (k, full) in stance.free_forces() {
                    let full = Vector3::from(full.value::<3>(x));
                    self.warped_full_forces[i][k] = full;
                    self.full_forces[i][k] = contact.point.jacobian * full;
                    if let Some(timed) = &mut self.force_nodes[i][k] {
                        timed.update(&self.basis, x);
                        let share = timed.share();
                        self.warped_forces[i][k] = full * share;
                        self.forces[i][k] = self.full_forces[i][k] * share;
                    }
                }
            }
            let order = if curved { Order::Second } else { Order::First };
            for (k, timed) in self.foot_nodes[i].iter_mut().enumerate() {
                if let Phase::Swing(_) = layout.phase[i][k] {
                    timed.update(&self.basis, x);
                    self.swings[i][k] = foot_at(&timed.node, order);
                }
            }
            for (k, timed) in self.foot_nodes_between[i].iter_mut().enumerate() {
                if let Phase::Swing(_) = layout.phase_at(i, Instant::Between(k)) {
                    timed.update(&self.basis, x);
                    self.swings_between[i][k] = foot_at(&timed.node, order);
                }
            }
            for (at, point) in self.swing_points[i].iter().zip(&mut self.points[i]) {
                *point = foot_at(&at.node, order);
            }
        }
    }

    /// The base at an instant.
    pub fn base_at(&self, instant: Instant) -> &BaseNode {
        match instant {
            Instant::Sample(k) => &self.base[k],
            Instant::Between(k) => &self.base_between[k],
        }
    }

    /// A foot at an instant in terms of the variables, at the present x.
    pub fn foot_node(&self, foot: usize, instant: impl Into<Instant>) -> &LinearNode {
        match instant.into() {
            Instant::Sample(k) => &self.foot_nodes[foot][k].node,
            Instant::Between(k) => &self.foot_nodes_between[foot][k].node,
        }
    }

    /// The force f̄ of a foot at a sample in terms of the variables, at the present x, if it may bear something there, and its
    /// stance.
    pub fn force_node<'a>(&'a self, model: &Model, foot: usize, k: usize) -> Option<(usize, &'a LinearNode)> {
        let (stance, _) = model.layout.force(foot, k)?;
        self.force_nodes[foot][k].as_ref().map(|timed| (stance, &timed.node))
    }

    /// A foot at an instant, in stance or in swing.
    pub fn foot(&self, model: &Model, foot: usize, instant: impl Into<Instant>) -> &FootNode {
        let instant = instant.into();
        match (model.layout.phase_at(foot, instant), instant) {
            (Phase::Stance(j), _) => &self.contacts[foot][j],
            (Phase::Swing(_), Instant::Sample(k)) => &self.swings[foot][k],
            (Phase::Swing(_), Instant::Between(k)) => &self.swings_between[foot][k],
        }
    }
}

/// The middle of each swing; where its switches are variables, also points where the samples would be at nominal times.
pub(crate) fn swing_points(layout: &Layout, foot: usize) -> Vec<SwingPoint> {
    let mut points = Vec::new();
    for (swing, variables) in layout.feet[foot].swings.iter().enumerate() {
        let mut add = |u: f64, apex: bool| {
            points.push(SwingPoint { swing, u, apex, node: layout.swing_node(foot, swing, u, 0) });
        };
        add(0.5, true);
        if variables.switches.is_some() {
            let samples = (variables.swing.end - variables.swing.start) as usize;
            (1..samples).for_each(|k| add(k as f64 / samples as f64, false));
        }
    }
    points
}

/// ∂L/∂(ambient quantities) of a Lagrangian term: the weights of the nodes' own second derivatives.
#[derive(Clone, Debug)]
pub struct Curvature {
    /// ∂L/∂p by sample.
    pub base_position: Vec<Vector3<f64>>,
    /// ∂L/∂R by sample.
    pub base_rotation: Vec<Matrix3<f64>>,
    /// ∂L/∂p and ∂L/∂R half way from each sample to the next, as in [`State::base_between`].
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

impl Curvature {
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

    /// Says Σ ∂L/∂(node) · ∂²(node)/∂(variables)² to the sink, after all constraints have added their weights.
    pub fn say(&self, model: &Model, state: &State, sink: &mut Sink) {
        let layout = &model.layout;
        for (k, base) in state.base.iter().enumerate() {
            say_base(model, base, &layout.base[k], &self.base_position[k], &self.base_rotation[k], sink);
        }
        for (k, base) in state.base_between.iter().enumerate() {
            let (position, rotation) = &self.base_between[k];
            say_base(model, base, &layout.base_between[k], position, rotation, sink);
        }
        self.say_switches(model, state, sink);
        if model.space.is_warped() {
            self.say_feet(model, state, sink);
        }
    }

    /// The part of the feet and forces that is due to φ.
    fn say_feet(&self, model: &Model, state: &State, sink: &mut Sink) {
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
    fn say_switches(&self, model: &Model, state: &State, sink: &mut Sink) {
        let layout = &model.layout;
        for i in 0..layout.feet.len() {
            for (k, timed) in state.foot_nodes[i].iter().enumerate().filter(|(_, t)| t.is_timed()) {
                let weight = state.swings[i][k].point.jacobian.tr_mul(&self.swings[i][k]);
                say_timed(timed, &weight, sink);
            }
            let between = state.foot_nodes_between[i].iter().enumerate();
            for (k, timed) in between.filter(|(_, t)| t.is_timed()) {
                let jacobian = &state.swings_between[i][k].point.jacobian;
                say_timed(timed, &jacobian.tr_mul(&self.swings_between[i][k]), sink);
            }
            for (k, timed) in state.force_nodes[i].iter().enumerate() {
                let Some(timed) = timed.as_ref().filter(|t| t.is_timed()) else { continue };
                let Some((j, _)) = layout.force(i, k) else { continue };
                let jacobian = &state.contacts[i][j].point.jacobian;
                let weight = jacobian.tr_mul(&self.forces[i][k]) + self.warped_forces[i][k];
                say_timed(timed, &weight, sink);
            }
        }
    }
}

/// Says ∂L/∂p · ∂²p and ⟨∂L/∂R, ∂²R⟩ of the base.
fn say_base(
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
    let first = if model.space.is_warped() { 0 } else { 3 };
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

/// Says weight · ∂²y of a node y whose weights depend on switches.
fn say_timed(timed: &TimedNode, weight: &Vector3<f64>, sink: &mut Sink) {
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
