//! The ambient nodes at the present x: evaluated once for each new x, read by every constraint and cost.

use nalgebra::{Matrix3, Vector3};

use super::model::Model;
use crate::heightfield::HeightJet;
use crate::trajectory::layout::Phase;
use crate::trajectory::rotation::RotationJet;
use crate::trajectory::space::PointJet;
use crate::trajectory::spline::SwingBasis;
use crate::trajectory::switches::TimedNode;
use crate::trajectory::variables::SwingVariables;
use crate::trajectory::{Instant, LinearNode};
use crate::warp::Order;

/// Over ground with edges, the path of a swing is constrained at the ends of so many intervals.
const POINTS_OVER_EDGES: usize = 12;

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

/// A foot on or above the ground.
#[derive(Clone, Copy, Debug)]
pub struct FootNode {
    /// φ of its variables.
    pub point: PointJet,
    /// The ground under it.
    pub ground: HeightJet,
}

impl FootNode {
    /// Height above the ground, m, and its derivative with respect to the ambient position.
    pub fn gap(&self) -> (f64, Vector3<f64>) {
        (self.point.position.z - self.ground.h, Vector3::new(-self.ground.d1[0], -self.ground.d1[1], 1.0))
    }
}

/// A point of a swing's path, at whatever time the foot passes it.
#[derive(Clone, Debug)]
pub struct SwingPoint {
    /// Which swing.
    pub swing: usize,
    /// Fraction of the swing before it.
    pub u: f64,
    /// Whether it is the middle, where the swing must reach its apex.
    pub apex: bool,
    /// Its variables.
    pub node: LinearNode,
}

/// All nodes at one x.
#[derive(Clone, Debug)]
pub struct State {
    /// The variables.
    pub x: Vec<f64>,
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
    /// `swings_between[foot][k]`: halfway from each sample to the next; empty where the leg's geometry is not known, stale
    /// where the foot stands.
    pub swings_between: Vec<Vec<FootNode>>,
    /// `points[foot]`: the middle of each swing, and where switches are variables or the ground has edges more points of its path.
    pub points: Vec<Vec<FootNode>>,
    /// Which points these are.
    pub swing_points: Vec<Vec<SwingPoint>>,
    /// `warped_forces[foot][k]`, f̄ in m g.
    pub warped_forces: Vec<Vec<Vector3<f64>>>,
    /// `forces[foot][k]`, f = J f̄ in m g.
    pub forces: Vec<Vec<Vector3<f64>>>,
    /// `warped_full_forces[foot][k]`, ḡ in m g: the variables of f̄ = σ ḡ, see
    /// [`crate::trajectory::switches`]. The same as f̄ where durations are given.
    pub warped_full_forces: Vec<Vec<Vector3<f64>>>,
    /// `full_forces[foot][k]`, J ḡ in m g.
    pub full_forces: Vec<Vec<Vector3<f64>>>,
    /// `switches[foot][swing]`: lift-off and touch-down, in samples.
    pub switches: Vec<Vec<[f64; 2]>>,
    pub(super) foot_nodes: Vec<Vec<TimedNode>>,
    pub(super) foot_nodes_between: Vec<Vec<TimedNode>>,
    pub(super) force_nodes: Vec<Vec<Option<TimedNode>>>,
    basis: SwingBasis,
}

impl State {
    /// Allocates all nodes of a model.
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
        let swing_points: Vec<Vec<SwingPoint>> = (0..feet).map(|i| swing_points(model, i)).collect();
        Self {
            x: vec![0.0; layout.variables],
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
            basis: SwingBasis::new(layout.swing_shape),
        }
    }

    /// Evaluates all nodes at x; if `curved`, with what second derivatives of constraints need.
    pub fn update(&mut self, model: &Model, x: &[f64], curved: bool) {
        let layout = &model.layout;
        self.x.copy_from_slice(x);
        let order = if curved { Order::Third } else { Order::Second };
        let foot_at = |node: &LinearNode, order: Order| {
            let point = model.spaces.feet.jet(&Vector3::from(node.value::<3>(x)), order);
            FootNode { point, ground: model.surfaces.feet.jet(point.position.x, point.position.y) }
        };
        for (k, node) in layout.base.iter().enumerate() {
            let y = node.value::<6>(x);
            let (point, turn) = model.spaces.base.pose(&y, curved);
            self.base[k] = BaseNode { point, turn };
            self.base_motion[k] = [y, layout.base_rates[k][0].value(x), layout.base_rates[k][1].value(x)];
        }
        for (between, node) in self.base_between.iter_mut().zip(&layout.base_between) {
            let (point, turn) = model.spaces.base.pose(&node.value::<6>(x), curved);
            *between = BaseNode { point, turn };
        }
        for (i, foot) in layout.feet.iter().enumerate() {
            for (swing, times) in foot.swings.iter().zip(&mut self.switches[i]) {
                *times = swing.times(x);
            }
            for (j, (stance, contact)) in foot.stances.iter().zip(&mut self.contacts[i]).enumerate() {
                *contact = foot_at(&stance.foothold, order);
                if let Some(patch) = model.patch(i, j) {
                    contact.ground = patch.jet(contact.point.position.x, contact.point.position.y);
                }
                for (k, full) in stance.free_forces() {
                    let full = Vector3::from(full.value::<3>(x));
                    self.warped_full_forces[i][k] = full;
                    self.full_forces[i][k] = contact.point.jacobian * full;
                    if let Some(timed) = &mut self.force_nodes[i][k] {
                        timed.update(&self.basis, x);
                        let activation = timed.activation();
                        self.warped_forces[i][k] = full * activation;
                        self.forces[i][k] = self.full_forces[i][k] * activation;
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

    /// The force f̄ of a foot at a sample in terms of the variables, at the present x, if one may act there, and its stance.
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

/// Whether the clearance of a foot's swing is constrained at points of its path rather than at samples: where its switches are
/// variables, since the path does not depend on time; and where the ground has edges, which a foot can cut between samples.
pub(crate) fn has_points(model: &Model, swing: &SwingVariables) -> bool {
    swing.switches.is_some() || model.surfaces.have_edges()
}

/// The middle of each swing; where [`has_points`], also points where the samples would be at nominal times, and at least
/// [`POINTS_OVER_EDGES`] intervals where the ground has edges.
pub(crate) fn swing_points(model: &Model, foot: usize) -> Vec<SwingPoint> {
    let layout = &model.layout;
    let mut points = Vec::new();
    for (swing, variables) in layout.feet[foot].swings.iter().enumerate() {
        let mut add = |u: f64, apex: bool| {
            points.push(SwingPoint { swing, u, apex, node: layout.swing_node(foot, swing, u, 0) });
        };
        add(0.5, true);
        if has_points(model, variables) {
            let samples = (variables.swing.end - variables.swing.start) as usize;
            let least = if model.surfaces.have_edges() { POINTS_OVER_EDGES } else { 0 };
            let intervals = samples.max(least);
            (1..intervals)
                .filter(|k| 2 * k != intervals)
                .for_each(|k| add(k as f64 / intervals as f64, false));
        }
    }
    points
}
