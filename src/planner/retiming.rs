//! When the guessed base is where on its way, so that every foot stays within reach of its foothold: slower on a staircase, waiting
//! before a gap.
//!
//! The way is fixed; s_k is how far the base is at sample k, m. It minimizes, with squares summed over time,
//!
//! ```text
//!   ∑ (s̈² w_a + (s − ŝ)² w_n + (s below or above a corridor)² + (ṡ below 0)²) Δt,
//! ```
//!
//! where ŝ is the steady travel, and each standing foot is a corridor: from where to where the base can be while the foothold
//! is within the reach box. The sum is convex and piecewise quadratic; Newton's method finds its minimum in a few steps, each
//! with a matrix of two bands.

/// w_a, s⁴: an acceleration of 1 m/s² costs as much as 2 cm out of reach.
const ACCELERATION: f64 = 4e-4;
/// w_n.
const NOMINAL: f64 = 2e-4;
/// Limit on the Newton steps; the active corridors stop changing after 5 to 15.
const STEPS: usize = 30;

/// Where the base can be during a stance.
#[derive(Clone, Copy, Debug)]
pub struct Corridor {
    /// First and last sample.
    pub samples: [usize; 2],
    /// Least and greatest s, m.
    pub range: [f64; 2],
}

/// s at each sample, from the steady travel; at the samples of some `pins`, given values.
pub fn retimed(nominal: &[f64], corridors: &[Corridor], pins: &[(usize, f64)], time_step: f64) -> Vec<f64> {
    let n = nominal.len();
    if n < 5 {
        return nominal.to_vec();
    }
    let mut s = nominal.to_vec();
    let mut active = Vec::new();
    for _ in 0..STEPS {
        let before = std::mem::take(&mut active);
        let mut system = Banded::new(n);
        for (k, nominal) in nominal.iter().enumerate() {
            system.add(&[(k, 1.0)], *nominal, NOMINAL);
        }
        for k in 1..n - 1 {
            let weight = ACCELERATION / time_step.powi(4);
            system.add(&[(k - 1, 1.0), (k, -2.0), (k + 1, 1.0)], 0.0, weight);
        }
        for (c, corridor) in corridors.iter().enumerate() {
            for k in corridor.samples[0]..=corridor.samples[1].min(n - 1) {
                let [least, most] = corridor.range;
                let bound = if s[k] < least { least } else { most };
                if s[k] < least || s[k] > most {
                    system.add(&[(k, 1.0)], bound, 1.0);
                    active.push((c, k));
                }
            }
        }
        for k in 1..n {
            if s[k] < s[k - 1] {
                system.add(&[(k, 1.0), (k - 1, -1.0)], 0.0, 1.0 / time_step.powi(2));
                active.push((corridors.len(), k));
            }
        }
        // At rest at both ends.
        for k in [0, 1, n - 2, n - 1] {
            system.pin(k, nominal[k]);
        }
        for &(k, value) in pins {
            system.pin(k, value);
        }
        s = system.solve();
        if active == before {
            break;
        }
    }
    s
}

/// A symmetric matrix with two bands on each side of the diagonal, and a right side: the normal equations of weighted rows.
struct Banded {
    /// `[k][j]`: entry (k, k + j).
    bands: Vec<[f64; 3]>,
    right: Vec<f64>,
}

/// What a pinned unknown weighs.
const PIN: f64 = 1e9;

impl Banded {
    fn new(n: usize) -> Self {
        Self { bands: vec![[0.0; 3]; n], right: vec![0.0; n] }
    }

    /// Adds weight · (∑ factor · unknown − value)².
    fn add(&mut self, row: &[(usize, f64)], value: f64, weight: f64) {
        for &(i, a) in row {
            self.right[i] += weight * a * value;
            for &(j, b) in row.iter().filter(|(j, _)| *j >= i) {
                self.bands[i][j - i] += weight * a * b;
            }
        }
    }

    fn pin(&mut self, k: usize, value: f64) {
        self.add(&[(k, 1.0)], value, PIN);
    }

    /// By LDLᵀ; the matrix is positive definite.
    fn solve(mut self) -> Vec<f64> {
        let n = self.right.len();
        for k in 0..n {
            let [pivot, first, second] = self.bands[k];
            let [l1, l2] = [first / pivot, second / pivot];
            if k + 1 < n {
                self.bands[k + 1][0] -= l1 * first;
                self.bands[k + 1][1] -= l1 * second;
                self.right[k + 1] -= l1 * self.right[k];
            }
            if k + 2 < n {
                self.bands[k + 2][0] -= l2 * second;
                self.right[k + 2] -= l2 * self.right[k];
            }
        }
        for k in (0..n).rev() {
            let after = |j: usize| self.right.get(k + j).copied().unwrap_or(0.0);
            let [pivot, first, second] = self.bands[k];
            self.right[k] = (self.right[k] - first * after(1) - second * after(2)) / pivot;
        }
        self.right
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    fn steady() -> Vec<f64> {
        (0..=100).map(|k| 0.03 * f64::from(k)).collect()
    }

    #[test]
    fn a_way_within_all_corridors_stays() {
        let nominal = steady();
        let corridor = Corridor { samples: [10, 60], range: [0.0, 2.0] };
        let s = retimed(&nominal, &[corridor], &[], 0.05);
        assert!(s.iter().zip(&nominal).all(|(a, b)| (a - b).abs() < 1e-6));
    }

    #[test]
    fn the_base_waits_for_a_foot_and_catches_up() {
        let nominal = steady();
        let s = retimed(&nominal, &[Corridor { samples: [40, 60], range: [0.9, 1.5] }], &[], 0.05);
        assert!(s[60] < 1.53 && s[60] > 1.45, "{}", s[60]);
        assert!((s[0] - nominal[0]).abs() < 1e-6 && (s[100] - nominal[100]).abs() < 1e-6);
        assert!(s.windows(2).all(|p| p[1] - p[0] > -1e-3));
        assert!((s[10] - nominal[10]).abs() < 0.1);
    }
}
