//! The steps of a cyclic motion: as many cycles as fill the horizon, begun at a time when as many feet as possible stand.

use super::cadence::Cadence;
use super::phase::Swing;
use crate::Result;

/// The swings of each foot over a number of intervals. One that crosses the end comes at the start as well, from before it.
///
/// # Errors
/// Those of [`Cadence::swing`].
pub(super) fn swings(
    cadence: &Cadence,
    lift_offs: &[f64],
    intervals: usize,
    step: f64,
) -> Result<Vec<Vec<Swing>>> {
    let last = intervals as f64;
    let with = |swing: f64| around_seam(lift_offs, swing, cadence.cycle / step, last);
    let usual = cadence.swing(step)?;
    let found = with(usual);
    // A stance that takes no time at the seam has no forces. A swing that is shorter by a time step leaves room for both of its parts.
    let ends_there = |swings: &[Vec<Swing>]| swings.iter().flatten().any(|s| s.start == 0.0 || s.end == last);
    if ends_there(&found) {
        let shorter = with(usual - 1.0);
        if usual > 2.0 && !ends_there(&shorter) {
            return Ok(shorter);
        }
    }
    Ok(found)
}

/// The same for swings and cycles of so many intervals.
fn around_seam(lift_offs: &[f64], swing: f64, cycle: f64, last: f64) -> Vec<Vec<Swing>> {
    let seam = seam(lift_offs, swing / cycle);
    let of_foot = |lift_off: &f64| {
        let first = (lift_off - seam).rem_euclid(1.0);
        let mut starts: Vec<f64> =
            (0..(last / cycle).round() as usize).map(|j| ((j as f64 + first) * cycle).round()).collect();
        // The last swing of the cycle before.
        starts.insert(0, starts.last().map_or(0.0, |start| start - last));
        let within = |start: &f64| *start < last && start + swing > 0.0;
        starts.into_iter().filter(within).map(|start| Swing::given(start, start + swing)).collect()
    };
    lift_offs.iter().map(of_foot).collect()
}

/// The middle of the longest time at which the most feet stand, as a fraction of the cycle, if each lifts off at its fraction and swings for
/// another; of several the last, after which the first foot lifts off.
fn seam(lift_offs: &[f64], swing: f64) -> f64 {
    let mut events: Vec<f64> =
        lift_offs.iter().flat_map(|l| [*l, l + swing]).map(|e| e.rem_euclid(1.0)).collect();
    events.sort_by(f64::total_cmp);
    let next = events.iter().skip(1).copied().chain(events.first().map(|e| e + 1.0));
    let spans = events.iter().zip(next).map(|(from, to)| (to - from, 0.5 * (from + to)));
    let standing = |at: f64| lift_offs.iter().filter(|l| (at - **l).rem_euclid(1.0) >= swing).count();
    // Without rounding; what is shorter is no time at all.
    let rank = |(length, middle): &(f64, f64)| (standing(*middle), (1e9 * length).round() as u64);
    let best = spans.filter(|span| rank(span).1 > 0).max_by_key(rank);
    best.map_or(0.0, |(_, middle)| middle.rem_euclid(1.0))
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn cycles_begin_while_all_feet_stand_if_they_ever_do() {
        let cadence = Cadence { cycle: 0.8, duty: 0.6 };
        let swings = swings(&cadence, &[0.0, 0.5, 0.5, 0.0], 32, 0.05).expect("steps");
        assert_eq!(swings[0], swings[3]);
        assert_eq!(swings[0], [Swing::given(1.0, 7.0), Swing::given(17.0, 23.0)]);
        assert_eq!(swings[1], [Swing::given(9.0, 15.0), Swing::given(25.0, 31.0)]);
    }

    #[test]
    fn no_stance_at_the_seam_is_without_duration() {
        // Swings of 6.7 intervals become 7; then 2 of 16 intervals are left for four stances.
        let cadence = Cadence { cycle: 0.8, duty: 0.58 };
        let swings = swings(&cadence, &[0.0, 0.5, 0.5, 0.0], 16, 0.05).expect("steps");
        assert!(swings.iter().flatten().all(|swing| swing.start > 0.0 && swing.end < 16.0), "{swings:?}");
    }

    #[test]
    fn a_swing_over_the_seam_comes_at_both_ends() {
        // Each pair stands for two fifths of the cycle: one always flies.
        let cadence = Cadence { cycle: 0.5, duty: 0.4 };
        let swings = swings(&cadence, &[0.0, 0.5], 20, 0.025).expect("steps");
        let crossing: Vec<&Vec<Swing>> = swings.iter().filter(|s| s[0].start < 0.0).collect();
        assert_eq!(crossing.len(), 1);
        let (first, last) = (crossing[0][0], crossing[0][1]);
        assert_eq!((first.start + 20.0, first.end + 20.0), (last.start, last.end));
    }
}
