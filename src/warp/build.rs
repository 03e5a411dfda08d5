//! From a terrain to its map: coarse grids first, each the start of the next finer one.

use std::ops::ControlFlow;
use std::time::Instant;

use super::WarpMap;
use super::axis::Rule;
use super::density::Mips;
use super::lbfgs::{Limits, Outcome, minimize};
use super::problem::Problem;
use super::report::MapReport;
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
/// The coarsest grid has at least this many cells along each axis, where the numbers can be halved at all.
const COARSEST: usize = 8;

/// Finds the map over a terrain by the method of `spec`. F's box stands over the terrain's rectangle.
///
/// `progress` is called once an iteration and may stop the work.
///
/// # Errors
/// For a grid that makes no sense, a method that is not available, and when `progress` says to stop. A map that is folded
/// or did not converge is not an error: its report says so.
pub fn build(
    field: &Heightfield,
    spec: &MapSpec,
    progress: &mut dyn FnMut(MapProgress) -> ControlFlow<()>,
) -> Result<(WarpMap, MapReport)> {
    let start = Instant::now();
    match spec.method {
        MapMethod::Shear => {
            let map = WarpMap::shear(field, spec)?;
            let mut report = MapReport::measure(&map, field, spec.method);
            report.seconds = start.elapsed().as_secs_f64();
            Ok((map, report))
        }
        MapMethod::Mips => mips(field, spec, progress, start),
        other => Err(Error::input(format!(
            "map.method = {} is not available yet; available are \"mips\" and \"shear\"",
            serde_json::to_string(&other).unwrap_or_default()
        ))),
    }
}

fn mips(
    field: &Heightfield,
    spec: &MapSpec,
    progress: &mut dyn FnMut(MapProgress) -> ControlFlow<()>,
    start: Instant,
) -> Result<(WarpMap, MapReport)> {
    let mut run = Run { field, progress, outcome: Outcome::default(), notes: Vec::new() };
    let map = run.coarse_to_fine(spec, Rule::Lobatto)?;
    let mut report = MapReport::measure(&map, field, spec.method);
    let mut best = (map, run.outcome);
    if report.inverted_points > 0 {
        // More points a cell leave less room for folds between them.
        run.notes.push(
            "the first map was folded between its quadrature points; it was built again with four Gauss points a cell and axis".into(),
        );
        let map = run.coarse_to_fine(spec, Rule::Gauss)?;
        let second = MapReport::measure(&map, field, spec.method);
        if second.inverted_points < report.inverted_points {
            report = second;
            best = (map, run.outcome);
        }
    }
    report.converged = best.1.converged;
    report.energy = best.1.value;
    report.iterations = run.outcome.iterations;
    report.evaluations = run.outcome.evaluations;
    if !report.converged {
        report.warnings.push(format!(
            "the optimizer stopped before its rule was met (gᵀHg is {:.1e} of the energy, wanted {TOLERANCE:.0e}), as happens where the terrain is steeper than its cells can follow; the map could be better",
            best.1.decrement / (best.1.value + ENERGY_FLOOR)
        ));
    }
    report.warnings.append(&mut run.notes);
    report.seconds = start.elapsed().as_secs_f64();
    Ok((best.0, report))
}

/// One building of a map, with what has been spent on it.
struct Run<'a> {
    field: &'a Heightfield,
    progress: &'a mut dyn FnMut(MapProgress) -> ControlFlow<()>,
    /// The last outcome; iterations and evaluations are sums.
    outcome: Outcome,
    notes: Vec<String>,
}

impl Run<'_> {
    fn coarse_to_fine(&mut self, spec: &MapSpec, rule: Rule) -> Result<WarpMap> {
        let mut cells = spec.cells;
        let mut halvings = Vec::new();
        loop {
            let halve = cells.map(|n| n % 2 == 0 && n / 2 >= COARSEST);
            if halve == [false; 3] {
                break;
            }
            cells = std::array::from_fn(|d| if halve[d] { cells[d] / 2 } else { cells[d] });
            halvings.push(halve);
        }
        let mut map = WarpMap::shear(self.field, &MapSpec { cells, ..spec.clone() })?;
        for halve in halvings.into_iter().rev() {
            map = self.minimized(&map, rule, MAX_COARSE_ITERATIONS)?.refined(halve);
        }
        self.minimized(&map, rule, MAX_ITERATIONS)
    }

    /// The minimizer on the grid of `start`, the map of a coarser grid.
    fn minimized(&mut self, start: &WarpMap, rule: Rule, iterations: usize) -> Result<WarpMap> {
        let cells = start.cells();
        let shear =
            WarpMap::shear(self.field, &MapSpec { cells, thickness: start.size()[2], ..MapSpec::default() })?;
        // What is fine on the coarser grid may fold when it is moved onto the ground that only this one sees: then that
        // ground is grown in steps. The shear is never folded.
        for (map, steps) in [(start, 1), (start, GROWTH_STEPS), (&shear, 1)] {
            let mut problem = Problem::new(self.field, Mips, map, rule)?;
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
        problem: &mut Problem<Mips>,
        u: &mut Vec<f64>,
        cells: [usize; 3],
        iterations: usize,
    ) -> Result<Outcome> {
        let limits = Limits { iterations, tolerance: TOLERANCE, floor: ENERGY_FLOOR };
        let outcome = minimize(problem, u, limits, &mut |iteration, energy, decrement| {
            (self.progress)(MapProgress {
                cells,
                iteration,
                energy,
                decrement: decrement / (energy + ENERGY_FLOOR),
                tolerance: TOLERANCE,
            })
        });
        if outcome.interrupted {
            return Err(Error::input("building the warp map was stopped before it was done"));
        }
        self.outcome.iterations += outcome.iterations;
        self.outcome.evaluations += outcome.evaluations;
        Ok(outcome)
    }
}
