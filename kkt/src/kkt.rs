//! The solver: analysis, factorization with its certificate, solves with refinement.

use std::fmt;
use std::time::{Duration, Instant};

use crate::condense::Condenser;
use crate::ldlt::Ldlt;
use crate::symmetric::Symmetric;

/// A multiplier's diagonal is lowered by this much unless it is already below −1e-12, as it is where Ipopt has perturbed it. With less of it, equations that are
/// closer to dependent have a certain inertia, but rounding errors grow: the second one is for where the first does not do.
const STATIC_REGULARIZATIONS: [f64; 2] = [1e-8, 1e-11];
/// See [`STATIC_REGULARIZATIONS`].
const PERTURBED: f64 = 1e-12;
/// The certificate: a random vector of normally distributed numbers has shrunk to this length. Its component along an eigenvector that does not
/// shrink is shorter than that from the beginning with a probability of less than 1e-3.
const CERTAIN: f64 = 1e-3;
/// It is multiplied at most so often …
const MOST_PROBES: usize = 10;
/// … and, after the first two times, as long as it shrinks at least to this fraction each time.
const LEAST_SHRINKAGE: f64 = 0.7;
/// Refinement ends when the residual is this small against the solution and the right-hand side, max norm …
const WANTED_RESIDUAL: f64 = 1e-12;
/// … or when it has become smaller by less than this factor …
const LEAST_IMPROVEMENT: f64 = 0.7;
/// … or after so many steps.
const MOST_STEPS: usize = 10;

/// The sizes of the blocks, in the order of rows: x, s, y_c, y_d.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct Layout {
    /// Of x.
    pub variables: usize,
    /// Of s, and of y_d.
    pub inequalities: usize,
    /// Of y_c.
    pub equations: usize,
}

impl Layout {
    /// The order of the matrix.
    #[must_use]
    pub fn dimension(&self) -> usize {
        self.variables + 2 * self.inequalities + self.equations
    }
}

/// Why a matrix cannot be analyzed.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Error {
    /// The lists of rows and columns differ in length, or an index lies outside the matrix of the layout.
    Structure,
    /// Not enough memory.
    Memory,
}

impl fmt::Display for Error {
    fn fmt(&self, formatter: &mut fmt::Formatter<'_>) -> fmt::Result {
        formatter.write_str(match self {
            Self::Structure => "the entries do not belong to a matrix of this layout",
            Self::Memory => "not enough memory for the factorization",
        })
    }
}

impl std::error::Error for Error {}

/// The result of a factorization.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Factored {
    /// Done; so many eigenvalues are negative, none is zero.
    Regular {
        /// How many.
        negative: usize,
    },
    /// The matrix is singular, or so close to it that its inertia is not certain.
    Singular,
}

/// What was done so far.
#[derive(Clone, Copy, Debug, Default)]
pub struct Statistics {
    /// Factorizations.
    pub factorizations: usize,
    /// Of these, those of matrices that counted as singular.
    pub singular: usize,
    /// Right-hand sides.
    pub solves: usize,
    /// Steps of refinement, of all solves.
    pub refinements: usize,
    /// Multiplications of random vectors, of all certificates.
    pub probes: usize,
    /// Largest residual that a solve returned.
    pub worst_residual: f64,
    /// In the analysis.
    pub analysis_time: Duration,
    /// In factorizations.
    pub factorization_time: Duration,
    /// In solves.
    pub solve_time: Duration,
}

/// A matrix with a fixed pattern, factored again and again.
pub struct Kkt {
    matrix: Symmetric,
    condenser: Condenser,
    ldlt: Ldlt,
    /// Places of the multipliers' diagonal in `ldlt.values`.
    multipliers: Vec<u32>,
    random: Vec<f64>,
    reduced: Vec<f64>,
    solution: Vec<f64>,
    residual: Vec<f64>,
    best: Vec<f64>,
    zero: Vec<f64>,
    /// What was done so far.
    pub statistics: Statistics,
}

impl Kkt {
    /// Analyzes the pattern of a matrix: rows and columns of its entries, from 0, of either triangle; entries that occur twice are added.
    ///
    /// # Errors
    /// See [`Error`].
    pub fn new(layout: Layout, rows: &[u32], columns: &[u32]) -> Result<Self, Error> {
        let start = Instant::now();
        let n = layout.dimension();
        let inside = |&index: &u32| (index as usize) < n;
        if rows.len() != columns.len() || !rows.iter().chain(columns).all(inside) {
            return Err(Error::Structure);
        }
        let entries: Vec<(u32, u32)> = rows.iter().copied().zip(columns.iter().copied()).collect();
        let matrix = Symmetric::new(n, &entries);
        let (mut condenser, pattern) = Condenser::new(&matrix, layout);
        let (ldlt, places) = Ldlt::new(&pattern)?;
        condenser.relocate(&places);
        // The diagonal is the first entry of each column of the pattern.
        let first_multiplier = (layout.variables + layout.inequalities) as u32;
        let kept = condenser.kept().iter().zip(&pattern.starts);
        let multipliers = kept.filter(|&(&old, _)| old >= first_multiplier);
        let multipliers = multipliers.map(|(_, &place)| places[place]).collect();
        let reduced = condenser.kept().len();
        Ok(Self {
            matrix,
            condenser,
            ldlt,
            multipliers,
            random: normal_numbers(n),
            reduced: vec![0.0; reduced],
            solution: vec![0.0; n],
            residual: vec![0.0; n],
            best: vec![0.0; n],
            zero: vec![0.0; n],
            statistics: Statistics { analysis_time: start.elapsed(), ..Statistics::default() },
        })
    }

    /// The order of the matrix.
    #[must_use]
    pub fn dimension(&self) -> usize {
        self.matrix.dimension()
    }

    /// How many slacks, with their multipliers, are condensed out: all of them, or none if the pattern contradicts the layout.
    #[must_use]
    pub fn num_condensed(&self) -> usize {
        self.condenser.num_condensed()
    }

    /// The entries of L, zeros in supernodes included.
    #[must_use]
    pub fn factor_len(&self) -> usize {
        self.ldlt.factor_len()
    }

    /// Factors the matrix with these values, in the order of the entries.
    ///
    /// # Panics
    /// When there are not as many values as entries.
    pub fn factor(&mut self, values: &[f64]) -> Factored {
        let start = Instant::now();
        let result = self.try_factor(values);
        self.statistics.factorizations += 1;
        self.statistics.factorization_time += start.elapsed();
        match result {
            Some(negative) => Factored::Regular { negative },
            None => {
                self.statistics.singular += 1;
                Factored::Singular
            }
        }
    }

    fn try_factor(&mut self, values: &[f64]) -> Option<usize> {
        self.matrix.assemble(values);
        for regularization in STATIC_REGULARIZATIONS {
            let condensed = self.condenser.reduce(&self.matrix.values, &mut self.ldlt.values)?;
            let mut regularized = false;
            for &place in &self.multipliers {
                let diagonal = &mut self.ldlt.values[place as usize];
                if *diagonal > -PERTURBED {
                    *diagonal -= regularization;
                    regularized = true;
                }
            }
            let negative = condensed + self.ldlt.factor()?;
            if self.refinement_converges() {
                return Some(negative);
            }
            if !regularized {
                // Another regularization would give the same matrix.
                break;
            }
        }
        None
    }

    /// Multiplies a random vector by I − M⁻¹K until it is short, and says whether that came about.
    fn refinement_converges(&mut self) -> bool {
        self.solution.copy_from_slice(&self.random);
        let mut last = f64::INFINITY;
        for probe in 0..MOST_PROBES {
            self.statistics.probes += 1;
            self.matrix.residual(&self.zero, &self.solution, &mut self.residual);
            self.correct();
            let length = norm(&self.solution);
            if length <= CERTAIN {
                return true;
            }
            if !length.is_finite() || (probe >= 2 && length > LEAST_SHRINKAGE * last) {
                return false;
            }
            last = length;
        }
        false
    }

    /// solution ← solution + M⁻¹ residual; the residual is used up.
    fn correct(&mut self) {
        self.condenser.restrict(&self.residual, &mut self.reduced);
        self.ldlt.solve(&mut self.reduced);
        self.condenser.expand(&self.reduced, &mut self.residual);
        for (value, correction) in self.solution.iter_mut().zip(&self.residual) {
            *value += correction;
        }
    }

    /// Solves with the matrix that was factored last: `x` is the right-hand side, then the solution. Returns the residual's max norm over those of
    /// solution plus right-hand side.
    ///
    /// # Panics
    /// When `x` does not have the matrix's order.
    pub fn solve(&mut self, x: &mut [f64]) -> f64 {
        let start = Instant::now();
        let right_side_norm = max_norm(x);
        self.solution.fill(0.0);
        self.residual.copy_from_slice(x);
        self.correct();
        let mut error = self.error(x, right_side_norm);
        self.best.copy_from_slice(&self.solution);
        for _ in 0..MOST_STEPS {
            if error <= WANTED_RESIDUAL || error.is_nan() {
                break;
            }
            self.statistics.refinements += 1;
            self.correct();
            let last = std::mem::replace(&mut error, self.error(x, right_side_norm));
            if error < last {
                self.best.copy_from_slice(&self.solution);
            }
            if error.is_nan() || error > LEAST_IMPROVEMENT * last {
                error = error.min(last);
                break;
            }
        }
        x.copy_from_slice(&self.best);
        self.statistics.solves += 1;
        self.statistics.worst_residual = self.statistics.worst_residual.max(error);
        self.statistics.solve_time += start.elapsed();
        error
    }

    /// Computes the residual of the solution, and its max norm over those of solution plus right-hand side.
    fn error(&mut self, right_side: &[f64], right_side_norm: f64) -> f64 {
        self.matrix.residual(right_side, &self.solution, &mut self.residual);
        let size = max_norm(&self.solution) + right_side_norm;
        if size == 0.0 { 0.0 } else { max_norm(&self.residual) / size }
    }
}

fn max_norm(x: &[f64]) -> f64 {
    x.iter().fold(0.0, |largest: f64, value| if value.is_nan() { f64::NAN } else { largest.max(value.abs()) })
}

fn norm(x: &[f64]) -> f64 {
    x.iter().map(|value| value * value).sum::<f64>().sqrt()
}

/// Normally distributed numbers, the same ones every time.
fn normal_numbers(n: usize) -> Vec<f64> {
    let mut state = 0x9E37_79B9_7F4A_7C15_u64;
    // SplitMix64, to the open interval from 0 to 1.
    let mut uniform = || {
        state = state.wrapping_add(0x9E37_79B9_7F4A_7C15);
        let mut z = state;
        z = (z ^ (z >> 30)).wrapping_mul(0xBF58_476D_1CE4_E5B9);
        z = (z ^ (z >> 27)).wrapping_mul(0x94D0_49BB_1331_11EB);
        ((z ^ (z >> 31)) >> 11) as f64 / (1u64 << 53) as f64 + f64::EPSILON / 4.0
    };
    // Box and Muller.
    (0..n).map(|_| (-2.0 * uniform().ln()).sqrt() * (std::f64::consts::TAU * uniform()).cos()).collect()
}
