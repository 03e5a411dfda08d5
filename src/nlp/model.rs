//! What stays the same during a solve.

use nalgebra::{Matrix3, Vector3};

use super::cycle::Cycle;
use super::leg_terms::LegTerms;
use super::start::Start;
use super::tighter::Tighter;
use crate::leg::Leg;
use crate::leg::body::Body;
use crate::robot::{Box3, Foot, Robot};
use crate::scenario::{FootholdSpec, ForceSpec, Legs, Scenario, Stop};
use crate::terrain::{Patch, Surfaces};
use crate::trajectory::layout::KnotSpacing;
use crate::trajectory::spline::SwingShape;
use crate::trajectory::{Gait, Layout, Spaces};

/// m/s².
pub const GRAVITY: f64 = 9.81;

/// ε that rounds the tip of the friction cone, in m g; see [`crate::constraints::friction`].
pub const CONE_ROUNDING: f64 = 2e-3;

/// Least normal force of a standing foot that does not adhere, in m g, away from the switches.
pub const LEAST_NORMAL_FORCE: f64 = 0.02;

/// Points of the torso's underside at which its clearance is constrained, along x and y.
pub const UNDERSIDE: [usize; 2] = [5, 3];

/// A place that the base passes at a sample.
#[derive(Clone, Debug, PartialEq)]
pub struct Visit {
    /// When.
    pub sample: usize,
    /// Where.
    pub stop: Stop,
    /// How near, if the stop has no time, m.
    pub distance: f64,
}

/// Where a stance must be.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct FixedFoothold {
    /// i.
    pub foot: usize,
    /// j.
    pub stance: usize,
    /// x, y, m.
    pub position: [f64; 2],
}

/// The fixed footholds of a scenario; none where the gait has no such step.
pub fn fixed_footholds(scenario: &Scenario, robot: &Robot, gait: &Gait) -> Vec<Option<FixedFoothold>> {
    let find = |spec: &FootholdSpec| {
        let foot = robot.feet.iter().position(|foot| foot.name == spec.foot)?;
        let stances = gait.stances(foot);
        let stance = match (spec.step, spec.time) {
            (Some(step), _) => step,
            (None, Some(time)) => {
                let k = time / scenario.time_step;
                stances.iter().position(|stance| (stance.start..=stance.end).contains(&k))?
            }
            (None, None) => return None,
        };
        (stance < stances.len()).then_some(FixedFoothold { foot, stance, position: spec.position })
    };
    scenario.foothold.iter().map(find).collect()
}

/// The forces on the trunk at each sample.
fn applied(scenario: &Scenario, mass: f64, intervals: usize) -> Vec<Vec<[Vector3<f64>; 2]>> {
    if scenario.force.is_empty() {
        return Vec::new();
    }
    let at = |k: usize| {
        let fraction = |force: &ForceSpec| force.fraction(k as f64 * scenario.time_step, scenario.time_step);
        let acting = scenario.force.iter().filter(|force| fraction(force) > 0.0);
        let value = |force: &ForceSpec| {
            [Vector3::from(force.vector) * (fraction(force) / (mass * GRAVITY)), Vector3::from(force.point)]
        };
        acting.map(value).collect()
    };
    (0..=intervals).map(at).collect()
}

/// Robot, ground, space and layout. Units of the NLP: m, s, forces in m g, torques in m g · 1 m.
#[derive(Clone, Debug)]
pub struct Model {
    /// kg.
    pub mass: f64,
    /// Of the robot, in ANYmals.
    pub size: f64,
    /// S = ½ tr(I) 1 − I, kg m²: the second moment of the mass, ∫ρ x xᵀ.
    pub second_moment: Matrix3<f64>,
    /// Height of the center of mass above the feet at rest, m.
    pub standing_height: f64,
    /// By foot, base frame, m.
    pub nominal: Vec<Vector3<f64>>,
    /// By foot.
    pub reach: Vec<Box3>,
    /// By how much limits are tighter than by the scenario and the margins.
    pub tighter: Tighter,
    /// By foot, where the robot's file describes the leg.
    pub legs: Vec<Option<Leg>>,
    /// Trunk and links, where the legs have mass in this plan.
    pub body: Option<Body>,
    /// By foot, its radius, m, if it moves in a plane of the base, as those of legs of two joints do; empty where none does.
    pub sagittal: Vec<Option<f64>>,
    /// What their mass adds.
    pub leg_terms: LegTerms,
    /// By foot.
    pub foot_names: Vec<String>,
    /// By foot.
    pub adhesive: Vec<bool>,
    /// Points of the torso's underside, base frame, m.
    pub underside: Vec<Vector3<f64>>,
    /// The ground.
    pub surfaces: Surfaces,
    /// `patches[foot][stance]`: where each stance must be. Empty where feet may stand anywhere.
    pub patches: Vec<Vec<Patch>>,
    /// When the base is where on its way.
    pub visits: Vec<Visit>,
    /// Footholds whose place is given.
    pub fixed: Vec<FixedFoothold>,
    /// By sample, forces on the trunk, world frame, m g, and where they act, base frame as in `nominal`, m. Empty where there are none.
    pub applied: Vec<Vec<[Vector3<f64>; 2]>>,
    /// What is given of the state at the start, beside the place and the heading.
    pub start: Option<Start>,
    /// What the end of a cyclic motion is to its start; none for others.
    pub cycle: Option<Cycle>,
    /// Of the base at the end, m/s; none at rest.
    pub goal_velocity: Option<Vector3<f64>>,
    /// The spaces of the variables.
    pub spaces: Spaces,
    /// The variables.
    pub layout: Layout,
    /// Threads that evaluate derivatives, 1 or 2.
    pub threads: usize,
}

impl Model {
    /// The model of a scenario.
    pub fn new(scenario: &Scenario, robot: &Robot, gait: &Gait, surfaces: Surfaces, spaces: Spaces) -> Self {
        let foot_names: Vec<String> = robot.feet.iter().map(|f| f.name.clone()).collect();
        let adhesive_feet = &scenario.robot.adhesive_feet;
        let inertia = Matrix3::from_fn(|r, c| robot.inertia[r][c]);
        let along = |i: usize, count: usize| 2.0 * i as f64 / (count - 1) as f64 - 1.0;
        let (center, half) = (robot.torso.center, robot.torso.half_size);
        let underside = (0..UNDERSIDE[0])
            .flat_map(|i| {
                (0..UNDERSIDE[1]).map(move |j| {
                    Vector3::new(
                        center[0] + half[0] * along(i, UNDERSIDE[0]),
                        center[1] + half[1] * along(j, UNDERSIDE[1]),
                        center[2] - half[2],
                    )
                })
            })
            .collect();
        let body = if scenario.legs() == Legs::Massless { None } else { robot.body() };
        let swing_shape = if body.is_some() { SwingShape::Smooth } else { SwingShape::Light };
        Self {
            mass: robot.mass,
            size: robot.size(),
            second_moment: Matrix3::identity() * (0.5 * inertia.trace()) - inertia,
            standing_height: robot.standing_height(),
            nominal: robot.feet.iter().map(|f| Vector3::from(f.nominal)).collect(),
            reach: robot.feet.iter().map(|f| f.reach).collect(),
            tighter: Tighter::default(),
            legs: robot.feet.iter().map(Foot::leg).collect(),
            sagittal: robot.sagittal_radii(),
            body,
            leg_terms: LegTerms::default(),
            adhesive: foot_names.iter().map(|name| adhesive_feet.contains(name)).collect(),
            foot_names,
            underside,
            cycle: Cycle::of(scenario, &surfaces),
            surfaces,
            patches: Vec::new(),
            start: None,
            goal_velocity: None,
            visits: Vec::new(),
            fixed: fixed_footholds(scenario, robot, gait).into_iter().flatten().collect(),
            applied: applied(scenario, robot.mass, gait.intervals),
            spaces,
            threads: scenario.solver.threads,
            layout: Layout::new(
                gait,
                scenario.time_step,
                KnotSpacing {
                    base: scenario.discretization.base_knots,
                    force: scenario.discretization.force_knots,
                },
                swing_shape,
                [scenario.start.moves(), scenario.goal.velocity.is_some()]
                    .map(|moves| moves || scenario.gait.periodic),
            ),
        }
    }

    /// The unit of the robot's times, in those of ANYmal ([`Robot::time_scale`]).
    pub fn time_scale(&self) -> f64 {
        self.size.sqrt()
    }

    /// The leg of a foot whose leg the robot's file describes.
    ///
    /// # Panics
    /// If it does not.
    pub fn leg(&self, foot: usize) -> &Leg {
        self.legs[foot].as_ref().expect("a leg that the robot's file describes")
    }

    /// The patch of a stance, where there is one.
    pub fn patch(&self, foot: usize, stance: usize) -> Option<&Patch> {
        self.patches.get(foot).map(|stances| &stances[stance])
    }

    /// When a stance is halfway over, in samples ([`crate::trajectory::Stance::middle`]); in a cyclic motion, where one that begins or ends with
    /// the motion is part of a longer one, the middle of that, and where it is beyond a swing over the start or the end, that of the one that it
    /// repeats. These may be before the start or after the end.
    pub fn halfway(&self, foot: usize, stance: usize) -> f64 {
        let (last, stances) = (self.layout.intervals as f64, &self.layout.feet[foot].stances);
        let this = &stances[stance].stance;
        if self.cycle.is_none() {
            return this.middle(last);
        }
        let after = stances.len() - 1;
        if this.end < 0.0 {
            return self.halfway(foot, after - 1) - last;
        }
        if this.start > last {
            return self.halfway(foot, 1) + last;
        }
        let start = if stance == 0 { stances[after].stance.start - last } else { this.start };
        let end = if stance == after { stances[0].stance.end + last } else { this.end };
        0.5 * (start + end)
    }

    /// The forces on the trunk at sample k, and where they act.
    pub fn applied(&self, k: usize) -> &[[Vector3<f64>; 2]] {
        self.applied.get(k).map_or(&[], Vec::as_slice)
    }

    /// Number of feet.
    pub fn feet(&self) -> usize {
        self.nominal.len()
    }
}
