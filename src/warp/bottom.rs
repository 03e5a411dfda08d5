//! The L² projection of functions onto the splines of the box's bottom face, and its adjoint.

use super::axis::{MapAxis, Projection, Sample};

/// The splines of the bottom face, and a tensor grid of Gauss points.
pub(super) struct Bottom {
    axes: [MapAxis; 2],
    x: Projection,
    y: Projection,
}

impl Bottom {
    /// The face spanned by two axes.
    pub fn new(x: &MapAxis, y: &MapAxis) -> Bottom {
        Bottom { axes: [*x, *y], x: Projection::new(x), y: Projection::new(y) }
    }

    /// The Gauss points, in cells from the corner, y fastest.
    pub fn positions(&self) -> impl Iterator<Item = [f64; 2]> {
        self.x.samples.iter().flat_map(|sx| self.y.samples.iter().map(|sy| [sx.at, sy.at]))
    }

    /// Turns face coefficients into the control points of a two-dimensional spline, in place.
    pub fn to_control_points(&self, coefficients: &mut Vec<f64>) {
        let [nx, ny] = self.axes.map(|a| a.len());
        for line in coefficients.chunks_exact_mut(ny) {
            self.axes[1].face_to_control(line);
        }
        let mut turned = transposed(coefficients, nx, ny);
        for line in turned.chunks_exact_mut(nx) {
            self.axes[0].face_to_control(line);
        }
        *coefficients = transposed(&turned, ny, nx);
    }

    /// B u: the spline with these face coefficients (nx · ny) at the Gauss points.
    pub fn values(&self, coefficients: &[f64]) -> Vec<f64> {
        let ny = self.axes[1].len();
        let along_x = expand(&self.x.samples, coefficients, ny);
        // y is the fast axis.
        along_x.chunks_exact(ny).flat_map(|row| self.y.samples.iter().map(|s| dot(s, row))).collect()
    }

    /// Bᵀ f: the adjoint of [`Bottom::values`].
    pub fn values_adjoint(&self, values: &[f64]) -> Vec<f64> {
        self.gather(values, |_| 1.0)
    }

    /// M⁻¹ Bᵀ W f: the coefficients of the L² projection of a function given at the Gauss points.
    pub fn project(&self, values: &[f64]) -> Vec<f64> {
        let mut out = self.gather(values, |s| s.weight);
        self.solve(&mut out);
        out
    }

    /// W B M⁻¹ g: the adjoint of [`Bottom::project`].
    pub fn project_adjoint(&self, gradient: &[f64]) -> Vec<f64> {
        let mut inverse = gradient.to_vec();
        self.solve(&mut inverse);
        self.weighted(&self.values(&inverse))
    }

    /// W f: values at the Gauss points times the quadrature weights.
    pub fn weighted(&self, values: &[f64]) -> Vec<f64> {
        let mut out = values.to_vec();
        for (row, sx) in out.chunks_exact_mut(self.y.samples.len()).zip(&self.x.samples) {
            for (v, sy) in row.iter_mut().zip(&self.y.samples) {
                *v *= sx.weight * sy.weight;
            }
        }
        out
    }

    /// Bᵀ f, with each point multiplied by a factor for each axis.
    fn gather(&self, values: &[f64], factor: impl Fn(&Sample) -> f64) -> Vec<f64> {
        let [nx, ny] = self.axes.map(|a| a.len());
        let mut out = vec![0.0; nx * ny];
        let mut row = vec![0.0; ny];
        for (line, sx) in values.chunks_exact(self.y.samples.len()).zip(&self.x.samples) {
            row.fill(0.0);
            for (v, sy) in line.iter().zip(&self.y.samples) {
                for k in 0..4 {
                    row[sy.first + k] += factor(sy) * sy.value[k] * v;
                }
            }
            for i in 0..4 {
                let weight = factor(sx) * sx.value[i];
                for (o, r) in out[(sx.first + i) * ny..][..ny].iter_mut().zip(&row) {
                    *o += weight * r;
                }
            }
        }
        out
    }

    /// Applies M⁻¹ along both axes, in place.
    fn solve(&self, coefficients: &mut Vec<f64>) {
        let [nx, ny] = self.axes.map(|a| a.len());
        self.x.solve(coefficients, ny);
        let mut turned = transposed(coefficients, nx, ny);
        self.y.solve(&mut turned, nx);
        *coefficients = transposed(&turned, ny, nx);
    }
}

/// The spline with these coefficients at a point.
fn dot(sample: &Sample, line: &[f64]) -> f64 {
    (0..4).map(|k| sample.value[k] * line[sample.first + k]).sum()
}

/// Rows of length `width` at the samples, from such rows at the coefficients.
fn expand(samples: &[Sample], coefficients: &[f64], width: usize) -> Vec<f64> {
    let mut out = vec![0.0; samples.len() * width];
    for (row, s) in out.chunks_exact_mut(width).zip(samples) {
        for k in 0..4 {
            let source = &coefficients[(s.first + k) * width..][..width];
            for (o, c) in row.iter_mut().zip(source) {
                *o += s.value[k] * c;
            }
        }
    }
    out
}

fn transposed(matrix: &[f64], rows: usize, columns: usize) -> Vec<f64> {
    let mut out = vec![0.0; matrix.len()];
    for i in 0..rows {
        for j in 0..columns {
            out[j * rows + i] = matrix[i * columns + j];
        }
    }
    out
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

    #[test]
    fn projection_reproduces_splines() {
        let (bottom, nx, ny) = bottom();
        let coefficients = wave(nx * ny, 0.2);
        let back = bottom.project(&bottom.values(&coefficients));
        for (a, b) in back.iter().zip(&coefficients) {
            assert!((a - b).abs() < 1e-10, "{a} {b}");
        }
    }

    #[test]
    fn adjoints_are_adjoint() {
        let (bottom, nx, ny) = bottom();
        let (u, f) = (wave(nx * ny, 0.4), wave(bottom.positions().count(), 1.1));
        let inner = |a: &[f64], b: &[f64]| a.iter().zip(b).map(|(x, y)| x * y).sum::<f64>();
        assert!((inner(&bottom.values(&u), &f) - inner(&u, &bottom.values_adjoint(&f))).abs() < 1e-10);
        assert!((inner(&bottom.project(&f), &u) - inner(&f, &bottom.project_adjoint(&u))).abs() < 1e-10);
    }

    #[test]
    fn end_coefficients_are_face_values() {
        let axis = MapAxis { cells: 5, cell: 0.2 };
        let mut line = wave(8, 0.0);
        axis.control_to_face(&mut line);
        for (at, index) in [(0.0, 0), (5.0, 7)] {
            let s = axis.sample(at, 0.0);
            assert!((dot(&s, &line) - line[index]).abs() < 1e-14);
        }
        let middle = dot(&axis.sample(2.3, 0.0), &line);
        let mut control = line;
        axis.face_to_control(&mut control);
        assert!(control.iter().zip(wave(8, 0.0)).all(|(a, b)| (a - b).abs() < 1e-14));
        let w = axis_weights::<1>(2.3, 5);
        let expected: f64 = (0..4).map(|k| w.weight[0][k] * control[w.first + k]).sum();
        assert!((middle - expected).abs() < 1e-14);
    }
}
