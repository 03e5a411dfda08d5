//! From a terrain to its map: coarse grids first, each the start of the next finer one.

use std::ops::ControlFlow;
use std::time::Instant;

use super::WarpMap;
use super::axis::Rule;
use super::barrier::Barrier;
use super::density::{Density, Mips};
use super::distance::Distance;
use super::gauss_newton::gauss_newton;
use super::lbfgs::{Limits, Outcome, minimize};
use super::local_global::alternate;
use super::problem::{Problem, Quadrature};
use super::report::{EnergyHistory, MapReport, RejectedMap};
use crate::heightfield::Heightfield;
use crate::scenario::{MapMethod, MapSpec};
use crate::{Error, Result};

/// Where the optimizer stands.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct MapProgress {
    /// Cells of the grid at work.
    pub cells: [usize; 3],
    /// Iteration on this grid.
    pub iteration: usize,
    /// The energy, m³.
    pub energy: f64,
    /// gᵀHg over the energy, which falls to `tolerance`.
    pub decrement: f64,
    /// Where this grid is done.
    pub tolerance: f64,
}

/// On all grids: gᵀHg relative to the energy.
const TOLERANCE: f64 = 1e-4;
/// Energies much below this are rounding, m³: over flat ground there is nothing to do.
const ENERGY_FLOOR: f64 = 1e-9;
/// On the finest grid. The benchmark's hardest terrain takes 300.
const MAX_ITERATIONS: usize = 600;
/// On the grids before it, which need not be done with: what they cannot resolve only keeps them busy.
const MAX_COARSE_ITERATIONS: usize = 150;
/// In how many steps ground is grown, and the iterations on each but the last.
const GROWTH_STEPS: usize = 8;
const GROWTH_ITERATIONS: usize = 30;
/// What is tried in turn while the map is folded between its points, as happens at the top of the box over ground of slope 3: a
/// greater weight of what is above the ground, by these factors, and at last more points a cell.
const RETRIES: [(Rule, f64); 3] = [(Rule::Lobatto, 3.0), (Rule::Lobatto, 10.0), (Rule::Gauss, 10.0)];
/// The coarsest grid has at least this many cells along each axis, where the numbers can be halved at all.
const COARSEST: usize = 8;

/// By how much cells are to be halved along x and y where the scenario does not give them: when the bottom misses the terrain by
/// more than the first. Beyond the second the terrain has edges that cells half as large do not follow either, m.
const WORTH_REFINING: std::ops::Range<f64> = 1e-3..1e-2;

/// Finds the map over a terrain by the method of `spec`. F's box stands over the terrain's rectangle.
///
/// `progress` is called once an iteration and may stop the work.
///
/// # Errors
/// For a grid that makes no sense, and when `progress` says to stop. A map that is folded or did not converge is not an
/// error: its report says so.
pub fn build(
    field: &Heightfield,
    spec: &MapSpec,
    progress: &mut dyn FnMut(MapProgress) -> ControlFlow<()>,
) -> Result<(WarpMap, MapReport)> {
    let start = Instant::now();
    let (map, mut report) = match spec.method {
        MapMethod::Auto => auto(field, spec, progress)?,
        method => by_method(field, spec, method, progress)?,
    };
    report.seconds = start.elapsed().as_secs_f64();
    Ok((map, report))
}

/// In the order of their cost. (`dirichlet` is left out: wherever it serves, the shear was better at the ground; the others cost
/// more than `mips`.)
const CANDIDATES: [MapMethod; 2] = [MapMethod::Shear, MapMethod::Mips];

/// The first of the candidates that is good enough; the last, where none is.
fn auto(
    field: &Heightfield,
    spec: &MapSpec,
    progress: &mut dyn FnMut(MapProgress) -> ControlFlow<()>,
) -> Result<(WarpMap, MapReport)> {
    let mut trials = Vec::new();
    let (last, first) = CANDIDATES.split_last().unwrap_or((&MapMethod::Mips, &[]));
    for method in first {
        let (map, mut report) = by_method(field, spec, *method, progress)?;
        match report.shortfall() {
            None => {
                report.rejected = trials;
                return Ok((map, report));
            }
            Some(why) => trials.push(RejectedMap { method: *method, why }),
        }
    }
    let (map, mut report) = by_method(field, spec, *last, progress)?;
    report.rejected = trials;
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
        MapMethod::Shear => shear(field, spec),
        MapMethod::Mips | MapMethod::Auto => optimized(field, spec, Mips, quasi_newton, progress),
        MapMethod::Dirichlet => optimized(field, spec, Distance::Identity, quasi_newton, progress),
        MapMethod::Arap => optimized(field, spec, Distance::Rotation, quasi_newton, progress),
        MapMethod::AcapLocalGlobal => optimized(
            field,
            spec,
            Distance::Similarity(spec.scale),
            |p, u, l, report| alternate(p, u, l, report),
            progress,
        ),
        MapMethod::AcapNewton => {
            optimized(field, spec, Barrier { scale: spec.scale }, gauss_newton, progress)
        }
    }
}

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

/// How an energy is minimized on one grid.
type Minimizer<D> = fn(
    &mut Problem<'_, D>,
    &mut Vec<f64>,
    Limits,
    &mut dyn FnMut(usize, f64, f64) -> ControlFlow<()>,
) -> Outcome;

fn quasi_newton<D: Density>(
    problem: &mut Problem<'_, D>,
    u: &mut Vec<f64>,
    limits: Limits,
    progress: &mut dyn FnMut(usize, f64, f64) -> ControlFlow<()>,
) -> Outcome {
    minimize(problem, u, limits, progress)
}

/// The map that minimizes an energy.
fn optimized<D: Density>(
    field: &Heightfield,
    spec: &MapSpec,
    density: D,
    minimizer: Minimizer<D>,
    progress: &mut dyn FnMut(MapProgress) -> ControlFlow<()>,
) -> Result<(WarpMap, MapReport)> {
    let (outcome, notes, history) = (Outcome::default(), Vec::new(), Vec::new());
    let mut run = Run { field, density, minimizer, progress, outcome, notes, history };
    let mut best = run.attempt(spec, Quadrature { rule: Rule::Lobatto, torso_weight: spec.torso_weight })?;
    for (rule, factor) in RETRIES {
        if best.report.inverted_points == 0 || density.may_fold() {
            break;
        }
        let points = Quadrature { rule, torso_weight: factor * spec.torso_weight };
        run.notes.push(format!(
            "the map was folded between its quadrature points; it was built again with torso_weight {:.2}{}",
            points.torso_weight,
            if rule == Rule::Gauss { " and four Gauss points a cell and axis" } else { "" }
        ));
        best = best.or_better(run.attempt(spec, points)?);
    }
    if worth_refining(spec, &best.report) {
        let points = best.points;
        let map = run.minimized(&best.map.refined([true, true, false]), points, MAX_ITERATIONS)?;
        best = best.or_better(run.measured(map, spec, points));
    }
    let Attempt { map, mut report, outcome, .. } = best;
    report.converged = outcome.converged;
    report.energy = outcome.value;
    report.iterations = run.outcome.iterations;
    report.evaluations = run.outcome.evaluations;
    report.history = run.history;
    if !report.converged {
        report.warnings.push(format!(
            "the optimizer stopped before its rule was met (gᵀHg is {:.1e} of the energy, wanted {TOLERANCE:.0e}), as happens where the terrain is steeper than its cells can follow; the map could be better",
            outcome.decrement / (outcome.value.abs() + ENERGY_FLOOR)
        ));
    }
    report.warnings.append(&mut run.notes);
    Ok((map, report))
}

/// A map, what it is like, and how it was found.
struct Attempt {
    map: WarpMap,
    report: MapReport,
    outcome: Outcome,
    points: Quadrature,
}

impl Attempt {
    /// The one that is folded at fewer points; where both are at as many, the one closer to the terrain.
    fn or_better(self, other: Attempt) -> Attempt {
        let badness = |a: &Attempt| (a.report.inverted_points, a.report.misfit_max);
        if badness(&other) < badness(&self) { other } else { self }
    }
}

/// One building of a map, with what has been spent on it.
struct Run<'a, D> {
    field: &'a Heightfield,
    density: D,
    minimizer: Minimizer<D>,
    progress: &'a mut dyn FnMut(MapProgress) -> ControlFlow<()>,
    /// The last outcome; iterations and evaluations are sums.
    outcome: Outcome,
    notes: Vec<String>,
    history: Vec<EnergyHistory>,
}

impl<D: Density> Run<'_, D> {
    fn attempt(&mut self, spec: &MapSpec, points: Quadrature) -> Result<Attempt> {
        let map = self.coarse_to_fine(spec, points)?;
        Ok(self.measured(map, spec, points))
    }

    fn measured(&self, map: WarpMap, spec: &MapSpec, points: Quadrature) -> Attempt {
        let report = MapReport::measure(&map, self.field, spec.method);
        Attempt { map, report, outcome: self.outcome, points }
    }

    fn coarse_to_fine(&mut self, spec: &MapSpec, points: Quadrature) -> Result<WarpMap> {
        let mut cells = spec.cells(self.field.extent());
        let mut halvings = Vec::new();
        loop {
            let halve = cells.map(|n| n % 2 == 0 && n / 2 >= COARSEST);
            if halve == [false; 3] {
                break;
            }
            cells = std::array::from_fn(|d| if halve[d] { cells[d] / 2 } else { cells[d] });
            halvings.push(halve);
        }
        let mut map = WarpMap::shear(self.field, &MapSpec { cells: Some(cells), ..spec.clone() })?;
        for halve in halvings.into_iter().rev() {
            map = self.minimized(&map, points, MAX_COARSE_ITERATIONS)?.refined(halve);
        }
        self.minimized(&map, points, MAX_ITERATIONS)
    }

    /// The minimizer on the grid of `start`, the map of a coarser grid.
    fn minimized(&mut self, start: &WarpMap, points: Quadrature, iterations: usize) -> Result<WarpMap> {
        let cells = start.cells();
        let thickness = start.size()[2];
        let shear =
            WarpMap::shear(self.field, &MapSpec { cells: Some(cells), thickness, ..MapSpec::default() })?;
        // What is fine on the coarser grid may fold when it is moved onto the ground that only this one sees: then that
        // ground is grown in steps. The shear is never folded.
        for (map, steps) in [(start, 1), (start, GROWTH_STEPS), (&shear, 1)] {
            let mut problem = Problem::new(self.field, self.density, map, points)?;
            let mut u = problem.coefficients(map);
            let gap = problem.gap(&u);
            let mut outcome = Outcome::default();
            for step in 1..=steps {
                problem.lower_ground(&gap, 1.0 - step as f64 / steps as f64);
                problem.seat(&mut u);
                if iterations < MAX_ITERATIONS {
                    problem.forgive_misfit(&u);
                }
                let iterations = if step < steps { GROWTH_ITERATIONS } else { iterations };
                outcome = self.run(&mut problem, &mut u, cells, iterations)?;
                if !outcome.value.is_finite() {
                    break;
                }
            }
            if outcome.value.is_finite() {
                self.outcome.converged = outcome.converged;
                self.outcome.value = outcome.value;
                self.outcome.decrement = outcome.decrement;
                return Ok(problem.to_map(&u, map));
            }
        }
        Err(Error::Internal("the shear onto the terrain is folded".into()))
    }

    /// One run of the optimizer; it is added to what has been spent.
    fn run(
        &mut self,
        problem: &mut Problem<'_, D>,
        u: &mut Vec<f64>,
        cells: [usize; 3],
        iterations: usize,
    ) -> Result<Outcome> {
        let limits = Limits { iterations, tolerance: TOLERANCE, floor: ENERGY_FLOOR };
        let mut energies = Vec::new();
        let outcome = (self.minimizer)(problem, u, limits, &mut |iteration, energy, decrement| {
            energies.push(energy);
            (self.progress)(MapProgress {
                cells,
                iteration,
                energy,
                decrement: decrement / (energy.abs() + ENERGY_FLOOR),
                tolerance: TOLERANCE,
            })
        });
        if outcome.interrupted {
            return Err(Error::input("building the warp map was stopped before it was done"));
        }
        self.history.push(EnergyHistory { cells, energy: energies });
        self.outcome.iterations += outcome.iterations;
        self.outcome.evaluations += outcome.evaluations;
        Ok(outcome)
    }
}
