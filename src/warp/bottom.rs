//! The L² projection of functions onto the splines of the box's bottom face, and its adjoint.

use pulp::NullaryFnOnce;

use super::axis::{MapAxis, Projection};
use super::lanes::vectorized;

/// The splines of the bottom face, and a tensor grid of Gauss points.
pub(super) struct Bottom {
    axes: [MapAxis; 2],
    x: Projection,
    y: Projection,
    /// By cell along y, the basis functions at its Gauss points, and the same times the weights of these points.
    taps: Vec<[CellPoints; 4]>,
    weighted_taps: Vec<[CellPoints; 4]>,
    /// Rows of coefficients along y, one for each Gauss point along x.
    rows: Vec<f64>,
    /// Coefficients.
    inverse: Vec<f64>,
    turned: Vec<f64>,
}

/// Gauss points of a cell, along one axis.
const POINTS: usize = 4;
/// Numbers at these points.
type CellPoints = [f64; POINTS];

impl Bottom {
    /// The face spanned by two axes.
    pub fn new(x: &MapAxis, y: &MapAxis) -> Bottom {
        let axes = [*x, *y];
        let [x, y] = axes.map(|axis| Projection::new(&axis));
        let cells = y.samples.chunks_exact(POINTS);
        let taps: Vec<[CellPoints; 4]> =
            cells.clone().map(|s| std::array::from_fn(|k| std::array::from_fn(|l| s[l].value[k]))).collect();
        let weighted_taps = cells
            .map(|s| std::array::from_fn(|k| std::array::from_fn(|l| s[l].weight * s[l].value[k])))
            .collect();
        let coefficients = axes[0].len() * axes[1].len();
        Bottom {
            rows: vec![0.0; x.samples.len() * axes[1].len()],
            inverse: vec![0.0; coefficients],
            turned: vec![0.0; coefficients],
            axes,
            x,
            y,
            taps,
            weighted_taps,
        }
    }

    /// The number of Gauss points.
    pub fn len(&self) -> usize {
        self.x.samples.len() * self.y.samples.len()
    }

    /// The Gauss points, in cells from the corner, y fastest.
    pub fn positions(&self) -> impl Iterator<Item = [f64; 2]> {
        self.x.samples.iter().flat_map(|sx| self.y.samples.iter().map(|sy| [sx.at, sy.at]))
    }

    /// Turns face coefficients into the control points of a two-dimensional spline, in place.
    pub fn turn_into_control_points(&mut self, coefficients: &mut [f64]) {
        let [nx, ny] = self.axes.map(|a| a.len());
        for line in coefficients.chunks_exact_mut(ny) {
            self.axes[1].face_to_control(line);
        }
        transpose(coefficients, nx, ny, &mut self.turned);
        for line in self.turned.chunks_exact_mut(nx) {
            self.axes[0].face_to_control(line);
        }
        transpose(&self.turned, ny, nx, coefficients);
    }

    /// `out` ← B u: the spline with these face coefficients (nx · ny) at the Gauss points.
    pub fn values(&mut self, coefficients: &[f64], out: &mut [f64]) {
        vectorized(Values { bottom: self, coefficients, out });
    }

    /// `out` ← Bᵀ f: the adjoint of [`Bottom::values`].
    pub fn values_adjoint(&mut self, values: &[f64], out: &mut [f64]) {
        vectorized(Gather { bottom: self, values, weighted: false, out });
    }

    /// `out` ← M⁻¹ Bᵀ W f: the coefficients of the L² projection of a function given at the Gauss points.
    pub fn project(&mut self, values: &[f64], out: &mut [f64]) {
        vectorized(Gather { bottom: self, values, weighted: true, out });
        self.solve(out);
    }

    /// `out` ← W B M⁻¹ g: the adjoint of [`Bottom::project`].
    pub fn project_adjoint(&mut self, gradient: &[f64], out: &mut [f64]) {
        let mut inverse = std::mem::take(&mut self.inverse);
        inverse.copy_from_slice(gradient);
        self.solve(&mut inverse);
        self.values(&inverse, out);
        self.inverse = inverse;
        self.weigh(out);
    }

    /// f ← W f: values at the Gauss points times the quadrature weights.
    pub fn weigh(&self, values: &mut [f64]) {
        for (row, sx) in values.chunks_exact_mut(self.y.samples.len()).zip(&self.x.samples) {
            for (v, sy) in row.iter_mut().zip(&self.y.samples) {
                *v *= sx.weight * sy.weight;
            }
        }
    }

    /// Applies M⁻¹ along both axes, in place.
    fn solve(&mut self, coefficients: &mut [f64]) {
        let [nx, ny] = self.axes.map(|a| a.len());
        self.x.solve(coefficients, ny);
        transpose(coefficients, nx, ny, &mut self.turned);
        self.y.solve(&mut self.turned, nx);
        transpose(&self.turned, ny, nx, coefficients);
    }
}

/// The arguments of [`Bottom::values`].
struct Values<'a> {
    bottom: &'a mut Bottom,
    coefficients: &'a [f64],
    out: &'a mut [f64],
}

impl NullaryFnOnce for Values<'_> {
    type Output = ();

    #[inline(always)]
    fn call(self) {
        let Bottom { axes, x, taps, rows, .. } = self.bottom;
        let ny = axes[1].len();
        let lines = self.out.chunks_exact_mut(POINTS * axes[1].cells);
        for ((row, line), s) in rows.chunks_exact_mut(ny).zip(lines).zip(&x.samples) {
            let source = |k: usize| &self.coefficients[(s.first + k) * ny..][..ny];
            let sources = source(0).iter().zip(source(1)).zip(source(2)).zip(source(3));
            let w = &s.value;
            for (r, (((a, b), c), d)) in row.iter_mut().zip(sources) {
                *r = w[0] * a + w[1] * b + w[2] * c + w[3] * d;
            }
            // y is the fast axis.
            let cells = line.as_chunks_mut::<POINTS>().0;
            for ((out, taps), r) in cells.iter_mut().zip(taps.iter()).zip(row.windows(4)) {
                for l in 0..POINTS {
                    out[l] = r[0] * taps[0][l] + r[1] * taps[1][l] + r[2] * taps[2][l] + r[3] * taps[3][l];
                }
            }
        }
    }
}

/// The arguments of [`Bottom::values_adjoint`] and [`Bottom::project`]: Bᵀ f, or `weighted` Bᵀ W f.
struct Gather<'a> {
    bottom: &'a mut Bottom,
    values: &'a [f64],
    weighted: bool,
    out: &'a mut [f64],
}

impl NullaryFnOnce for Gather<'_> {
    type Output = ();

    #[inline(always)]
    fn call(self) {
        let Bottom { axes, x, taps, weighted_taps, rows, .. } = self.bottom;
        let ny = axes[1].len();
        let taps = if self.weighted { weighted_taps } else { taps };
        let row = &mut rows[..ny];
        self.out.fill(0.0);
        for (line, s) in self.values.chunks_exact(POINTS * axes[1].cells).zip(&x.samples) {
            row.fill(0.0);
            for (cell, (values, taps)) in line.as_chunks::<POINTS>().0.iter().zip(taps.iter()).enumerate() {
                for (r, t) in row[cell..cell + 4].iter_mut().zip(taps) {
                    *r += t[0] * values[0] + t[1] * values[1] + t[2] * values[2] + t[3] * values[3];
                }
            }
            for k in 0..4 {
                let weight = if self.weighted { s.weight * s.value[k] } else { s.value[k] };
                for (o, r) in self.out[(s.first + k) * ny..][..ny].iter_mut().zip(row.iter()) {
                    *o += weight * r;
                }
            }
        }
    }
}

/// `out` ← the transposed matrix.
fn transpose(matrix: &[f64], rows: usize, columns: usize, out: &mut [f64]) {
    for i in 0..rows {
        for j in 0..columns {
            out[j * rows + i] = matrix[i * columns + j];
        }
    }
}

#[cfg(test)]
mod tests {
    use super::super::basis::axis_weights;
    use super::*;

    fn bottom() -> (Bottom, usize, usize) {
        let (x, y) = (MapAxis { cells: 9, cell: 0.3 }, MapAxis { cells: 6, cell: 0.5 });
        (Bottom::new(&x, &y), x.len(), y.len())
    }

    fn wave(n: usize, phase: f64) -> Vec<f64> {
        (0..n).map(|i| (1.7 * i as f64 + phase).sin()).collect()
    }

    /// The result of one of the operators, which all write to their last argument.
    fn made(n: usize, write: impl FnOnce(&mut [f64])) -> Vec<f64> {
        let mut out = vec![f64::NAN; n];
        write(&mut out);
        out
    }

    #[test]
    fn projection_reproduces_splines() {
        let (mut bottom, nx, ny) = bottom();
        let coefficients = wave(nx * ny, 0.2);
        let values = made(bottom.len(), |out| bottom.values(&coefficients, out));
        let back = made(nx * ny, |out| bottom.project(&values, out));
        for (a, b) in back.iter().zip(&coefficients) {
            assert!((a - b).abs() < 1e-10, "{a} {b}");
        }
    }

    #[test]
    fn values_are_those_of_the_spline() {
        let (mut bottom, nx, ny) = bottom();
        let coefficients = wave(nx * ny, 0.7);
        let values = made(bottom.len(), |out| bottom.values(&coefficients, out));
        for (value, [s, t]) in values.iter().zip(bottom.positions()) {
            let (x, y) = (bottom.axes[0].sample(s, 0.0), bottom.axes[1].sample(t, 0.0));
            let mut sum = 0.0;
            for i in 0..4 {
                for j in 0..4 {
                    sum += x.value[i] * y.value[j] * coefficients[(x.first + i) * ny + y.first + j];
                }
            }
            assert!((value - sum).abs() < 1e-13, "{value} {sum}");
        }
    }

    #[test]
    fn adjoints_are_adjoint() {
        let (mut bottom, nx, ny) = bottom();
        let (u, f) = (wave(nx * ny, 0.4), wave(bottom.len(), 1.1));
        let inner = |a: &[f64], b: &[f64]| a.iter().zip(b).map(|(x, y)| x * y).sum::<f64>();
        let values = made(f.len(), |out| bottom.values(&u, out));
        let values_adjoint = made(u.len(), |out| bottom.values_adjoint(&f, out));
        assert!((inner(&values, &f) - inner(&u, &values_adjoint)).abs() < 1e-10);
        let project = made(u.len(), |out| bottom.project(&f, out));
        let project_adjoint = made(f.len(), |out| bottom.project_adjoint(&u, out));
        assert!((inner(&project, &u) - inner(&f, &project_adjoint)).abs() < 1e-10);
    }

    #[test]
    fn end_coefficients_are_face_values() {
        let axis = MapAxis { cells: 5, cell: 0.2 };
        let mut line = wave(8, 0.0);
        axis.control_to_face(&mut line);
        let value = |at: f64, line: &[f64]| {
            let s = axis.sample(at, 0.0);
            (0..4).map(|k| s.value[k] * line[s.first + k]).sum::<f64>()
        };
        for (at, index) in [(0.0, 0), (5.0, 7)] {
            assert!((value(at, &line) - line[index]).abs() < 1e-14);
        }
        let middle = value(2.3, &line);
        let mut control = line;
        axis.face_to_control(&mut control);
        assert!(control.iter().zip(wave(8, 0.0)).all(|(a, b)| (a - b).abs() < 1e-14));
        let w = axis_weights::<1>(2.3, 5);
        let expected: f64 = (0..4).map(|k| w.weight[0][k] * control[w.first + k]).sum();
        assert!((middle - expected).abs() < 1e-14);
    }
}
