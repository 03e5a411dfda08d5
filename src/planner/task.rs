//! What is to be planned.

use std::sync::Arc;

use super::base_path::BasePath;
use super::guess;
use super::legs;
use super::problem::{Choice, GaitProblem};
use super::start;
use super::steps::Steps;
use crate::Result;
use crate::nlp::{Model, Tighter};
use crate::robot::Robot;
use crate::scenario::{GivenMotion, Scenario};
use crate::terrain::Surfaces;
use crate::trajectory::Spaces;
use crate::warp::WarpMap;

/// What is to be planned.
#[derive(Clone, Copy)]
pub struct Task<'a> {
    /// The scenario.
    pub scenario: &'a Scenario,
    /// Its robot.
    pub robot: &'a Robot,
    /// When the feet step, and where.
    pub steps: &'a Steps,
    /// Its ground.
    pub surfaces: &'a Surfaces,
    /// A motion to start from, where the scenario gives one.
    pub guess: Option<&'a GivenMotion>,
    /// By how much limits are tighter than the scenario's.
    pub tighter: Tighter,
    /// The map over the posture surface, for all formulations but the direct one.
    pub map: Option<&'a WarpMap>,
}

impl Task<'_> {
    /// The model over the whole terrain.
    pub(super) fn model(&self) -> Result<Model> {
        let map = self.map.map(|map| Arc::new(map.clone()));
        let spaces = Spaces::of(self.scenario.formulation(), map)?;
        let Self { scenario, robot, steps, surfaces, .. } = *self;
        let model = Model::new(scenario, robot, &steps.gait, surfaces.clone(), spaces);
        self.completed(Model { patches: steps.patches.clone(), ..model })
    }

    /// The model with the given state at the start, and with the times at which the guess passes the way-points.
    pub(super) fn completed(&self, mut model: Model) -> Result<Model> {
        start::set(self.scenario, &mut model)?;
        model.tighter = self.tighter;
        model.visits = BasePath::new(self.scenario, &model)?.visits(self.scenario);
        Ok(model)
    }

    /// The NLP at its guess, for checks of its derivatives and for timing.
    ///
    /// # Errors
    /// Those of the guess.
    pub fn problem(&self) -> Result<GaitProblem> {
        let mut model = self.model()?;
        let x = guess::guess(self.scenario, &model, self.guess)?;
        model.leg_terms = legs::terms(&model, &x, self.scenario.physics.law).unwrap_or_default();
        Ok(GaitProblem::new(self.scenario, model, x, Choice { with_costs: true, exact_hessian: true }))
    }
}
