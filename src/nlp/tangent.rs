//! First derivatives of ambient vectors in terms of the variables, and bilinear forms of them.

use nalgebra::{Matrix3, Vector3};

use super::model::Model;
use super::sink::{Differential, Sink};
use super::state::{BaseNode, FootNode};
use crate::trajectory::LinearNode;

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
    /// Of the position of the base.
    pub fn base(model: &Model, base: &BaseNode, node: &'a LinearNode) -> Self {
        Self::matrix(node, &base.point.jacobian, !model.spaces.base.is_warped())
    }

    /// Of the orientation of the base.
    pub fn turn(model: &Model, base: &BaseNode, node: &'a LinearNode) -> Self {
        let first = if model.spaces.base.is_warped() { 0 } else { 3 };
        Self { node, columns: base.turn.first, first, last: 6, identity: false }
    }

    /// Of the position of a foot.
    pub fn foot(model: &Model, foot: &FootNode, node: &'a LinearNode) -> Self {
        Self::matrix(node, &foot.point.jacobian, !model.spaces.feet.is_warped())
    }

    /// Of a force J f̄ with its own variables.
    pub fn force(model: &Model, contact: &FootNode, node: &'a LinearNode) -> Self {
        Self::matrix(node, &contact.point.jacobian, !model.spaces.feet.is_warped())
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
        let last = if model.spaces.feet.is_warped() { 3 } else { 0 };
        Self { node, columns, first: 0, last, identity: false }
    }

    fn matrix(node: &'a LinearNode, matrix: &Matrix3<f64>, identity: bool) -> Self {
        let mut columns = [Vector3::zeros(); 6];
        for d in 0..3 {
            columns[d] = matrix.column(d).into();
        }
        Self { node, columns, first: 0, last: 3, identity }
    }

    /// Adds the derivatives of a scalar that changes by `by` · (change of the vector).
    pub fn add_along(&self, by: &Vector3<f64>, scalar: &mut impl Differential) {
        for d in self.first..self.last {
            scalar.node(self.node, d, by.dot(&self.columns[d]));
        }
    }

    /// Adds the derivatives of a scalar that changes by `scale` times the change of component `c` of the vector.
    pub fn add_component(&self, c: usize, scale: f64, scalar: &mut impl Differential) {
        for d in self.first..self.last {
            if !self.identity || c == d {
                scalar.node(self.node, d, scale * self.columns[d][c]);
            }
        }
    }

    /// Adds the second derivatives of the bilinear form aᵀ B b in the changes a of this vector and b of another.
    pub fn cross(&self, form: &Matrix3<f64>, other: &Tangent, sink: &mut Sink) {
        for d in self.first..self.last {
            let left = form.tr_mul(&self.columns[d]);
            for e in other.first..other.last {
                sink.pair((self.node, d), (other.node, e), left.dot(&other.columns[e]));
            }
        }
    }

    /// Adds the second derivatives of the quadratic form ½ aᵀ Q a in the change a of this vector, Q symmetric.
    pub fn quadratic(&self, form: &Matrix3<f64>, sink: &mut Sink) {
        for d in self.first..self.last {
            let left = form * self.columns[d];
            for e in self.first..=d {
                sink.own(self.node, d, e, left.dot(&self.columns[e]));
            }
        }
    }
}
