//! From a terrain to its map.

use std::ops::ControlFlow;
use std::time::Instant;

use super::WarpMap;
use super::axis::Rule;
use super::density::Mips;
use super::lbfgs::{Limits, Outcome, minimize};
use super::problem::Problem;
use crate::heightfield::Heightfield;
use crate::scenario::{MapMethod, MapSpec};
use crate::{Error, Result};

pub fn experiment(field: &Heightfield, spec: &MapSpec, levels: usize, tol: f64, coarse_tol: f64, verbose: bool) -> Result<WarpMap> {
    let mut plan = vec![(spec.cells, [false; 3])];
    for _ in 1..levels {
        let cells = plan[0].0;
        let halve = cells.map(|n| n % 2 == 0 && n / 2 >= 6);
        if halve == [false; 3] { break; }
        let coarse = std::array::from_fn(|d| if halve[d] { cells[d] / 2 } else { cells[d] });
        plan[0].1 = halve;
        plan.insert(0, (coarse, [false; 3]));
    }
    let mut map = WarpMap::shear(field, &MapSpec { cells: plan[0].0, ..spec.clone() })?;
    let start = Instant::now();
    let last = plan.len() - 1;
    for (i, (cells, halve)) in plan.iter().enumerate() {
        if i > 0 { map = map.refined(*halve); }
        let t = Instant::now();
        let mut problem = Problem::new(field, Mips, &map, Rule::Lobatto)?;
        let mut u = problem.seated(&map);
        let setup = t.elapsed().as_secs_f64();
        let limits = Limits { iterations: 500, tolerance: if i == last { tol } else { coarse_tol } };
        let outcome = minimize(&mut problem, &mut u, limits, &mut |it, e, d| {
            if verbose { println!("    {it} {e:.6} {:.3e}", d / e); }
            ControlFlow::Continue(())
        });
        println!("  {cells:?} setup {setup:.3} {outcome:?} t {:.3}", start.elapsed().as_secs_f64());
        map = problem.to_map(&u, &map);
    }
    Ok(map)
}
