//! Eq. 6, the optimization problem of the map: minimize E_map + E_match, the energy ∫ w ρ(J) dV plus the misfit between the bottom
//! face and the terrain.
//!
//! φ has coefficients u, with face values at the ends of each axis (see `MapAxis`), component by component. φ₀ is fixed on the
//! x-faces, φ₁ on the y-faces. The coefficients of φ₂ on the bottom face are eliminated: they are the L² projection of h(φ₀, φ₁),
//! which minimizes E_match over them, and the chain rule takes their gradient to φ₀ and φ₁. What the projection leaves of E_match
//! is kept with a large weight.
//!
//! The unknowns v are those of u, except that φ₂ is relative to the bottom face: a column stands on the ground and moves up and
//! down with it when φ₀ and φ₁ move along a slope. (If only the face moved, it would bend the lowest cells. They are stiff, and the
//! minimizer needed two to four times as many iterations.)

use super::assembly::Assembly;
use super::axis::{MapAxis, Rule};
use super::bottom_face::{BottomFace, gather};
use super::density::Density;
use super::distance::Norm;
use super::lanes::Lanes;
use super::objective::{Objective, difference, dot};
use super::preconditioner::Preconditioner;
use super::spline::WarpMap;
use crate::Result;
use crate::heightfield::Heightfield;

/// Weight of the squared misfit that the projection leaves at the bottom, in units of the cell: 64 m · (misfit/cell)². Without it,
/// the energy is least where the points of the bottom face avoid steep places (a hill of slope 2 was missed by 139 mm; with it, by
/// 1 mm).
const MISFIT_WEIGHT: f64 = 64.0;

/// On coarse grids, the misfit contributes at most this fraction to the energy at the start.
const SOFT_MISFIT: f64 = 0.05;

/// Eq. 6 on one grid.
pub(super) struct WarpProblem<'a, D> {
    density: D,
    axes: [MapAxis; 3],
    assembly: Assembly,
    ground: BottomFace<'a>,
    preconditioner: Preconditioner,
    /// 1/m.
    misfit_weight: f64,
    /// u at the last evaluation.
    coefficients: Vec<f64>,
    /// The gradient for the bottom face's coefficients.
    by_face: Vec<f64>,
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
        let [nx, ny, nz] = axes.map(|a| a.len());
        let free = [[1..nx - 1, 0..ny, 0..nz], [0..nx, 1..ny - 1, 0..nz], [0..nx, 0..ny, 1..nz]];
        let samples = std::array::from_fn(|d| assembly.samples(d));
        let preconditioner = Preconditioner::new(samples, free, density.stiffness())?;
        Ok(WarpProblem {
            density,
            axes,
            assembly,
            ground: BottomFace::new(field, &axes),
            preconditioner,
            misfit_weight: MISFIT_WEIGHT / (axes[0].cell * axes[1].cell),
            coefficients: vec![0.0; 3 * nx * ny * nz],
            by_face: vec![0.0; nx * ny],
        })
    }

    /// The coefficients u of a map on the grid of this problem.
    pub fn coefficients(&self, map: &WarpMap) -> Vec<f64> {
        coefficients_of(map, &self.axes)
    }

    /// v from u: φ₂ relative to the bottom face, wherever that is.
    pub fn unknowns(&self, mut u: Vec<f64>) -> Vec<f64> {
        let columns = u.len() / 3 * 2;
        for column in u[columns..].chunks_exact_mut(self.axes[2].len()) {
            let bottom = column[0];
            column.iter_mut().for_each(|v| *v -= bottom);
        }
        u
    }

    /// u from v: each column stands on the ground.
    pub fn on_ground(&mut self, mut v: Vec<f64>) -> Vec<f64> {
        let face = self.ground.fit(&v);
        raise(&mut v, face, self.axes[2].len());
        v
    }

    /// How far the ground lies above the bottom face (bottom-face coefficients, m).
    pub fn gap(&mut self, u: &[f64]) -> Vec<f64> {
        gather(u, 2, self.axes[2].len(), &mut self.by_face);
        difference(self.ground.fit(u), &self.by_face)
    }

    /// Lowers the ground below the terrain by a fraction of `gap`.
    pub fn lower_ground(&mut self, gap: &[f64], fraction: f64) {
        self.ground.lower(gap, fraction);
    }

    /// Lowers the weight of the misfit so that it contributes little to the energy at v. For coarse grids: if they followed the
    /// terrain as well as they can, points would gather at edges that only finer grids resolve, and go back later.
    pub fn soften_misfit(&mut self, v: &[f64]) {
        let u = self.on_ground(v.to_vec());
        let energy = self.assembly.energy(self.density, &u, &mut vec![0.0; v.len()]);
        self.misfit_weight = self
            .misfit_weight
            .min(SOFT_MISFIT * energy / self.ground.squared_misfit().max(f64::MIN_POSITIVE));
    }

    /// The map with the unknowns v, on the grid of `map`.
    pub fn map_of(&mut self, v: Vec<f64>, map: &WarpMap) -> WarpMap {
        let mut out = map.clone();
        let mut u = self.on_ground(v);
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
        let nz = self.axes[2].len();
        for (step, gap) in face_step[u.len() / 3 * 2..].iter_mut().step_by(nz).zip(self.gap(u)) {
            *step = gap;
        }
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

    /// The curvature of the density at all points for the unknowns v. Together with the slopes of the ground there, it determines
    /// [`WarpProblem::gauss_newton_product`].
    pub fn linearized<C>(&mut self, v: &[f64], curvature: impl Fn(&D, &[Lanes; 9]) -> C) -> Vec<C> {
        let u = self.on_ground(v.to_vec());
        self.assembly.curvatures(&u, |jacobian| curvature(&self.density, jacobian))
    }

    /// `out` ← the Gauss–Newton matrix times a direction, in which all fixed coefficients are zero: the curvature of the energy plus
    /// that of the squared misfit, where the problem was linearized last. `times` multiplies the curvature of the density by a
    /// change of J.
    pub fn gauss_newton_product<C>(
        &mut self,
        curvatures: &[C],
        times: impl Fn(&C, &[Lanes; 9]) -> [Lanes; 9],
        direction: &[f64],
        out: &mut [f64],
    ) {
        self.coefficients.copy_from_slice(direction);
        raise(&mut self.coefficients, self.ground.linear(direction), self.axes[2].len());
        self.assembly.curvature_product(curvatures, times, &self.coefficients, out);
        self.pull_back(out);
    }

    /// Turns a gradient with respect to u into one with respect to v, and adds that of the misfit.
    fn pull_back(&mut self, gradient: &mut [f64]) {
        let columns = gradient[gradient.len() / 3 * 2..].chunks_exact(self.axes[2].len());
        for (sum, column) in self.by_face.iter_mut().zip(columns) {
            *sum = column.iter().sum();
        }
        self.ground.add_adjoint(&self.by_face, self.misfit_weight, gradient);
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
}

impl<D: Density> Objective for WarpProblem<'_, D> {
    /// E_map + E_match of Eq. 6, with the bottom face on the ground.
    fn evaluate(&mut self, v: &[f64], gradient: &mut [f64]) -> f64 {
        self.coefficients.copy_from_slice(v);
        raise(&mut self.coefficients, self.ground.fit(v), self.axes[2].len());
        let energy = self.assembly.energy(self.density, &self.coefficients, gradient);
        if !energy.is_finite() {
            return energy;
        }
        self.pull_back(gradient);
        energy + self.misfit_weight * self.ground.squared_misfit()
    }

    fn precondition(&mut self, v: &mut [f64]) {
        self.preconditioner.apply(v);
    }
}

/// Moves each column of φ₂, of so many coefficients, up by the coefficient of the face below it.
fn raise(u: &mut [f64], face: &[f64], column: usize) {
    let columns = u.len() / 3 * 2;
    for (column, face) in u[columns..].chunks_exact_mut(column).zip(face) {
        column.iter_mut().for_each(|v| *v += face);
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

    /// The unknowns of a map, all but the fixed ones perturbed.
    fn moved(problem: &WarpProblem<impl Density>, map: &WarpMap) -> Vec<f64> {
        let mut v = problem.unknowns(problem.coefficients(map));
        let mut change: Vec<f64> = (0..v.len()).map(|i| 0.02 * (1.9 * i as f64).sin()).collect();
        problem.hold_fixed(&mut change);
        v.iter_mut().zip(&change).for_each(|(v, c)| *v += c);
        v
    }

    #[test]
    fn the_map_of_the_unknowns_stands_on_the_ground() {
        let field = field();
        let map = map(&field);
        let mut problem = WarpProblem::new(&field, Mips, &map, POINTS).unwrap();
        let v = moved(&problem, &map);
        let u = problem.on_ground(v.clone());
        assert!(problem.gap(&u).iter().all(|gap| gap.abs() < 1e-14));
        assert!(problem.unknowns(u).iter().zip(&v).all(|(a, b)| (a - b).abs() < 1e-14));
        let position = problem.map_of(v, &map).position([0.2, 0.3, 0.0]);
        assert!((position[2] - field.height(position[0], position[1])).abs() < 2e-2, "{position:?}");
    }

    fn gradient_matches(density: impl Density) {
        let field = field();
        let map = map(&field);
        let mut problem = WarpProblem::new(&field, density, &map, POINTS).unwrap();
        let v = moved(&problem, &map);
        let mut gradient = vec![0.0; v.len()];
        let mut unused = gradient.clone();
        problem.evaluate(&v, &mut gradient);
        for at in (0..v.len()).filter(|at| gradient[*at] != 0.0).step_by(5) {
            let mut at_step = |step: f64| {
                let mut moved = v.clone();
                moved[at] += step;
                problem.evaluate(&moved, &mut unused)
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
        let mut problem = WarpProblem::new(&field, Barrier { scale: MapScale::Trace }, &map, POINTS).unwrap();
        let v = moved(&problem, &map);
        let linearized = problem.linearized(&v, |density, jacobian| density.curvature(jacobian, 0.0));
        let direction = |k: f64| {
            let mut direction: Vec<f64> = (0..v.len()).map(|i| (k * i as f64).sin()).collect();
            problem.hold_fixed(&mut direction);
            direction
        };
        let (a, b) = (direction(0.7), direction(1.3));
        let mut times = |v: &[f64]| {
            let mut out = vec![0.0; v.len()];
            problem.gauss_newton_product(&linearized, BarrierCurvature::times, v, &mut out);
            out
        };
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
        let v = moved(&problem, &map);
        let mut u = problem.on_ground(v);
        let ground = problem.ground.fit(&u).to_vec();
        let (before, _) = problem.alternate(&mut u);
        let mut face = ground.clone();
        gather(&u, 2, problem.axes[2].len(), &mut face);
        assert!(face.iter().zip(&ground).all(|(a, b)| (a - b).abs() < 1e-14));
        let mut gradient = vec![0.0; u.len()];
        let after = problem.assembly.energy(problem.density, &u, &mut gradient);
        problem.hold_fixed(&mut gradient);
        assert!(after < before && gradient.iter().all(|g| g.abs() < 1e-9), "{before} {after}");
    }
}
