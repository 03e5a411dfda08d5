//! The splines that were optimized, which are the motion between the samples, and the map: evaluated at the samples.
//!
//! In the space of the variables the splines must go through the samples of that space; φ must carry these to the samples in ambient
//! space. The splines are evaluated here by de Boor's algorithm, from the knots in the file.

use super::laws;
use super::subject::{Finding, Subject, Worst, larger};
use super::vector::{add, cross, dot, norm, rotate, rotation_between, scale, sub};
use crate::warp::{Order, WarpMap};
use crate::{Error, Result};

/// Closer to a switch than this, s, a foot may count as standing or not.
const SWITCH: f64 = 1e-7;

/// Knots of a swing, as fractions of its duration, and how many control points are the foothold at each end, where the foot rests. With
/// three free control points there are two, with five there are three.
pub(super) fn swing_knots(free: usize) -> (Vec<f64>, usize) {
    let ends = if free == 3 { 2 } else { 3 };
    let intervals = free + 2 * ends - 3;
    let at = |i: usize| i.saturating_sub(3).min(intervals) as f64 / intervals as f64;
    ((0..intervals + 7).map(at).collect(), ends)
}

pub(super) fn findings(s: &Subject, findings: &mut Vec<Finding>) -> Result<()> {
    // Refuses splines that do not fit together: shapes, knots and phases.
    s.plan.motion()?;
    let splines = Splines::of(s)?;
    base(s, &splines, findings);
    feet(s, &splines, findings);
    if let Some(grid) = &s.plan.map {
        map(s, &WarpMap::from_grid(grid)?, findings);
    }
    Ok(())
}

/// The members under `spline/`, whose shapes fit together.
struct Splines<'a> {
    base_points: &'a [[f64; 6]],
    base_knots: &'a [f64],
    force_knots: &'a [f64],
    footholds: Vec<&'a [[f64; 3]]>,
    swings: Vec<&'a [[f64; 3]]>,
    /// Free control points of a swing.
    free: usize,
    forces: Vec<&'a [[f64; 3]]>,
}

impl<'a> Splines<'a> {
    fn of(s: &Subject<'a>) -> Result<Self> {
        let plan = s.plan;
        let member = |name: &str| -> Result<&'a [f64]> {
            let found = plan.splines.iter().find(|(member, ..)| member == name);
            let missing = || Error::input(format!("member spline/{name}: is missing"));
            found.map(|(_, _, values)| values.as_slice()).ok_or_else(missing)
        };
        let of_feet = |what: &str| -> Result<Vec<&'a [[f64; 3]]>> {
            plan.foot_names
                .iter()
                .map(|foot| Ok(member(&format!("{foot}_{what}"))?.as_chunks::<3>().0))
                .collect()
        };
        Ok(Self {
            base_points: member("base_control_points")?.as_chunks::<6>().0,
            base_knots: member("base_knots")?,
            force_knots: member("force_knots")?,
            footholds: of_feet("footholds")?,
            swings: of_feet("swing_control_points")?,
            free: plan.swing_shape()?.free(),
            forces: of_feet("force_nodes")?,
        })
    }
}

/// A cubic spline at t, by de Boor's algorithm: `knots` has four more elements than `points`.
fn cubic<const D: usize>(knots: &[f64], points: &[[f64; D]], t: f64) -> [f64; D] {
    let last = points.len() - 1;
    let span = (3..=last).rev().find(|&i| knots[i] <= t).unwrap_or(3);
    let mut d: [[f64; D]; 4] = std::array::from_fn(|j| points[span - 3 + j]);
    for r in 1..4 {
        for j in (r..4).rev() {
            let i = span - 3 + j;
            let u = (t - knots[i]) / (knots[i + 4 - r] - knots[i]);
            d[j] = std::array::from_fn(|k| (1.0 - u) * d[j - 1][k] + u * d[j][k]);
        }
    }
    d[3]
}

/// Between the knots linear.
fn linear(knots: &[f64], values: &[[f64; 3]], t: f64) -> [f64; 3] {
    let i = knots.partition_point(|knot| *knot <= t).clamp(1, knots.len() - 1) - 1;
    let u = (t - knots[i]) / (knots[i + 1] - knots[i]);
    add(scale(1.0 - u, values[i]), scale(u, values[i + 1]))
}

/// Roll, pitch and yaw as the quaternion of Rz(yaw) Ry(pitch) Rx(roll).
fn quaternion([roll, pitch, yaw]: [f64; 3]) -> [f64; 4] {
    let about = |angle: f64, axis: [f64; 3]| {
        let [x, y, z] = scale((0.5 * angle).sin(), axis);
        [(0.5 * angle).cos(), x, y, z]
    };
    let [x, y, z] = [[1.0, 0.0, 0.0], [0.0, 1.0, 0.0], [0.0, 0.0, 1.0]];
    product(product(about(yaw, z), about(pitch, y)), about(roll, x))
}

fn product(a: [f64; 4], b: [f64; 4]) -> [f64; 4] {
    let (ua, ub) = ([a[1], a[2], a[3]], [b[1], b[2], b[3]]);
    let [x, y, z] = add(add(scale(a[0], ub), scale(b[0], ua)), cross(ua, ub));
    [a[0] * b[0] - dot(ua, ub), x, y, z]
}

fn base(s: &Subject, splines: &Splines, findings: &mut Vec<Finding>) {
    let plan = s.plan;
    let warped = plan.warped.as_ref().and_then(|warped| warped.base.as_ref());
    let (mut position, mut turn) = (Worst::default(), Worst::default());
    for n in 0..s.samples {
        let [x, y, z, roll, pitch, yaw] = cubic(splines.base_knots, splines.base_points, plan.t[n]);
        let sample = warped.map_or(plan.base_position[n], |base| base.position[n]);
        position.meet(1e3 * norm(sub([x, y, z], sample)), n, None);
        let found = quaternion([roll, pitch, yaw]);
        let off = match warped {
            Some(base) => norm(sub([roll, pitch, yaw], base.euler[n])),
            None => norm(rotation_between(plan.base_quaternion_wxyz[n], found)),
        };
        turn.meet(1e3 * off, n, None);
    }
    findings.push((laws::SPLINE_BASE, position));
    findings.push((laws::SPLINE_TURN, turn));
}

fn feet(s: &Subject, splines: &Splines, findings: &mut Vec<Finding>) {
    let plan = s.plan;
    let warped = plan.warped.as_ref();
    let positions = warped.map_or(&plan.foot_position, |warped| &warped.foot_position);
    let forces = warped.map_or(&plan.foot_force, |warped| &warped.foot_force);
    let [mut position, mut force, mut phases] = [Worst::default(); 3];
    for e in 0..s.feet {
        for n in 0..s.samples {
            let t = plan.t[n];
            let (place, in_swing, near_switch) = foot(s, splines, e, t);
            position.meet(1e3 * norm(sub(place, positions[n * s.feet + e])), n, Some(e));
            let standing = s.in_contact(n, e);
            phases.meet(f64::from(u8::from(standing == in_swing && !near_switch)), n, Some(e));
            let expected =
                if standing { linear(splines.force_knots, splines.forces[e], t) } else { [0.0; 3] };
            let off = norm(sub(expected, forces[n * s.feet + e]));
            force.meet(100.0 / s.weight * off, n, Some(e));
        }
    }
    findings.push((laws::SPLINE_FEET, position));
    findings.push((laws::SPLINE_FORCES, force));
    findings.push((laws::PHASES, phases));
}

/// Where a foot is at t in the space of the variables, whether it swings, and whether a switch is so near that this is rounding.
fn foot(s: &Subject, splines: &Splines, e: usize, t: f64) -> ([f64; 3], bool, bool) {
    let (footholds, swings) = (splines.footholds[e], splines.swings[e]);
    let mut near = false;
    for (i, [start, end]) in s.plan.phases(e).into_iter().enumerate() {
        near |= i > 0 && (t - start).abs() < SWITCH;
        let (stance, in_swing) = (i / 2, i % 2 == 1);
        if in_swing && t > start && t < end {
            let [a, b] = [footholds[stance], footholds[stance + 1]];
            let (knots, ends) = swing_knots(splines.free);
            let knots: Vec<f64> = knots.iter().map(|u| start + u * (end - start)).collect();
            let free = &swings[splines.free * stance..][..splines.free];
            let place = cubic(&knots, &[&vec![a; ends], free, &vec![b; ends]].concat(), t);
            return (place, true, near || (t - end).abs() < SWITCH);
        }
        if !in_swing && t <= end {
            return (footholds[stance], false, near || (t - end).abs() < SWITCH);
        }
    }
    (footholds[footholds.len() - 1], false, near)
}

/// p = φ(p̄), f = J f̄, and R = P R̄ with J = P H, H symmetric and positive definite.
fn map(s: &Subject, map: &WarpMap, findings: &mut Vec<Finding>) {
    let plan = s.plan;
    let Some(warped) = &plan.warped else { return };
    let [mut position, mut force, mut turn] = [Worst::default(); 3];
    for (n, e) in s.sample_feet() {
        let i = n * s.feet + e;
        let jet = map.jet(warped.foot_position[i], Order::First);
        position.meet(1e3 * norm(sub(jet.position, plan.foot_position[i])), n, Some(e));
        let pushed = jet.jacobian.map(|row| dot(row, warped.foot_force[i]));
        force.meet(100.0 / s.weight * norm(sub(pushed, plan.foot_force[i])), n, Some(e));
    }
    for (n, (base, euler)) in
        warped.base.iter().flat_map(|base| base.position.iter().zip(&base.euler)).enumerate()
    {
        let jet = map.jet(*base, Order::First);
        position.meet(1e3 * norm(sub(jet.position, plan.base_position[n])), n, None);
        let [w, x, y, z] = quaternion(*euler);
        let p = product(plan.base_quaternion_wxyz[n], [w, -x, -y, -z]);
        turn.meet(1e3 * off_polar(p, jet.jacobian), n, None);
    }
    findings.push((laws::MAP, position));
    findings.push((laws::MAP_FORCES, force));
    if warped.base.is_some() {
        findings.push((laws::MAP_TURN, turn));
    }
}

/// How far a rotation P is from that of the polar decomposition of J, rad: how far H = Pᵀ J is from symmetric.
fn off_polar(p: [f64; 4], jacobian: [[f64; 3]; 3]) -> f64 {
    // Columns of P, then H = Pᵀ J.
    let columns = [[1.0, 0.0, 0.0], [0.0, 1.0, 0.0], [0.0, 0.0, 1.0]].map(|axis| rotate(p, axis));
    let h: [[f64; 3]; 3] = std::array::from_fn(|i| {
        std::array::from_fn(|j| (0..3).map(|k| columns[i][k] * jacobian[k][j]).sum())
    });
    let skew = [h[2][1] - h[1][2], h[0][2] - h[2][0], h[1][0] - h[0][1]];
    let minors = [h[0][0], h[0][0] * h[1][1] - h[0][1] * h[1][0], dot(h[0], cross(h[1], h[2]))];
    let indefinite = if minors.iter().all(|minor| *minor > 0.0) { 0.0 } else { std::f64::consts::PI };
    // For a small rotation δ beyond P, the skew part is (tr H − H) δ, about two thirds of the trace.
    larger(1.5 * norm(skew) / (h[0][0] + h[1][1] + h[2][2]).abs(), indefinite)
}
