//! Small problems.

use std::ops::ControlFlow;

use warpgait::ipopt::{IpoptError, IterationRecord, NlpProblem, Options, Solution, solve};

/// Solves without a starting guess of the multipliers, and without stopping.
pub fn run(problem: &mut impl NlpProblem, options: &Options) -> Result<Solution, IpoptError> {
    solve(problem, options, &mut go_on)
}

pub fn go_on(_: &IterationRecord, _: &[f64]) -> ControlFlow<()> {
    ControlFlow::Continue(())
}

/// Hock and Schittkowski, problem 71:
/// minimise x₀x₃(x₀ + x₁ + x₂) + x₂ subject to x₀x₁x₂x₃ ≥ 25, ‖x‖² = 40, 1 ≤ xᵢ ≤ 5.
pub struct Hs071 {
    /// Whether Ipopt gets the exact Hessian.
    pub with_hessian: bool,
    pub start: [f64; 4],
    /// What happens on every call of a function, by the function's name.
    pub on_call: Box<dyn FnMut(&'static str) + Send>,
    jacobian_rows: Vec<i32>,
}

/// Its optimum, from the literature.
pub const HS071_X: [f64; 4] = [1.0, 4.742_999_64, 3.821_149_98, 1.379_408_29];
pub const HS071_OBJECTIVE: f64 = 17.014_017_3;

const JACOBIAN_ROWS: [i32; 8] = [0, 0, 0, 0, 1, 1, 1, 1];
const JACOBIAN_COLUMNS: [i32; 8] = [0, 1, 2, 3, 0, 1, 2, 3];
const HESSIAN_ROWS: [i32; 10] = [0, 1, 1, 2, 2, 2, 3, 3, 3, 3];
const HESSIAN_COLUMNS: [i32; 10] = [0, 0, 1, 0, 1, 2, 0, 1, 2, 3];

impl Hs071 {
    pub fn new(with_hessian: bool) -> Self {
        Self {
            with_hessian,
            start: [1.0, 5.0, 5.0, 1.0],
            on_call: Box::new(|_| ()),
            jacobian_rows: JACOBIAN_ROWS.to_vec(),
        }
    }

    pub fn with_jacobian_rows(rows: Vec<i32>) -> Self {
        Self { jacobian_rows: rows, ..Self::new(true) }
    }
}

impl NlpProblem for Hs071 {
    fn num_variables(&self) -> usize {
        4
    }

    fn num_constraints(&self) -> usize {
        2
    }

    fn variable_bounds(&self, lower: &mut [f64], upper: &mut [f64]) {
        lower.fill(1.0);
        upper.fill(5.0);
    }

    fn constraint_bounds(&self, lower: &mut [f64], upper: &mut [f64]) {
        lower.copy_from_slice(&[25.0, 40.0]);
        upper.copy_from_slice(&[f64::INFINITY, 40.0]);
    }

    fn initial_point(&self, x: &mut [f64]) {
        x.copy_from_slice(&self.start);
    }

    fn objective(&mut self, x: &[f64], _new_x: bool) -> f64 {
        (self.on_call)("objective");
        x[0] * x[3] * (x[0] + x[1] + x[2]) + x[2]
    }

    fn gradient(&mut self, x: &[f64], _new_x: bool, out: &mut [f64]) {
        (self.on_call)("gradient");
        out[0] = x[3] * (2.0 * x[0] + x[1] + x[2]);
        out[1] = x[0] * x[3];
        out[2] = x[0] * x[3] + 1.0;
        out[3] = x[0] * (x[0] + x[1] + x[2]);
    }

    fn constraints(&mut self, x: &[f64], _new_x: bool, out: &mut [f64]) {
        (self.on_call)("constraints");
        out[0] = x.iter().product();
        out[1] = x.iter().map(|v| v * v).sum();
    }

    fn jacobian_structure(&self) -> (&[i32], &[i32]) {
        (&self.jacobian_rows, &JACOBIAN_COLUMNS)
    }

    fn jacobian_values(&mut self, x: &[f64], _new_x: bool, out: &mut [f64]) {
        (self.on_call)("jacobian");
        for i in 0..4 {
            out[i] = (0..4).filter(|&j| j != i).map(|j| x[j]).product();
            out[4 + i] = 2.0 * x[i];
        }
    }

    fn hessian_structure(&self) -> Option<(&[i32], &[i32])> {
        self.with_hessian.then_some((&HESSIAN_ROWS, &HESSIAN_COLUMNS))
    }

    fn hessian_values(
        &mut self,
        x: &[f64],
        _new_x: bool,
        objective_factor: f64,
        multipliers: &[f64],
        _new_multipliers: bool,
        out: &mut [f64],
    ) {
        (self.on_call)("hessian");
        let objective = [2.0 * x[3], x[3], 0.0, x[3], 0.0, 0.0, 2.0 * x[0] + x[1] + x[2], x[0], x[0], 0.0];
        for (entry, (&row, &column)) in HESSIAN_ROWS.iter().zip(&HESSIAN_COLUMNS).enumerate() {
            let (row, column) = (row as usize, column as usize);
            let constraints = if row == column {
                2.0 * multipliers[1]
            } else {
                let others = (0..4).filter(|&k| k != row && k != column);
                multipliers[0] * others.map(|k| x[k]).product::<f64>()
            };
            out[entry] = objective_factor * objective[entry] + constraints;
        }
    }
}

/// Minimise x₀ + x₁ subject to x₀² + x₁² = `right_side`; infeasible where that is negative.
pub struct Circle {
    pub right_side: f64,
}

impl NlpProblem for Circle {
    fn num_variables(&self) -> usize {
        2
    }

    fn num_constraints(&self) -> usize {
        1
    }

    fn variable_bounds(&self, lower: &mut [f64], upper: &mut [f64]) {
        lower.fill(f64::NEG_INFINITY);
        upper.fill(f64::INFINITY);
    }

    fn constraint_bounds(&self, lower: &mut [f64], upper: &mut [f64]) {
        lower.fill(self.right_side);
        upper.fill(self.right_side);
    }

    fn initial_point(&self, x: &mut [f64]) {
        x.copy_from_slice(&[2.0, 1.0]);
    }

    fn objective(&mut self, x: &[f64], _new_x: bool) -> f64 {
        x[0] + x[1]
    }

    fn gradient(&mut self, _x: &[f64], _new_x: bool, out: &mut [f64]) {
        out.fill(1.0);
    }

    fn constraints(&mut self, x: &[f64], _new_x: bool, out: &mut [f64]) {
        out[0] = x[0] * x[0] + x[1] * x[1];
    }

    fn jacobian_structure(&self) -> (&[i32], &[i32]) {
        (&[0, 0], &[0, 1])
    }

    fn jacobian_values(&mut self, x: &[f64], _new_x: bool, out: &mut [f64]) {
        out.copy_from_slice(&[2.0 * x[0], 2.0 * x[1]]);
    }
}

/// Minimise Σ (xᵢ − i)⁴, with no constraints, and x₀ fixed at 3.
pub struct Unconstrained;

impl NlpProblem for Unconstrained {
    fn num_variables(&self) -> usize {
        3
    }

    fn num_constraints(&self) -> usize {
        0
    }

    fn variable_bounds(&self, lower: &mut [f64], upper: &mut [f64]) {
        lower.copy_from_slice(&[3.0, f64::NEG_INFINITY, 2.5]);
        upper.copy_from_slice(&[3.0, f64::INFINITY, f64::INFINITY]);
    }

    fn constraint_bounds(&self, lower: &mut [f64], upper: &mut [f64]) {
        assert!(lower.is_empty() && upper.is_empty());
    }

    fn initial_point(&self, x: &mut [f64]) {
        x.fill(10.0);
    }

    fn objective(&mut self, x: &[f64], _new_x: bool) -> f64 {
        (0..3).map(|i| (x[i] - i as f64).powi(4)).sum()
    }

    fn gradient(&mut self, x: &[f64], _new_x: bool, out: &mut [f64]) {
        for i in 0..3 {
            out[i] = 4.0 * (x[i] - i as f64).powi(3);
        }
    }

    fn constraints(&mut self, _x: &[f64], _new_x: bool, out: &mut [f64]) {
        assert!(out.is_empty());
    }

    fn jacobian_structure(&self) -> (&[i32], &[i32]) {
        (&[], &[])
    }

    fn jacobian_values(&mut self, _x: &[f64], _new_x: bool, out: &mut [f64]) {
        assert!(out.is_empty());
    }
}

/// minimise Σᵢ (sin(i + 3xᵢ) + (xᵢ − aᵢ)²/5) subject to xᵢ xᵢ₊₁ + sin(2xᵢ) = bᵢ for i < n/2 and |xᵢ| ≤ 4, where a and b
/// are pseudo-random: not convex, and not always feasible.
///
/// Counts how often `new_x` was false although x was not the one of the call before.
pub struct Wavy {
    targets: Vec<f64>,
    right_sides: Vec<f64>,
    rows: Vec<i32>,
    columns: Vec<i32>,
    last_x: Vec<f64>,
    pub false_new_x: usize,
}

impl Wavy {
    pub fn new(n: usize, seed: u64) -> Self {
        let mut state = seed.wrapping_mul(0x9E37_79B9_7F4A_7C15) | 1;
        let mut random = || {
            state ^= state << 13;
            state ^= state >> 7;
            state ^= state << 17;
            4.0 * (state >> 11) as f64 / (1u64 << 53) as f64 - 2.0
        };
        let rows = (0..n as i32 / 2).flat_map(|row| [row, row]).collect();
        let columns = (0..n as i32 / 2).flat_map(|row| [row, row + 1]).collect();
        Self {
            targets: (0..n).map(|_| random()).collect(),
            right_sides: (0..n / 2).map(|_| random()).collect(),
            rows,
            columns,
            last_x: vec![f64::NAN; n],
            false_new_x: 0,
        }
    }

    fn see(&mut self, x: &[f64], new_x: bool) {
        if !new_x && self.last_x != x {
            self.false_new_x += 1;
        }
        self.last_x.copy_from_slice(x);
    }
}

impl NlpProblem for Wavy {
    fn num_variables(&self) -> usize {
        self.targets.len()
    }

    fn num_constraints(&self) -> usize {
        self.right_sides.len()
    }

    fn variable_bounds(&self, lower: &mut [f64], upper: &mut [f64]) {
        lower.fill(-4.0);
        upper.fill(4.0);
    }

    fn constraint_bounds(&self, lower: &mut [f64], upper: &mut [f64]) {
        lower.copy_from_slice(&self.right_sides);
        upper.copy_from_slice(&self.right_sides);
    }

    fn initial_point(&self, x: &mut [f64]) {
        x.copy_from_slice(&self.targets);
    }

    fn objective(&mut self, x: &[f64], new_x: bool) -> f64 {
        self.see(x, new_x);
        let term = |(i, (x, a)): (usize, (&f64, &f64))| (i as f64 + 3.0 * x).sin() + (x - a).powi(2) / 5.0;
        x.iter().zip(&self.targets).enumerate().map(term).sum()
    }

    fn gradient(&mut self, x: &[f64], new_x: bool, out: &mut [f64]) {
        self.see(x, new_x);
        for i in 0..x.len() {
            out[i] = 3.0 * (i as f64 + 3.0 * x[i]).cos() + 0.4 * (x[i] - self.targets[i]);
        }
    }

    fn constraints(&mut self, x: &[f64], new_x: bool, out: &mut [f64]) {
        self.see(x, new_x);
        for i in 0..out.len() {
            out[i] = x[i] * x[i + 1] + (2.0 * x[i]).sin();
        }
    }

    fn jacobian_structure(&self) -> (&[i32], &[i32]) {
        (&self.rows, &self.columns)
    }

    fn jacobian_values(&mut self, x: &[f64], new_x: bool, out: &mut [f64]) {
        self.see(x, new_x);
        for i in 0..x.len() / 2 {
            out[2 * i] = x[i + 1] + 2.0 * (2.0 * x[i]).cos();
            out[2 * i + 1] = x[i];
        }
    }
}
