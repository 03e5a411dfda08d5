//! The one place where the problem is composed: variables with bounds, constraint blocks, costs, and their sparse derivatives.

use crate::constraints::base_clearance::BaseClearance;
use crate::constraints::closure::closure;
use crate::constraints::durations::Durations;
use crate::constraints::dynamics::Dynamics;
use crate::constraints::feet_at_start::feet_at_start;
use crate::constraints::fixed_foothold::fixed_footholds;
use crate::constraints::foothold_patch::FootholdPatch;
use crate::constraints::foothold_slope::FootholdSlope;
use crate::constraints::friction::Friction;
use crate::constraints::friction_conformal::FrictionConformal;
use crate::constraints::goal::{goal, way_points};
use crate::constraints::joint_speed::JointSpeed;
use crate::constraints::joint_torque::JointTorque;
use crate::constraints::keep_out::OutOfPolygons;
use crate::constraints::knee_clearance::KneeClearance;
use crate::constraints::newton_euler::NewtonEuler;
use crate::constraints::normal_force::NormalForce;
use crate::constraints::posture::posture;
use crate::constraints::rails::Rails;
use crate::constraints::reach::Reach;
use crate::constraints::stance::OnGround;
use crate::constraints::swing::SwingClearance;
use crate::costs::base_acceleration::BaseAcceleration;
use crate::costs::force_rate::ForceRate;
use crate::costs::force_share::ForceShare;
use crate::costs::posture::Posture;
use crate::costs::swing_acceleration::SwingAcceleration;
use crate::ipopt::{Multipliers, NlpProblem};
use crate::scenario::{Cone, Law, PostureSpec, Scenario};
use crate::trajectory::base::RATES;
use crate::trajectory::variables::FootVariables;

use std::cell::Cell;
use std::rc::Rc;
use std::sync::Arc;

use super::bounds::{given_rows, variable_bounds};
use super::leg_update::{Change, LegUpdate};
use super::threads::ThreadSplit;
use crate::nlp::curvature::NodeCurvature;
use crate::nlp::model::GRAVITY;
use crate::nlp::sink::{Gradient, Pattern, Sink};
use crate::nlp::{Constraint, Cost, LegTerms, Model, State};

/// The objective is this times the scenario's costs: Ipopt's tests of optimality are absolute, and with an objective of the
/// order of one a solve takes a third of the iterations (rippled, medium: 25 instead of 65).
const COST_SCALE: f64 = 1e3;
/// Weight of the swings' acceleration, relative to that of the base's.
const SWING_WEIGHT: f64 = 1e-3;
/// The same where swings are higher and longer, as over ground with edges. Joints and controller must follow them, and massless legs
/// leave out the forces that they take. More than this keeps swings so close to the edges that worlds that differ make feet touch them.
const HIGH_SWING_WEIGHT: f64 = 1.5;
/// Elsewhere, swings are high from this clearance on, m, for a robot of ANYmal's size.
const HIGH_SWING: f64 = 0.1;
/// Weight of the posture, relative to that of the base's acceleration, s⁻⁴.
const POSTURE_WEIGHT: f64 = 100.0;
/// Weight of how standing feet share the load, relative to that of the forces' rate, in g over the standing height: the square of
/// the rate at which a standing robot of that height falls over.
const FORCE_SHARE_WEIGHT: f64 = 0.5;
/// What the second derivatives get on the diagonal once the cost has settled. It leaves directions alone in which the cost hardly changes:
/// steps along them, of a tenth of a unit, kept the violation from converging. 0.1 to 10 take as many iterations; more ends at larger costs.
const DAMPING: f64 = 0.1;

/// The nonlinear program min f(x) s.t. lower ≤ g(x) ≤ upper: Eq. 1 in the direct formulation, Eq. 7 in the warped one.
pub struct GaitProblem {
    /// What stays the same.
    pub model: Arc<Model>,
    /// The nodes at the last x.
    pub state: State,
    blocks: Vec<Box<dyn Constraint>>,
    offsets: Vec<usize>,
    costs: Vec<Box<dyn Cost>>,
    jacobian: Pattern,
    jacobian_split: ThreadSplit,
    hessian: Option<LagrangianHessian>,
    /// The last x, and whether the second derivatives of the nodes were evaluated there.
    evaluated: Vec<f64>,
    curved: bool,
    initial: Vec<f64>,
    /// Updates the terms of the legs' mass during a solve.
    pub leg_update: Option<LegUpdate>,
    /// Whether the cost has settled (`planner/stopping.rs`): hardly more than feasibility is left to gain.
    pub settled: Rc<Cell<bool>>,
    /// To start from, if there are any.
    pub multipliers: Option<Multipliers>,
    /// Rows that a given start leaves no variable of.
    given_rows: Vec<usize>,
    lower: Vec<f64>,
    upper: Vec<f64>,
}

/// What to compose.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct Choice {
    /// With the costs of the scenario.
    pub with_costs: bool,
    /// With second derivatives.
    pub exact_hessian: bool,
}

impl GaitProblem {
    /// Composes the problem of a scenario, to be started from `initial`.
    pub fn new(scenario: &Scenario, model: Model, initial: Vec<f64>, choice: Choice) -> Self {
        let (motion, contact) = (&scenario.motion, &scenario.contact);
        let friction = (1.0 - contact.friction_margin) * contact.friction;
        let intervals = model.layout.intervals;
        let mut blocks: Vec<Box<dyn Constraint>> = vec![
            match scenario.physics.law {
                Law::PcdmBackward => Box::new(Dynamics::backward(intervals)),
                Law::Pcdm if model.cycle.is_some() => Box::new(Dynamics::cyclic(&model)),
                Law::Pcdm => Box::new(Dynamics::centered(intervals)),
                Law::NewtonEuler => Box::new(NewtonEuler::new(&model)),
            },
            Box::new(Reach::new(&model, motion.swing_clearance)),
            match contact.cone {
                Cone::Exact => Box::new(Friction::new(&model, friction)),
                Cone::Conformal => Box::new(FrictionConformal::new(&model, friction)),
            },
            Box::new(NormalForce::new(&model, motion.force_limit, motion.pull_limit)),
            Box::new(OnGround::new(&model)),
            Box::new(SwingClearance::new(&model, motion.swing_clearance + model.tighter.swing_clearance)),
            Box::new(BaseClearance::new(&model, motion.base_clearance + model.tighter.base_clearance)),
            Box::new(goal(&model, scenario)),
        ];
        if let Some(cycle) = &model.cycle {
            blocks.push(Box::new(closure(&model, cycle)));
        }
        if let Some(start) =
            model.start.as_ref().filter(|_| model.layout.feet.iter().any(FootVariables::starts_in_air))
        {
            blocks.push(Box::new(feet_at_start(&model, start)));
        }
        if scenario.posture != PostureSpec::default() {
            blocks.push(Box::new(posture(&model, &scenario.posture)));
        }
        if let Some(keep_out) = &model.surfaces.keep_out {
            blocks.push(Box::new(OutOfPolygons::new(&model, keep_out)));
        }
        if !model.fixed.is_empty() {
            blocks.push(Box::new(fixed_footholds(&model)));
        }
        if !model.visits.is_empty() {
            blocks.push(Box::new(way_points(&model)));
        }
        if model.surfaces.have_edges() {
            blocks.push(Box::new(FootholdPatch::new(&model)));
        } else if let Some(max_slope) = contact.max_slope {
            blocks.push(Box::new(FootholdSlope::new(&model, max_slope, contact.edge_margin)));
        }
        if model.legs.iter().any(Option::is_some) {
            blocks.push(Box::new(JointSpeed::new(&model)));
            blocks.push(Box::new(JointTorque::new(&model)));
            blocks.push(Box::new(KneeClearance::new(&model)));
        }
        if !model.sagittal.is_empty() {
            blocks.push(Box::new(Rails::new(&model)));
        }
        if model.layout.has_switches() {
            blocks.push(Box::new(Durations::new(&model, scenario.gait.duration_bounds)));
        }
        let [base, force] = motion.smoothness.map(|weight| COST_SCALE * weight);
        let mut costs: Vec<Box<dyn Cost>> = Vec::new();
        if choice.with_costs && base > 0.0 {
            costs.push(Box::new(BaseAcceleration::new(&model, base)));
            let high = model.surfaces.have_edges() || motion.swing_clearance > model.size * HIGH_SWING;
            let swing = if high { HIGH_SWING_WEIGHT } else { SWING_WEIGHT };
            costs.push(Box::new(SwingAcceleration::new(&model, swing * base)));
            costs.push(Box::new(Posture::new(&model, POSTURE_WEIGHT * base)));
        }
        if choice.with_costs && force > 0.0 {
            costs.push(Box::new(ForceRate::new(&model, force)));
            let share = FORCE_SHARE_WEIGHT * GRAVITY / model.standing_height;
            costs.push(Box::new(ForceShare::new(&model, share * force)));
        }
        Self::compose(model, blocks, costs, initial, choice.exact_hessian)
    }

    /// A problem of given blocks.
    pub fn compose(
        model: Model,
        blocks: Vec<Box<dyn Constraint>>,
        costs: Vec<Box<dyn Cost>>,
        initial: Vec<f64>,
        exact_hessian: bool,
    ) -> Self {
        let mut offsets = vec![0];
        for block in &blocks {
            offsets.push(offsets[offsets.len() - 1] + block.rows());
        }
        let mut state = State::new(&model);
        state.update(&model, &initial, exact_hessian);
        let jacobian = Pattern::record_parts(blocks.len(), |part, sink| {
            blocks[part].jacobian(&model, &state, offsets[part], sink);
        });
        let hessian = exact_hessian.then(|| {
            LagrangianHessian::new(&Terms {
                model: &model,
                state: &state,
                blocks: &blocks,
                offsets: &offsets,
                costs: &costs,
                x: &initial,
                factor: 1.0,
                multipliers: &vec![1.0; offsets[blocks.len()]],
            })
        });
        let (lower, upper) = variable_bounds(&model, &initial);
        let given_rows = given_rows(&model, &jacobian, &lower, &upper, offsets[blocks.len()]);
        Self {
            given_rows,
            evaluated: initial.clone(),
            curved: exact_hessian,
            jacobian_split: ThreadSplit::new(&jacobian, 0..blocks.len(), model.threads),
            model: Arc::new(model),
            state,
            blocks,
            offsets,
            costs,
            jacobian,
            hessian,
            initial,
            leg_update: None,
            settled: Rc::default(),
            multipliers: None,
            lower,
            upper,
        }
    }

    /// The constraint blocks with the number of their first row.
    pub fn blocks(&self) -> impl Iterator<Item = (&dyn Constraint, usize)> {
        self.blocks.iter().map(|b| &**b as &dyn Constraint).zip(self.offsets.iter().copied())
    }

    /// The numbers of variables, constraints and entries of the Jacobian and the Hessian.
    pub fn size(&self) -> [usize; 4] {
        [
            self.num_variables(),
            self.num_constraints(),
            self.jacobian.len(),
            self.hessian.as_ref().map_or(0, |h| h.pattern.len()),
        ]
    }

    /// The costs.
    pub fn costs(&self) -> impl Iterator<Item = &dyn Cost> {
        self.costs.iter().map(|c| &**c as &dyn Cost)
    }

    /// Evaluates the nodes at x, unless they already are.
    pub fn update(&mut self, x: &[f64], curved: bool) {
        if (curved && !self.curved) || self.evaluated != x {
            if let Some(terms) =
                self.leg_update.as_mut().filter(|_| self.evaluated != x).and_then(LegUpdate::take)
            {
                Arc::make_mut(&mut self.model).leg_terms = terms;
            }
            self.state.update(&self.model, x, curved);
            self.evaluated.copy_from_slice(x);
            self.curved = curved;
        }
    }

    /// By how much the torques that the legs' mass adds to Euler's law at x differ from those of other terms.
    pub fn leg_torque_change(&mut self, x: &[f64], other: &LegTerms) -> Change {
        self.update(x, false);
        Change::between(&self.model, &self.state, other)
    }

    /// Name of a variable, for messages.
    pub fn variable_name(&self, v: usize) -> String {
        let layout = &self.model.layout;
        let axis = |d: usize| ["x", "y", "z", "roll", "pitch", "yaw"][d];
        let spline = &layout.base_spline;
        if v < 6 * spline.blocks() {
            return format!("base control point {} {}", v / 6, axis(v % 6));
        }
        let within = |first: &usize, count: usize| (*first..*first + count).contains(&v);
        for (rates, end) in [(spline.start, "start"), (spline.end, "end")] {
            if let Some(first) = rates.filter(|first| within(first, RATES)) {
                let what = if v - first < 6 { "velocity" } else { "acceleration" };
                return format!("base {what} at the {end} {}", axis((v - first) % 6));
            }
        }
        for (name, foot) in self.model.foot_names.iter().zip(&layout.feet) {
            for (j, stance) in foot.stances.iter().enumerate() {
                if (0..3).any(|d| stance.foothold.first() + d == v) {
                    return format!("{name} foothold {j} {}", axis(v - stance.foothold.first()));
                }
                for (k, force) in stance.free_forces() {
                    if let Some(&(first, _)) = force.terms.iter().find(|t| (t.0..t.0 + 3).contains(&v)) {
                        return format!(
                            "{name} force near {:.3} s {}",
                            k as f64 * layout.time_step,
                            axis(v - first)
                        );
                    }
                }
            }
            for (j, swing) in foot.swings.iter().enumerate() {
                if (swing.control_points..swing.control_points + 3 * layout.swing_shape.free()).contains(&v) {
                    return format!("{name} swing {j} control point {}", (v - swing.control_points) / 3);
                }
                match swing.switches {
                    Some(lift_off) if v == lift_off => return format!("{name} lift-off {j}"),
                    Some(lift_off) if v == lift_off + 1 => return format!("{name} touch-down {j}"),
                    _ => {}
                }
            }
        }
        format!("variable {v}")
    }
}

/// The terms of the Lagrangian: the blocks' rows times their multipliers, then the costs times a factor.
struct Terms<'a> {
    model: &'a Model,
    state: &'a State,
    blocks: &'a [Box<dyn Constraint>],
    offsets: &'a [usize],
    costs: &'a [Box<dyn Cost>],
    x: &'a [f64],
    factor: f64,
    multipliers: &'a [f64],
}

impl Terms<'_> {
    fn hessian(&self, term: usize, curvature: &mut NodeCurvature, sink: &mut Sink) {
        let Self { model, state, .. } = self;
        match self.blocks.get(term) {
            Some(block) => {
                let multipliers = &self.multipliers[self.offsets[term]..self.offsets[term + 1]];
                block.hessian(model, state, multipliers, curvature, sink);
            }
            None => {
                let cost = &self.costs[term - self.blocks.len()];
                cost.hessian(model, state, self.x, self.factor, curvature, sink);
            }
        }
    }
}

/// Adds [`DAMPING`] to the diagonal.
fn damp(variables: usize, sink: &mut Sink) {
    (0..variables).for_each(|v| sink.add(v, v, DAMPING));
}

/// The Hessian of the Lagrangian and its thread split: first all terms, while each thread accumulates the nodes' weights on its
/// own; then, as further parts of the pattern, the nodes. The last part is the damping.
struct LagrangianHessian {
    pattern: Pattern,
    terms: ThreadSplit,
    nodes: ThreadSplit,
    curvatures: [NodeCurvature; 2],
}

impl LagrangianHessian {
    fn new(all: &Terms) -> Self {
        let mut curvature = NodeCurvature::new(all.state);
        let terms = all.blocks.len() + all.costs.len();
        let parts = terms + NodeCurvature::PARTS;
        let pattern = Pattern::record_parts(parts + 1, |part, sink| match part.checked_sub(terms) {
            None => all.hessian(part, &mut curvature, sink),
            Some(NodeCurvature::PARTS) => damp(all.x.len(), sink),
            Some(node) => curvature.scatter(node, all.model, all.state, sink),
        });
        let threads = all.model.threads;
        Self {
            terms: ThreadSplit::new(&pattern, 0..terms, threads),
            nodes: ThreadSplit::new(&pattern, terms..parts, threads),
            pattern,
            curvatures: [curvature.clone(), curvature],
        }
    }

    fn values(&mut self, all: &Terms, settled: bool, out: &mut [f64]) {
        let Self { pattern, terms, nodes, curvatures: [here, there] } = self;
        out.fill(0.0);
        here.clear();
        if all.model.threads > 1 {
            there.clear();
        }
        terms.add(
            pattern,
            out,
            |term, sink| all.hessian(term, here, sink),
            |term, sink| all.hessian(term, there, sink),
        );
        if all.model.threads > 1 {
            here.merge(there);
        }
        let first = all.blocks.len() + all.costs.len();
        let scatter = |part: usize, sink: &mut Sink| here.scatter(part - first, all.model, all.state, sink);
        nodes.add(pattern, out, scatter, scatter);
        if settled {
            pattern.add(&[first + NodeCurvature::PARTS], out, |_, sink| damp(all.x.len(), sink));
        }
    }
}

impl NlpProblem for GaitProblem {
    fn num_variables(&self) -> usize {
        self.model.layout.variables
    }

    fn num_constraints(&self) -> usize {
        self.offsets[self.blocks.len()]
    }

    fn variable_bounds(&self, lower: &mut [f64], upper: &mut [f64]) {
        lower.copy_from_slice(&self.lower);
        upper.copy_from_slice(&self.upper);
    }

    fn constraint_bounds(&self, lower: &mut [f64], upper: &mut [f64]) {
        for (block, &first) in self.blocks.iter().zip(&self.offsets) {
            let rows = first..first + block.rows();
            block.bounds(&self.model, &mut lower[rows.clone()], &mut upper[rows]);
        }
        for &row in &self.given_rows {
            (lower[row], upper[row]) = (f64::NEG_INFINITY, f64::INFINITY);
        }
    }

    fn initial_point(&self, x: &mut [f64]) {
        x.copy_from_slice(&self.initial);
    }

    fn initial_multipliers(&self) -> Option<Multipliers> {
        self.multipliers.clone()
    }

    fn objective(&mut self, x: &[f64], _new_x: bool) -> f64 {
        self.update(x, false);
        self.costs.iter().map(|cost| cost.value(&self.model, &self.state, x)).sum()
    }

    fn gradient(&mut self, x: &[f64], _new_x: bool, out: &mut [f64]) {
        self.update(x, false);
        out.fill(0.0);
        for cost in &self.costs {
            cost.gradient(&self.model, &self.state, x, &mut Gradient(out));
        }
    }

    fn constraints(&mut self, x: &[f64], _new_x: bool, out: &mut [f64]) {
        self.update(x, false);
        for (block, &first) in self.blocks.iter().zip(&self.offsets) {
            block.values(&self.model, &self.state, &mut out[first..first + block.rows()]);
        }
    }

    fn jacobian_structure(&self) -> (&[i32], &[i32]) {
        (&self.jacobian.rows, &self.jacobian.columns)
    }

    fn jacobian_values(&mut self, x: &[f64], _new_x: bool, out: &mut [f64]) {
        self.update(x, false);
        let (model, state, blocks, offsets) = (&self.model, &self.state, &self.blocks, &self.offsets);
        let scatter = |part: usize, sink: &mut Sink| blocks[part].jacobian(model, state, offsets[part], sink);
        out.fill(0.0);
        self.jacobian_split.add(&self.jacobian, out, scatter, scatter);
    }

    fn hessian_structure(&self) -> Option<(&[i32], &[i32])> {
        self.hessian.as_ref().map(|h| (&h.pattern.rows[..], &h.pattern.columns[..]))
    }

    fn hessian_values(
        &mut self,
        x: &[f64],
        _new_x: bool,
        objective_factor: f64,
        multipliers: &[f64],
        _new_multipliers: bool,
        out: &mut [f64],
    ) {
        self.update(x, true);
        // Ipopt asks for second derivatives once at every iterate, and in its restoration phase without the objective.
        if let Some(leg_update) = self.leg_update.as_mut().filter(|_| objective_factor != 0.0) {
            leg_update.observe(&self.model, &self.state, x, self.settled.get());
        }
        if let Some(hessian) = &mut self.hessian {
            let terms = Terms {
                model: &self.model,
                state: &self.state,
                blocks: &self.blocks,
                offsets: &self.offsets,
                costs: &self.costs,
                x,
                factor: objective_factor,
                multipliers,
            };
            hessian.values(&terms, self.settled.get(), out);
        }
    }
}
