//! Builds the map over a terrain: coarse grids first, each the start of the next finer one.

use std::ops::{ControlFlow, Range};
use std::time::Instant;

use super::axis::Rule;
use super::barrier::Barrier;
use super::density::{Density, Mips};
use super::distance::Distance;
use super::gauss_newton::gauss_newton;
use super::lbfgs::minimize;
use super::local_global::alternate;
use super::objective::{Minimized, Observer, StoppingLimits};
use super::problem::{Quadrature, WarpProblem};
use super::report::{EnergyHistory, MapReport, RejectedMap};
use super::shear::ShearedFace;
use super::spline::{WarpMap, checked_box};
use crate::heightfield::Heightfield;
use crate::scenario::{MapMethod, MapSpec};
use crate::{Error, Result};

/// The state of the optimizer before an iteration.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct MapProgress {
    /// Cells of the current grid.
    pub cells: [usize; 3],
    /// Iteration on this grid.
    pub iteration: usize,
    /// The energy, m³.
    pub energy: f64,
    /// gᵀd relative to the energy, g the gradient and d the step: the optimizer converges when it falls to `tolerance`.
    pub decrement: f64,
    /// Where the optimizer converges on this grid.
    pub tolerance: f64,
}

/// The relative decrement at which the optimizer converges on the finest grid.
const TOLERANCE: f64 = 1e-4;
/// The same on coarser grids and while ground grows. With the finest grid's, maps are no better and take a sixth longer.
const COARSE_TOLERANCE: f64 = 3e-3;
/// Energies much below this are rounding errors, m³, as over flat ground.
const ENERGY_FLOOR: f64 = 1e-9;
/// On the finest grid. The benchmark's hardest terrain takes 300.
const MAX_ITERATIONS: usize = 600;
/// On each coarser grid. These need not converge: they would spend iterations on ground that is too fine for them.
const MAX_COARSE_ITERATIONS: usize = 150;
/// Number of steps in which new ground grows.
const GROWTH_STEPS: usize = 8;
/// Iterations for each of these steps but the last.
const GROWTH_ITERATIONS: usize = 30;
/// Tried in order while the map is folded between its quadrature points, as happens at the top of the box over slopes of 3: more
/// weight above the ground, by these factors, and in the end more points per cell.
const RETRIES: [(Rule, f64); 3] = [(Rule::Lobatto, 3.0), (Rule::Lobatto, 10.0), (Rule::Gauss, 10.0)];
/// The coarsest grid has at least this many cells along each axis that can be halved.
const COARSEST: usize = 8;
/// If the scenario does not give the cells, and the bottom misses the terrain by this much, m, the cells are halved along x and y.
/// Below, there is no need; above, the terrain has edges that cells of half the size do not follow either.
const WORTH_REFINING: Range<f64> = 1e-3..1e-2;
/// Halving the cells resolves the terrain if it decreases the misfit of the shear by this factor.
const RESOLVED: f64 = 0.25;
/// On ground steeper than this, finer cells fold between their quadrature points or converge slowly (the walls of scanned stairs).
const STEEP: f64 = 5.0;
/// What `map.method = "auto"` tries before [`FALLBACK`], in order of cost. (Wherever `dirichlet` is good enough, the shear is better
/// at the ground; the other methods are more expensive than `mips`.)
const CHEAPER: [MapMethod; 1] = [MapMethod::Shear];
/// What `map.method = "auto"` uses where nothing cheaper is good enough.
const FALLBACK: MapMethod = MapMethod::Mips;

/// Builds the map over a terrain by the method of `spec`. The box of F stands on the terrain's rectangle.
///
/// `progress` is called before each iteration and may stop the optimizer.
///
/// # Errors
/// If `spec` is not valid, or if `progress` stops the optimizer. A map that is folded or has not converged is not an error; its
/// report says so.
pub fn build(
    field: &Heightfield,
    spec: &MapSpec,
    progress: &mut dyn FnMut(MapProgress) -> ControlFlow<()>,
) -> Result<(WarpMap, MapReport)> {
    let start = Instant::now();
    let (map, mut report) = by_method(field, spec, spec.method, progress)?;
    report.seconds = start.elapsed().as_secs_f64();
    Ok((map, report))
}

fn by_method(
    field: &Heightfield,
    spec: &MapSpec,
    method: MapMethod,
    progress: &mut dyn FnMut(MapProgress) -> ControlFlow<()>,
) -> Result<(WarpMap, MapReport)> {
    let spec = &MapSpec { method, ..spec.clone() };
    match method {
        MapMethod::Auto => auto(field, spec, progress),
        MapMethod::Shear => shear(field, spec),
        MapMethod::Mips => optimized(field, spec, Mips, quasi_newton, progress),
        MapMethod::Dirichlet => optimized(field, spec, Distance::Identity, quasi_newton, progress),
        MapMethod::Arap => optimized(field, spec, Distance::Rotation, quasi_newton, progress),
        MapMethod::AcapLocalGlobal => {
            optimized(field, spec, Distance::Similarity(spec.scale), alternate, progress)
        }
        MapMethod::AcapNewton => {
            optimized(field, spec, Barrier { scale: spec.scale }, gauss_newton, progress)
        }
    }
}

/// The first map that is good enough, cheapest method first.
fn auto(
    field: &Heightfield,
    spec: &MapSpec,
    progress: &mut dyn FnMut(MapProgress) -> ControlFlow<()>,
) -> Result<(WarpMap, MapReport)> {
    let mut rejected = Vec::new();
    for method in CHEAPER {
        let (map, mut report) = by_method(field, spec, method, progress)?;
        let Some(why) = report.shortfall() else {
            report.rejected = rejected;
            return Ok((map, report));
        };
        rejected.push(RejectedMap { method, why });
    }
    let (map, mut report) = by_method(field, spec, FALLBACK, progress)?;
    report.rejected = rejected;
    Ok((map, report))
}

/// The shear, on a finer grid where that is worthwhile.
fn shear(field: &Heightfield, spec: &MapSpec) -> Result<(WarpMap, MapReport)> {
    let map = WarpMap::shear(field, spec)?;
    let report = MapReport::measure(&map, field, spec.method);
    if !worth_refining(spec, &report) {
        return Ok((map, report));
    }
    let [x, y, z] = report.cells;
    let map = WarpMap::shear(field, &MapSpec { cells: Some([2 * x, 2 * y, z]), ..spec.clone() })?;
    let report = MapReport::measure(&map, field, spec.method);
    Ok((map, report))
}

fn worth_refining(spec: &MapSpec, report: &MapReport) -> bool {
    spec.cells.is_none() && report.inverted_points == 0 && WORTH_REFINING.contains(&report.misfit_max)
}

/// The cells of the finest grid to begin with. Where the shear shows that it must be refined, it is fine from the start.
fn finest_cells(field: &Heightfield, spec: &MapSpec) -> [usize; 3] {
    let cells @ [x, y, _] = spec.cells(field.extent());
    let Some(finer) = halved(field, spec) else {
        return cells;
    };
    let misfit = ShearedFace::new(field, [x, y]).misfit();
    let resolved = misfit > WORTH_REFINING.start
        && ShearedFace::new(field, [finer[0], finer[1]]).misfit() < RESOLVED * misfit;
    if resolved { finer } else { cells }
}

/// The default cells, halved along x and y; none if the scenario gives the cells, if these are too many, or if the terrain is too
/// steep for them to help.
fn halved(field: &Heightfield, spec: &MapSpec) -> Option<[usize; 3]> {
    let [x, y, z] = spec.cells(field.extent());
    let finer = MapSpec { cells: Some([2 * x, 2 * y, z]), ..spec.clone() };
    let possible = spec.cells.is_none() && checked_box(field.extent(), &finer).is_ok();
    let useful = possible && ShearedFace::new(field, [x, y]).steepest(field) <= STEEP;
    finer.cells.filter(|_| useful)
}

/// Minimizes an energy on one grid, from the unknowns given, and returns those where it ends.
type Minimizer<D> =
    fn(&mut WarpProblem<'_, D>, Vec<f64>, StoppingLimits, &mut Observer) -> (Vec<f64>, Minimized);

fn quasi_newton<D: Density>(
    problem: &mut WarpProblem<'_, D>,
    v: Vec<f64>,
    limits: StoppingLimits,
    observer: &mut Observer,
) -> (Vec<f64>, Minimized) {
    minimize(problem, v, limits, observer)
}

/// The map that minimizes an energy.
fn optimized<D: Density>(
    field: &Heightfield,
    spec: &MapSpec,
    density: D,
    minimizer: Minimizer<D>,
    progress: &mut dyn FnMut(MapProgress) -> ControlFlow<()>,
) -> Result<(WarpMap, MapReport)> {
    let mut builder = MapBuilder {
        field,
        spec,
        density,
        minimizer,
        progress,
        cells: finest_cells(field, spec),
        iterations: 0,
        evaluations: 0,
        notes: Vec::new(),
        history: Vec::new(),
    };
    let attempt = builder.attempt(Quadrature { rule: Rule::Lobatto, torso_weight: spec.torso_weight })?;
    let attempt = builder.retried_while_folded(attempt)?;
    let attempt = builder.refined_if_worthwhile(attempt)?;
    Ok(builder.finished(attempt))
}

/// A map, its quality, and how it was found.
struct Attempt {
    map: WarpMap,
    report: MapReport,
    minimized: Minimized,
    points: Quadrature,
}

impl Attempt {
    /// The attempt with fewer folded points or, if they have equally many, the one that is closer to the terrain.
    fn or_better(self, other: Attempt) -> Attempt {
        let badness = |a: &Attempt| (a.report.inverted_points, a.report.misfit_max);
        if badness(&other) < badness(&self) { other } else { self }
    }
}

/// A grid's place in the sequence from coarse to fine.
#[derive(Clone, Copy, PartialEq)]
enum GridLevel {
    Coarse,
    Finest,
}

impl GridLevel {
    fn limits(self) -> StoppingLimits {
        let (iterations, tolerance) = match self {
            GridLevel::Coarse => (MAX_COARSE_ITERATIONS, COARSE_TOLERANCE),
            GridLevel::Finest => (MAX_ITERATIONS, TOLERANCE),
        };
        StoppingLimits { iterations, tolerance, floor: ENERGY_FLOOR }
    }
}

/// Builds one map by one method, in one or more attempts.
struct MapBuilder<'a, D> {
    field: &'a Heightfield,
    spec: &'a MapSpec,
    density: D,
    minimizer: Minimizer<D>,
    progress: &'a mut dyn FnMut(MapProgress) -> ControlFlow<()>,
    /// Of the finest grid.
    cells: [usize; 3],
    /// Iterations so far.
    iterations: usize,
    /// Evaluations of the energy so far.
    evaluations: usize,
    notes: Vec<String>,
    history: Vec<EnergyHistory>,
}

impl<D: Density> MapBuilder<'_, D> {
    /// From the coarsest grid to that of the specification.
    fn attempt(&mut self, points: Quadrature) -> Result<Attempt> {
        let (coarsest, halvings) = halvings(self.cells);
        let mut map = self.shear(coarsest)?;
        for halved in halvings.into_iter().rev() {
            map = self.minimized(&map, points, GridLevel::Coarse)?.0.refined(halved);
        }
        self.finest(&map, points)
    }

    /// Repeats a folded attempt with the settings of [`RETRIES`].
    fn retried_while_folded(&mut self, mut best: Attempt) -> Result<Attempt> {
        for (rule, factor) in RETRIES {
            if best.report.inverted_points == 0 || self.density.may_fold() {
                break;
            }
            let points = Quadrature { rule, torso_weight: factor * self.spec.torso_weight };
            self.notes.push(format!(
                "the map was folded between its quadrature points; it was built again with torso_weight {:.2}{}",
                points.torso_weight,
                if rule == Rule::Gauss { " and four Gauss points per cell and axis" } else { "" }
            ));
            best = best.or_better(self.attempt(points)?);
        }
        Ok(best)
    }

    /// Halves the cells along x and y if that is worthwhile and has not been done.
    fn refined_if_worthwhile(&mut self, attempt: Attempt) -> Result<Attempt> {
        let worthwhile = worth_refining(self.spec, &attempt.report)
            && halved(self.field, self.spec).is_some_and(|finer| finer != self.cells);
        if !worthwhile {
            return Ok(attempt);
        }
        let finer = self.finest(&attempt.map.refined([true, true, false]), attempt.points)?;
        Ok(attempt.or_better(finer))
    }

    /// Adds to the report how the map was found.
    fn finished(mut self, attempt: Attempt) -> (WarpMap, MapReport) {
        let Attempt { map, mut report, minimized, .. } = attempt;
        report.converged = minimized.converged;
        report.energy = minimized.value;
        report.iterations = self.iterations;
        report.evaluations = self.evaluations;
        report.history = self.history;
        if !report.converged {
            report.warnings.push(format!(
                "the optimizer stopped before it converged (gᵀd is {:.1e} of the energy, not {TOLERANCE:.0e}), as happens where the terrain is too steep for the cells; the map could be better",
                GridLevel::Finest.limits().relative(minimized.value, minimized.decrement)
            ));
        }
        report.warnings.append(&mut self.notes);
        (map, report)
    }

    /// Minimizes on the finest grid, from the map of a coarser one, and measures the result.
    fn finest(&mut self, start: &WarpMap, points: Quadrature) -> Result<Attempt> {
        let (map, minimized) = self.minimized(start, points, GridLevel::Finest)?;
        let report = MapReport::measure(&map, self.field, self.spec.method);
        Ok(Attempt { map, report, minimized, points })
    }

    /// Minimizes on the grid of `start`, the map of a coarser grid.
    ///
    /// A map that is injective on the coarser grid may fold when it is moved onto ground that only this grid resolves. Then that
    /// ground grows in steps. If that fails, too, the minimizer starts from the shear, which is never folded.
    fn minimized(
        &mut self,
        start: &WarpMap,
        points: Quadrature,
        level: GridLevel,
    ) -> Result<(WarpMap, Minimized)> {
        let shear = self.shear(start.cells())?;
        for (map, steps) in [(start, 1), (start, GROWTH_STEPS), (&shear, 1)] {
            if let Some(found) = self.grown(map, steps, points, level)? {
                return Ok(found);
            }
        }
        Err(Error::Internal("the shear onto the terrain is folded".into()))
    }

    /// Minimizes from `map` while the ground grows, in steps, from the bottom of `map` to the terrain. None if the map folds.
    fn grown(
        &mut self,
        map: &WarpMap,
        steps: usize,
        points: Quadrature,
        level: GridLevel,
    ) -> Result<Option<(WarpMap, Minimized)>> {
        let mut problem = WarpProblem::new(self.field, self.density, map, points)?;
        let u = problem.coefficients(map);
        let gap = problem.gap(&u);
        let mut v = problem.unknowns(u);
        let mut minimized = Minimized::default();
        for step in 1..=steps {
            problem.lower_ground(&gap, 1.0 - step as f64 / steps as f64);
            if level == GridLevel::Coarse {
                problem.soften_misfit(&v);
            }
            let limits = if step < steps {
                GridLevel::Coarse.limits().at_most(GROWTH_ITERATIONS)
            } else {
                level.limits()
            };
            (v, minimized) = self.run_minimizer(&mut problem, v, map.cells(), limits)?;
            if !minimized.value.is_finite() {
                return Ok(None);
            }
        }
        Ok(Some((problem.map_of(v, map), minimized)))
    }

    /// Runs the minimizer once and records its cost.
    fn run_minimizer(
        &mut self,
        problem: &mut WarpProblem<'_, D>,
        v: Vec<f64>,
        cells: [usize; 3],
        limits: StoppingLimits,
    ) -> Result<(Vec<f64>, Minimized)> {
        let mut energies = Vec::new();
        let (v, minimized) = (self.minimizer)(problem, v, limits, &mut |iteration, energy, decrement| {
            energies.push(energy);
            let decrement = limits.relative(energy, decrement);
            (self.progress)(MapProgress { cells, iteration, energy, decrement, tolerance: limits.tolerance })
        });
        if minimized.interrupted {
            return Err(Error::input("the warp map was stopped before it was finished"));
        }
        self.history.push(EnergyHistory { cells, energy: energies });
        self.iterations += minimized.iterations;
        self.evaluations += minimized.evaluations;
        Ok((v, minimized))
    }

    /// The shear on a grid with this many cells.
    fn shear(&self, cells: [usize; 3]) -> Result<WarpMap> {
        WarpMap::shear(self.field, &MapSpec { cells: Some(cells), ..self.spec.clone() })
    }
}

/// The cells of the coarsest grid, and along which axes to halve the cells of `cells`, and those that result, to arrive there.
fn halvings(mut cells: [usize; 3]) -> ([usize; 3], Vec<[bool; 3]>) {
    let mut halvings = Vec::new();
    loop {
        let halved = cells.map(|n| n % 2 == 0 && n / 2 >= COARSEST);
        if halved == [false; 3] {
            return (cells, halvings);
        }
        cells = std::array::from_fn(|d| if halved[d] { cells[d] / 2 } else { cells[d] });
        halvings.push(halved);
    }
}
