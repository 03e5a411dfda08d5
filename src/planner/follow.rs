//! The guess from a motion that the scenario gives (`[guess]`): base, footholds, swings and forces are as near to it as the variables
//! allow. When feet step is the gait's.

use nalgebra::{DMatrix, Matrix3, Quaternion, UnitQuaternion, Vector3};

use super::places::{fixed, on_ground, pulled_back};
use super::standing::{self, Pose};
use crate::nlp::Model;
use crate::nlp::model::GRAVITY;
use crate::scenario::GivenMotion;
use crate::trajectory::spline::swing_basis;
use crate::warp::Order;
use crate::{Error, Result};

/// Points of a swing to which its control points are fitted.
const SWING_POINTS: usize = 20;
/// Footholds on patches that are farther than this from the motion's are other ones, m, for a robot of ANYmal's size.
const MOVED: f64 = 0.05;
/// Forces whose activation is less are not asked for.
const LEAST_ACTIVATION: f64 = 1e-3;

/// Sets all variables that the motion says something about.
///
/// # Errors
/// Where the motion is so far from the ground that it has no preimage under the map.
pub(super) fn follow(motion: &GivenMotion, model: &Model, x: &mut [f64]) -> Result<()> {
    set_base(motion, model, x)?;
    set_footholds(motion, model, x)?;
    set_swings(motion, model, x)?;
    set_forces(motion, model, x);
    Ok(())
}

fn unreachable(what: &str, t: f64, error: &Error) -> Error {
    Error::key("guess.file", format!("{what} at {t:.3} s is not over the ground: {error}"))
}

fn set_base(motion: &GivenMotion, model: &Model, x: &mut [f64]) -> Result<()> {
    let spline = &model.layout.base_spline;
    let horizon = model.layout.intervals as f64 * model.layout.time_step;
    let mut values: Vec<[f64; 6]> = Vec::new();
    for j in 0..=spline.intervals {
        let t = j as f64 * horizon / spline.intervals as f64;
        let (position, [w, i, j, k]) = motion.base(t);
        let turn = UnitQuaternion::from_quaternion(Quaternion::new(w, i, j, k));
        let pose =
            Pose { position: Vector3::from(position), rotation: turn.to_rotation_matrix().into_inner() };
        let mut value =
            standing::pulled_back(&model.spaces.base, &pose).map_err(|e| unreachable("the base", t, &e))?;
        // Headings go on from that of the start, over any number of turns.
        let near = values.last().map_or(x[5], |last| last[5]);
        value[5] += ((near - value[5]) / std::f64::consts::TAU).round() * std::f64::consts::TAU;
        values.push(value);
    }
    let last = spline.intervals;
    for block in 0..spline.blocks() {
        let value = match block {
            0 => values[0],
            b if b + 1 == spline.blocks() => values[last],
            // Cubic quasi-interpolation: exact for cubic polynomials.
            b => std::array::from_fn(|d| {
                let [before, here, after] = [b, b + 1, b + 2].map(|j| values[j.min(last)][d]);
                here - (before - 2.0 * here + after) / 6.0
            }),
        };
        x[6 * block..6 * block + 6].copy_from_slice(&value);
    }
    Ok(())
}

fn set_footholds(motion: &GivenMotion, model: &Model, x: &mut [f64]) -> Result<()> {
    let layout = &model.layout;
    for (i, foot) in layout.feet.iter().enumerate() {
        for (j, stance) in foot.stances.iter().enumerate() {
            if fixed(model, i, j).is_some() {
                continue;
            }
            let t = stance.stance.middle(layout.intervals as f64) * layout.time_step;
            let [px, py, _] = motion.foot(i, t);
            let foothold = match model.patch(i, j) {
                Some(patch) => {
                    let [px, py] = patch.nearest([px, py]);
                    pulled_back(&model.spaces.feet, &Vector3::new(px, py, patch.jet(px, py).h))
                }
                None => {
                    let keep_out = model.surfaces.keep_out.as_ref();
                    on_ground(model, keep_out.map_or([px, py], |keep_out| keep_out.moved_out([px, py])))
                }
            };
            let foothold = foothold.map_err(|e| unreachable(&model.foot_names[i], t, &e))?;
            x[stance.foothold.first()..][..3].copy_from_slice(foothold.as_slice());
        }
    }
    Ok(())
}

/// Least squares: the free control points between the footholds.
fn set_swings(motion: &GivenMotion, model: &Model, x: &mut [f64]) -> Result<()> {
    let layout = &model.layout;
    let free = layout.swing_shape.free();
    let at: Vec<f64> = (1..SWING_POINTS).map(|n| n as f64 / SWING_POINTS as f64).collect();
    let basis: Vec<Vec<f64>> = at
        .iter()
        .map(|u| swing_basis(layout.swing_shape, *u).into_iter().next().unwrap_or_default())
        .collect();
    let inner = DMatrix::from_fn(at.len(), free, |n, c| basis[n][c + 1]);
    let Some(inverse) = inner.tr_mul(&inner).try_inverse() else { return Ok(()) };
    let fit = inverse * inner.transpose();
    for (i, foot) in layout.feet.iter().enumerate() {
        for (j, swing) in foot.swings.iter().enumerate() {
            let ends = [j, j + 1].map(|s| foot.stances[s].foothold.value::<3>(x));
            let is_moved = |(end, k): (&[f64; 3], f64)| {
                let place = model.spaces.feet.jet(&Vector3::from(*end), Order::First).position;
                (place - Vector3::from(motion.foot(i, k * layout.time_step))).norm() > model.size * MOVED
            };
            // From or to another patch than the motion's, the guess leads over all that lies between.
            if model.patch(i, j).is_some()
                && ends.iter().zip([swing.swing.start, swing.swing.end]).any(is_moved)
            {
                continue;
            }
            let mut rest = DMatrix::zeros(at.len(), 3);
            for (n, u) in at.iter().enumerate() {
                let t = (swing.swing.start + u * (swing.swing.end - swing.swing.start)) * layout.time_step;
                let place = pulled_back(&model.spaces.feet, &Vector3::from(motion.foot(i, t)))
                    .map_err(|e| unreachable(&model.foot_names[i], t, &e))?;
                for d in 0..3 {
                    rest[(n, d)] = place[d] - basis[n][0] * ends[0][d] - basis[n][free + 1] * ends[1][d];
                }
            }
            let points = &fit * rest;
            for c in 0..free {
                for d in 0..3 {
                    x[swing.control_points + 3 * c + d] = points[(c, d)];
                }
            }
        }
    }
    Ok(())
}

fn set_forces(motion: &GivenMotion, model: &Model, x: &mut [f64]) {
    let (layout, unit) = (&model.layout, model.mass * GRAVITY);
    for (i, foot) in layout.feet.iter().enumerate() {
        for stance in &foot.stances {
            let foothold = Vector3::from(stance.foothold.value::<3>(x));
            let jacobian = model.spaces.feet.jet(&foothold, Order::First).jacobian;
            let inverse = jacobian.try_inverse().unwrap_or_else(Matrix3::identity);
            for (k, node) in stance.free_forces() {
                let activation: f64 = node.terms.iter().map(|(_, weight)| weight).sum();
                let Some(force) = motion.force(i, k as f64 * layout.time_step) else { return };
                if activation > LEAST_ACTIVATION {
                    let value = inverse * Vector3::from(force) / (unit * activation);
                    for &(variable, _) in &node.terms {
                        x[variable..][..3].copy_from_slice(value.as_slice());
                    }
                }
            }
        }
    }
}
