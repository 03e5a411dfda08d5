//! Eq. 6, the optimization problem of the map: minimize E_map + E_match, the energy ∫ w ρ(J) dV plus the misfit between the bottom
//! face and the terrain.
//!
//! The unknowns u are the coefficients of φ, with face values at the ends of each axis (see `MapAxis`), component by component.
//! φ₀ is fixed on the x-faces, φ₁ on the y-faces. The coefficients of φ₂ on the bottom face are eliminated: they are the L²
//! projection of h(φ₀, φ₁), which minimizes E_match over them, and the chain rule takes their gradient to φ₀ and φ₁. What the
//! projection leaves of E_match is kept with a large weight.

use super::assembly::Assembly;
use super::axis::{MapAxis, Rule};
use super::bottom::Bottom;
use super::density::Density;
use super::distance::Norm;
use super::lanes::Lanes;
use super::objective::{Objective, difference, dot};
use super::preconditioner::Preconditioner;
use super::spline::WarpMap;
use crate::Result;
use crate::heightfield::Heightfield;

/// Weight of the squared misfit that the projection leaves at the bottom, 1/m. Without it, the energy is least where the points of
/// the bottom face avoid steep places (a hill of slope 2 was missed by 139 mm; with it, by 5 mm).
const MISFIT_WEIGHT: f64 = 1e3;

/// Eq. 6 on one grid.
pub(super) struct WarpProblem<'a, D> {
    field: &'a Heightfield,
    density: D,
    axes: [MapAxis; 3],
    assembly: Assembly,
    bottom: Bottom,
    preconditioner: Preconditioner,
    misfit_weight: f64,
    /// How far the ground is lowered below the terrain (bottom-face coefficients, m).
    lowered: Vec<f64>,
}

/// Where an energy is evaluated, and its weight above the ground.
#[derive(Clone, Copy, Debug)]
pub(super) struct Quadrature {
    pub rule: Rule,
    /// Weight of the energy well above the ground relative to that at the ground (`MapSpec::torso_weight`).
    pub torso_weight: f64,
}

impl<'a, D: Density> WarpProblem<'a, D> {
    /// The problem on the grid of `map`.
    ///
    /// # Errors
    /// Internal errors of the preconditioner.
    pub fn new(field: &'a Heightfield, density: D, map: &WarpMap, points: Quadrature) -> Result<Self> {
        let axes: [MapAxis; 3] =
            std::array::from_fn(|d| MapAxis { cells: map.cells()[d], cell: map.cell()[d] });
        let weight = |z| density.weight(z, points.torso_weight);
        let assembly = Assembly::new(axes, points.rule, weight, density.face_weight());
        let bottom = Bottom::new(&axes[0], &axes[1]);
        let [nx, ny, nz] = axes.map(|a| a.len());
        let free = [[1..nx - 1, 0..ny, 0..nz], [0..nx, 1..ny - 1, 0..nz], [0..nx, 0..ny, 1..nz]];
        let samples = std::array::from_fn(|d| assembly.samples(d));
        let preconditioner = Preconditioner::new(samples, free, density.stiffness())?;
        Ok(WarpProblem {
            field,
            density,
            axes,
            assembly,
            bottom,
            preconditioner,
            misfit_weight: MISFIT_WEIGHT,
            lowered: vec![0.0; nx * ny],
        })
    }

    /// The coefficients of a map on the grid of this problem.
    pub fn coefficients(&self, map: &WarpMap) -> Vec<f64> {
        coefficients_of(map, &self.axes)
    }

    /// How far the ground lies above the bottom face (bottom-face coefficients, m).
    pub fn gap(&self, u: &[f64]) -> Vec<f64> {
        difference(&self.bottom_fit(u).face, &self.face(u, 2))
    }

    /// Lowers the ground below the terrain by a fraction of `gap`.
    pub fn lower_ground(&mut self, gap: &[f64], fraction: f64) {
        self.lowered = gap.iter().map(|g| fraction * g).collect();
    }

    /// Moves each column above the bottom face up or down so that the face lies on the ground.
    pub fn move_onto_ground(&self, u: &mut [f64]) {
        let gap = self.gap(u);
        let columns = u.len() / 3 * 2;
        for (column, gap) in u[columns..].chunks_exact_mut(self.axes[2].len()).zip(gap) {
            column.iter_mut().for_each(|v| *v += gap);
        }
    }

    /// Drops the misfit term if it exceeds the energy of the map at u: then the grid is too coarse for the terrain, and the map
    /// follows a smoothed one.
    pub fn drop_dominant_misfit(&mut self, u: &[f64]) {
        let misfit = self.bottom_fit(u).misfit;
        let misfit_energy = MISFIT_WEIGHT * dot(&self.bottom.weighted(&misfit), &misfit);
        let energy = self.assembly.energy(self.density, u, &mut vec![0.0; u.len()]);
        if misfit_energy > energy {
            self.misfit_weight = 0.0;
        }
    }

    /// The map with these coefficients, on the grid of `map`.
    pub fn to_map(&self, u: &[f64], map: &WarpMap) -> WarpMap {
        let mut out = map.clone();
        let mut u = u.to_vec();
        for axis in 0..3 {
            along(&mut u, self.axes.map(|a| a.len()), axis, |line| self.axes[axis].face_to_control(line));
        }
        let n = u.len() / 3;
        for (i, point) in out.control_points_mut().iter_mut().enumerate() {
            *point = std::array::from_fn(|c| u[c * n + i]);
        }
        out
    }

    /// One round of Algorithm 1. It freezes the target T(J) at every point and the ground under the bottom face, and minimizes the
    /// quadratic energy ½∫ w‖J − T‖² dV with the face on that ground. Its matrix K is the tensor-product stiffness that the
    /// preconditioner inverts, so the minimum is exact. Returns the energy before the round and the square of the step in the norm
    /// of K.
    ///
    /// With ∇ the gradient at u, the step δ satisfies δ = ground − u on the bottom face and Kδ + ∇ = 0 elsewhere.
    pub fn alternate(&mut self, u: &mut [f64]) -> (f64, f64) {
        let mut gradient = vec![0.0; u.len()];
        let energy = self.assembly.energy(self.density, u, &mut gradient);
        // δ = face_step − rest, where face_step is zero off the bottom face and rest is zero on it.
        let mut face_step = vec![0.0; u.len()];
        self.set_face(&mut face_step, &self.gap(u));
        let mut product = vec![0.0; u.len()];
        let face_square = 2.0 * self.assembly.energy(Norm, &face_step, &mut product);
        // K · rest = ∇ + K · face_step.
        let mut residual = gradient;
        for (r, p) in residual.iter_mut().zip(&product) {
            *r += p;
        }
        self.hold_fixed(&mut residual);
        let mut rest = residual.clone();
        self.preconditioner.apply(&mut rest);
        let rest_square = dot(&residual, &rest);
        for ((u, face), rest) in u.iter_mut().zip(&face_step).zip(&rest) {
            *u += face - rest;
        }
        (energy, face_square + rest_square)
    }

    /// The Gauss–Newton matrix at u, given the curvature of the density; see [`WarpProblem::gauss_newton_product`].
    pub fn linearized<C>(&self, u: &[f64], curvature: impl Fn(&D, &[Lanes; 9]) -> C) -> Linearized<C> {
        Linearized {
            curvatures: self.assembly.curvatures(u, |jacobian| curvature(&self.density, jacobian)),
            slopes: self.bottom_fit(u).slopes,
        }
    }

    /// `out` ← the Gauss–Newton matrix times a direction, in which all fixed coefficients are zero: the curvature of the energy plus
    /// that of the squared misfit, with the bottom face following φ₀ and φ₁.
    ///
    /// `times` multiplies the curvature of the density by a change of J.
    pub fn gauss_newton_product<C>(
        &self,
        at: &Linearized<C>,
        times: impl Fn(&C, &[Lanes; 9]) -> [Lanes; 9],
        direction: &mut [f64],
        out: &mut [f64],
    ) {
        let [x, y] = [0, 1].map(|c| self.bottom.values(&self.face(direction, c)));
        let rise: Vec<f64> =
            at.slopes.iter().enumerate().map(|(i, slope)| slope[0] * x[i] + slope[1] * y[i]).collect();
        let face = self.bottom.project(&rise);
        self.set_face(direction, &face);
        self.assembly.curvature_product(&at.curvatures, times, direction, out);
        let misfit = difference(&self.bottom.values(&face), &rise);
        self.eliminate_face(&at.slopes, &self.bottom.weighted(&misfit), out);
        self.hold_fixed(direction);
    }

    /// The bottom-face coefficients of one component.
    fn face(&self, u: &[f64], component: usize) -> Vec<f64> {
        let n = u.len() / 3;
        u[component * n..][..n].iter().step_by(self.axes[2].len()).copied().collect()
    }

    /// Sets the bottom-face coefficients of φ₂.
    fn set_face(&self, u: &mut [f64], face: &[f64]) {
        let n = u.len() / 3;
        for (v, ground) in u[2 * n..].iter_mut().step_by(self.axes[2].len()).zip(face) {
            *v = *ground;
        }
    }

    /// Eliminates the bottom-face coefficients of φ₂ from a gradient: adds their part to that of φ₀ and φ₁ by the chain rule, with
    /// the slopes of h at the Gauss points. Also adds the gradient of the squared misfit. The misfit (given times quadrature
    /// weights) is orthogonal to the splines, so its square depends on φ₀ and φ₁ through h alone.
    fn eliminate_face(&self, slopes: &[[f64; 2]], weighted_misfit: &[f64], gradient: &mut [f64]) {
        let n = gradient.len() / 3;
        let nz = self.axes[2].len();
        let mut by_height = self.bottom.project_adjoint(&self.face(gradient, 2));
        for (p, m) in by_height.iter_mut().zip(weighted_misfit) {
            *p -= 2.0 * self.misfit_weight * m;
        }
        for c in 0..2 {
            let by_place: Vec<f64> = by_height.iter().zip(slopes).map(|(p, slope)| p * slope[c]).collect();
            let added = self.bottom.values_adjoint(&by_place);
            for (g, a) in gradient[c * n..][..n].iter_mut().step_by(nz).zip(&added) {
                *g += a;
            }
        }
        self.hold_fixed(gradient);
    }

    /// Sets the entries of all fixed coefficients to zero: φ₀ on the x-faces, φ₁ on the y-faces, φ₂ on the bottom.
    fn hold_fixed(&self, gradient: &mut [f64]) {
        let [nx, ny, nz] = self.axes.map(|a| a.len());
        let n = nx * ny * nz;
        gradient[2 * n..].iter_mut().step_by(nz).for_each(|g| *g = 0.0);
        gradient[..ny * nz].fill(0.0);
        gradient[(nx - 1) * ny * nz..n].fill(0.0);
        for slab in gradient[n..2 * n].chunks_exact_mut(ny * nz) {
            slab[..nz].fill(0.0);
            slab[(ny - 1) * nz..].fill(0.0);
        }
    }

    /// The bottom face on the ground, given φ₀ and φ₁ there.
    fn bottom_fit(&self, u: &[f64]) -> BottomFit {
        let [x, y] = [0, 1].map(|c| self.bottom.values(&self.face(u, c)));
        let (heights, slopes): (Vec<f64>, _) =
            x.iter().zip(&y).map(|(x, y)| self.field.height_and_gradient(*x, *y)).unzip();
        let mut face = self.bottom.project(&heights);
        let misfit = difference(&self.bottom.values(&face), &heights);
        for (f, lowered) in face.iter_mut().zip(&self.lowered) {
            *f -= lowered;
        }
        BottomFit { slopes, face, misfit }
    }
}

/// The Gauss–Newton matrix as the parts of its products.
pub(super) struct Linearized<C> {
    /// Of the density, at the points of the assembly.
    curvatures: Vec<C>,
    /// ∇h at the Gauss points of the bottom.
    slopes: Vec<[f64; 2]>,
}

/// The bottom face that fits the ground best.
struct BottomFit {
    /// ∇h(φ₀, φ₁) at the Gauss points.
    slopes: Vec<[f64; 2]>,
    /// The bottom-face coefficients of φ₂: the L² projection of h(φ₀, φ₁), lowered.
    face: Vec<f64>,
    /// The error of the projection, φ₂ − h(φ₀, φ₁) at the Gauss points, m.
    misfit: Vec<f64>,
}

impl<D: Density> Objective for WarpProblem<'_, D> {
    /// E_map + E_match of Eq. 6, with the bottom face on the ground.
    fn evaluate(&mut self, u: &mut [f64], gradient: &mut [f64]) -> f64 {
        let BottomFit { slopes, face, misfit } = self.bottom_fit(u);
        self.set_face(u, &face);
        let energy = self.assembly.energy(self.density, u, gradient);
        if !energy.is_finite() {
            return energy;
        }
        let weighted = self.bottom.weighted(&misfit);
        self.eliminate_face(&slopes, &weighted, gradient);
        energy + self.misfit_weight * dot(&weighted, &misfit)
    }

    fn precondition(&mut self, v: &mut [f64]) {
        self.preconditioner.apply(v);
    }
}

/// The control points of a map, component by component, with face values at the ends of each axis.
pub(super) fn coefficients_of(map: &WarpMap, axes: &[MapAxis; 3]) -> Vec<f64> {
    let mut u = Vec::with_capacity(3 * map.control_points().len());
    for c in 0..3 {
        u.extend(map.control_points().iter().map(|p| p[c]));
    }
    for axis in 0..3 {
        along(&mut u, axes.map(|a| a.len()), axis, |line| axes[axis].control_to_face(line));
    }
    u
}

/// Applies `change` to every line of coefficients along an axis.
fn along(u: &mut [f64], shape: [usize; 3], axis: usize, change: impl Fn(&mut [f64])) {
    let stride: usize = shape[axis + 1..].iter().product();
    let mut line = vec![0.0; shape[axis]];
    for block in u.chunks_exact_mut(shape[axis] * stride) {
        for s in 0..stride {
            for (l, v) in line.iter_mut().zip(block[s..].iter().step_by(stride)) {
                *l = *v;
            }
            change(&mut line);
            for (l, v) in line.iter().zip(block[s..].iter_mut().step_by(stride)) {
                *v = *l;
            }
        }
    }
}

#[cfg(test)]
mod tests {
    use super::super::barrier::{Barrier, BarrierCurvature};
    use super::super::density::Mips;
    use super::super::distance::Distance;
    use super::*;
    use crate::scenario::{MapScale, MapSpec};

    const POINTS: Quadrature = Quadrature { rule: Rule::Lobatto, torso_weight: 0.03 };

    fn field() -> Heightfield {
        Heightfield::from_function([-1.0, 1.0, -1.0, 1.5], 0.05, |x, y| Ok(0.2 * (2.0 * x + y).sin()))
            .unwrap()
    }

    fn map(field: &Heightfield) -> WarpMap {
        let spec = MapSpec { cells: Some([5, 4, 4]), thickness: 1.5, ..MapSpec::default() };
        WarpMap::shear(field, &spec).unwrap()
    }

    /// The coefficients of a map, all but the fixed ones perturbed.
    fn moved(problem: &WarpProblem<impl Density>, map: &WarpMap) -> Vec<f64> {
        let mut u = problem.coefficients(map);
        let mut change: Vec<f64> = (0..u.len()).map(|i| 0.02 * (1.9 * i as f64).sin()).collect();
        problem.hold_fixed(&mut change);
        u.iter_mut().zip(&change).for_each(|(u, c)| *u += c);
        u
    }

    fn gradient_matches(density: impl Density) {
        let field = field();
        let map = map(&field);
        let mut problem = WarpProblem::new(&field, density, &map, POINTS).unwrap();
        let mut u = moved(&problem, &map);
        let mut gradient = vec![0.0; u.len()];
        let mut unused = gradient.clone();
        problem.evaluate(&mut u, &mut gradient);
        for at in (0..u.len()).filter(|at| gradient[*at] != 0.0).step_by(5) {
            let mut at_step = |step: f64| {
                let mut moved = u.clone();
                moved[at] += step;
                problem.evaluate(&mut moved, &mut unused)
            };
            let slope = (at_step(1e-5) - at_step(-1e-5)) / 2e-5;
            assert!(
                (slope - gradient[at]).abs() < 2e-6 * (1.0 + slope.abs()),
                "{at}: {slope} {}",
                gradient[at]
            );
        }
    }

    #[test]
    fn gradients_through_the_bottom_match_central_differences() {
        gradient_matches(Mips);
        gradient_matches(Distance::Rotation);
        gradient_matches(Barrier { scale: MapScale::Trace });
        gradient_matches(Barrier { scale: MapScale::Determinant });
    }

    #[test]
    fn the_gauss_newton_matrix_is_symmetric_and_positive_definite() {
        let field = field();
        let map = map(&field);
        let problem = WarpProblem::new(&field, Barrier { scale: MapScale::Trace }, &map, POINTS).unwrap();
        let mut u = moved(&problem, &map);
        problem.move_onto_ground(&mut u);
        let linearized = problem.linearized(&u, |density, jacobian| density.curvature(jacobian, 0.0));
        let direction = |k: f64| {
            let mut v: Vec<f64> = (0..u.len()).map(|i| (k * i as f64).sin()).collect();
            problem.hold_fixed(&mut v);
            v
        };
        let times = |v: &[f64]| {
            let (mut v, mut out) = (v.to_vec(), vec![0.0; v.len()]);
            problem.gauss_newton_product(&linearized, BarrierCurvature::times, &mut v, &mut out);
            out
        };
        let (a, b) = (direction(0.7), direction(1.3));
        let (ab, ba) = (dot(&a, &times(&b)), dot(&b, &times(&a)));
        assert!((ab - ba).abs() < 1e-9 * (ab.abs() + dot(&a, &times(&a))), "{ab} {ba}");
        assert!(dot(&a, &times(&a)) > 0.0 && dot(&b, &times(&b)) > 0.0);
    }

    #[test]
    fn a_round_of_algorithm_one_solves_its_quadratic_problem() {
        let field = field();
        let map = map(&field);
        // The target of this energy is constant, so one round finds the minimum above the frozen ground.
        let mut problem = WarpProblem::new(&field, Distance::Identity, &map, POINTS).unwrap();
        let mut u = moved(&problem, &map);
        let ground = problem.bottom_fit(&u).face;
        let (before, _) = problem.alternate(&mut u);
        assert_eq!(problem.face(&u, 2), ground);
        let mut gradient = vec![0.0; u.len()];
        let after = problem.assembly.energy(problem.density, &u, &mut gradient);
        problem.hold_fixed(&mut gradient);
        assert!(after < before && gradient.iter().all(|g| g.abs() < 1e-9), "{before} {after}");
    }
}
