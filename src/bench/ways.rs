//! Where the benchmark's motions start and end, and how its terrains get steeper.

use std::f64::consts::TAU;

/// Half the size of the terrain, m: starts and goals lie on circles of half of it.
pub(super) const RADIUS: f64 = 3.0;
/// Headings on ripple and cone: every 15°.
const HEADINGS: usize = 24;
/// Goals on hill and pit.
const GOALS: usize = 15;
/// Cases by terrain in a quick run, and at each step of the frontier.
const FEW: usize = 3;
/// Foot of the hill, where its climbs start, m.
const HILL_START: [f64; 2] = [-2.2, 0.0];
/// Places on the hill, m: fanned over its near slope, up to the top and a little beyond.
const HILL_GOALS: [[f64; 2]; GOALS] = [
    [-0.7, 0.0],
    [-0.45, 0.3],
    [-0.45, -0.3],
    [-0.2, 0.2],
    [-0.2, -0.2],
    [0.0, 0.0],
    [-0.6, 0.45],
    [-0.6, -0.45],
    [0.1, 0.25],
    [0.1, -0.25],
    [-0.3, 0.0],
    [0.0, 0.4],
    [0.0, -0.4],
    [0.2, 0.0],
    [-0.8, 0.2],
];
/// Distance of the goals outside the pit from its centre, m.
const PIT_GOAL: f64 = 2.0;

/// Where a motion starts and ends.
pub(super) struct Way {
    /// Names it among the ways of its terrain.
    pub label: String,
    /// θ, degrees, as the paper counts it.
    pub heading: Option<f64>,
    /// m.
    pub start: [f64; 2],
    /// m.
    pub goal: [f64; 2],
}

/// Cliffs need finer cells than slopes.
pub(super) fn cells(terrain: &str) -> &'static str {
    if terrain == "pit" { "cells = [64, 64, 16]\n" } else { "" }
}

/// Where the front feet may pull, as with the paper's suckers.
pub(super) fn is_steep(terrain: &str) -> bool {
    matches!(terrain, "hilly" | "pit")
}

/// The ways of Section V on a terrain.
pub(super) fn ways(terrain: &str) -> Vec<Way> {
    let half = 0.5 * RADIUS;
    let heading = |i: usize, start: fn([f64; 2]) -> [f64; 2]| {
        let theta = TAU * i as f64 / HEADINGS as f64;
        let goal = [half * theta.sin(), half * theta.cos()];
        let degrees = theta.to_degrees().round();
        Way { label: format!("{degrees:03}"), heading: Some(degrees), start: start(goal), goal }
    };
    match terrain {
        "rippled" => (0..HEADINGS).map(|i| heading(i, |_| [0.0, 0.0])).collect(),
        "conic" => (0..HEADINGS).map(|i| heading(i, |[x, y]| [-x, -y])).collect(),
        "hilly" => {
            let way = |(i, &goal): (usize, &[f64; 2])| Way {
                label: format!("goal-{i:02}"),
                heading: None,
                start: HILL_START,
                goal,
            };
            HILL_GOALS.iter().enumerate().map(way).collect()
        }
        _ => (0..GOALS)
            .map(|i| {
                let angle = TAU * i as f64 / GOALS as f64;
                Way {
                    label: format!("goal-{i:02}"),
                    heading: Some((450.0 - angle.to_degrees()) % 360.0),
                    start: [0.0, 0.0],
                    goal: [PIT_GOAL * angle.cos(), PIT_GOAL * angle.sin()],
                }
            })
            .collect(),
    }
}

/// A few of the ways, evenly chosen.
pub(super) fn thinned(ways: Vec<Way>, few: bool) -> Vec<Way> {
    let step = if few { ways.len() / FEW } else { 1 };
    ways.into_iter().step_by(step).collect()
}

/// What makes a terrain steeper than "hard", in eight steps.
pub(super) fn steeper(terrain: &str) -> (&'static str, [f64; 8]) {
    match terrain {
        // Greatest slope k A = 2.6 A.
        "rippled" => ("amplitude", [0.30, 0.35, 0.40, 0.45, 0.50, 0.60, 0.70, 0.80]),
        // Its flank is as steep as that; feet that do not pull slip beyond the friction coefficient, 0.75.
        "conic" => ("slope", [0.72, 0.74, 0.76, 0.80, 0.85, 0.90, 1.00, 1.20]),
        // Greatest slope H/(w √e) = 1.01 H.
        "hilly" => ("height", [1.75, 2.0, 2.25, 2.5, 2.75, 3.0, 3.5, 4.0]),
        // Greatest slope about D/(2δ) = 5 D.
        _ => ("depth", [1.0, 1.1, 1.2, 1.3, 1.4, 1.5, 1.7, 2.0]),
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn headings_are_the_papers() {
        let ways = ways("conic");
        assert_eq!(ways[6].label, "090");
        let [x, y] = ways[6].goal;
        assert!((x - 1.5).abs() < 1e-12 && y.abs() < 1e-12);
        assert!((ways[6].start[0] + 1.5).abs() < 1e-12);
        assert!((super::ways("pit")[0].heading.unwrap() - 90.0).abs() < 1e-9);
    }
}
