//! Where on the time axis rows are asked.

/// A sample, or half way to the next.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Instant {
    /// Sample k.
    Sample(usize),
    /// k + ½.
    Between(usize),
}

impl Instant {
    /// In samples.
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
