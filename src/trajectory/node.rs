//! A sampled quantity as a linear combination of variables.

/// A sampled quantity: component d is the sum of `weight * x[variable + d]` over the terms.
///
/// If the weights depend on switches, `times` holds their part of the differential.
#[derive(Clone, Debug, Default, PartialEq)]
pub struct LinearNode {
    /// (first variable, weight).
    pub terms: Vec<(usize, f64)>,
    /// (switch, derivatives of the three components with respect to it).
    pub times: Vec<(usize, [f64; 3])>,
}

/// Weights below this are rounding errors.
const NEGLIGIBLE: f64 = 1e-15;

impl LinearNode {
    /// A node that equals variables.
    pub fn variable(variable: usize) -> Self {
        Self { terms: vec![(variable, 1.0)], times: Vec::new() }
    }

    /// The first variable of its first term.
    pub fn first(&self) -> usize {
        self.terms[0].0
    }

    /// The value at x.
    pub fn value<const D: usize>(&self, x: &[f64]) -> [f64; D] {
        let mut y = [0.0; D];
        for &(variable, weight) in &self.terms {
            for d in 0..D {
                y[d] += weight * x[variable + d];
            }
        }
        y
    }

    /// The differential of component d: (variable, coefficient).
    #[inline]
    pub fn differential(&self, d: usize) -> impl ExactSizeIterator<Item = (usize, f64)> + '_ {
        // An index and not a chain of iterators: loops over it are the inner loops of every derivative and take half the time this way.
        let terms = self.terms.len();
        (0..terms + self.times.len()).map(move |n| match self.terms.get(n) {
            Some(&(variable, weight)) => (variable + d, weight),
            None => (self.times[n - terms].0, self.times[n - terms].1[d]),
        })
    }

    /// Adds `weight · x[variable + d]`. Weights that are zero up to rounding are dropped.
    pub fn push(&mut self, variable: usize, weight: f64) {
        if weight.abs() < NEGLIGIBLE {
            return;
        }
        match self.terms.iter_mut().find(|(v, _)| *v == variable) {
            Some(term) => term.1 += weight,
            None => self.terms.push((variable, weight)),
        }
    }
}
