//! A sampled quantity as a linear combination of variables.

/// A sampled quantity: component d is the sum of `weight * x[variable + d]` over the terms.
///
/// Where the weights depend on switches, `times` holds what the node's differential has besides the terms.
#[derive(Clone, Debug, Default, PartialEq)]
pub struct LinearNode {
    /// (first variable, weight).
    pub terms: Vec<(usize, f64)>,
    /// (switch, derivative of each of the three components with respect to it).
    pub times: Vec<(usize, [f64; 3])>,
}

impl LinearNode {
    /// A node that is a variable itself.
    pub fn variable(variable: usize) -> Self {
        Self { terms: vec![(variable, 1.0)], times: Vec::new() }
    }

    /// Its first variable; of a node that is a variable itself, that variable.
    pub fn first(&self) -> usize {
        self.terms[0].0
    }

    /// Its value at x.
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
        // By number and not chained: loops over it are the inner loops of every derivative, and compile to half the time.
        let terms = self.terms.len();
        (0..terms + self.times.len()).map(move |n| match self.terms.get(n) {
            Some(&(variable, weight)) => (variable + d, weight),
            None => (self.times[n - terms].0, self.times[n - terms].1[d]),
        })
    }

    /// Adds a variable's share.
    pub fn push(&mut self, variable: usize, weight: f64) {
        if weight.abs() < 1e-15 {
            return;
        }
        match self.terms.iter_mut().find(|(v, _)| *v == variable) {
            Some(term) => term.1 += weight,
            None => self.terms.push((variable, weight)),
        }
    }
}
