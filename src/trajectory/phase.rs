//! The phases of a foot: a stance, a swing.

/// A time during which a foot stands, in samples.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Stance {
    /// Touch-down (force zero, unless the motion starts here).
    pub start: f64,
    /// Lift-off (force zero, unless the motion ends here).
    pub end: f64,
}

/// A time during which a foot moves, in samples; both ends belong to a stance as well.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Swing {
    /// Lift-off.
    pub start: f64,
    /// Touch-down.
    pub end: f64,
    /// How far lift-off and touch-down may move to either side; zero where they are given.
    pub room: [f64; 2],
}

impl Swing {
    /// With given ends.
    pub fn given(start: f64, end: f64) -> Self {
        Self { start, end, room: [0.0; 2] }
    }

    /// Whether its ends are variables.
    pub fn is_free(&self) -> bool {
        self.room != [0.0; 2]
    }

    /// The samples at which the foot moves, or may move, lie strictly between these.
    pub fn span(&self) -> [f64; 2] {
        [self.start - self.room[0], self.end + self.room[1]]
    }

    /// Time between its nominal ends; forces before it belong to the stance before.
    pub fn middle(&self) -> f64 {
        0.5 * (self.start + self.end)
    }
}
