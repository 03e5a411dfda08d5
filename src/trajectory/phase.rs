//! The phases of a foot: stance and swing.

/// Shortest phase of a given gait, in time steps: with fewer, no sample is inside it.
pub const SHORTEST_PHASE: f64 = 2.0;

/// A phase in which a foot is on the ground; times in samples.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Stance {
    /// Touch-down. The force is zero then, unless the motion starts.
    pub start: f64,
    /// Lift-off. The force is zero then, unless the motion ends.
    pub end: f64,
}

impl Stance {
    /// When it is halfway over, in samples; where it begins or ends with a motion of so many samples, that end, at which the base is at rest.
    pub fn middle(&self, last: f64) -> f64 {
        if self.start == 0.0 {
            0.0
        } else if self.end == last {
            last
        } else {
            0.5 * (self.start + self.end)
        }
    }
}

/// A phase in which a foot is in the air; times in samples. Both ends belong to a stance, too.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Swing {
    /// Lift-off.
    pub start: f64,
    /// Touch-down.
    pub end: f64,
    /// How far lift-off and touch-down may each move in either direction; zero if they are given.
    pub room: [f64; 2],
}

impl Swing {
    /// A swing with given switches.
    pub fn given(start: f64, end: f64) -> Self {
        Self { start, end, room: [0.0; 2] }
    }

    /// Whether its switches are variables.
    pub fn is_free(&self) -> bool {
        self.room != [0.0; 2]
    }

    /// The foot moves, or may move, strictly between these times.
    pub fn span(&self) -> [f64; 2] {
        [self.start - self.room[0], self.end + self.room[1]]
    }

    /// Halfway between its nominal switches. Forces before this time belong to the preceding stance, others to the following one.
    pub fn middle(&self) -> f64 {
        0.5 * (self.start + self.end)
    }
}
