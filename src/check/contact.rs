//! Feet and forces: on the ground in stance, above it in swing, forces within their cones and limits.

use super::laws;
use super::patches::{PlanPatch, patch_at, stance_numbers};
use super::subject::{Finding, Residuals, Subject, Worst, larger};
use super::vector::{dot, norm, scale, sub};

pub(super) fn findings(s: &Subject, findings: &mut Vec<Finding>, residuals: &mut Residuals) {
    let stances: Vec<_> = (0..s.feet).map(|e| stance_numbers(s, e)).collect();
    feet(s, &stances, findings, residuals);
    swings(s, &stances, findings);
    forces(s, &stances, findings, residuals);
    footholds(s, &stances, findings);
}

/// Height of a foot above the ground, m; for a foot that stands on a patch, above that patch's plane.
fn height_over_ground(s: &Subject, stances: &[Vec<usize>], n: usize, e: usize) -> f64 {
    let [x, y, z] = s.foot_position(n, e);
    match patch_at(s, &stances[e], n, e) {
        Some(patch) => z - patch.height(x, y),
        None => z - s.ground.height(x, y),
    }
}

fn feet(s: &Subject, stances: &[Vec<usize>], findings: &mut Vec<Finding>, residuals: &mut Residuals) {
    let (mut gap, mut slip, mut penetration) = (Worst::default(), Worst::default(), Worst::default());
    let mut landed = vec![None; s.feet];
    residuals.stance_gap = vec![0.0; s.samples];
    for (n, e) in s.sample_feet() {
        let over = 1e3 * height_over_ground(s, stances, n, e);
        if s.in_contact(n, e) {
            gap.meet(over.abs(), n, Some(e));
            residuals.stance_gap[n] = residuals.stance_gap[n].max(over.abs());
            let first = *landed[e].get_or_insert(s.foot_position(n, e));
            slip.meet(1e3 * norm(sub(s.foot_position(n, e), first)), n, Some(e));
        } else {
            // Over edges the foot counts as a ball: see `patches`.
            if !s.has_edges() {
                penetration.meet(-over, n, Some(e));
            }
            landed[e] = None;
        }
    }
    findings.push((laws::STANCE_GAP, gap));
    findings.push((laws::STANCE_SLIP, slip));
    findings.push((laws::SWING_PENETRATION, penetration));
}

/// The apex of every swing that begins and ends within the plan.
fn swings(s: &Subject, stances: &[Vec<usize>], findings: &mut Vec<Finding>) {
    let clearance = 1e3 * s.scenario.motion.swing_clearance;
    let mut shortfall = Worst::default();
    let mut least: Option<Worst> = None;
    for e in 0..s.feet {
        let mut n = 0;
        while n < s.samples {
            let begin = n;
            while n < s.samples && !s.in_contact(n, e) {
                n += 1;
            }
            if begin > 0 && n > begin && n < s.samples {
                let heights: Vec<f64> =
                    (begin..n).map(|k| 1e3 * height_over_ground(s, stances, k, e)).collect();
                let apex = heights.iter().copied().fold(f64::NEG_INFINITY, larger);
                let at = begin + heights.iter().position(|h| *h == apex).unwrap_or(0);
                shortfall.meet(clearance - apex, at, Some(e));
                if least.is_none_or(|known| apex < known.value) {
                    least = Some(Worst { value: apex, sample: Some(at), foot: Some(e) });
                }
            }
            n += 1;
        }
    }
    findings.push((laws::SWING_APEX, shortfall));
    findings.extend(least.map(|worst| (laws::LEAST_APEX, worst)));
}

/// The cone of Eq. 5 with the terrain's own normals, limits along the normal, nothing in swing.
fn forces(s: &Subject, stances: &[Vec<usize>], findings: &mut Vec<Finding>, residuals: &mut Residuals) {
    let motion = &s.scenario.motion;
    let percent = 100.0 / s.weight;
    let [mut friction, mut shear, mut pull, mut push_over, mut pull_over, mut swing, mut normals] =
        [Worst::default(); 7];
    let coefficient = (1.0 - s.scenario.contact.friction_margin) * s.robot.friction;
    residuals.friction = vec![0.0; s.samples];
    for (n, e) in s.sample_feet() {
        let force = s.foot_force(n, e);
        let [x, y, _] = s.foot_position(n, e);
        let patch = patch_at(s, &stances[e], n, e);
        let normal = patch.as_ref().map_or_else(|| s.ground.normal(x, y), PlanPatch::normal);
        let stated = s.plan.foot_normal[n * s.feet + e];
        // Unit length, as an angle.
        normals.meet((norm(stated) - 1.0).abs().to_degrees(), n, Some(e));
        // In the air over edges, the raw ground has no normal to speak of, and nothing depends on it.
        if patch.is_some() || !s.has_edges() {
            // For small angles the chord between two unit vectors is more accurate than the cosine.
            normals.meet((2.0 * (0.5 * norm(sub(normal, stated))).min(1.0).asin()).to_degrees(), n, Some(e));
        }
        if !s.in_contact(n, e) {
            swing.meet(percent * norm(force), n, Some(e));
            continue;
        }
        let along = dot(force, normal);
        let across = norm(sub(force, scale(along, normal)));
        push_over.meet(percent * along - 100.0 * motion.force_limit, n, Some(e));
        if s.plan.foot_adhesive[e] {
            pull_over.meet(-percent * along - 100.0 * motion.pull_limit, n, Some(e));
            // The adhesion presses the foot onto the ground with as much as it may pull.
            let pressed = along + motion.pull_limit * s.weight;
            shear.meet(percent * (across - coefficient * pressed), n, Some(e));
        } else {
            let excess = percent * (across - coefficient * along);
            friction.meet(excess, n, Some(e));
            residuals.friction[n] = residuals.friction[n].max(excess);
            pull.meet(-percent * along, n, Some(e));
        }
    }
    findings.push((laws::NORMAL, normals));
    findings.push((laws::FRICTION, friction));
    findings.push((laws::SHEAR, shear));
    findings.push((laws::PULL, pull));
    findings.push((laws::FORCE_LIMIT, push_over));
    findings.push((laws::PULL_LIMIT, pull_over));
    findings.push((laws::SWING_FORCE, swing));
}

/// Where feet may stand: within the terrain, and not on slopes that the scenario rules out.
fn footholds(s: &Subject, stances: &[Vec<usize>], findings: &mut Vec<Finding>) {
    let [x_min, x_max, y_min, y_max] = s.ground.extent();
    let (mut outside, mut steep, mut kept) = (Worst::default(), Worst::default(), Worst::default());
    for (n, e) in s.sample_feet().filter(|&(n, e)| s.in_contact(n, e)) {
        let [x, y, _] = s.foot_position(n, e);
        if !s.ground.covers(x, y) {
            let beyond = |v: f64, low: f64, high: f64| larger(larger(low - v, v - high), 0.0);
            outside.meet(1e3 * beyond(x, x_min, x_max).hypot(beyond(y, y_min, y_max)), n, Some(e));
        }
        for polygon in &s.scenario.keep_out {
            kept.meet(-1e3 * polygon.distance([x, y]), n, Some(e));
        }
        if let Some(most) = s.scenario.contact.max_slope {
            let margin = s.scenario.contact.edge_margin;
            for [u, v] in [[0.0, 0.0], [1.0, 0.0], [-1.0, 0.0], [0.0, 1.0], [0.0, -1.0]] {
                let patch = patch_at(s, &stances[e], n, e);
                let normal = patch
                    .map_or_else(|| s.ground.normal(x + margin * u, y + margin * v), |patch| patch.normal());
                steep.meet(normal[0].hypot(normal[1]) / normal[2] - most, n, Some(e));
            }
        }
    }
    findings.push((laws::INSIDE, outside));
    if !s.scenario.keep_out.is_empty() {
        findings.push((laws::KEEP_OUT, kept));
    }
    if s.scenario.contact.max_slope.is_some() {
        findings.push((laws::FOOTHOLD_SLOPE, steep));
    }
}
