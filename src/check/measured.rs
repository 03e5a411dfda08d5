//! Footholds against what was measured: none where a scan has no data, none where smoothing moved the ground. What counts as a hole
//! is computed for the check alone, so that an error in the planner's rule cannot hide itself.

use super::ground::PlanGround;
use super::laws;
use super::patches::stance_numbers;
use super::subject::{Finding, Subject, Worst};

/// A hole whose border is this close to its middle, in cells beyond the radius, still counts as that wide.
const ROUNDING: f64 = 1e-6;

pub(super) fn findings(s: &Subject, findings: &mut Vec<Finding>) {
    if let Some(unknown) = &s.plan.ground.unknown {
        let (mut count, mut first) = (0, Worst::default());
        for (n, e, [x, y]) in footholds(s) {
            if is_in_hole(s, unknown, x, y) {
                count += 1;
                if first.sample.is_none_or(|found| n < found) {
                    first = Worst { value: 0.0, sample: Some(n), foot: Some(e) };
                }
            }
        }
        let found = Worst { value: f64::from(count), ..first };
        let demanded = s.scenario.contact.on_known_ground;
        findings.push((if demanded { laws::UNKNOWN_GROUND } else { laws::UNKNOWN_STANCES }, found));
    }
    if !s.has_edges() && s.plan.ground.raw.is_some() {
        let raw = PlanGround::with_edges(&s.plan.ground);
        let mut moved = Worst::default();
        for (n, e, [x, y]) in footholds(s) {
            moved.meet(1e3 * (s.ground.height(x, y) - raw.height(x, y)).abs(), n, Some(e));
        }
        findings.push((laws::GROUND_MOVED, moved));
    }
}

/// The first sample of each stance, its foot, and where it stands.
fn footholds(s: &Subject) -> Vec<(usize, usize, [f64; 2])> {
    let mut found = Vec::new();
    for e in 0..s.feet {
        let stances = stance_numbers(s, e);
        let mut before = None;
        for n in (0..s.samples).filter(|&n| s.in_contact(n, e)) {
            if before != Some(stances[n]) {
                before = Some(stances[n]);
                let [x, y, _] = s.foot_position(n, e);
                found.push((n, e, [x, y]));
            }
        }
    }
    found
}

/// Whether a place is in ground without data that is wider than a foot: within a disc of the foot's radius without any data.
fn is_in_hole(s: &Subject, unknown: &[bool], x: f64, y: f64) -> bool {
    let grid = &s.plan.ground;
    let counts = [grid.columns, grid.rows];
    let radius = s.robot.foot_radius;
    let offsets: Vec<[isize; 2]> = {
        let reach = [0, 1].map(|c| (radius / grid.spacing[c] + ROUNDING) as isize);
        let within = |u: isize, v: isize| {
            (u as f64 * grid.spacing[0]).hypot(v as f64 * grid.spacing[1])
                <= radius + ROUNDING * grid.spacing[0]
        };
        (-reach[1]..=reach[1])
            .flat_map(|v| (-reach[0]..=reach[0]).map(move |u| [u, v]))
            .filter(|&[u, v]| within(u, v))
            .collect()
    };
    let at = |c: usize, place: f64| {
        let cell = ((place - grid.origin[c]) / grid.spacing[c]).round();
        cell.clamp(0.0, (counts[c] - 1) as f64) as isize
    };
    let place = [at(0, x), at(1, y)];
    // Beyond the border the outermost cells count.
    let has_no_data = |[u, v]: [isize; 2]| {
        let clamped = |k: isize, count: usize| k.clamp(0, count as isize - 1) as usize;
        unknown[clamped(v, counts[1]) * grid.columns + clamped(u, counts[0])]
    };
    let add = |a: [isize; 2], b: &[isize; 2]| [a[0] + b[0], a[1] + b[1]];
    has_no_data(place)
        && offsets
            .iter()
            .map(|o| add(place, o))
            .any(|middle| offsets.iter().all(|o| has_no_data(add(middle, o))))
}
