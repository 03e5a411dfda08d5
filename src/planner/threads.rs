//! The parts of a pattern, split between two threads of evaluation.

use std::cmp::Reverse;
use std::ops::Range;
use std::panic::resume_unwind;
use std::thread;

use crate::nlp::sink::{Pattern, Sink};

/// Which parts of a pattern this thread evaluates, and which a second one does.
///
/// The split is by what was recorded, and the sums of the two are added in one order: results do not depend on timing.
pub(super) struct ThreadSplit {
    here: Vec<usize>,
    there: Vec<usize>,
    /// What the second thread adds to, one for each slot.
    values: Vec<f64>,
}

impl ThreadSplit {
    /// Splits some parts between 1 or 2 threads so that both add about the same number of entries.
    pub fn new(pattern: &Pattern, parts: Range<usize>, threads: usize) -> Self {
        let (mut here, mut there, mut lead) = (Vec::new(), Vec::new(), 0);
        let mut by_size: Vec<usize> = parts.collect();
        by_size.sort_by_key(|&part| Reverse(pattern.entries(part)));
        for part in by_size {
            let entries = pattern.entries(part) as isize;
            if threads == 1 || lead <= 0 {
                here.push(part);
                lead += entries;
            } else {
                there.push(part);
                lead -= entries;
            }
        }
        here.sort_unstable();
        there.sort_unstable();
        Self { values: vec![0.0; if there.is_empty() { 0 } else { pattern.len() }], here, there }
    }

    /// Adds to `values` what `scatter_here` adds for the parts of this thread and `scatter_there` for the others. A panic in either
    /// reaches the caller.
    pub fn add(
        &mut self,
        pattern: &Pattern,
        values: &mut [f64],
        scatter_here: impl FnMut(usize, &mut Sink),
        scatter_there: impl FnMut(usize, &mut Sink) + Send,
    ) {
        let Self { here, there, values: others } = self;
        if there.is_empty() {
            return pattern.add(here, values, scatter_here);
        }
        others.fill(0.0);
        thread::scope(|scope| {
            let second = scope.spawn(|| pattern.add(there, others, scatter_there));
            pattern.add(here, values, scatter_here);
            // Joined by hand, so that the panic keeps its message.
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

    fn scatter(part: usize, sink: &mut Sink) {
        (0..=part).for_each(|column| sink.add(0, column, (1 + part) as f64));
    }

    #[test]
    fn two_threads_add_what_one_adds() {
        let pattern = Pattern::record_parts(5, scatter);
        for threads in [1, 2] {
            let mut split = ThreadSplit::new(&pattern, 1..5, threads);
            assert_eq!((split.here.len(), split.there.len()), if threads == 1 { (4, 0) } else { (2, 2) });
            for _ in 0..2 {
                let mut values = vec![0.0; pattern.len()];
                split.add(&pattern, &mut values, scatter, scatter);
                assert_eq!(values, [14.0, 14.0, 12.0, 9.0, 5.0]);
            }
        }
    }

    #[test]
    fn a_panic_of_the_second_thread_keeps_its_message() {
        let pattern = Pattern::record_parts(2, scatter);
        let mut split = ThreadSplit::new(&pattern, 0..2, 2);
        let mut add = || split.add(&pattern, &mut [0.0; 2], scatter, |_, _| panic!("no ground there"));
        let panic = std::panic::catch_unwind(std::panic::AssertUnwindSafe(&mut add)).unwrap_err();
        assert_eq!(panic.downcast_ref(), Some(&"no ground there"));
    }
}
