//! One axis of the finite-element grid: a basis whose end coefficients are face values, its quadrature, and the L² projection
//! onto it.

use super::basis::axis_weights;

/// A point on an axis and the basis functions there.
#[derive(Clone, Copy, Debug)]
pub(super) struct Sample {
    /// Position, in cells from the lower face.
    pub at: f64,
    /// Quadrature weight, m.
    pub weight: f64,
    /// The first of the four coefficients that the spline depends on there.
    pub first: usize,
    /// Values of the basis functions.
    pub value: [f64; 4],
    /// Their derivatives, 1/m.
    pub slope: [f64; 4],
}

/// A composite quadrature rule.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(super) enum Rule {
    /// Three Lobatto points per cell (Simpson's rule): the knots, which neighboring cells have in common, and the middles of cells.
    Lobatto,
    /// Points at thirds of cells, with equal weights: not for integrals, but to inspect a map between the points of the other rules.
    Thirds,
    /// Four Gauss points per cell: integrates products of basis functions exactly.
    Gauss,
}

/// N cells of equal size and N + 3 coefficients, of which the first and the last are the values at the two faces.
#[derive(Clone, Copy, Debug)]
pub(super) struct MapAxis {
    pub cells: usize,
    /// Size of a cell, m.
    pub cell: f64,
}

impl MapAxis {
    /// The number of coefficients.
    pub fn len(&self) -> usize {
        self.cells + 3
    }

    /// The basis functions at `at` (in cells from the lower face, inside the box).
    ///
    /// At the lower face the spline has the value u₀ = (ψ₀ + 4ψ₁ + ψ₂)/6. With u₀ as the coefficient in place of ψ₀, that is, with
    /// ψ₀ = 6u₀ − 4ψ₁ − ψ₂, fixing the face fixes one coefficient and none of the others; likewise at the upper face.
    pub fn sample(&self, at: f64, weight: f64) -> Sample {
        let w = axis_weights::<2>(at, self.cells);
        let [mut value, mut slope] = w.weight;
        for b in [&mut value, &mut slope] {
            if w.first == 0 {
                *b = [6.0 * b[0], b[1] - 4.0 * b[0], b[2] - b[0], b[3]];
            }
            if w.first + 1 == self.cells {
                *b = [b[0], b[1] - b[3], b[2] - 4.0 * b[3], 6.0 * b[3]];
            }
        }
        Sample { at, weight, first: w.first, value, slope: slope.map(|s| s / self.cell) }
    }

    /// The points of a rule, in order.
    pub fn quadrature(&self, rule: Rule) -> Vec<Sample> {
        match rule {
            Rule::Lobatto => (0..=2 * self.cells)
                .map(|i| {
                    let end = i == 0 || i == 2 * self.cells;
                    let weight = if end { 1.0 / 6.0 } else { [1.0 / 3.0, 2.0 / 3.0][i % 2] };
                    self.sample(0.5 * i as f64, weight * self.cell)
                })
                .collect(),
            Rule::Thirds => {
                (0..=3 * self.cells).map(|i| self.sample(i as f64 / 3.0, self.cell / 3.0)).collect()
            }
            Rule::Gauss => {
                // The roots of the Legendre polynomial P₄ and their weights, on [−1, 1] and in sum 1.
                let root = 1.2_f64.sqrt();
                let outer = ((3.0 + 2.0 * root) / 7.0).sqrt();
                let inner = ((3.0 - 2.0 * root) / 7.0).sqrt();
                let heavy = (18.0 + 30.0_f64.sqrt()) / 72.0;
                let rule = [(-outer, 0.5 - heavy), (-inner, heavy), (inner, heavy), (outer, 0.5 - heavy)];
                (0..self.cells)
                    .flat_map(|i| rule.map(|(x, w)| self.sample(i as f64 + 0.5 + 0.5 * x, w * self.cell)))
                    .collect()
            }
        }
    }

    /// Turns control points into coefficients with face values at the ends, in place.
    pub fn control_to_face(&self, line: &mut [f64]) {
        let n = line.len();
        line[0] = (line[0] + 4.0 * line[1] + line[2]) / 6.0;
        line[n - 1] = (line[n - 3] + 4.0 * line[n - 2] + line[n - 1]) / 6.0;
    }

    /// The inverse of [`MapAxis::control_to_face`].
    pub fn face_to_control(&self, line: &mut [f64]) {
        let n = line.len();
        line[0] = 6.0 * line[0] - 4.0 * line[1] - line[2];
        line[n - 1] = 6.0 * line[n - 1] - 4.0 * line[n - 2] - line[n - 3];
    }
}

/// The L² projection onto the splines of one axis: u = M⁻¹ Bᵀ W f with the banded mass matrix M = Bᵀ W B.
pub(super) struct Projection {
    pub samples: Vec<Sample>,
    /// Cholesky factor of M: `[row][k]` = L[row][row − 3 + k].
    factor: Vec<[f64; 4]>,
}

impl Projection {
    /// With four Gauss points per cell.
    pub fn new(axis: &MapAxis) -> Projection {
        let samples = axis.quadrature(Rule::Gauss);
        let factor = banded_cholesky(mass_band(&samples, axis.len()));
        Projection { samples, factor }
    }

    /// Applies M⁻¹ along the slow axis of `lines`, which has a row of length `width` for each coefficient.
    pub fn solve(&self, lines: &mut [f64], width: usize) {
        let n = self.factor.len();
        for row in 0..n {
            for k in row.saturating_sub(3)..row {
                subtract_row(lines, width, row, k, self.factor[row][3 + k - row]);
            }
            scale_row(lines, width, row, 1.0 / self.factor[row][3]);
        }
        for row in (0..n).rev() {
            for k in row + 1..(row + 4).min(n) {
                subtract_row(lines, width, row, k, self.factor[k][3 + row - k]);
            }
            scale_row(lines, width, row, 1.0 / self.factor[row][3]);
        }
    }
}

/// The lower half of M, stored like the Cholesky factor.
fn mass_band(samples: &[Sample], coefficients: usize) -> Vec<[f64; 4]> {
    let mut band = vec![[0.0; 4]; coefficients];
    for s in samples {
        for i in 0..4 {
            for j in 0..=i {
                band[s.first + i][3 + j - i] += s.weight * s.value[i] * s.value[j];
            }
        }
    }
    band
}

/// The Cholesky factor of a positive definite matrix, `[row][k]` = M[row][row − 3 + k].
fn banded_cholesky(mut factor: Vec<[f64; 4]>) -> Vec<[f64; 4]> {
    for row in 0..factor.len() {
        for k in row.saturating_sub(3)..=row {
            let mut sum = factor[row][3 + k - row];
            for l in row.saturating_sub(3)..k {
                // L[k][l] is in the band whenever l ≥ k − 3, which l ≥ row − 3 implies.
                sum -= factor[row][3 + l - row] * factor[k][3 + l - k];
            }
            factor[row][3 + k - row] = if k == row { sum.sqrt() } else { sum / factor[k][3] };
        }
    }
    factor
}

/// Row `to` −= factor · row `from`.
fn subtract_row(lines: &mut [f64], width: usize, to: usize, from: usize, factor: f64) {
    let (low, high) = lines.split_at_mut(to.max(from) * width);
    let (a, b) = (&mut low[to.min(from) * width..][..width], &mut high[..width]);
    let (target, source) = if to < from { (a, b) } else { (b, a) };
    for (t, s) in target.iter_mut().zip(source) {
        *t -= factor * *s;
    }
}

fn scale_row(lines: &mut [f64], width: usize, row: usize, factor: f64) {
    for v in &mut lines[row * width..][..width] {
        *v *= factor;
    }
}
