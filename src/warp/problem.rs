//! The map's optimization problem: minimize ∫ w ρ(J) dV over the maps whose bottom face is the terrain.
//!
//! Unknowns are the coefficients u of φ with face values at the ends of each axis (see `Axis`), component by component.
//! φ₀ is fixed on the x-faces, φ₁ on the y-faces. The coefficients of φ₂ on the bottom face are not free: they are the L²
//! projection of h(φ₀, φ₁), and the gradient with respect to them flows on to φ₀ and φ₁ (elimination of Eq. 6's second
//! term, which makes the match exact up to the projection).

use super::WarpMap;
use super::assembly::Assembly;
use super::axis::{Axis, Rule};
use super::bottom::Bottom;
use super::density::Density;
use super::distance::Norm;
use super::lanes::Lanes;
use super::lbfgs::{Objective, dot};
use super::preconditioner::Preconditioner;
use crate::Result;
use crate::heightfield::Heightfield;

/// Weight of the squared misfit that the projection leaves at the bottom, 1/m. Without it the optimizer finds that a steep
/// place costs least where its points keep away from it (a hill of slope 2 was missed by 139 mm; with it, by 5).
const MISFIT_WEIGHT: f64 = 1e3;

/// The problem on one grid.
pub(super) struct Problem<'a, D> {
    field: &'a Heightfield,
    density: D,
    axes: [Axis; 3],
    assembly: Assembly,
    bottom: Bottom,
    preconditioner: Preconditioner,
    misfit_weight: f64,
    /// By how much the ground is lower than the terrain for now (bottom-face coefficients, m).
    lowered: Vec<f64>,
}

/// Where an energy is looked at, and what counts there.
#[derive(Clone, Copy, Debug)]
pub(super) struct Quadrature {
    pub rule: Rule,
    /// Weight of the energy well above the ground, of that at the ground (`MapSpec::torso_weight`).
    pub torso_weight: f64,
}

impl<'a, D: Density> Problem<'a, D> {
    /// On the grid of `map`.
    ///
    /// # Errors
    /// Internal ones of the preconditioner.
    pub fn new(field: &'a Heightfield, density: D, map: &WarpMap, points: Quadrature) -> Result<Self> {
        let axes: [Axis; 3] = std::array::from_fn(|d| Axis { cells: map.cells()[d], cell: map.cell()[d] });
        let weight = |z| density.weight(z, points.torso_weight);
        let assembly = Assembly::new(axes, points.rule, weight, density.face_weight());
        let bottom = Bottom::new(&axes[0], &axes[1]);
        let [nx, ny, nz] = axes.map(|a| a.len());
        let free = [[1..nx - 1, 0..ny, 0..nz], [0..nx, 1..ny - 1, 0..nz], [0..nx, 0..ny, 1..nz]];
        let samples = std::array::from_fn(|d| assembly.samples(d));
        let preconditioner = Preconditioner::new(samples, free, density.stiffness())?;
        Ok(Problem {
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

    /// The coefficients of a map, on the grid of this problem.
    pub fn coefficients(&self, map: &WarpMap) -> Vec<f64> {
        coefficients_of(map, &self.axes)
    }

    /// How far the ground lies above the bottom face (bottom-face coefficients, m).
    pub fn gap(&self, u: &[f64]) -> Vec<f64> {
        let mut gap = self.ground(u).face;
        for (g, v) in gap.iter_mut().zip(self.face(u, 2)) {
            *g -= v;
        }
        gap
    }

    /// From here on, the ground is lower than the terrain by a share of `gap`.
    pub fn lower_ground(&mut self, gap: &[f64], share: f64) {
        self.lowered = gap.iter().map(|g| share * g).collect();
    }

    /// Moves the columns over the bottom face up or down, so that it lies on the ground.
    pub fn seat(&self, u: &mut [f64]) {
        let gap = self.gap(u);
        let columns = u.len() / 3 * 2;
        for (column, gap) in u[columns..].chunks_exact_mut(self.axes[2].len()).zip(gap) {
            column.iter_mut().for_each(|v| *v += gap);
        }
    }

    /// Leaves the misfit out where the grid cannot follow the terrain: where, at these coefficients, it would cost more than
    /// what bends the map. The terrain is then as smooth as the grid makes it.
    pub fn forgive_misfit(&mut self, u: &[f64]) {
        let misfit = self.ground(u).misfit;
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

    /// One round of Algorithm 1: the target T(J) at every point and the ground under the bottom are frozen, and the quadratic
    /// energy ½∫ w‖J − T‖² dV, with the bottom on that ground, is minimized exactly (its matrix is the tensor-product stiffness
    /// that the preconditioner inverts). Returns the energy before and the square of the step in that energy's norm.
    ///
    /// With ∇ the gradient at u and K the matrix, the step δ has δ = ground − u on the bottom face and Kδ + ∇ = 0 elsewhere.
    pub fn alternate(&mut self, u: &mut [f64], scratch: &mut [Vec<f64>; 2]) -> (f64, f64) {
        let ground = self.ground(u).face;
        let [rest, moved] = scratch;
        let energy = self.assembly.energy(self.density, u, rest);
        moved.fill(0.0);
        let down: Vec<f64> = ground.iter().zip(self.face(u, 2)).map(|(g, v)| g - v).collect();
        self.set_face(moved, &down);
        let mut pull = vec![0.0; u.len()];
        let seated = 2.0 * self.assembly.energy(Norm, moved, &mut pull);
        for (r, p) in rest.iter_mut().zip(&pull) {
            *r += p;
        }
        self.hold_fixed(rest);
        pull.copy_from_slice(rest);
        self.preconditioner.apply(rest);
        let decrement = dot(&pull, rest);
        for ((u, m), r) in u.iter_mut().zip(moved.iter()).zip(rest.iter()) {
            *u += m - r;
        }
        (energy, seated + decrement)
    }

    /// The Gauss–Newton matrix at u, to be applied by [`Problem::curved`].
    pub fn linearized<C>(&self, u: &[f64], curvature: impl Fn(&D, &[Lanes; 9]) -> C) -> Linearized<C> {
        Linearized {
            curvatures: self.assembly.curvatures(u, |jacobian| curvature(&self.density, jacobian)),
            slopes: self.ground(u).slopes,
        }
    }

    /// `out` ← the Gauss–Newton matrix times a direction, which is zero for what is fixed: the curvature of the energy and the
    /// square of the misfit's change, with the bottom face moving as φ₀ and φ₁ do.
    pub fn curved<C>(
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
        self.assembly.curved(&at.curvatures, times, direction, out);
        let mut misfit = self.bottom.values(&face);
        for (m, r) in misfit.iter_mut().zip(&rise) {
            *m -= r;
        }
        self.pass_on(&at.slopes, &self.bottom.weighted(&misfit), out);
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

    /// The eliminated coefficients pass their gradient on to φ₀ and φ₁ by the chain rule, with the slopes of h at the Gauss
    /// points. The misfit (given times quadrature weights) is orthogonal to the splines, so that its square depends on φ₀ and
    /// φ₁ only through h itself.
    fn pass_on(&self, slopes: &[[f64; 2]], weighted_misfit: &[f64], gradient: &mut [f64]) {
        let n = gradient.len() / 3;
        let nz = self.axes[2].len();
        let mut pull = self.bottom.project_adjoint(&self.face(gradient, 2));
        for (p, m) in pull.iter_mut().zip(weighted_misfit) {
            *p -= 2.0 * self.misfit_weight * m;
        }
        for c in 0..2 {
            let pulled: Vec<f64> = pull.iter().zip(slopes).map(|(p, slope)| p * slope[c]).collect();
            let added = self.bottom.values_adjoint(&pulled);
            for (g, a) in gradient[c * n..][..n].iter_mut().step_by(nz).zip(&added) {
                *g += a;
            }
        }
        self.hold_fixed(gradient);
    }

    /// Zero for what is fixed: φ₀ on the x-faces, φ₁ on the y-faces, φ₂ on the bottom.
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

    /// What the ground asks for, given φ₀ and φ₁ on the bottom face.
    fn ground(&self, u: &[f64]) -> Ground {
        let [x, y] = [0, 1].map(|c| self.bottom.values(&self.face(u, c)));
        let (heights, slopes): (Vec<f64>, _) =
            x.iter().zip(&y).map(|(x, y)| self.field.height_and_gradient(*x, *y)).unzip();
        let mut face = self.bottom.project(&heights);
        let mut misfit = self.bottom.values(&face);
        for (m, h) in misfit.iter_mut().zip(&heights) {
            *m -= h;
        }
        for (f, lowered) in face.iter_mut().zip(&self.lowered) {
            *f -= lowered;
        }
        Ground { slopes, face, misfit }
    }
}

/// What the Gauss–Newton matrix is made of.
pub(super) struct Linearized<C> {
    /// Of the density at the points of the assembly.
    curvatures: Vec<C>,
    /// ∇h at the Gauss points of the bottom.
    slopes: Vec<[f64; 2]>,
}

/// The bottom face and the terrain under it.
struct Ground {
    /// ∇h(φ₀, φ₁) at the Gauss points.
    slopes: Vec<[f64; 2]>,
    /// The bottom-face coefficients that φ₂ must have.
    face: Vec<f64>,
    /// What the projection leaves: φ₂ − h(φ₀, φ₁) at the Gauss points, m.
    misfit: Vec<f64>,
}

impl<D: Density> Objective for Problem<'_, D> {
    fn evaluate(&mut self, u: &mut [f64], gradient: &mut [f64]) -> f64 {
        let Ground { slopes, face, misfit } = self.ground(u);
        self.set_face(u, &face);
        let energy = self.assembly.energy(self.density, u, gradient);
        if !energy.is_finite() {
            return energy;
        }
        let weighted = self.bottom.weighted(&misfit);
        self.pass_on(&slopes, &weighted, gradient);
        energy + self.misfit_weight * dot(&weighted, &misfit)
    }

    fn precondition(&mut self, v: &mut [f64]) {
        self.preconditioner.apply(v);
    }
}

/// Control points, component by component, with face values at the ends of each axis.
pub(super) fn coefficients_of(map: &WarpMap, axes: &[Axis; 3]) -> Vec<f64> {
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
    use super::super::barrier::{Barrier, Curvature};
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

    /// Coefficients a little away from the map's, with what is fixed where it was.
    fn moved(problem: &Problem<impl Density>, map: &WarpMap) -> Vec<f64> {
        let mut u = problem.coefficients(map);
        let mut change: Vec<f64> = (0..u.len()).map(|i| 0.02 * (1.9 * i as f64).sin()).collect();
        problem.hold_fixed(&mut change);
        u.iter_mut().zip(&change).for_each(|(u, c)| *u += c);
        u
    }

    fn gradient_matches(density: impl Density) {
        let field = field();
        let map = map(&field);
        let mut problem = Problem::new(&field, density, &map, POINTS).unwrap();
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
    fn the_gauss_newton_matrix_is_symmetric_and_positive() {
        let field = field();
        let map = map(&field);
        let problem = Problem::new(&field, Barrier { scale: MapScale::Trace }, &map, POINTS).unwrap();
        let mut u = moved(&problem, &map);
        problem.seat(&mut u);
        let linearized = problem.linearized(&u, |density, jacobian| density.curvature(jacobian, 0.0));
        let direction = |k: f64| {
            let mut v: Vec<f64> = (0..u.len()).map(|i| (k * i as f64).sin()).collect();
            problem.hold_fixed(&mut v);
            v
        };
        let times = |v: &[f64]| {
            let (mut v, mut out) = (v.to_vec(), vec![0.0; v.len()]);
            problem.curved(&linearized, Curvature::times, &mut v, &mut out);
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
        // The target of this energy is always 1, so that one round is all there is to do above the frozen ground.
        let mut problem = Problem::new(&field, Distance::Identity, &map, POINTS).unwrap();
        let mut u = moved(&problem, &map);
        let ground = problem.ground(&u).face;
        let mut scratch = [vec![0.0; u.len()], vec![0.0; u.len()]];
        let (before, _) = problem.alternate(&mut u, &mut scratch);
        assert_eq!(problem.face(&u, 2), ground);
        let mut gradient = vec![0.0; u.len()];
        let after = problem.assembly.energy(problem.density, &u, &mut gradient);
        problem.hold_fixed(&mut gradient);
        assert!(after < before && gradient.iter().all(|g| g.abs() < 1e-9), "{before} {after}");
    }
}
