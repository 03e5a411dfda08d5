//! The check: every law recomputed in ambient space from the plan alone, on the plan's own samples.
//!
//! Nothing of the solver is used: positions, forces and heights are read from the plan, derivatives are taken by
//! differences, normals from a spline through the plan's own height grid. Every row is "value ≤ limit".

mod contact;
mod dynamics;
mod ground;
mod laws;
mod motion;

use crate::plan::{CheckRow, Plan};
use crate::scenario::{self, Scenario};
use crate::{Error, Result};
use ground::Ground;
pub use laws::{LAWS, Law, Limits};

/// What the check found.
#[derive(Clone, Debug)]
pub struct CheckReport {
    /// The laws, each with its worst value and verdict.
    pub rows: Vec<CheckRow>,
    /// What is measured without a limit; the limits are infinite.
    pub figures: Vec<CheckRow>,
    /// Whether every row holds.
    pub passed: bool,
    /// The main residuals over time.
    pub residuals: Residuals,
}

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

/// Checks a plan against the default limits. Fails when a value is not finite or an array has the wrong length, and when the scenario in the plan cannot be read, since limits such as
/// the swing clearance come from it.
pub fn check(plan: &Plan) -> Result<CheckReport> {
    check_with(plan, &Limits::default())
}

/// Checks a plan against given limits.
pub fn check_with(plan: &Plan, limits: &Limits) -> Result<CheckReport> {
    plan.ensure_sound()?;
    let scenario = scenario::parse("meta.scenario", &plan.meta.scenario)?;
    let subject = Subject::new(plan, &scenario)?;
    let mut residuals = Residuals { t: plan.t.clone(), ..Default::default() };
    let mut findings = Vec::new();
    dynamics::findings(&subject, &mut findings, &mut residuals);
    contact::findings(&subject, &mut findings, &mut residuals);
    motion::findings(&subject, &mut findings, &mut residuals);

    let (mut rows, mut figures) = (Vec::new(), Vec::new());
    for (law, worst) in findings {
        let limit = limits.of(law);
        let row = CheckRow {
            name: law.name.into(),
            value: worst.value,
            unit: law.unit.into(),
            limit: limit.unwrap_or(f64::INFINITY),
            passed: limit.is_none_or(|limit| worst.value <= limit),
            time: worst.sample.map(|n| plan.t[n]),
            foot: worst.foot.map(|e| plan.foot_names[e].clone()),
        };
        if limit.is_some() { rows.push(row) } else { figures.push(row) }
    }
    let passed = rows.iter().all(|row| row.passed);
    Ok(CheckReport { rows, figures, passed, residuals })
}

/// A law with its worst value.
type Finding = (&'static Law, Worst);

/// The plan with what the checks share.
struct Subject<'a> {
    plan: &'a Plan,
    scenario: &'a Scenario,
    ground: Ground,
    samples: usize,
    feet: usize,
    /// s between samples.
    step: f64,
    /// m g, N.
    weight: f64,
}

impl<'a> Subject<'a> {
    fn new(plan: &'a Plan, scenario: &'a Scenario) -> Result<Self> {
        let gravity = norm(plan.meta.robot.gravity);
        let weight = plan.meta.robot.mass * gravity;
        if !(weight.is_finite() && weight > 0.0) {
            return Err(Error::input(format!(
                "meta.robot: mass times gravity is {weight} N, expected more than 0"
            )));
        }
        let samples = plan.t.len();
        let step = (plan.t[samples - 1] - plan.t[0]) / (samples - 1) as f64;
        let even = plan.t.windows(2).all(|pair| (pair[1] - pair[0] - step).abs() <= 1e-6 * step);
        if !(step > 0.0 && even) {
            return Err(Error::input("member `t`: the samples are not evenly spaced in time".to_owned()));
        }
        Ok(Self {
            plan,
            scenario,
            ground: Ground::new(&plan.ground),
            samples,
            feet: plan.foot_names.len(),
            step,
            weight,
        })
    }

    fn foot_position(&self, n: usize, e: usize) -> [f64; 3] {
        self.plan.foot_position[n * self.feet + e]
    }

    fn foot_force(&self, n: usize, e: usize) -> [f64; 3] {
        self.plan.foot_force[n * self.feet + e]
    }

    fn in_contact(&self, n: usize, e: usize) -> bool {
        self.plan.foot_contact[n * self.feet + e]
    }

    /// All pairs of sample and foot.
    fn sample_feet(&self) -> impl Iterator<Item = (usize, usize)> + use<> {
        let feet = self.feet;
        (0..self.samples).flat_map(move |n| (0..feet).map(move |e| (n, e)))
    }
}

/// The largest value met, and where.
#[derive(Clone, Copy, Debug, Default)]
struct Worst {
    value: f64,
    sample: Option<usize>,
    foot: Option<usize>,
}

impl Worst {
    /// A value that belongs to no single sample, such as a root mean square.
    fn overall(value: f64) -> Self {
        Self { value, sample: None, foot: None }
    }

    /// Keeps the larger value.
    fn meet(&mut self, value: f64, sample: usize, foot: Option<usize>) {
        if value > self.value {
            *self = Self { value, sample: Some(sample), foot };
        }
    }
}

fn rms(values: &[f64]) -> f64 {
    (values.iter().map(|v| v * v).sum::<f64>() / values.len().max(1) as f64).sqrt()
}

fn norm(v: [f64; 3]) -> f64 {
    dot(v, v).sqrt()
}

fn dot(a: [f64; 3], b: [f64; 3]) -> f64 {
    a[0] * b[0] + a[1] * b[1] + a[2] * b[2]
}

fn add(a: [f64; 3], b: [f64; 3]) -> [f64; 3] {
    [a[0] + b[0], a[1] + b[1], a[2] + b[2]]
}

fn sub(a: [f64; 3], b: [f64; 3]) -> [f64; 3] {
    [a[0] - b[0], a[1] - b[1], a[2] - b[2]]
}

fn scale(a: f64, v: [f64; 3]) -> [f64; 3] {
    [a * v[0], a * v[1], a * v[2]]
}

fn cross(a: [f64; 3], b: [f64; 3]) -> [f64; 3] {
    [a[1] * b[2] - a[2] * b[1], a[2] * b[0] - a[0] * b[2], a[0] * b[1] - a[1] * b[0]]
}

/// v turned by a unit quaternion (w, x, y, z).
fn rotate(q: [f64; 4], v: [f64; 3]) -> [f64; 3] {
    let u = [q[1], q[2], q[3]];
    let t = scale(2.0, cross(u, v));
    add(add(v, scale(q[0], t)), cross(u, t))
}

/// v turned back.
fn rotate_back(q: [f64; 4], v: [f64; 3]) -> [f64; 3] {
    rotate([q[0], -q[1], -q[2], -q[3]], v)
}
