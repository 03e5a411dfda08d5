//! The plan under check, and what a check finds.

use super::ground::PlanGround;
use super::laws::CheckedLaw;
use super::legs::BodyMotion;
use super::vector::{norm, sub};
use crate::plan::{MetaRobot, Plan};
use crate::scenario::Scenario;
use crate::{Error, Result};

/// Residuals by sample, (N,) each.
#[derive(Clone, Debug, Default)]
pub struct Residuals {
    /// s
    pub t: Vec<f64>,
    /// ‖m p̈ − Σf − m g‖, % of m g.
    pub newton: Vec<f64>,
    /// ‖L̇ − Σ(pᵢ − p)×fᵢ‖, % of m g · 0.3 m.
    pub euler: Vec<f64>,
    /// Largest distance of a standing foot from the ground, mm.
    pub stance_gap: Vec<f64>,
    /// Largest force beyond the friction cone, % of m g.
    pub friction: Vec<f64>,
    /// Largest distance of a foot beyond its reach box, mm.
    pub reach: Vec<f64>,
    /// Least clearance of the torso's underside, mm.
    pub clearance: Vec<f64>,
}

/// Largest rounding error of the first time, s.
const FIRST_TIME: f64 = 1e-9;

/// A law with its worst value.
pub(super) type Finding = (&'static CheckedLaw, Worst);

/// The plan with what all checks use.
pub(super) struct Subject<'a> {
    pub plan: &'a Plan,
    pub scenario: &'a Scenario,
    /// What the plan is judged by: as the scenario asks, not as the plan states.
    pub robot: MetaRobot,
    pub ground: PlanGround,
    /// Trunk and links along the plan, where the legs have mass.
    pub body: Option<BodyMotion>,
    pub samples: usize,
    pub feet: usize,
    /// Time between samples, s.
    pub step: f64,
    /// m g, N.
    pub weight: f64,
}

impl<'a> Subject<'a> {
    /// `robot` is that of the scenario; as long as its file is not at hand, that of the plan.
    pub fn new(plan: &'a Plan, scenario: &'a Scenario, robot: MetaRobot) -> Result<Self> {
        let weight = robot.mass * norm(robot.gravity);
        if !(weight.is_finite() && weight > 0.0) {
            return Err(Error::input(format!(
                "meta.robot: mass times gravity is {weight} N, expected more than 0"
            )));
        }
        let radius = robot.foot_radius;
        let is_length = radius.is_finite() && radius > 0.0;
        if !(is_length || plan.patches.is_empty()) {
            return Err(Error::input(format!(
                "meta.robot: foot_radius is {radius} m, expected more than 0, for the patches"
            )));
        }
        let feet = plan.foot_names.len();
        if robot.reach.len() != feet {
            let boxes = robot.reach.len();
            return Err(Error::input(format!(
                "member `foot_names`: {feet} feet; the robot {} has {boxes}",
                robot.name
            )));
        }
        let samples = plan.t.len();
        if plan.t[0].abs() > FIRST_TIME {
            return Err(Error::input(format!("member `t`: begins at {} s, expected 0", plan.t[0])));
        }
        let step = plan.t[samples - 1] / (samples - 1) as f64;
        let even = plan.t.windows(2).all(|pair| (pair[1] - pair[0] - step).abs() <= 1e-6 * step);
        if !(step > 0.0 && even) {
            return Err(Error::input("member `t`: the samples are not evenly spaced in time".to_owned()));
        }
        let body = BodyMotion::new(plan, &robot).map_err(Error::input)?;
        Ok(Self {
            plan,
            body,
            scenario,
            robot,
            ground: if plan.patches.is_empty() {
                PlanGround::smooth(&plan.ground)
            } else {
                PlanGround::with_edges(&plan.ground)
            },
            samples,
            feet,
            step,
            weight,
        })
    }

    pub fn foot_position(&self, n: usize, e: usize) -> [f64; 3] {
        self.plan.foot_position[n * self.feet + e]
    }

    pub fn foot_force(&self, n: usize, e: usize) -> [f64; 3] {
        self.plan.foot_force[n * self.feet + e]
    }

    /// A point fixed to the trunk, base frame from the center of mass at the nominal stance, as seen from the center of mass.
    pub fn on_trunk(&self, n: usize, point: [f64; 3]) -> [f64; 3] {
        self.body.as_ref().map_or(point, |body| sub(point, body.shift[n]))
    }

    pub fn in_contact(&self, n: usize, e: usize) -> bool {
        self.plan.foot_contact[n * self.feet + e]
    }

    /// Height of the center of mass over the mean of the feet, m. A foot that swings counts as on the line, over time, between its
    /// footholds before and after.
    pub fn height_over_feet(&self, n: usize) -> f64 {
        let under = |e: usize| {
            let at = |n: usize| self.foot_position(n, e)[2];
            if self.in_contact(n, e) {
                return at(n);
            }
            let before = (0..n).rev().find(|&m| self.in_contact(m, e));
            let after = (n..self.samples).find(|&m| self.in_contact(m, e));
            match (before, after) {
                (Some(a), Some(b)) => {
                    let [lift_off, touch_down] =
                        self.plan.swing_at(e, self.plan.t[n]).unwrap_or([self.plan.t[a], self.plan.t[b]]);
                    at(a) + (self.plan.t[n] - lift_off) / (touch_down - lift_off) * (at(b) - at(a))
                }
                (Some(stands), None) | (None, Some(stands)) => at(stands),
                (None, None) => at(n),
            }
        };
        self.plan.base_position[n][2] - (0..self.feet).map(under).sum::<f64>() / self.feet as f64
    }

    /// Whether the ground has edges, so that feet stand on patches.
    pub fn has_edges(&self) -> bool {
        !self.plan.patches.is_empty()
    }

    /// All pairs of sample and foot.
    pub fn sample_feet(&self) -> impl Iterator<Item = (usize, usize)> + use<> {
        let feet = self.feet;
        (0..self.samples).flat_map(move |n| (0..feet).map(move |e| (n, e)))
    }
}

/// The largest value seen, and where.
#[derive(Clone, Copy, Debug, Default)]
pub(super) struct Worst {
    pub value: f64,
    pub sample: Option<usize>,
    pub foot: Option<usize>,
}

impl Worst {
    /// A value that belongs to no single sample, such as a root mean square.
    pub fn overall(value: f64) -> Self {
        Self { value, sample: None, foot: None }
    }

    /// Keeps the larger value; what is not a number is larger than everything.
    pub fn meet(&mut self, value: f64, sample: usize, foot: Option<usize>) {
        if value > self.value || (value.is_nan() && !self.value.is_nan()) {
            *self = Self { value, sample: Some(sample), foot };
        }
    }
}

/// Root mean square.
pub(super) fn rms(values: &[f64]) -> f64 {
    (values.iter().map(|v| v * v).sum::<f64>() / values.len().max(1) as f64).sqrt()
}

/// The larger of two values; what is not a number is larger than everything. (`f64::max` would leave it out.)
pub(super) fn larger(a: f64, b: f64) -> f64 {
    if a.is_nan() || a > b { a } else { b }
}
