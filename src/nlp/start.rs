//! A given state at the start of the motion.

use std::ops::Range;

use nalgebra::Vector3;

use crate::trajectory::Layout;

/// What is given of the state at the start, in the variables.
#[derive(Clone, Debug)]
pub struct Start {
    /// (p̄, θ̄) and its first and second derivatives in time. Where these are not zero, the base's variables are in ambient space.
    pub base: [[f64; 6]; 3],
    /// m p̈ and L̇ of one rigid body, world frame, in m g and m g · 1 m.
    pub rates: [Vector3<f64>; 2],
    /// By foot, p̄_i: footholds, or places in the air.
    pub footholds: Option<Vec<Vector3<f64>>>,
    /// By foot, p̄̇_i, of use for those in the air, m/s.
    pub feet_velocity: Option<Vec<Vector3<f64>>>,
    /// By foot, f̄_i, m g.
    pub forces: Option<Vec<Vector3<f64>>>,
}

impl Start {
    /// The variables of footholds and forces that are given, with their values.
    pub fn variables<'a>(
        &'a self,
        layout: &'a Layout,
    ) -> impl Iterator<Item = (Range<usize>, &'a Vector3<f64>)> {
        let footholds = self.footholds.iter().flatten().zip(&layout.feet);
        let footholds = footholds.filter(|(_, foot)| !foot.starts_in_air());
        let footholds = footholds.map(|(value, foot)| (foot.stances[0].foothold.first(), value));
        let forces = self.forces.iter().flatten().zip(&layout.feet);
        let forces = forces.filter_map(|(value, foot)| Some((foot.stances[0].force(0)?.first(), value)));
        footholds.chain(forces).map(|(first, value)| (first..first + 3, value))
    }
}
