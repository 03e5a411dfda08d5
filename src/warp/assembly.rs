//! The energy of a map, the paper's E_map = ∫ w ρ(J) dV (the first term of Eq. 6), and its gradient, by quadrature on a tensor grid.
//!
//! J is computed one axis at a time (sum factorization), and the gradient likewise by the adjoint. A layer of four points along z
//! fills the lanes, and all of its numbers stay in the cache. In a layer, the x axis is swept with a window of the four slabs of
//! coefficients that a plane of points depends on:
//!
//! slab (contracted along z) → plane (along x) → row (along y) → ρ, ∂ρ/∂J → back to row, plane, slab.

use std::cmp::Ordering;

use pulp::NullaryFnOnce;

use super::axis::{MapAxis, Rule, Sample};
use super::density::{Density, cofactors, determinant};
use super::lanes::{LANES, Lanes, vectorized};

/// The quadrature of one grid, and the memory that its sums use again and again.
pub(super) struct Assembly {
    grid: TensorGrid,
    buffers: Buffers,
}

/// The points and their weights.
struct TensorGrid {
    axes: [MapAxis; 3],
    x: Vec<Sample>,
    y: Vec<Sample>,
    /// Their weights include the weight of the energy over z̄. The last point is repeated with weight zero to fill the lanes.
    z: Vec<Sample>,
    layers: Vec<Layer>,
}

/// The points of a layer along z and the basis functions there.
struct Layer {
    weight: Lanes,
    /// The first of the coefficients that the spline depends on there.
    first: usize,
    /// Values and slopes, by coefficient.
    taps: Vec<[Lanes; 2]>,
}

/// At a coefficient along x and y: φ₀, φ₁, φ₂ and then ∂φ₀/∂z̄, ∂φ₁/∂z̄, ∂φ₂/∂z̄.
type SlabPoint = [Lanes; 6];
/// At a point along x and a coefficient along y: for each component, the parts of ∂/∂x̄, ∂/∂ȳ, ∂/∂z̄.
type PlanePoint = [Lanes; 9];

/// Slabs and a plane, each with its gradient; slab i is in place i mod 4.
struct Buffers {
    slabs: [Vec<SlabPoint>; 4],
    slab_gradients: [Vec<SlabPoint>; 4],
    plane: Vec<PlanePoint>,
    plane_gradient: Vec<PlanePoint>,
}

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
        let layers = z.chunks_exact(LANES).map(Layer::new).collect();
        let slabs = || std::array::from_fn(|_| vec![[Lanes::ZERO; 6]; axes[1].len()]);
        let plane = || vec![[Lanes::ZERO; 9]; axes[1].len()];
        let buffers =
            Buffers { slabs: slabs(), slab_gradients: slabs(), plane: plane(), plane_gradient: plane() };
        Assembly { grid: TensorGrid { axes, x, y, z, layers }, buffers }
    }

    /// The points along an axis with their weights.
    pub fn samples(&self, axis: usize) -> &[Sample] {
        [&self.grid.x, &self.grid.y, &self.grid.z][axis]
    }

    /// The energy and its gradient with respect to the coefficients (component, x, y, z in C order). If J is not allowed at some
    /// point, the energy is infinite and the gradient meaningless.
    pub fn energy(&mut self, density: impl Density, coefficients: &[f64], gradient: &mut [f64]) -> f64 {
        self.sweep(coefficients, gradient, Evaluated(density))
    }

    /// The curvature of a density at all points, in the order of [`Assembly::curvature_product`].
    pub fn curvatures<C>(&mut self, coefficients: &[f64], at: impl Fn(&[Lanes; 9]) -> C) -> Vec<C> {
        let grid = &self.grid;
        let mut found = Vec::with_capacity(grid.layers.len() * grid.x.len() * grid.y.len());
        let mut unused = vec![0.0; coefficients.len()];
        self.sweep(coefficients, &mut unused, Collected { at, found: &mut found });
        found
    }

    /// The second derivative of the energy times a direction, from that of the density at all points.
    pub fn curvature_product<C>(
        &mut self,
        curvatures: &[C],
        times: impl Fn(&C, &[Lanes; 9]) -> [Lanes; 9],
        direction: &[f64],
        out: &mut [f64],
    ) {
        self.sweep(direction, out, Multiplied { curvatures, times });
    }

    /// Visits all points. Sums the ρ that a visit returns to the energy, its ∂ρ/∂J to the gradient.
    fn sweep(&mut self, coefficients: &[f64], gradient: &mut [f64], visitor: impl Visitor) -> f64 {
        let Assembly { grid, buffers } = self;
        vectorized(Sweep { grid, buffers, coefficients, gradient, visitor })
    }

    /// The least determinant of J over all points, how many determinants are not positive, and the point of the least, in cells.
    pub fn determinants(&mut self, coefficients: &[f64]) -> (f64, usize, [f64; 3]) {
        let Assembly { grid, buffers } = self;
        vectorized(Determinants { grid, buffers, coefficients })
    }
}

/// What is done at the points. (Closures would not be inlined, and so not vectorized.)
trait Visitor {
    /// ρ and ∂ρ/∂J from the number of four points and J.
    fn visit(&mut self, at: usize, jacobian: &[Lanes; 9]) -> (Lanes, [Lanes; 9]);
}

/// A density.
struct Evaluated<D>(D);

impl<D: Density> Visitor for Evaluated<D> {
    #[inline(always)]
    fn visit(&mut self, _: usize, jacobian: &[Lanes; 9]) -> (Lanes, [Lanes; 9]) {
        self.0.at(jacobian)
    }
}

/// Collects something at all points.
struct Collected<'a, C, F> {
    at: F,
    found: &'a mut Vec<C>,
}

impl<C, F: Fn(&[Lanes; 9]) -> C> Visitor for Collected<'_, C, F> {
    #[inline(always)]
    fn visit(&mut self, _: usize, jacobian: &[Lanes; 9]) -> (Lanes, [Lanes; 9]) {
        self.found.push((self.at)(jacobian));
        (Lanes::ZERO, [Lanes::ZERO; 9])
    }
}

/// The curvatures at all points times a change of J.
struct Multiplied<'a, C, F> {
    curvatures: &'a [C],
    times: F,
}

impl<C, F: Fn(&C, &[Lanes; 9]) -> [Lanes; 9]> Visitor for Multiplied<'_, C, F> {
    #[inline(always)]
    fn visit(&mut self, at: usize, change: &[Lanes; 9]) -> (Lanes, [Lanes; 9]) {
        (Lanes::ZERO, (self.times)(&self.curvatures[at], change))
    }
}

/// The arguments of [`Assembly::sweep`].
struct Sweep<'a, V> {
    grid: &'a TensorGrid,
    buffers: &'a mut Buffers,
    coefficients: &'a [f64],
    gradient: &'a mut [f64],
    visitor: V,
}

impl<V: Visitor> NullaryFnOnce for Sweep<'_, V> {
    type Output = f64;

    #[inline(always)]
    fn call(mut self) -> f64 {
        let Sweep { grid, coefficients, .. } = self;
        let Buffers { slabs, slab_gradients, plane, plane_gradient } = self.buffers;
        self.gradient.fill(0.0);
        let mut energy = 0.0;
        let mut seen = 0;
        for layer in &grid.layers {
            let (mut entered, mut finished) = (0, 0);
            for sx in &grid.x {
                while finished < sx.first {
                    grid.slab_adjoint(layer, &slab_gradients[finished % 4], finished, self.gradient);
                    finished += 1;
                }
                while entered < sx.first + 4 {
                    grid.slab(layer, coefficients, entered, &mut slabs[entered % 4]);
                    slab_gradients[entered % 4].fill([Lanes::ZERO; 6]);
                    entered += 1;
                }
                plane_of(sx, slabs, plane);
                plane_gradient.fill([Lanes::ZERO; 9]);
                let mut sum = Lanes::ZERO;
                for sy in &grid.y {
                    let weight = (sx.weight * sy.weight) * layer.weight;
                    let (density, slope) = self.visitor.visit(seen, &jacobian(sy, plane));
                    sum += weight * density;
                    jacobian_adjoint(sy, &slope.map(|s| weight * s), plane_gradient);
                    seen += 1;
                }
                energy += sum.sum();
                if !energy.is_finite() {
                    return f64::INFINITY;
                }
                plane_adjoint(sx, plane_gradient, slab_gradients);
            }
            for index in finished..entered {
                grid.slab_adjoint(layer, &slab_gradients[index % 4], index, self.gradient);
            }
        }
        energy
    }
}

/// The arguments of [`Assembly::determinants`].
struct Determinants<'a> {
    grid: &'a TensorGrid,
    buffers: &'a mut Buffers,
    coefficients: &'a [f64],
}

impl NullaryFnOnce for Determinants<'_> {
    type Output = (f64, usize, [f64; 3]);

    #[inline(always)]
    fn call(self) -> Self::Output {
        let Determinants { grid, buffers, coefficients } = self;
        let Buffers { slabs, plane, .. } = buffers;
        let (mut least, mut folded, mut at) = (f64::INFINITY, 0, [0.0; 3]);
        for (layer, samples) in grid.layers.iter().zip(grid.z.chunks_exact(LANES)) {
            let mut entered = 0;
            for sx in &grid.x {
                while entered < sx.first + 4 {
                    grid.slab(layer, coefficients, entered, &mut slabs[entered % 4]);
                    entered += 1;
                }
                plane_of(sx, slabs, plane);
                for sy in &grid.y {
                    let jacobian = jacobian(sy, plane);
                    let determinants = determinant(&jacobian, &cofactors(&jacobian)).0;
                    for (det, sz) in determinants.into_iter().zip(samples) {
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
}

impl Layer {
    fn new(samples: &[Sample]) -> Layer {
        let first = samples.iter().map(|s| s.first).min().unwrap_or(0);
        let end = samples.iter().map(|s| s.first + 4).max().unwrap_or(first);
        let tap = |coefficient: usize| {
            let weights = |of: fn(&Sample) -> &[f64; 4]| {
                Lanes(std::array::from_fn(|l| {
                    let k = coefficient.wrapping_sub(samples[l].first);
                    of(&samples[l]).get(k).copied().unwrap_or(0.0)
                }))
            };
            [weights(|s| &s.value), weights(|s| &s.slope)]
        };
        let weight = Lanes(std::array::from_fn(|l| samples[l].weight));
        Layer { weight, first, taps: (first..end).map(tap).collect() }
    }
}

impl TensorGrid {
    /// Along z: the slab of the coefficients with one index along x.
    #[inline(always)]
    fn slab(&self, layer: &Layer, coefficients: &[f64], index: usize, slab: &mut [SlabPoint]) {
        let [nx, ny, nz] = self.axes.map(|a| a.len());
        for c in 0..3 {
            let lines = coefficients[(c * nx + index) * ny * nz..][..ny * nz].chunks_exact(nz);
            for (point, line) in slab.iter_mut().zip(lines) {
                let (mut value, mut slope) = (Lanes::ZERO, Lanes::ZERO);
                for (taps, u) in layer.taps.iter().zip(&line[layer.first..]) {
                    value += *u * taps[0];
                    slope += *u * taps[1];
                }
                (point[c], point[3 + c]) = (value, slope);
            }
        }
    }

    /// The adjoint of [`TensorGrid::slab`]; adds to the gradient.
    #[inline(always)]
    fn slab_adjoint(&self, layer: &Layer, slab: &[SlabPoint], index: usize, gradient: &mut [f64]) {
        let [nx, ny, nz] = self.axes.map(|a| a.len());
        for c in 0..3 {
            let lines = gradient[(c * nx + index) * ny * nz..][..ny * nz].chunks_exact_mut(nz);
            for (point, line) in slab.iter().zip(lines) {
                for (taps, u) in layer.taps.iter().zip(&mut line[layer.first..]) {
                    *u += (taps[0] * point[c] + taps[1] * point[3 + c]).sum();
                }
            }
        }
    }
}

/// Along x: a plane of points from the slabs around it.
#[inline(always)]
fn plane_of(s: &Sample, slabs: &[Vec<SlabPoint>; 4], plane: &mut [PlanePoint]) {
    let [a, b, c, d] = [0, 1, 2, 3].map(|k| &slabs[(s.first + k) % 4]);
    let sources = a.iter().zip(b).zip(c).zip(d);
    for (out, (((a, b), c), d)) in plane.iter_mut().zip(sources) {
        for i in 0..3 {
            let value = [a[i], b[i], c[i], d[i]];
            out[3 * i] = combination(&s.slope, value);
            out[3 * i + 1] = combination(&s.value, value);
            out[3 * i + 2] = combination(&s.value, [a[3 + i], b[3 + i], c[3 + i], d[3 + i]]);
        }
    }
}

/// The adjoint of [`plane_of`]; adds to the gradients of the slabs.
#[inline(always)]
fn plane_adjoint(s: &Sample, plane: &[PlanePoint], slabs: &mut [Vec<SlabPoint>; 4]) {
    for k in 0..4 {
        let (value, slope) = (s.value[k], s.slope[k]);
        if value == 0.0 && slope == 0.0 {
            continue;
        }
        for (out, source) in slabs[(s.first + k) % 4].iter_mut().zip(plane) {
            for i in 0..3 {
                out[i] += slope * source[3 * i] + value * source[3 * i + 1];
                out[3 + i] += value * source[3 * i + 2];
            }
        }
    }
}

/// Along y: J at four points.
#[inline(always)]
fn jacobian(s: &Sample, plane: &[PlanePoint]) -> [Lanes; 9] {
    let [a, b, c, d]: &[PlanePoint; 4] = plane[s.first..].first_chunk().expect("four coefficients");
    let mut jacobian = [Lanes::ZERO; 9];
    for (kind, out) in jacobian.iter_mut().enumerate() {
        let w = if kind % 3 == 1 { &s.slope } else { &s.value };
        *out = combination(w, [a[kind], b[kind], c[kind], d[kind]]);
    }
    jacobian
}

/// The adjoint of [`jacobian`]; adds to the gradient of the plane.
#[inline(always)]
fn jacobian_adjoint(s: &Sample, slope: &[Lanes; 9], plane: &mut [PlanePoint]) {
    for (k, target) in plane[s.first..s.first + 4].iter_mut().enumerate() {
        for (kind, (target, slope)) in target.iter_mut().zip(slope).enumerate() {
            let w = if kind % 3 == 1 { s.slope[k] } else { s.value[k] };
            *target += w * *slope;
        }
    }
}

/// Σ wₖ sourceₖ.
#[inline(always)]
fn combination(w: &[f64; 4], [a, b, c, d]: [Lanes; 4]) -> Lanes {
    w[0] * a + w[1] * b + w[2] * c + w[3] * d
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
            let mut assembly = Assembly::new(axes, rule, |z| (-z).exp(), 0.5);
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
