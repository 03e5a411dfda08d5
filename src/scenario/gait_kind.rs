//! The patterns of steps.

use std::fmt;

use schemars::JsonSchema;
use serde::{Deserialize, Serialize};

/// `gait.kind`.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq, Serialize, Deserialize, JsonSchema)]
#[serde(rename_all = "kebab-case")]
pub enum GaitKind {
    /// One foot at a time, from hind to front on the left, then on the right; all feet stand in between.
    #[default]
    Walk,
    /// As walk, without the time in between.
    Wave,
    /// Diagonal pairs; with six feet or more every second foot of a side with the others of the opposite side.
    Trot,
    /// As trot, with all feet in the air between the pairs.
    FlyingTrot,
    /// As trot, for six feet or more.
    Tripod,
    /// The feet of one side together.
    Pace,
    /// The feet of one row together: front, then hind.
    Bound,
    /// All feet at once, from one to eight, with flight in between.
    Hop,
    /// As hop.
    Pronk,
    /// No steps.
    Stand,
    /// A table of phase durations per foot.
    Custom,
}

impl GaitKind {
    /// All kinds.
    pub const ALL: [Self; 11] = [
        Self::Walk,
        Self::Wave,
        Self::Trot,
        Self::FlyingTrot,
        Self::Tripod,
        Self::Pace,
        Self::Bound,
        Self::Hop,
        Self::Pronk,
        Self::Stand,
        Self::Custom,
    ];

    /// Whether the steps repeat, with a cycle and a duty factor.
    pub fn is_cyclic(self) -> bool {
        !matches!(self, Self::Stand | Self::Custom)
    }

    /// Whether all feet are in the air at times, unless `gait.duty` says otherwise.
    pub fn flies(self) -> bool {
        matches!(self, Self::FlyingTrot | Self::Hop | Self::Pronk)
    }

    /// The same with the duty factor that is given: two groups of feet that stand for less than half of the cycle each leave gaps.
    pub fn flies_with(self, duty: Option<f64>) -> bool {
        self.flies()
            || matches!(self, Self::Trot | Self::Pace | Self::Bound) && duty.is_some_and(|duty| duty < 0.5)
    }
}

impl fmt::Display for GaitKind {
    fn fmt(&self, f: &mut fmt::Formatter) -> fmt::Result {
        self.serialize(f)
    }
}
