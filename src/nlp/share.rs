//! The parts of a pattern shared between two threads of evaluation.

use std::cmp::Reverse;
use std::ops::Range;
use std::panic::resume_unwind;
use std::thread;

use super::sink::{Pattern, Sink};

/// Which parts of a pattern are said here and which by a second thread, for as long as that takes.
///
/// The split is by what was recorded, and the sums of the two are added in one order: results do not depend on timing.
pub(super) struct Share {
    here: Vec<usize>,
    there: Vec<usize>,
    /// What the second thread adds to, one for each slot.
    values: Vec<f64>,
}

impl Share {
    /// Shares some parts between 1 or 2 threads so that both say about the same number of entries.
    pub fn new(pattern: &Pattern, parts: Range<usize>, threads: usize) -> Self {
        let (mut here, mut there, mut lead) = (Vec::new(), Vec::new(), 0);
        let mut by_size: Vec<usize> = parts.collect();
        by_size.sort_by_key(|&part| Reverse(pattern.said(part)));
        for part in by_size {
            let said = pattern.said(part) as isize;
            if threads == 1 || lead <= 0 {
                here.push(part);
                lead += said;
            } else {
                there.push(part);
                lead -= said;
            }
        }
        here.sort_unstable();
        there.sort_unstable();
        Self { values: vec![0.0; if there.is_empty() { 0 } else { pattern.len() }], here, there }
    }

    /// Adds to `values` what `say_here` says of the parts that are this thread's and `say_there` of the others. A panic of
    /// either is one of the caller's.
    pub fn add(
        &mut self,
        pattern: &Pattern,
        values: &mut [f64],
        say_here: impl FnMut(usize, &mut Sink),
        say_there: impl FnMut(usize, &mut Sink) + Send,
    ) {
        let Self { here, there, values: others } = self;
        if there.is_empty() {
            return pattern.add(here, values, say_here);
        }
        others.fill(0.0);
        thread::scope(|scope| {
            let second = scope.spawn(|| pattern.add(there, others, say_there));
            pattern.add(here, values, say_here);
            // Joined by hand, so that the panic keeps its own words.
            if let Err(panic) = second.join() {
                resume_unwind(panic);
            }
        });
        values.iter_mut().zip(others.iter()).for_each(|(sum, value)| *sum += value);
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    fn say(part: usize, sink: &mut Sink) {
        (0..=part).for_each(|column| sink.add(0, column, (1 + part) as f64));
    }

    #[test]
    fn two_threads_say_what_one_says() {
        let pattern = Pattern::record_parts(5, say);
        for threads in [1, 2] {
            let mut share = Share::new(&pattern, 1..5, threads);
            assert_eq!((share.here.len(), share.there.len()), if threads == 1 { (4, 0) } else { (2, 2) });
            for _ in 0..2 {
                let mut values = vec![0.0; pattern.len()];
                share.add(&pattern, &mut values, say, say);
                assert_eq!(values, [14.0, 14.0, 12.0, 9.0, 5.0]);
            }
        }
    }

    #[test]
    fn panics_of_the_second_thread_keep_their_words() {
        let pattern = Pattern::record_parts(2, say);
        let mut share = Share::new(&pattern, 0..2, 2);
        let mut add = || share.add(&pattern, &mut [0.0; 2], say, |_, _| panic!("no ground there"));
        let panic = std::panic::catch_unwind(std::panic::AssertUnwindSafe(&mut add)).unwrap_err();
        assert_eq!(panic.downcast_ref(), Some(&"no ground there"));
    }
}
