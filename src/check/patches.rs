//! Ground with edges: feet stand on the plane of their patch, the patch is on the raw ground, and swinging feet, as balls, keep
//! above the raw ground.

use super::laws;
use super::subject::{Finding, Subject, Worst, larger};
use super::vector::{add, cross, dot, norm, scale, sub};

/// Distance between the points at which the raw ground under a foot is looked at, as a fraction of the foot's radius.
const RESOLUTION: f64 = 0.2;

/// A patch as the file has it: four corners around a rectangle.
pub(super) struct PlanPatch<'a>(pub &'a [[f64; 3]; 4]);

impl PlanPatch<'_> {
    /// The upward unit normal.
    pub fn normal(&self) -> [f64; 3] {
        let c = self.0;
        let n = cross(sub(c[1], c[0]), sub(c[3], c[0]));
        scale(if n[2] < 0.0 { -1.0 } else { 1.0 } / norm(n), n)
    }

    /// Height of the plane, m.
    pub fn height(&self, x: f64, y: f64) -> f64 {
        let (n, c) = (self.normal(), self.0[0]);
        c[2] - (n[0] * (x - c[0]) + n[1] * (y - c[1])) / n[2]
    }

    /// Horizontal distance beyond the sides, m.
    fn beyond(&self, x: f64, y: f64) -> f64 {
        let along = |from: [f64; 3], to: [f64; 3]| {
            let d = [to[0] - from[0], to[1] - from[1]];
            let length = d[0].hypot(d[1]);
            let at = (d[0] * (x - from[0]) + d[1] * (y - from[1])) / length;
            larger(larger(-at, at - length), 0.0)
        };
        let c = self.0;
        along(c[0], c[1]).hypot(along(c[0], c[3]))
    }
}

/// The patch on which a foot stands at a sample, if it stands and has one.
pub(super) fn patch_at<'a>(s: &Subject<'a>, stances: &[usize], n: usize, e: usize) -> Option<PlanPatch<'a>> {
    let standing = s.in_contact(n, e);
    s.plan.patches.get(e)?.get(stances[n]).filter(|_| standing).map(PlanPatch)
}

/// For each sample, how many stances of a foot are over; one that is in the air at the start has one behind it.
pub(super) fn stance_numbers(s: &Subject, e: usize) -> Vec<usize> {
    let mut over = usize::from(!s.in_contact(0, e));
    (0..s.samples)
        .map(|n| {
            over += usize::from(n > 0 && s.in_contact(n - 1, e) && !s.in_contact(n, e));
            over
        })
        .collect()
}

pub(super) fn findings(s: &Subject, findings: &mut Vec<Finding>) {
    if !s.has_edges() {
        return;
    }
    let [mut outside, mut raw, mut offset, mut missing, mut cut] = [Worst::default(); 5];
    for e in 0..s.feet {
        let stances = stance_numbers(s, e);
        let needed = stances[s.samples - 1] + usize::from(s.in_contact(s.samples - 1, e));
        missing.meet(needed.abs_diff(s.plan.patches[e].len()) as f64, 0, Some(e));
        let mut before = None;
        for n in 0..s.samples {
            let [x, y, _] = s.foot_position(n, e);
            if let Some(patch) = patch_at(s, &stances, n, e) {
                outside.meet(1e3 * patch.beyond(x, y), n, Some(e));
                // A standing foot does not move: once for each stance is enough.
                if before != Some(stances[n]) {
                    let [largest, mean] = differences(s, &patch, [x, y]);
                    raw.meet(1e3 * largest, n, Some(e));
                    offset.meet(1e3 * mean.abs(), n, Some(e));
                    before = Some(stances[n]);
                }
            }
        }
        for (n, depth) in swing_depths(s, e) {
            cut.meet(1e3 * depth, n, Some(e));
        }
    }
    findings.push((laws::PATCH_COUNT, missing));
    findings.push((laws::PATCH, outside));
    findings.push((laws::PATCH_ROUGHNESS, raw));
    findings.push((laws::PATCH_OFFSET, offset));
    findings.push((laws::SWING_EDGE, cut));
}

/// Offsets within a foot's radius of its axis.
fn under_foot(radius: f64) -> impl Iterator<Item = [f64; 2]> {
    let steps = (1.0 / RESOLUTION) as i32;
    let at = move |k: i32| radius * f64::from(k) / f64::from(steps);
    (-steps..=steps)
        .flat_map(move |i| (-steps..=steps).map(move |j| [at(i), at(j)]))
        .filter(move |d| d[0].hypot(d[1]) <= radius)
}

/// Largest and mean difference of the raw ground under a foot from the plane of its patch, m.
fn differences(s: &Subject, patch: &PlanPatch, [x, y]: [f64; 2]) -> [f64; 2] {
    let (mut largest, mut sum, mut count) = (0.0_f64, 0.0, 0.0);
    for [u, v] in under_foot(s.robot.foot_radius) {
        let above = s.ground.height(x + u, y + v) - patch.height(x + u, y + v);
        largest = larger(largest, above.abs());
        sum += above;
        count += 1.0;
    }
    [largest, sum / count]
}

/// How deep a foot, as a ball that touches its contact point, is in the raw ground, m.
fn depth(s: &Subject, contact: [f64; 3], direction: [f64; 3]) -> f64 {
    let radius = s.robot.foot_radius;
    let [x, y, z] = add(contact, scale(radius, direction));
    under_foot(radius)
        .map(|[u, v]| {
            let below = (radius * radius - u * u - v * v).max(0.0).sqrt();
            s.ground.height(x + u, y + v) + below - z
        })
        .fold(f64::NEG_INFINITY, larger)
}

/// How deep a swinging foot is in the raw ground, by sample, m. The ground under a foothold need not be a plane, so that a foot may
/// stand with a bump pressed into it; while it is within its radius of that foothold, what counts is how much deeper it is.
fn swing_depths(s: &Subject, e: usize) -> Vec<(usize, f64)> {
    let normal = |n: usize| s.plan.foot_normal[n * s.feet + e];
    let contact = |n: usize| s.foot_position(n, e);
    let radius = s.robot.foot_radius;
    let mut depths = Vec::new();
    let mut n = 0;
    while n < s.samples {
        let first = n;
        while n < s.samples && !s.in_contact(n, e) {
            n += 1;
        }
        // A swing at the very beginning or end of the plan has a foothold on one side only.
        let stands = |n: &usize| *n < s.samples && s.in_contact(*n, e);
        let ends = [first.wrapping_sub(1), n].map(|n| Some(n).filter(stands));
        if n > first {
            let up = [0.0, 0.0, 1.0];
            let from = ends[0].or(ends[1]).map_or(up, normal);
            let to = ends[1].or(ends[0]).map_or(up, normal);
            let pressed = |n| (contact(n), depth(s, contact(n), normal(n)).max(0.0));
            let footholds: Vec<_> = ends.into_iter().flatten().map(pressed).collect();
            for k in first..n {
                // The center turns evenly from one normal to the next.
                let u = (k + 1 - first) as f64 / (n + 1 - first) as f64;
                let turned = add(scale(1.0 - u, from), scale(u, to));
                let direction = scale(1.0 / dot(turned, turned).sqrt(), turned);
                let stood = footholds
                    .iter()
                    .filter(|(foothold, _)| norm(sub(contact(k), *foothold)) <= radius)
                    .map(|(_, depth)| *depth)
                    .fold(0.0, f64::max);
                depths.push((k, depth(s, contact(k), direction) - stood));
            }
        }
        n += 1;
    }
    depths
}
