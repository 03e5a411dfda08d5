//! Second derivatives of a Lagrangian in the changes of ambient quantities at one instant, accumulated over all terms before
//! they are pulled back to the variables.
//!
//! Several constraints and costs depend on the same base, foot and force at the same instant. Each accumulates its dense form
//! here; [`super::curvature`] pulls every form back once. With legs this takes a fraction of the time of scattering
//! every row by itself.
//!
//! Changes are δ (rotation vector of the base), dp (base), dp_i (foot) and df_i (force). For changes u and v of two different
//! quantities, a form B stands for uᵀ B v; for one and the same, a symmetric Q for ½ uᵀ Q u.

use std::ops::AddAssign;

use nalgebra::Matrix3;

use super::state::State;
use crate::trajectory::Instant;

/// A form in the pose of the base.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
pub struct PoseForm {
    /// δ, δ.
    pub turn: Matrix3<f64>,
    /// δ, dp.
    pub turn_base: Matrix3<f64>,
    /// dp, dp.
    pub base: Matrix3<f64>,
}

/// A form in the pose of the base and the position of a foot.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
pub struct FootForm {
    /// The part in the pose alone.
    pub pose: PoseForm,
    /// δ, dp_i.
    pub turn_foot: Matrix3<f64>,
    /// dp, dp_i.
    pub base_foot: Matrix3<f64>,
    /// dp_i, dp_i.
    pub foot: Matrix3<f64>,
}

/// How a force enters forms with the pose, the foot at the same instant, and the foothold of its stance. (These are the same foot
/// unless switches are variables.)
#[derive(Clone, Copy, Debug, Default, PartialEq)]
pub struct ForceForm {
    /// df_i, δ.
    pub turn: Matrix3<f64>,
    /// df_i, dp.
    pub base: Matrix3<f64>,
    /// df_i, dp_i at this instant.
    pub foot: Matrix3<f64>,
    /// df_i, dp_i of the stance.
    pub foothold: Matrix3<f64>,
}

impl AddAssign<&PoseForm> for PoseForm {
    fn add_assign(&mut self, other: &PoseForm) {
        self.turn += other.turn;
        self.turn_base += other.turn_base;
        self.base += other.base;
    }
}

impl AddAssign<&FootForm> for FootForm {
    fn add_assign(&mut self, other: &FootForm) {
        self.pose += &other.pose;
        self.turn_foot += other.turn_foot;
        self.base_foot += other.base_foot;
        self.foot += other.foot;
    }
}

impl AddAssign<&ForceForm> for ForceForm {
    fn add_assign(&mut self, other: &ForceForm) {
        self.turn += other.turn;
        self.base += other.base;
        self.foot += other.foot;
        self.foothold += other.foothold;
    }
}

/// The forms of all instants.
#[derive(Clone, Debug)]
pub struct LocalForms {
    /// By sample, beyond what is in `feet`.
    pub base: Vec<PoseForm>,
    /// `[foot][k]`.
    feet: Vec<Vec<FootForm>>,
    /// As in [`State::swings_between`].
    feet_between: Vec<Vec<FootForm>>,
    /// `[foot][k]`.
    pub forces: Vec<Vec<ForceForm>>,
}

impl LocalForms {
    /// All zero.
    pub fn new(state: &State) -> Self {
        let samples = state.base.len();
        Self {
            base: vec![PoseForm::default(); samples],
            feet: vec![vec![FootForm::default(); samples]; state.swings.len()],
            feet_between: state.swings_between.iter().map(|f| vec![FootForm::default(); f.len()]).collect(),
            forces: vec![vec![ForceForm::default(); samples]; state.swings.len()],
        }
    }

    /// Sets all to zero.
    pub fn clear(&mut self) {
        self.base.fill(PoseForm::default());
        self.feet.iter_mut().for_each(|forms| forms.fill(FootForm::default()));
        self.feet_between.iter_mut().for_each(|forms| forms.fill(FootForm::default()));
        self.forces.iter_mut().for_each(|forms| forms.fill(ForceForm::default()));
    }

    /// Adds what another instance has accumulated.
    pub fn merge(&mut self, other: &Self) {
        fn sum<T: for<'a> AddAssign<&'a T>>(to: &mut [T], from: &[T]) {
            to.iter_mut().zip(from).for_each(|(to, from)| *to += from);
        }
        sum(&mut self.base, &other.base);
        self.feet.iter_mut().zip(&other.feet).for_each(|(to, from)| sum(to, from));
        self.feet_between.iter_mut().zip(&other.feet_between).for_each(|(to, from)| sum(to, from));
        self.forces.iter_mut().zip(&other.forces).for_each(|(to, from)| sum(to, from));
    }

    /// The form of a foot at an instant.
    pub fn foot(&self, foot: usize, instant: Instant) -> &FootForm {
        match instant {
            Instant::Sample(k) => &self.feet[foot][k],
            Instant::Between(k) => &self.feet_between[foot][k],
        }
    }

    /// The same, to add to.
    pub fn foot_mut(&mut self, foot: usize, instant: Instant) -> &mut FootForm {
        match instant {
            Instant::Sample(k) => &mut self.feet[foot][k],
            Instant::Between(k) => &mut self.feet_between[foot][k],
        }
    }

    /// The form in the pose of the base at an instant, summed over the feet.
    pub fn pose(&self, instant: Instant) -> PoseForm {
        match instant {
            Instant::Sample(k) => {
                let mut sum = self.base[k];
                self.feet.iter().for_each(|forms| sum += &forms[k].pose);
                sum
            }
            Instant::Between(k) => {
                let mut sum = PoseForm::default();
                self.feet_between.iter().filter_map(|forms| forms.get(k)).for_each(|form| sum += &form.pose);
                sum
            }
        }
    }
}
