//! Eq. 11, the position-based centroidal dynamics (PCDM) by the times of Eq. 14: centered and with gravity, or backward as printed.
//!
//! ```text
//!   Σ_l w_l Σ_i f_i(t_l) + m g                    = m/Δt² Σ_j c_j p(t_j)
//!   Σ_l w_l Σ_i (p_i(t_l) − p(t_l)) × f_i(t_l)    = −1/Δt² Σ_j c'_j ρ∫ R(t_j) x × R(t) x dv
//!                                                 = 1/Δt² axis(N − Nᵀ) + λ(t),  N = Σ_j c'_j R(t_j) S R(t)ᵀ
//! ```
//!
//! | law | c over t₋₋ t₋ t t₊ | c' | w |
//! | --- | --- | --- | --- |
//! | `pcdm` | 0 1 −2 1 | 0 1 · 1 | 1/6 at t₋, 2/3 at t, 1/6 at t₊ |
//! | `pcdm-backward` (Eq. 11) | 1 −2 1 0 | 1 −2 · 0 | 1 at t |
//!
//! The centered second difference is p̈ averaged with the hat function over [t₋, t₊]. Averaging the forces in the same way
//! makes each row the integral of the law against that hat. Forces are linear between samples, and p̈ nearly so. A residual
//! that is linear between samples, whose hat averages are zero and which vanishes at both ends of the motion, vanishes
//! everywhere. At the first and the last sample the row is the law itself: the robot rests or moves steadily there, or its accelerations are
//! given ([`crate::nlp::Start`]). In a cyclic motion they are those of the spline at the start (`body_rates`); the end is the start
//! ([`super::closure`]), so that the law there needs no rows of its own.
//!
//! Forces on the trunk (`[[force]]`) are known functions of time, linear between samples, and act at points R(t) (r − s) from the center of
//! mass; they are added to those of the feet.
//!
//! λ is what the legs' own mass adds, averaged with the same hat: a known function of time and a term that follows the swinging feet, see
//! [`crate::nlp::leg_terms`]; zero for massless legs.
//!
//! Rows: 6 a sample, force then torque about the center of mass, world frame, in m g and m g · 1 m.

use nalgebra::{Matrix3, Vector3};

use super::body_rates::BodyRates;
use crate::nlp::curvature::NodeCurvature;
use crate::nlp::foot_in_base;
use crate::nlp::model::GRAVITY;
use crate::nlp::sink::Sink;
use crate::nlp::tangent::Tangent;
use crate::nlp::term::{Constraint, RowPlace};
use crate::nlp::{Model, State};
use crate::trajectory::rotation::{cross_matrix, skew_part};

/// Which samples enter the law at one sample, with which weights.
#[derive(Clone, Debug, Default)]
struct Stencil {
    /// w: forces and torques.
    wrench: Vec<(usize, f64)>,
    /// c: positions.
    position: Vec<(usize, f64)>,
    /// c': the other rotations.
    turn: Vec<(usize, f64)>,
}

/// Newton's and Euler's law at every sample.
#[derive(Clone, Debug)]
pub struct Dynamics {
    stencils: Vec<Stencil>,
    /// In a cyclic motion, the rates of the momenta at the start.
    at_start: Option<BodyRates>,
}

impl Dynamics {
    /// Second order: the default.
    pub fn centered(intervals: usize) -> Self {
        Self::new(intervals, |k| Stencil {
            wrench: vec![(k - 1, 1.0 / 6.0), (k, 2.0 / 3.0), (k + 1, 1.0 / 6.0)],
            position: vec![(k - 1, 1.0), (k, -2.0), (k + 1, 1.0)],
            turn: vec![(k - 1, 1.0), (k + 1, 1.0)],
        })
    }

    /// Second order, for a motion whose end is its start.
    pub fn cyclic(model: &Model) -> Self {
        Self { at_start: Some(BodyRates::new(model, 0..1)), ..Self::centered(model.layout.intervals) }
    }

    /// First order, as the paper prints it (with gravity). Before the start the robot rests.
    pub fn backward(intervals: usize) -> Self {
        Self::new(intervals, |k| {
            let before = k.saturating_sub(2);
            Stencil {
                wrench: vec![(k, 1.0)],
                position: vec![(k, 1.0), (k - 1, -2.0), (before, 1.0)],
                turn: vec![(k - 1, -2.0), (before, 1.0)],
            }
        })
    }

    /// The forces and torques of each sample alone, for [`super::newton_euler`].
    pub(super) fn wrench(intervals: usize) -> Self {
        Self::new(intervals, |k| Stencil { wrench: vec![(k, 1.0)], ..Stencil::default() })
    }

    fn new(intervals: usize, inner: impl Fn(usize) -> Stencil) -> Self {
        let stencils = (0..=intervals)
            .map(|k| {
                if k == 0 || k == intervals {
                    Stencil { wrench: vec![(k, 1.0)], ..Stencil::default() }
                } else {
                    inner(k)
                }
            })
            .collect();
        Self { stencils, at_start: None }
    }

    /// The multipliers of the force and the torque at sample l, which enter the rows of its neighbors too.
    fn wrench_multipliers(&self, multipliers: &[f64], l: usize) -> (Vector3<f64>, Vector3<f64>) {
        let (mut force, mut torque) = (Vector3::zeros(), Vector3::zeros());
        for k in l.saturating_sub(1)..=(l + 1).min(self.stencils.len() - 1) {
            for &(_, weight) in self.stencils[k].wrench.iter().filter(|w| w.0 == l) {
                force += Vector3::from_column_slice(&multipliers[6 * k..6 * k + 3]) * weight;
                torque += Vector3::from_column_slice(&multipliers[6 * k + 3..6 * k + 6]) * weight;
            }
        }
        (force, torque)
    }

    /// Σ c' R(t_j) S, the left side of N.
    fn turned(&self, model: &Model, state: &State, k: usize) -> Matrix3<f64> {
        self.stencils[k].turn.iter().map(|&(j, c)| state.base[j].rotation() * c).sum::<Matrix3<f64>>()
            * model.second_moment
    }
}

/// 1/(Δt² m g): from kg m²/s² to m g · 1 m.
fn torque_scale(model: &Model) -> f64 {
    1.0 / (model.layout.time_step.powi(2) * model.mass * GRAVITY)
}

impl Constraint for Dynamics {
    fn name(&self) -> &'static str {
        "dynamics"
    }

    fn rows(&self) -> usize {
        6 * self.stencils.len()
    }

    fn bounds(&self, _model: &Model, lower: &mut [f64], upper: &mut [f64]) {
        lower.fill(0.0);
        upper.fill(0.0);
        if self.at_start.is_some() {
            let last = 6 * (self.stencils.len() - 1);
            lower[last..].fill(f64::NEG_INFINITY);
            upper[last..].fill(f64::INFINITY);
        }
    }

    fn values(&self, model: &Model, state: &State, out: &mut [f64]) {
        let acceleration = 1.0 / (model.layout.time_step.powi(2) * GRAVITY);
        for (k, stencil) in self.stencils.iter().enumerate() {
            let mut force = -Vector3::z();
            let mut torque = -model.leg_terms.torque(k);
            for &(l, weight) in &stencil.wrench {
                let p = state.base[l].position();
                for [f, point] in model.applied(l) {
                    force += f * weight;
                    let arm = state.base[l].rotation() * (point - model.leg_terms.shift(l));
                    torque += arm.cross(f) * weight;
                }
                for i in 0..model.feet() {
                    if let Some((j, _)) = model.layout.force(i, l) {
                        let f = state.forces[i][l] * weight;
                        force += f;
                        torque += (state.contacts[i][j].point.position - p).cross(&f);
                    }
                }
            }
            for &(j, c) in &stencil.position {
                force -= state.base[j].position() * (c * acceleration);
            }
            if let Some(start) = model.start.as_ref().filter(|_| k == 0) {
                force -= start.rates[0];
                torque -= start.rates[1];
            }
            if !stencil.turn.is_empty() {
                let n = self.turned(model, state, k) * state.base[k].rotation().transpose();
                torque -= skew_part(&n) * torque_scale(model);
            }
            for c in 0..3 {
                out[6 * k + c] = force[c];
                out[6 * k + 3 + c] = torque[c];
            }
        }
        if let Some(rates) = &self.at_start {
            rates.subtract(model, state, out);
        }
        for inertia in &model.leg_terms.inertia {
            let torque = foot_in_base::inertial_torque(model, state, inertia);
            for c in 0..3 {
                out[6 * inertia.sample + 3 + c] -= torque[c];
            }
        }
    }

    fn jacobian(&self, model: &Model, state: &State, first: usize, sink: &mut Sink) {
        let layout = &model.layout;
        let acceleration = 1.0 / (layout.time_step.powi(2) * GRAVITY);
        let scale = torque_scale(model);
        for (k, stencil) in self.stencils.iter().enumerate() {
            let row = first + 6 * k;
            for &(l, weight) in &stencil.wrench {
                let base = &state.base[l];
                let mut total = Vector3::zeros();
                for [f, point] in model.applied(l) {
                    // (δ × a) × f = −[f] [δ] a = [f] [a] δ.
                    let arm = base.rotation() * (point - model.leg_terms.shift(l));
                    let form = cross_matrix(f) * cross_matrix(&arm) * weight;
                    let turn = Tangent::turn(model, base, &layout.base[l]);
                    for c in 0..3 {
                        turn.add_along(&form.row(c).transpose(), &mut sink.row(row + 3 + c));
                    }
                }
                for i in 0..model.feet() {
                    let Some((j, force_node)) = state.force_node(model, i, l) else { continue };
                    let contact = &state.contacts[i][j];
                    let (f, arm) = (state.forces[i][l] * weight, contact.point.position - base.position());
                    total += f;
                    let foothold = &layout.feet[i].stances[j].foothold;
                    let by_force = Tangent::force(model, contact, force_node);
                    let warped = state.warped_forces[i][l];
                    let by_foothold = Tangent::force_by_foothold(model, contact, foothold, &warped);
                    let position = Tangent::foot(model, contact, foothold);
                    let (arm_form, force_form) = (cross_matrix(&arm) * weight, -cross_matrix(&f));
                    for c in 0..3 {
                        by_force.add_component(c, weight, &mut sink.row(row + c));
                        by_foothold.add_component(c, weight, &mut sink.row(row + c));
                        let by_f = arm_form.row(c).transpose();
                        by_force.add_along(&by_f, &mut sink.row(row + 3 + c));
                        by_foothold.add_along(&by_f, &mut sink.row(row + 3 + c));
                        position.add_along(&force_form.row(c).transpose(), &mut sink.row(row + 3 + c));
                    }
                }
                let position = Tangent::base(model, base, &layout.base[l]);
                let form = cross_matrix(&total);
                for c in 0..3 {
                    position.add_along(&form.row(c).transpose(), &mut sink.row(row + 3 + c));
                }
            }
            for &(j, coefficient) in &stencil.position {
                let position = Tangent::base(model, &state.base[j], &layout.base[j]);
                for c in 0..3 {
                    position.add_component(c, -coefficient * acceleration, &mut sink.row(row + c));
                }
            }
            if stencil.turn.is_empty() {
                continue;
            }
            // axis([δ]G + Gᵀ[δ]) = (tr G 1 − G) δ, with G = c' R_j S Rᵀ; and for R itself −(tr N 1 − Nᵀ) δ.
            let r_t = state.base[k].rotation().transpose();
            for &(j, coefficient) in &stencil.turn {
                let g = state.base[j].rotation() * model.second_moment * r_t * (coefficient * scale);
                let form = g - Matrix3::identity() * g.trace();
                let turn = Tangent::turn(model, &state.base[j], &layout.base[j]);
                for c in 0..3 {
                    turn.add_along(&form.row(c).transpose(), &mut sink.row(row + 3 + c));
                }
            }
            let n = self.turned(model, state, k) * r_t * scale;
            let form = Matrix3::identity() * n.trace() - n.transpose();
            let turn = Tangent::turn(model, &state.base[k], &layout.base[k]);
            for c in 0..3 {
                turn.add_along(&form.row(c).transpose(), &mut sink.row(row + 3 + c));
            }
        }
        if let Some(rates) = &self.at_start {
            rates.jacobian(model, state, first, sink);
        }
        for inertia in &model.leg_terms.inertia {
            for (l, weight) in inertia.stencil() {
                for c in 0..3 {
                    let by = inertia.form.row(c).transpose() * -weight;
                    let row = first + 6 * inertia.sample + 3 + c;
                    foot_in_base::add_derivative(model, state, (inertia.foot, l), &by, &mut sink.row(row));
                }
            }
        }
    }

    fn hessian(
        &self,
        model: &Model,
        state: &State,
        multipliers: &[f64],
        curvature: &mut NodeCurvature,
        sink: &mut Sink,
    ) {
        let layout = &model.layout;
        let acceleration = 1.0 / (layout.time_step.powi(2) * GRAVITY);
        for (k, stencil) in self.stencils.iter().enumerate() {
            let force = Vector3::from_column_slice(&multipliers[6 * k..6 * k + 3]);
            let torque = Vector3::from_column_slice(&multipliers[6 * k + 3..6 * k + 6]);
            for &(j, c) in &stencil.position {
                curvature.base_position[j] -= force * (c * acceleration);
            }
            if stencil.turn.is_empty() {
                continue;
            }
            // λ · axis(N − Nᵀ) = ⟨N, [λ]⟩, bilinear in R_j and R.
            let lambda = cross_matrix(&(torque * -torque_scale(model)));
            let r = state.base[k].rotation();
            let this = Tangent::turn(model, &state.base[k], &layout.base[k]);
            curvature.base_rotation[k] += lambda.transpose() * self.turned(model, state, k);
            for &(j, c) in &stencil.turn {
                let other = state.base[j].rotation() * c;
                curvature.base_rotation[j] += lambda * r * model.second_moment * c;
                // ∂²⟨[a] G [b]ᵀ, [λ]⟩ for turns a of R_j and b of R, G = c' R_j S Rᵀ.
                let g = other * model.second_moment * r.transpose();
                let form = Matrix3::from_fn(|a, b| {
                    let unit = |i: usize| cross_matrix(&Vector3::from_fn(|r, _| f64::from(u8::from(r == i))));
                    -(unit(a) * g * unit(b)).dot(&lambda)
                });
                Tangent::turn(model, &state.base[j], &layout.base[j]).cross(&form, &this, sink);
            }
        }
        for l in 0..self.stencils.len() {
            let (by_force, by_torque) = self.wrench_multipliers(multipliers, l);
            let cross = cross_matrix(&by_torque);
            for [f, point] in model.applied(l) {
                // λ · (R r × f) = (f × λ) · R r.
                let arm = point - model.leg_terms.shift(l);
                curvature.base_rotation[l] += f.cross(&by_torque) * arm.transpose();
            }
            for i in 0..model.feet() {
                let Some((j, _)) = state.force_node(model, i, l) else { continue };
                let arm = state.contacts[i][j].point.position - state.base[l].position();
                // λ · (r × f): ∂/∂r = f × λ, ∂/∂f = λ × r, ∂²/∂f∂r = [λ].
                let by_arm = state.forces[i][l].cross(&by_torque);
                curvature.contacts[i][j] += by_arm;
                curvature.base_position[l] -= by_arm;
                curvature.forces[i][l] += by_force + by_torque.cross(&arm);
                let form = &mut curvature.forms.forces[i][l];
                form.foothold += cross;
                form.base -= cross;
            }
        }
        if let Some(rates) = &self.at_start {
            rates.hessian(model, state, multipliers, sink);
        }
        for inertia in &model.leg_terms.inertia {
            let torque = Vector3::from_column_slice(&multipliers[6 * inertia.sample + 3..][..3]);
            for (l, weight) in inertia.stencil() {
                let lambda = inertia.form.tr_mul(&torque) * -weight;
                foot_in_base::add_curvature(model, state, (inertia.foot, l), &lambda, curvature);
            }
        }
    }

    fn place(&self, row: usize) -> RowPlace {
        RowPlace { foot: None, sample: (row / 6) as f64 }
    }
}
