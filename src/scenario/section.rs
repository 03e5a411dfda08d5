//! A section of a sequence of gaits.

use schemars::JsonSchema;
use serde::{Deserialize, Serialize};

use super::gait_kind::GaitKind;

/// A section of `[[gait.sequence]]`.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize, JsonSchema)]
#[serde(deny_unknown_fields)]
pub struct SectionSpec {
    /// The pattern; not `custom`.
    pub kind: GaitKind,
    /// How long it lasts, s; sections without a duration share what the others leave of the horizon.
    #[schemars(range(min = 0.01, max = 600.0))]
    pub duration: Option<f64>,
    /// As `gait.cycle`.
    #[schemars(range(min = 0.1, max = 20.0))]
    pub cycle: Option<f64>,
    /// As `gait.duty`.
    #[schemars(range(min = 0.1, max = 1.0))]
    pub duty: Option<f64>,
}
