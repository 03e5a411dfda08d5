//! The instants at which rows are imposed.

/// A sample, or halfway to the next.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Instant {
    /// Sample k.
    Sample(usize),
    /// Halfway from sample k to the next.
    Between(usize),
}

impl Instant {
    /// The time in samples.
    pub fn time(self) -> f64 {
        match self {
            Self::Sample(k) => k as f64,
            Self::Between(k) => k as f64 + 0.5,
        }
    }
}

impl From<usize> for Instant {
    fn from(k: usize) -> Self {
        Self::Sample(k)
    }
}
