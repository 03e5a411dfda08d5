//! The force of a foot at a sample of a stance, with derivatives: what friction, normal force and joint torque are functions of.

use nalgebra::Matrix3;

use super::model::Model;
use super::sink::Sink;
use super::state::State;
use super::tangent::Tangent;
use super::term::RowPlace;
use crate::trajectory::LinearNode;

/// A free force: which foot's, in which of its stances, at which sample.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct ForceSample {
    /// Index of the foot.
    pub foot: usize,
    /// Index among its stances.
    pub stance: usize,
    /// Sample.
    pub sample: usize,
}

impl ForceSample {
    /// Where rows on this force act.
    pub fn place(self) -> RowPlace {
        RowPlace { foot: Some(self.foot), sample: self.sample as f64 }
    }
}

/// All free forces of the feet for which `wanted` holds.
pub fn force_samples(model: &Model, wanted: impl Fn(usize) -> bool) -> Vec<ForceSample> {
    let mut samples = Vec::new();
    for (foot, variables) in model.layout.feet.iter().enumerate().filter(|(foot, _)| wanted(*foot)) {
        for (j, stance) in variables.stances.iter().enumerate() {
            let free = stance.free_forces();
            samples.extend(free.map(|(sample, _)| ForceSample { foot, stance: j, sample }));
        }
    }
    samples
}

/// The node of a force; where durations are optimized, of the full force.
pub fn force_node(model: &Model, at: ForceSample) -> &LinearNode {
    let stance = &model.layout.feet[at.foot].stances[at.stance];
    stance.force(at.sample).expect("a force sample is that of a free force")
}

/// How a force and its foothold change.
pub struct ForceTangents<'a> {
    /// The force with its own variables.
    pub force: Tangent<'a>,
    /// The force J f̄ with its foothold, through J.
    pub by_foothold: Tangent<'a>,
    /// The foothold.
    pub foothold: Tangent<'a>,
}

impl<'a> ForceTangents<'a> {
    /// At the present x.
    pub fn new(model: &'a Model, state: &State, at: ForceSample) -> Self {
        let contact = &state.contacts[at.foot][at.stance];
        let foothold = &model.layout.feet[at.foot].stances[at.stance].foothold;
        let warped = &state.warped_full_forces[at.foot][at.sample];
        Self {
            force: Tangent::force(model, contact, force_node(model, at)),
            by_foothold: Tangent::force_by_foothold(model, contact, foothold, warped),
            foothold: Tangent::foot(model, contact, foothold),
        }
    }

    /// Adds the second derivatives of a function of (f, p_i) with blocks ∂²/∂f², ∂²/∂f∂p and ∂²/∂p².
    pub fn add_blocks(
        &self,
        ff: Option<&Matrix3<f64>>,
        fp: &Matrix3<f64>,
        pp: &Matrix3<f64>,
        sink: &mut Sink,
    ) {
        let Self { force, by_foothold, foothold } = self;
        if let Some(ff) = ff {
            force.quadratic(ff, sink);
            by_foothold.quadratic(ff, sink);
            force.cross(ff, by_foothold, sink);
        }
        force.cross(fp, foothold, sink);
        by_foothold.cross(fp, foothold, sink);
        foothold.quadratic(pp, sink);
    }
}
