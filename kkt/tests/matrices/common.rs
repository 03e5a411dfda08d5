//! Matrices for the tests, and what dense linear algebra says of them.

#![allow(dead_code)]

use faer::Mat;
use kkt::{Factored, Kkt, Layout};

/// SplitMix64.
pub struct Random(pub u64);

impl Random {
    pub fn bits(&mut self) -> u64 {
        self.0 = self.0.wrapping_add(0x9E37_79B9_7F4A_7C15);
        let mut z = self.0;
        z = (z ^ (z >> 30)).wrapping_mul(0xBF58_476D_1CE4_E5B9);
        z = (z ^ (z >> 27)).wrapping_mul(0x94D0_49BB_1331_11EB);
        z ^ (z >> 31)
    }

    /// From −1 to 1.
    pub fn number(&mut self) -> f64 {
        (self.bits() >> 11) as f64 / (1u64 << 52) as f64 - 1.0
    }

    pub fn below(&mut self, bound: usize) -> usize {
        (self.bits() % bound as u64) as usize
    }
}

/// A matrix by its entries, lower triangle or upper.
#[derive(Clone, Debug)]
pub struct Matrix {
    pub layout: Layout,
    pub rows: Vec<u32>,
    pub columns: Vec<u32>,
    pub values: Vec<f64>,
}

impl Matrix {
    pub fn new(variables: usize, inequalities: usize, equations: usize) -> Self {
        let layout = Layout { variables, inequalities, equations };
        Self { layout, rows: vec![], columns: vec![], values: vec![] }
    }

    pub fn dimension(&self) -> usize {
        self.layout.dimension()
    }

    pub fn add(&mut self, row: usize, column: usize, value: f64) {
        self.rows.push(row as u32);
        self.columns.push(column as u32);
        self.values.push(value);
    }

    pub fn slack(&self, k: usize) -> usize {
        self.layout.variables + k
    }

    pub fn equation(&self, k: usize) -> usize {
        self.layout.variables + self.layout.inequalities + k
    }

    pub fn multiplier(&self, k: usize) -> usize {
        self.equation(self.layout.equations) + k
    }

    pub fn dense(&self) -> Mat<f64> {
        let mut dense = Mat::zeros(self.dimension(), self.dimension());
        for ((&i, &j), &value) in self.rows.iter().zip(&self.columns).zip(&self.values) {
            let (i, j) = (i as usize, j as usize);
            dense[(i, j)] += value;
            if i != j {
                dense[(j, i)] += value;
            }
        }
        dense
    }

    /// Those of the matrix after a scaling of rows and columns, which leaves their signs (Sylvester) and makes them as exact as can be.
    pub fn scaled_eigenvalues(&self) -> Vec<f64> {
        let mut dense = self.dense();
        let n = self.dimension();
        for _ in 0..3 {
            let largest = |i: usize| (0..n).map(|j| dense[(i, j)].abs()).fold(0.0, f64::max);
            let scale = |size: f64| if size > 0.0 { 1.0 / size.sqrt() } else { 1.0 };
            let factors: Vec<f64> = (0..n).map(|i| scale(largest(i))).collect();
            dense = Mat::from_fn(n, n, |i, j| dense[(i, j)] * factors[i] * factors[j]);
        }
        dense.self_adjoint_eigenvalues(faer::Side::Lower).expect("the iteration converges")
    }

    pub fn kkt(&self) -> Kkt {
        Kkt::new(self.layout, &self.rows, &self.columns).expect("the entries lie inside the matrix")
    }

    /// ‖b − Kx‖ / (‖K‖ ‖x‖ + ‖b‖), max norms.
    pub fn backward_error(&self, x: &[f64], b: &[f64]) -> f64 {
        let (mut residual, mut sums) = (b.to_vec(), vec![0.0; b.len()]);
        for ((&i, &j), &value) in self.rows.iter().zip(&self.columns).zip(&self.values) {
            let (i, j) = (i as usize, j as usize);
            residual[i] -= value * x[j];
            sums[i] += value.abs();
            if i != j {
                residual[j] -= value * x[i];
                sums[j] += value.abs();
            }
        }
        let norm = |v: &[f64]| v.iter().fold(0.0, |a: f64, b| a.max(b.abs()));
        norm(&residual) / (norm(&sums) * norm(x) + norm(b))
    }

    /// Solves for a random right-hand side, and demands a backward error of 1e-12 unless the solver itself tells of a larger residual.
    /// Returns the residual it tells of.
    #[track_caller]
    pub fn check_solve(&self, kkt: &mut Kkt, random: &mut Random) -> f64 {
        let b: Vec<f64> = (0..self.dimension()).map(|_| random.number()).collect();
        let mut x = b.clone();
        let told = kkt.solve(&mut x);
        let found = self.backward_error(&x, &b);
        assert!(found <= 1e-12 || told > 1e-12, "backward error {found:.1e}, told {told:.1e}");
        told
    }

    /// Factors and demands the inertia of the eigenvalues, or that the matrix is called singular. Returns the smallest
    /// eigenvalue over the largest, by magnitude, and the number of negative ones if the matrix is called regular.
    #[track_caller]
    pub fn check_inertia(&self, kkt: &mut Kkt) -> (f64, Option<usize>) {
        let eigenvalues = self.scaled_eigenvalues();
        let size = |pick: fn(f64, f64) -> f64, start| eigenvalues.iter().map(|v| v.abs()).fold(start, pick);
        let (least, most) = (size(f64::min, f64::INFINITY), size(f64::max, 0.0));
        let ratio = if most > 0.0 { least / most } else { 0.0 };
        match kkt.factor(&self.values) {
            Factored::Singular => (ratio, None),
            Factored::Regular { negative } => {
                let expected = eigenvalues.iter().filter(|&&v| v < 0.0).count();
                // The eigenvalues themselves are exact to about 1e-15 of the largest one.
                if ratio > 1e-14 {
                    assert_eq!(negative, expected, "least over largest eigenvalue {ratio:.1e}");
                }
                (ratio, Some(negative))
            }
        }
    }
}
