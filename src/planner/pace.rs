//! How far the base is on its way at each time, if it travels steadily from stop to stop.

use super::retiming::retimed;

/// Time in which the base speeds up and slows down: this fraction of its travel time, but at most a given one.
const RAMP_FRACTION: f64 = 0.2;

/// How far the base is at each time.
#[derive(Clone, Debug)]
pub struct Pace {
    /// When the base departs and when it arrives, s.
    travel: [f64; 2],
    /// Longest time of speeding up and of slowing down, s.
    longest_ramp: f64,
    /// Of the whole way, m.
    length: f64,
    /// Between two samples, s.
    time_step: f64,
    /// Without speeding up and slowing down.
    even: bool,
    /// At each sample, m, where some stops have times.
    timed: Option<Vec<f64>>,
    /// The samples at which the base must be at a stop, and where that is, m.
    pub pins: Vec<(usize, f64)>,
}

impl Pace {
    /// Between departure and arrival, s, with ramps of at most a given time, s, so that each stop at a given time, s, is where it is on the
    /// way, m. There are so many intervals of time.
    pub fn new(
        mut travel: [f64; 2],
        longest_ramp: f64,
        length: f64,
        stops: &[(f64, f64)],
        intervals: usize,
        time_step: f64,
    ) -> Self {
        if let (Some(first), Some(last)) = (stops.first(), stops.last()) {
            travel = [travel[0].min(first.0), travel[1].max(last.0)];
        }
        let pin = |&(time, at): &(f64, f64)| ((time / time_step).round() as usize, at);
        let pins: Vec<(usize, f64)> = stops.iter().map(pin).collect();
        let timed = (!stops.is_empty()).then(|| {
            let knots: Vec<(f64, f64)> = std::iter::once((travel[0], 0.0))
                .chain(stops.iter().copied())
                .chain([(travel[1], length)])
                .collect();
            let at = |k: usize| piecewise(&knots, k as f64 * time_step);
            let nominal: Vec<f64> = (0..=intervals).map(at).collect();
            retimed(&nominal, &[], &pins, time_step)
        });
        Self { travel, longest_ramp, length, time_step, even: false, timed, pins }
    }

    /// The same speed from the start to the end, s, and beyond them.
    pub fn even(horizon: f64, length: f64, time_step: f64) -> Self {
        Self {
            travel: [0.0, horizon],
            longest_ramp: 0.0,
            length,
            time_step,
            even: true,
            timed: None,
            pins: Vec::new(),
        }
    }

    /// How long the base travels, s.
    pub fn travel_time(&self) -> f64 {
        (self.travel[1] - self.travel[0]).max(self.time_step)
    }

    /// How far the base is on its way at time t, s; m.
    pub fn at(&self, t: f64) -> f64 {
        match &self.timed {
            Some(timed) => interpolated(timed, t / self.time_step),
            None if self.even => self.length * t / self.travel[1],
            None => self.length * progress(t, self.travel, self.longest_ramp),
        }
    }
}

/// A table at a place that need not be an index.
pub fn interpolated(table: &[f64], k: f64) -> f64 {
    let k = k.clamp(0.0, (table.len() - 1) as f64);
    let before = (k as usize).min(table.len() - 2);
    table[before] + (k - before as f64) * (table[before + 1] - table[before])
}

/// The value at t on the straight lines through knots (t, value), constant beyond them.
fn piecewise(knots: &[(f64, f64)], t: f64) -> f64 {
    let after = knots.partition_point(|knot| knot.0 <= t);
    match (after.checked_sub(1).map(|n| knots[n]), knots.get(after)) {
        (Some(a), Some(b)) => a.1 + (t - a.0) / (b.0 - a.0) * (b.1 - a.1),
        (Some(a), None) => a.1,
        (None, _) => knots[0].1,
    }
}

/// Fraction of the way covered at time t: constant speed between `from` and `to` with parabolic ends, at most `longest_ramp` long.
fn progress(t: f64, [from, to]: [f64; 2], longest_ramp: f64) -> f64 {
    let duration = to - from;
    let ramp = (RAMP_FRACTION * duration).min(longest_ramp);
    let s = (t - from).clamp(0.0, duration);
    let speed = 1.0 / (duration - ramp);
    if s < ramp {
        0.5 * speed * s * s / ramp
    } else if s > duration - ramp {
        1.0 - 0.5 * speed * (duration - s).powi(2) / ramp
    } else {
        speed * (s - 0.5 * ramp)
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn progress_runs_from_zero_to_one_without_a_jump() {
        let mut before = 0.0;
        for i in 0..=1000 {
            let u = progress(f64::from(i) * 0.01, [0.3, 9.7], 0.8);
            assert!(u >= before - 1e-12 && u - before < 2e-3);
            before = u;
        }
        assert!((before - 1.0).abs() < 1e-12);
    }

    #[test]
    fn stops_are_met_at_their_times_and_the_rest_is_divided_by_length() {
        // Two stops at one place: the base waits there.
        let pace = Pace::new([0.3, 9.7], 0.8, 3.0, &[(4.0, 1.0), (6.0, 1.0)], 200, 0.05);
        for (t, s) in [(0.0, 0.0), (4.0, 1.0), (6.0, 1.0), (10.0, 3.0)] {
            assert!((pace.at(t) - s).abs() < 0.02, "{t}: {}", pace.at(t));
        }
        assert!((pace.at(5.0) - 1.0).abs() < 0.06, "{}", pace.at(5.0));
        assert!((pace.at(2.15) - 0.5).abs() < 0.05, "{}", pace.at(2.15));
    }
}
