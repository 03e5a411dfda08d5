//! The energy of a map, the paper's E_map = ∫ w ρ(J) dV (the first term of Eq. 6), and its gradient, by quadrature on a tensor grid.
//!
//! J is computed one axis at a time (sum factorization), and the gradient likewise by the adjoint. The x axis is swept with a window
//! of the four slabs of coefficients that a plane of points depends on. Within a plane, each row of points along z is processed from
//! coefficients to energy and back before the next, so that the working set stays in the cache:
//!
//! slab (contracted along z) → plane (along x) → row (along y) → ρ, ∂ρ/∂J → back to row, plane, slab.

use std::cmp::Ordering;
use std::ops::Range;

use super::axis::{MapAxis, Rule, Sample};
use super::density::{Density, cofactors, determinant};
use super::lanes::{LANES, Lanes};

/// The tensor grid and its weights.
pub(super) struct Assembly {
    axes: [MapAxis; 3],
    x: Vec<Sample>,
    y: Vec<Sample>,
    /// Their weights include the weight of the energy over z̄. The last point is repeated with weight zero to fill the lanes.
    z: Vec<Sample>,
    weight_z: Vec<Lanes>,
}

/// Numbers at a row of points along z.
type PointRow = [Lanes];
/// Point rows for each coefficient along y of a slab: φ₀, φ₁, φ₂ and then ∂φ₀/∂z̄, ∂φ₁/∂z̄, ∂φ₂/∂z̄.
const SLAB_KINDS: usize = 6;
/// Point rows for each coefficient along y of a plane: for each component, the parts of ∂/∂x̄, ∂/∂ȳ, ∂/∂z̄.
const PLANE_KINDS: usize = 9;

impl Assembly {
    /// `weight(z̄)` is the weight of the volume, `face` (m) that of the bottom face.
    pub fn new(axes: [MapAxis; 3], rule: Rule, weight: impl Fn(f64) -> f64, face: f64) -> Assembly {
        let [x, y, mut z] = axes.map(|axis| axis.quadrature(rule));
        for s in &mut z {
            s.weight *= weight(s.at * axes[2].cell);
        }
        if z[0].at == 0.0 {
            z[0].weight += face;
        } else {
            z.insert(0, axes[2].sample(0.0, face));
        }
        while z.len() % LANES != 0 {
            let last = z[z.len() - 1];
            z.push(Sample { weight: 0.0, ..last });
        }
        let weight_z = z.chunks_exact(LANES).map(|s| Lanes(std::array::from_fn(|l| s[l].weight))).collect();
        Assembly { axes, x, y, z, weight_z }
    }

    /// The points along an axis with their weights.
    pub fn samples(&self, axis: usize) -> &[Sample] {
        [&self.x, &self.y, &self.z][axis]
    }

    /// The energy and its gradient with respect to the coefficients (component, x, y, z in C order). If J is not allowed at some
    /// point, the energy is infinite and the gradient meaningless.
    pub fn energy(&self, density: impl Density, coefficients: &[f64], gradient: &mut [f64]) -> f64 {
        self.sweep(coefficients, gradient, |_, jacobian| density.at(jacobian))
    }

    /// The curvature of a density at all points, in the order of [`Assembly::curvature_product`].
    pub fn curvatures<C>(&self, coefficients: &[f64], at: impl Fn(&[Lanes; 9]) -> C) -> Vec<C> {
        let mut found = Vec::with_capacity(self.x.len() * self.y.len() * self.weight_z.len());
        let mut unused = vec![0.0; coefficients.len()];
        self.sweep(coefficients, &mut unused, |_, jacobian| {
            found.push(at(jacobian));
            (Lanes::ZERO, [Lanes::ZERO; 9])
        });
        found
    }

    /// The second derivative of the energy times a direction, from that of the density at all points.
    pub fn curvature_product<C>(
        &self,
        curvatures: &[C],
        times: impl Fn(&C, &[Lanes; 9]) -> [Lanes; 9],
        direction: &[f64],
        out: &mut [f64],
    ) {
        self.sweep(direction, out, |at, change| (Lanes::ZERO, times(&curvatures[at], change)));
    }

    /// Visits all points, with their number and J. Sums the ρ that a visit returns to the energy, its ∂ρ/∂J to the gradient.
    fn sweep(
        &self,
        coefficients: &[f64],
        gradient: &mut [f64],
        mut visit: impl FnMut(usize, &[Lanes; 9]) -> (Lanes, [Lanes; 9]),
    ) -> f64 {
        let blocks = self.weight_z.len();
        let mut window = SlabWindow::new(self, coefficients);
        let mut slab_gradients = window.slabs.clone();
        let mut plane = self.empty(PLANE_KINDS);
        let mut plane_gradient = plane.clone();
        let mut energy = 0.0;
        let mut finished = 0;
        let mut seen = 0;
        for sx in &self.x {
            while finished < sx.first {
                self.slab_adjoint(&slab_gradients[finished % 4], finished, gradient);
                finished += 1;
            }
            for entered in window.advance(sx) {
                slab_gradients[entered % 4].fill(Lanes::ZERO);
            }
            window.plane(sx, &mut plane);
            plane_gradient.fill(Lanes::ZERO);
            for sy in &self.y {
                let weight = sx.weight * sy.weight;
                let visit = |b: usize, jacobian: &[Lanes; 9]| visit(seen + b, jacobian);
                energy += row(visit, sy, weight, &self.weight_z, &plane, &mut plane_gradient);
                seen += blocks;
                if !energy.is_finite() {
                    return f64::INFINITY;
                }
            }
            for k in 0..4 {
                plane_adjoint(sx, k, &plane_gradient, blocks, &mut slab_gradients[(sx.first + k) % 4]);
            }
        }
        for index in finished..window.entered {
            self.slab_adjoint(&slab_gradients[index % 4], index, gradient);
        }
        energy
    }

    /// The least determinant of J over all points, how many determinants are not positive, and the point of the least, in cells.
    pub fn determinants(&self, coefficients: &[f64]) -> (f64, usize, [f64; 3]) {
        let blocks = self.weight_z.len();
        let mut window = SlabWindow::new(self, coefficients);
        let mut plane = self.empty(PLANE_KINDS);
        let (mut least, mut folded, mut at) = (f64::INFINITY, 0, [0.0; 3]);
        for sx in &self.x {
            window.advance(sx);
            window.plane(sx, &mut plane);
            for sy in &self.y {
                for b in 0..blocks {
                    let jacobian = jacobian_lanes(sy, &plane, blocks, b);
                    let determinants = determinant(&jacobian, &cofactors(&jacobian)).0;
                    for (det, sz) in determinants.into_iter().zip(&self.z[b * LANES..]) {
                        let folds = det.partial_cmp(&0.0) != Some(Ordering::Greater);
                        // Points of weight zero only fill the lanes and do not count.
                        folded += usize::from(folds && sz.weight != 0.0);
                        if det < least || det.is_nan() {
                            (least, at) = (det, [sx.at, sy.at, sz.at]);
                        }
                    }
                }
            }
        }
        (least, folded, at)
    }

    /// Zeros for so many point rows for each coefficient along y.
    fn empty(&self, kinds: usize) -> Vec<Lanes> {
        vec![Lanes::ZERO; self.axes[1].len() * kinds * self.weight_z.len()]
    }

    /// Along z: the slab of the coefficients with one index along x.
    fn slab(&self, coefficients: &[f64], index: usize, slab: &mut [Lanes]) {
        let [nx, ny, nz] = self.axes.map(|a| a.len());
        let blocks = self.weight_z.len();
        for (j, row) in slab.chunks_exact_mut(SLAB_KINDS * blocks).enumerate() {
            let (values, slopes) = row.split_at_mut(3 * blocks);
            for c in 0..3 {
                let line = &coefficients[((c * nx + index) * ny + j) * nz..][..nz];
                for (b, samples) in self.z.chunks_exact(LANES).enumerate() {
                    let along = |weights: fn(&Sample) -> &[f64; 4]| {
                        Lanes(std::array::from_fn(|l| {
                            let (w, u) = (weights(&samples[l]), &line[samples[l].first..][..4]);
                            w[0] * u[0] + w[1] * u[1] + w[2] * u[2] + w[3] * u[3]
                        }))
                    };
                    values[c * blocks + b] = along(|s| &s.value);
                    slopes[c * blocks + b] = along(|s| &s.slope);
                }
            }
        }
    }

    /// The adjoint of [`Assembly::slab`].
    fn slab_adjoint(&self, slab: &[Lanes], index: usize, gradient: &mut [f64]) {
        let [nx, ny, nz] = self.axes.map(|a| a.len());
        let blocks = self.weight_z.len();
        for (j, row) in slab.chunks_exact(SLAB_KINDS * blocks).enumerate() {
            let (values, slopes) = row.split_at(3 * blocks);
            for c in 0..3 {
                let line = &mut gradient[((c * nx + index) * ny + j) * nz..][..nz];
                line.fill(0.0);
                let values = Lanes::flat(&values[c * blocks..][..blocks]);
                let slopes = Lanes::flat(&slopes[c * blocks..][..blocks]);
                for ((value, slope), s) in values.zip(slopes).zip(&self.z) {
                    for (k, u) in line[s.first..s.first + 4].iter_mut().enumerate() {
                        *u += s.value[k] * value + s.slope[k] * slope;
                    }
                }
            }
        }
    }
}

/// The slabs of the four coefficients along x that a plane of points depends on; slab i is in place i mod 4.
struct SlabWindow<'a> {
    assembly: &'a Assembly,
    coefficients: &'a [f64],
    slabs: [Vec<Lanes>; 4],
    /// Slabs computed so far.
    entered: usize,
}

impl<'a> SlabWindow<'a> {
    fn new(assembly: &'a Assembly, coefficients: &'a [f64]) -> SlabWindow<'a> {
        let slabs = std::array::from_fn(|_| assembly.empty(SLAB_KINDS));
        SlabWindow { assembly, coefficients, slabs, entered: 0 }
    }

    /// Computes the slabs around a plane that are not yet in the window, and returns which.
    fn advance(&mut self, plane: &Sample) -> Range<usize> {
        let entering = self.entered..plane.first + 4;
        for index in entering.clone() {
            self.assembly.slab(self.coefficients, index, &mut self.slabs[index % 4]);
        }
        self.entered = entering.end;
        entering
    }

    /// Along x: a plane of points from the slabs around it.
    fn plane(&self, s: &Sample, plane: &mut [Lanes]) {
        let slab = |k: usize| &self.slabs[(s.first + k) % 4][..];
        plane_of(s, [slab(0), slab(1), slab(2), slab(3)], self.assembly.weight_z.len(), plane);
    }
}

/// Along x: a plane of points from the four slabs around it.
fn plane_of(s: &Sample, slabs: [&[Lanes]; 4], blocks: usize, plane: &mut [Lanes]) {
    let width = SLAB_KINDS * blocks;
    for (j, out) in plane.chunks_exact_mut(PLANE_KINDS * blocks).enumerate() {
        let sources = slabs.map(|slab| &slab[j * width..][..width]);
        for c in 0..3 {
            let values = sources.map(|row| &row[c * blocks..][..blocks]);
            let slopes = sources.map(|row| &row[(3 + c) * blocks..][..blocks]);
            let out = &mut out[3 * c * blocks..][..3 * blocks];
            combine(&s.slope, values, &mut out[..blocks]);
            combine(&s.value, values, &mut out[blocks..2 * blocks]);
            combine(&s.value, slopes, &mut out[2 * blocks..]);
        }
    }
}

/// The adjoint of [`plane_of`] with respect to the k-th slab; adds to it.
fn plane_adjoint(s: &Sample, k: usize, plane: &[Lanes], blocks: usize, slab: &mut [Lanes]) {
    if s.value[k] == 0.0 && s.slope[k] == 0.0 {
        return;
    }
    let rows = plane.chunks_exact(PLANE_KINDS * blocks).zip(slab.chunks_exact_mut(SLAB_KINDS * blocks));
    for (source, out) in rows {
        let (values, slopes) = out.split_at_mut(3 * blocks);
        for c in 0..3 {
            let source = &source[3 * c * blocks..][..3 * blocks];
            accumulate(s.slope[k], &source[..blocks], &mut values[c * blocks..][..blocks]);
            accumulate(s.value[k], &source[blocks..2 * blocks], &mut values[c * blocks..][..blocks]);
            accumulate(s.value[k], &source[2 * blocks..], &mut slopes[c * blocks..][..blocks]);
        }
    }
}

/// Along y and back: returns the energy of one row of points and adds its gradient to the plane's.
#[inline]
fn row(
    mut visit: impl FnMut(usize, &[Lanes; 9]) -> (Lanes, [Lanes; 9]),
    s: &Sample,
    weight: f64,
    weight_z: &[Lanes],
    plane: &[Lanes],
    plane_gradient: &mut [Lanes],
) -> f64 {
    let blocks = weight_z.len();
    let width = PLANE_KINDS * blocks;
    let targets = &mut plane_gradient[s.first * width..][..4 * width];
    let mut sum = Lanes::ZERO;
    for b in 0..blocks {
        let jacobian = jacobian_lanes(s, plane, blocks, b);
        let (density, slope) = visit(b, &jacobian);
        let weight = weight * weight_z[b];
        sum += weight * density;
        for (kind, source) in slope.iter().enumerate() {
            let source = weight * *source;
            let w = if kind % 3 == 1 { &s.slope } else { &s.value };
            for k in 0..4 {
                targets[k * width + kind * blocks + b] += w[k] * source;
            }
        }
    }
    sum.sum()
}

/// Along y: J at one block of points of a row.
#[inline(always)]
fn jacobian_lanes(s: &Sample, plane: &[Lanes], blocks: usize, block: usize) -> [Lanes; 9] {
    let width = PLANE_KINDS * blocks;
    let sources: [&PointRow; 4] = std::array::from_fn(|k| &plane[(s.first + k) * width..][..width]);
    let mut jacobian = [Lanes::ZERO; 9];
    for (kind, out) in jacobian.iter_mut().enumerate() {
        let w = if kind % 3 == 1 { &s.slope } else { &s.value };
        let at = kind * blocks + block;
        *out = w[0] * sources[0][at] + w[1] * sources[1][at] + w[2] * sources[2][at] + w[3] * sources[3][at];
    }
    jacobian
}

/// out = Σ wₖ sourceₖ.
fn combine(w: &[f64; 4], sources: [&PointRow; 4], out: &mut PointRow) {
    let [a, b, c, d] = sources;
    for ((((o, a), b), c), d) in out.iter_mut().zip(a).zip(b).zip(c).zip(d) {
        *o = w[0] * *a + w[1] * *b + w[2] * *c + w[3] * *d;
    }
}

/// out += w source.
fn accumulate(w: f64, source: &PointRow, out: &mut PointRow) {
    for (o, a) in out.iter_mut().zip(source) {
        *o += w * *a;
    }
}

#[cfg(test)]
mod tests {
    use super::super::density::Mips;
    use super::*;

    #[test]
    fn energy_gradient_matches_central_differences_for_both_rules() {
        let axes = [
            MapAxis { cells: 5, cell: 0.4 },
            MapAxis { cells: 4, cell: 0.5 },
            MapAxis { cells: 4, cell: 0.6 },
        ];
        let [nx, ny, nz] = axes.map(|a| a.len());
        // The face coefficients of the identity, perturbed.
        let mut u = vec![0.0; 3 * nx * ny * nz];
        for c in 0..3 {
            for i in 0..nx {
                for j in 0..ny {
                    for k in 0..nz {
                        let at = ((c * nx + i) * ny + j) * nz + k;
                        let last = axes[c].cells as f64;
                        let greville = ([i, j, k][c] as f64 - 1.0).clamp(0.0, last) * axes[c].cell;
                        u[at] = greville + 0.05 * (1.9 * at as f64).sin();
                    }
                }
            }
        }
        for rule in [Rule::Lobatto, Rule::Gauss] {
            let assembly = Assembly::new(axes, rule, |z| (-z).exp(), 0.5);
            let mut gradient = vec![f64::NAN; u.len()];
            let mut unused = vec![0.0; u.len()];
            let energy = assembly.energy(Mips, &u, &mut gradient);
            assert!(energy.is_finite() && energy > 0.0);
            for at in (0..u.len()).step_by(7) {
                let mut at_step = |step: f64| {
                    let mut moved = u.clone();
                    moved[at] += step;
                    assembly.energy(Mips, &moved, &mut unused)
                };
                let slope = (at_step(1e-5) - at_step(-1e-5)) / 2e-5;
                assert!((slope - gradient[at]).abs() < 1e-7, "{at}: {slope} {}", gradient[at]);
            }
        }
    }
}
