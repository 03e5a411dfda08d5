//! The goal: position and heading of the base at the end.
//!
//! ```text
//!   p_x(T), p_y(T) = goal;    −sin ψ R_xx(T) + cos ψ R_yx(T) = 0   (heading ψ, when given)
//! ```
//!
//! Rows: x, y in m, then the heading (sine of the error).

use nalgebra::{Matrix3, Vector3};

use crate::nlp::curvature::NodeCurvature;
use crate::nlp::sink::Sink;
use crate::nlp::tangent::Tangent;
use crate::nlp::term::{Constraint, RowPlace};
use crate::nlp::{Model, State};

/// The end of the motion.
#[derive(Clone, Debug)]
pub struct Goal {
    position: [f64; 2],
    yaw: Option<f64>,
    last: usize,
}

impl Goal {
    /// At the last sample.
    pub fn new(model: &Model, position: [f64; 2], yaw: Option<f64>) -> Self {
        Self { position, yaw, last: model.layout.intervals }
    }
}

/// Horizontal normal of the heading, along which the base's x axis has no component.
fn side(yaw: f64) -> Vector3<f64> {
    Vector3::new(-yaw.sin(), yaw.cos(), 0.0)
}

impl Constraint for Goal {
    fn name(&self) -> &'static str {
        "goal"
    }

    fn rows(&self) -> usize {
        2 + usize::from(self.yaw.is_some())
    }

    fn bounds(&self, _model: &Model, lower: &mut [f64], upper: &mut [f64]) {
        for bound in [lower, upper] {
            bound.fill(0.0);
            bound[..2].copy_from_slice(&self.position);
        }
    }

    fn values(&self, _model: &Model, state: &State, out: &mut [f64]) {
        let base = &state.base[self.last];
        out[0] = base.position().x;
        out[1] = base.position().y;
        if let Some(yaw) = self.yaw {
            out[2] = side(yaw).dot(&base.rotation().column(0));
        }
    }

    fn jacobian(&self, model: &Model, state: &State, first: usize, sink: &mut Sink) {
        let (base, node) = (&state.base[self.last], &model.layout.base[self.last]);
        let position = Tangent::base(model, base, node);
        position.add_component(0, 1.0, &mut sink.row(first));
        position.add_component(1, 1.0, &mut sink.row(first + 1));
        if let Some(yaw) = self.yaw {
            // s · (δ × x) = δ · (x × s).
            let x: Vector3<f64> = base.rotation().column(0).into();
            Tangent::turn(model, base, node).add_along(&x.cross(&side(yaw)), &mut sink.row(first + 2));
        }
    }

    fn hessian(
        &self,
        _model: &Model,
        _state: &State,
        multipliers: &[f64],
        curvature: &mut NodeCurvature,
        _sink: &mut Sink,
    ) {
        curvature.base_position[self.last] += Vector3::new(multipliers[0], multipliers[1], 0.0);
        if let Some(yaw) = self.yaw {
            let mut weight = Matrix3::zeros();
            weight.set_column(0, &(side(yaw) * multipliers[2]));
            curvature.base_rotation[self.last] += weight;
        }
    }

    fn place(&self, _row: usize) -> RowPlace {
        RowPlace { foot: None, sample: self.last as f64 }
    }
}
