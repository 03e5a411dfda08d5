//! `[posture]`, `[payload]`, `[[force]]` and `[[foothold]]`: under which conditions the motion takes place.

use schemars::JsonSchema;
use serde::{Deserialize, Serialize};

/// `[posture]`: within which limits the torso stays, as `[least, greatest]`.
#[derive(Clone, Debug, Default, PartialEq, Serialize, Deserialize, JsonSchema)]
#[serde(deny_unknown_fields, default)]
pub struct PostureSpec {
    /// Height of the center of mass above the mean of the feet, m.
    #[serde(skip_serializing_if = "Option::is_none")]
    #[schemars(inner(range(min = 0.0, max = 10.0)))]
    pub height: Option<[f64; 2]>,
    /// Roll against the horizontal, rad; positive to the right.
    #[serde(skip_serializing_if = "Option::is_none")]
    #[schemars(inner(range(min = -1.5, max = 1.5)))]
    pub roll: Option<[f64; 2]>,
    /// Pitch against the horizontal, rad; positive nose down.
    #[serde(skip_serializing_if = "Option::is_none")]
    #[schemars(inner(range(min = -1.5, max = 1.5)))]
    pub pitch: Option<[f64; 2]>,
}

/// `[payload]`: a mass fixed to the trunk.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize, JsonSchema)]
#[serde(deny_unknown_fields)]
pub struct PayloadSpec {
    /// kg.
    #[schemars(range(min = 0.0, max = 1000.0))]
    pub mass: f64,
    /// Its place, base frame, m from the center of mass of the robot without it at the nominal stance.
    #[serde(default)]
    #[schemars(inner(range(min = -10.0, max = 10.0)))]
    pub position: [f64; 3],
}

/// `[[force]]`: a force on the trunk for some time.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize, JsonSchema)]
#[serde(deny_unknown_fields)]
pub struct ForceSpec {
    /// World frame, N.
    #[schemars(inner(range(min = -1e5, max = 1e5)))]
    pub vector: [f64; 3],
    /// When it begins to rise, s.
    #[schemars(range(min = 0.0, max = 600.0))]
    pub from: f64,
    /// When it is zero again, s.
    #[schemars(range(min = 0.0, max = 600.0))]
    pub until: f64,
    /// How long it rises, and falls, s; between two time steps it is linear.
    #[serde(default = "default_ramp")]
    #[schemars(range(min = 0.0, max = 600.0))]
    pub ramp: f64,
    /// Where it acts, base frame, m from the center of mass at the nominal stance.
    #[serde(default)]
    #[schemars(inner(range(min = -10.0, max = 10.0)))]
    pub point: [f64; 3],
}

fn default_ramp() -> f64 {
    0.2
}

impl ForceSpec {
    /// The force at a time, s, as a fraction of the whole: linear between the ends of time steps.
    pub fn fraction(&self, time: f64, time_step: f64) -> f64 {
        let ramp = self.ramp.max(time_step);
        let at = |t: f64| ((t - self.from).min(self.until - t) / ramp).clamp(0.0, 1.0);
        let k = (time / time_step + 1e-9).floor();
        let u = (time / time_step - k).clamp(0.0, 1.0);
        (1.0 - u) * at(k * time_step) + u * at((k + 1.0) * time_step)
    }
}

/// `[[foothold]]`: where a foot stands once.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize, JsonSchema)]
#[serde(deny_unknown_fields)]
pub struct FootholdSpec {
    /// Name of the foot.
    pub foot: String,
    /// Which of its steps leads there, from 1; 0 is where it stands at the start.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    #[schemars(range(min = 0, max = 10000))]
    pub step: Option<usize>,
    /// Or a time at which it stands there, s.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    #[schemars(range(min = 0.0, max = 600.0))]
    pub time: Option<f64>,
    /// x, y, m.
    pub position: [f64; 2],
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_force_rises_stays_and_falls() {
        let force = ForceSpec { vector: [1.0; 3], from: 1.0, until: 2.0, ramp: 0.2, point: [0.0; 3] };
        for (t, fraction) in
            [(0.9, 0.0), (1.0, 0.0), (1.1, 0.5), (1.2, 1.0), (1.8, 1.0), (1.95, 0.25), (2.1, 0.0)]
        {
            assert!((force.fraction(t, 0.05) - fraction).abs() < 1e-9, "{t}: {}", force.fraction(t, 0.05));
        }
        // A ramp that begins between two time steps is linear there all the same.
        let force = ForceSpec { from: 1.02, ramp: 0.0, ..force };
        assert!(
            (force.fraction(1.075, 0.05) - 0.5 * (force.fraction(1.05, 0.05) + force.fraction(1.1, 0.05)))
                .abs()
                < 1e-9
        );
    }
}
