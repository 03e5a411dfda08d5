//! Limits that a motion misses between its samples are tightened by what it misses, and it is solved again.

/// By how much limits are tighter than by the scenario and the margins.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
pub struct Tighter {
    /// Reach boxes, on each side, m.
    pub reach: f64,
    /// `motion.base_clearance`, m.
    pub base_clearance: f64,
    /// `motion.swing_clearance`, m.
    pub swing_clearance: f64,
    /// Speed of the joints, as a fraction of its limit.
    pub joint_speed: f64,
    /// Torque of the joints, likewise.
    pub joint_torque: f64,
}

impl Tighter {
    /// Tighter by that much more.
    pub fn and(&self, more: &Self) -> Self {
        Self {
            reach: self.reach + more.reach,
            base_clearance: self.base_clearance + more.base_clearance,
            swing_clearance: self.swing_clearance + more.swing_clearance,
            joint_speed: self.joint_speed + more.joint_speed,
            joint_torque: self.joint_torque + more.joint_torque,
        }
    }

    /// In words.
    pub fn words(&self) -> String {
        let all = [
            (1e3 * self.reach, "mm less reach"),
            (1e3 * self.base_clearance, "mm more base clearance"),
            (1e3 * self.swing_clearance, "mm more swing clearance"),
            (1e2 * self.joint_speed, "% less joint speed"),
            (1e2 * self.joint_torque, "% less joint torque"),
        ];
        let words = all.iter().filter(|(by, _)| *by > 0.0).map(|(by, what)| format!("{by:.1} {what}"));
        words.collect::<Vec<_>>().join(", ")
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn what_is_tighter_adds_up_and_is_said() {
        let reach = Tighter { reach: 0.002, ..Tighter::default() };
        let both = reach.and(&Tighter { reach: 0.001, joint_speed: 0.05, ..Tighter::default() });
        assert_eq!(both.words(), "3.0 mm less reach, 5.0 % less joint speed");
    }
}
