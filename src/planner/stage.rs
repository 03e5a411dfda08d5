//! The stages of a solve.

use std::fmt;

/// One solve of a sequence, each but the first started where the one before it ended.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Stage {
    /// To a feasible point on the whole terrain, without the rows of the joints.
    WithoutJoints,
    /// The scenario itself.
    Whole,
    /// The scenario again, with what the legs' mass adds along the motion found before.
    LegMass {
        /// From 1.
        round: usize,
    },
    /// With limits that give, to find out why no motion was found.
    Why,
    /// With the terrain at `step / steps` of its height.
    Continuation {
        /// From 1 to `steps`.
        step: u32,
        /// How many there are; the last one is on the whole terrain.
        steps: u32,
    },
}

impl Stage {
    /// The terrain's height in this stage, as a fraction of the scenario's.
    pub fn height_fraction(self) -> f64 {
        match self {
            Self::WithoutJoints | Self::Whole | Self::LegMass { .. } | Self::Why => 1.0,
            Self::Continuation { step, steps } => f64::from(step) / f64::from(steps),
        }
    }

    /// Whether every constraint of the scenario is there, on the whole terrain.
    pub fn is_whole(self) -> bool {
        match self {
            Self::WithoutJoints | Self::Why => false,
            Self::Whole | Self::LegMass { .. } => true,
            Self::Continuation { step, steps } => step == steps,
        }
    }

    /// Whether the plain solve had failed before.
    pub fn is_continuation(self) -> bool {
        matches!(self, Self::Continuation { .. })
    }
}

impl fmt::Display for Stage {
    fn fmt(&self, f: &mut fmt::Formatter) -> fmt::Result {
        match self {
            Self::WithoutJoints => write!(f, "without joints"),
            Self::Whole => write!(f, "solve"),
            Self::LegMass { round } => write!(f, "legs with mass, {round}"),
            Self::Why => write!(f, "why no motion is found"),
            Self::Continuation { .. } => {
                write!(f, "continuation, terrain at {:.0} %", 100.0 * self.height_fraction())
            }
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_stage_says_what_it_solves() {
        let last = Stage::Continuation { step: 3, steps: 3 };
        let first = Stage::Continuation { step: 1, steps: 3 };
        assert_eq!(first.to_string(), "continuation, terrain at 33 %");
        assert_eq!(
            [first, last, Stage::Whole, Stage::WithoutJoints].map(Stage::is_whole),
            [false, true, true, false]
        );
        assert_eq!(
            [first, last, Stage::Whole, Stage::WithoutJoints].map(Stage::is_continuation),
            [true, true, false, false]
        );
    }
}
