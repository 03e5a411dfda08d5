//! The initial guess: a straight line in the space of the variables, nominal footholds under the base, and the weight divided among
//! the feet that stand. Where the scenario gives a motion, that (`follow.rs`).

use nalgebra::{Matrix3, Vector3};

use super::base_path::BasePath;
use super::follow::follow;
use super::places::{fixed, on_ground, pulled_back};
use crate::Result;
use crate::nlp::Model;
use crate::scenario::{GivenMotion, Scenario};
use crate::terrain::Patch;
use crate::trajectory::rotation::euler;
use crate::trajectory::switches;
use crate::warp::Order;

/// Apex of the guessed swings, as a multiple of `swing_clearance`.
const SWING_APEX: f64 = 1.5;
/// Intervals of the way of a swing over edges at whose ends the highest ground is looked for.
const WAY_SAMPLES: usize = 20;

/// The guess, one value for each variable; the first six are the pinned start.
///
/// # Errors
/// When a foot cannot reach the ground at the start, or a pose has no preimage under the map.
pub fn guess(scenario: &Scenario, model: &Model, given: Option<&GivenMotion>) -> Result<Vec<f64>> {
    let path = BasePath::new(scenario, model)?;
    let mut x = vec![0.0; model.layout.variables];
    set_base(&path, model, &mut x);
    let footholds = set_footholds(&path, model, &mut x)?;
    set_swings(SWING_APEX * scenario.motion.swing_clearance, &footholds, model, &mut x)?;
    set_forces(&footholds, model, &mut x);
    if let Some(motion) = given {
        follow(motion, model, &mut x)?;
    }
    set_given(model, &mut x);
    Ok(x)
}

fn set_base(path: &BasePath, model: &Model, x: &mut [f64]) {
    let layout = &model.layout;
    let spline = &layout.base_spline;
    if model.cycle.is_some() {
        // A control point's Greville abscissa is the knot before it.
        let at = |i: usize| path.at((i as f64 - 1.0) * spline.spacing);
        let points: Vec<[f64; 6]> = (0..spline.points()).map(at).collect();
        spline.set(&points, x);
        return;
    }
    for block in 0..spline.blocks() {
        // Block b is control point b + 2, whose Greville abscissa is knot b + 1; the outer ones are at rest.
        let t = match block {
            0 => 0.0,
            b if b + 1 == spline.blocks() => layout.intervals as f64 * layout.time_step,
            b => (b + 1) as f64 * spline.spacing,
        };
        x[6 * block..6 * block + 6].copy_from_slice(&path.at(t));
    }
    x[..6].copy_from_slice(&path.ends[0]);
}

/// What the scenario gives of the state at the start and of the velocity at the end.
fn set_given(model: &Model, x: &mut [f64]) {
    let layout = &model.layout;
    let (spline, h) = (&layout.base_spline, layout.base_spline.spacing);
    if let (Some(first), Some(velocity)) = (spline.end, &model.goal_velocity) {
        (0..3).for_each(|c| x[first + c] = h * velocity[c]);
    }
    let Some(start) = &model.start else { return };
    x[..6].copy_from_slice(&start.base[0]);
    if let Some(first) = spline.start {
        for d in 0..6 {
            x[first + d] = h * start.base[1][d];
            x[first + 6 + d] = h * h * start.base[2][d];
        }
    }
    for (variables, value) in start.variables(layout) {
        x[variables].copy_from_slice(value.as_slice());
    }
}

/// Puts each foothold on its patch or, where there is none, under the base where it is in the middle of the stance;
/// `[foot][stance]`.
fn set_footholds(path: &BasePath, model: &Model, x: &mut [f64]) -> Result<Vec<Vec<Vector3<f64>>>> {
    let layout = &model.layout;
    let mut footholds = Vec::new();
    for (i, foot) in layout.feet.iter().enumerate() {
        let on_ground = foot.stances.iter().enumerate().map(|(j, stance)| {
            let foothold = match model.patch(i, j) {
                Some(patch) => {
                    let [x, y] = patch.center;
                    pulled_back(&model.spaces.feet, &Vector3::new(x, y, patch.height))?
                }
                None if let Some([x, y]) = fixed(model, i, j) => {
                    let height = model.surfaces.feet.height(x, y);
                    pulled_back(&model.spaces.feet, &Vector3::new(x, y, height))?
                }
                None => foothold_under(model, i, &path.at(model.halfway(i, j) * layout.time_step)),
            };
            x[stance.foothold.first()..][..3].copy_from_slice(foothold.as_slice());
            Ok(foothold)
        });
        footholds.push(on_ground.collect::<Result<_>>()?);
    }
    Ok(footholds)
}

/// Control points of the swings, evenly spaced from foothold to foothold, lifted to the apex.
fn set_swings(apex: f64, footholds: &[Vec<Vector3<f64>>], model: &Model, x: &mut [f64]) -> Result<()> {
    for (i, (foot, footholds)) in model.layout.feet.iter().zip(footholds).enumerate() {
        for (j, (swing, ends)) in foot.swings.iter().zip(footholds.windows(2)).enumerate() {
            if let Some(lift_off) = swing.switches {
                x[lift_off..lift_off + 2].copy_from_slice(&switches::guessed(&swing.swing));
            }
            let over_edges = match (model.patch(i, j), model.patch(i, j + 1)) {
                (Some(from), Some(to)) => Some((from, to)),
                _ => None,
            };
            for c in 0..model.layout.swing_shape.free() {
                let point = match over_edges {
                    Some((from, to)) => over_edge(apex, [from, to], c, model)?,
                    None => over_smooth_ground(apex, [ends[0], ends[1]], c, model),
                };
                x[swing.control_points + 3 * c..][..3].copy_from_slice(point.as_slice());
            }
        }
    }
    Ok(())
}

/// The c-th control point of a swing over smooth ground.
fn over_smooth_ground(apex: f64, ends: [Vector3<f64>; 2], c: usize, model: &Model) -> Vector3<f64> {
    let fraction = (c + 1) as f64 / (model.layout.swing_shape.free() + 1) as f64;
    let mut point = ends[0] + (ends[1] - ends[0]) * fraction;
    point.z = if model.spaces.feet.is_warped() {
        apex
    } else {
        apex + point.z.max(model.surfaces.feet.height(point.x, point.y))
    };
    point
}

/// The c-th control point of a swing between two patches: straight up to the apex above all that lies between, across, and down.
fn over_edge(apex: f64, patches: [&Patch; 2], c: usize, model: &Model) -> Result<Vector3<f64>> {
    let [from, to] = patches.map(|p| Vector3::new(p.center[0], p.center[1], p.height));
    let between = |u: f64| from + (to - from) * u;
    let top = (0..=WAY_SAMPLES)
        .map(|n| between(n as f64 / WAY_SAMPLES as f64))
        .map(|q| model.surfaces.feet.height(q.x, q.y))
        .fold(f64::NEG_INFINITY, f64::max);
    let mut point = between(c as f64 / (model.layout.swing_shape.free() - 1) as f64);
    point.z = top + apex;
    pulled_back(&model.spaces.feet, &point)
}

/// Upright forces, equal for all feet that stand.
fn set_forces(footholds: &[Vec<Vector3<f64>>], model: &Model, x: &mut [f64]) {
    let bearing = bearing_feet(model);
    for (foot, footholds) in model.layout.feet.iter().zip(footholds) {
        for (stance, foothold) in foot.stances.iter().zip(footholds) {
            let jacobian = model.spaces.feet.jet(foothold, Order::First).jacobian;
            let up = jacobian
                .try_inverse()
                .map_or_else(Vector3::z, |inverse: Matrix3<f64>| inverse * Vector3::z());
            for (k, node) in stance.free_forces() {
                for &(variable, _) in &node.terms {
                    x[variable..][..3].copy_from_slice((up / bearing[k]).as_slice());
                }
            }
        }
    }
}

/// How many feet bear the weight at each sample, at least one; a foot near a switch counts as the activation of its force.
fn bearing_feet(model: &Model) -> Vec<f64> {
    let layout = &model.layout;
    let activation = |i: usize, k: usize| {
        layout.force(i, k).map_or(0.0, |(j, _)| {
            let swings = &layout.feet[i].swings;
            let switch = |j: Option<usize>, which: usize| {
                let swing = swings.get(j?)?;
                swing.switches.map(|_| switches::guessed(&swing.swing)[which])
            };
            switches::activation(k, switch(j.checked_sub(1), 1), switch(Some(j), 0))
        })
    };
    let total = |k: usize| (0..model.feet()).map(|i| activation(i, k)).sum::<f64>();
    (0..=layout.intervals).map(|k| total(k).max(1.0)).collect()
}

/// Where foot `i` would stand under a base with variables y, in the space of the variables.
fn foothold_under(model: &Model, i: usize, y: &[f64; 6]) -> Vector3<f64> {
    let (point, turn) = model.spaces.base.pose(y, false);
    let mut q = point.position + turn.rotation * model.nominal[i];
    if let Some(keep_out) = &model.surfaces.keep_out {
        [q.x, q.y] = keep_out.moved_out([q.x, q.y]);
    }
    on_ground(model, [q.x, q.y]).unwrap_or_else(|_| {
        let [x, y] = without_preimage(model, i, y, &q);
        Vector3::new(x, y, 0.0)
    })
}

/// A place in F for a foothold q that has no preimage, such as one outside the map's box: with the base in F, the nominal offset
/// scaled like lengths there; else q itself.
fn without_preimage(model: &Model, i: usize, y: &[f64; 6], q: &Vector3<f64>) -> [f64; 2] {
    if !model.spaces.base.is_warped() {
        return [q.x, q.y];
    }
    let jacobian = model.spaces.base.jet(&Vector3::new(y[0], y[1], y[2]), Order::First).jacobian;
    let scale = jacobian.determinant().abs().cbrt();
    let offset = euler(&Vector3::new(0.0, 0.0, y[5])).rotation * model.nominal[i] / scale;
    [y[0] + offset.x, y[1] + offset.y]
}
