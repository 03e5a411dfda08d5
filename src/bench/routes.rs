//! Starts and goals of the benchmark's motions, and the parameters of its terrains.

use std::f64::consts::TAU;

/// Half the side of the square terrain, m. On ripple and cone, goals lie on a circle of half this radius.
pub(super) const HALF_EXTENT: f64 = 3.0;
/// Headings on ripple and cone: every 15°.
const HEADINGS: usize = 24;
/// Goals on hill and pit.
const GOALS: usize = 15;
/// Routes per terrain in a quick run, and at each step of the frontier.
const FEW: usize = 3;
/// The diagonal over the ripple, among its routes.
pub(super) const RIPPLE_DIAGONAL: usize = 3;
/// The climb to the top of the hill, among its routes.
pub(super) const HILL_TOP: usize = 5;
/// Foot of the hill, where its climbs start, m.
const HILL_START: [f64; 2] = [-2.2, 0.0];
/// Goals on the hill, m: spread over its near slope, up to the top and a little beyond.
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
/// Distance of the goals, which lie outside the pit, from its center, m.
const PIT_GOAL: f64 = 2.0;

/// Start and goal of a motion.
pub(super) struct Route {
    /// Unique among the routes of a terrain.
    pub label: String,
    /// θ, degrees, counted as in the paper: from +y to +x.
    pub heading: Option<f64>,
    /// Where the base starts, m.
    pub start: [f64; 2],
    /// Where it ends, m.
    pub goal: [f64; 2],
}

/// The map's cells, as a line of `[map]`: cliffs need finer ones than the default.
pub(super) fn cells(terrain: &str) -> &'static str {
    if terrain == "pit" { "cells = [64, 64, 16]\n" } else { "" }
}

/// Whether the front feet may pull, like the suction cups in the paper.
pub(super) fn has_adhesive_feet(terrain: &str) -> bool {
    matches!(terrain, "hilly" | "pit")
}

/// The routes of Section V on a terrain.
pub(super) fn routes(terrain: &str) -> Vec<Route> {
    let radius = 0.5 * HALF_EXTENT;
    let heading = |i: usize, start: fn([f64; 2]) -> [f64; 2]| {
        let theta = TAU * i as f64 / HEADINGS as f64;
        let goal = [radius * theta.sin(), radius * theta.cos()];
        let degrees = theta.to_degrees().round();
        Route { label: format!("{degrees:03}"), heading: Some(degrees), start: start(goal), goal }
    };
    match terrain {
        "rippled" => (0..HEADINGS).map(|i| heading(i, |_| [0.0, 0.0])).collect(),
        "conic" => (0..HEADINGS).map(|i| heading(i, |[x, y]| [-x, -y])).collect(),
        "hilly" => {
            let climb = |(i, &goal): (usize, &[f64; 2])| Route {
                label: format!("goal-{i:02}"),
                heading: None,
                start: HILL_START,
                goal,
            };
            HILL_GOALS.iter().enumerate().map(climb).collect()
        }
        _ => (0..GOALS)
            .map(|i| {
                let angle = TAU * i as f64 / GOALS as f64;
                Route {
                    label: format!("goal-{i:02}"),
                    heading: Some((450.0 - angle.to_degrees()) % 360.0),
                    start: [0.0, 0.0],
                    goal: [PIT_GOAL * angle.cos(), PIT_GOAL * angle.sin()],
                }
            })
            .collect(),
    }
}

/// Every route, or a few evenly spaced ones.
pub(super) fn thinned(routes: Vec<Route>, few: bool) -> Vec<Route> {
    let step = if few { routes.len() / FEW } else { 1 };
    routes.into_iter().step_by(step).collect()
}

/// The parameter that makes a terrain steeper than its hard level, and eight values of it.
pub(super) fn steeper(terrain: &str) -> (&'static str, [f64; 8]) {
    match terrain {
        // Maximum slope k A = 2.6 A.
        "rippled" => ("amplitude", [0.30, 0.35, 0.40, 0.45, 0.50, 0.60, 0.70, 0.80]),
        // The slope of its flank; beyond the friction coefficient, 0.75, feet that do not pull slip.
        "conic" => ("slope", [0.72, 0.74, 0.76, 0.80, 0.85, 0.90, 1.00, 1.20]),
        // Maximum slope H/(w √e) = 1.01 H.
        "hilly" => ("height", [1.75, 2.0, 2.25, 2.5, 2.75, 3.0, 3.5, 4.0]),
        // Maximum slope about D/(2δ) = 5 D.
        _ => ("depth", [1.0, 1.1, 1.2, 1.3, 1.4, 1.5, 1.7, 2.0]),
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn headings_are_counted_as_in_the_paper() {
        let routes = routes("conic");
        assert_eq!(routes[6].label, "090");
        let [x, y] = routes[6].goal;
        assert!((x - 1.5).abs() < 1e-12 && y.abs() < 1e-12);
        assert!((routes[6].start[0] + 1.5).abs() < 1e-12);
        assert!((super::routes("pit")[0].heading.unwrap() - 90.0).abs() < 1e-9);
    }

    #[test]
    fn routes_with_a_name_are_what_they_are_called() {
        assert_eq!(routes("hilly")[HILL_TOP].goal, [0.0, 0.0]);
        assert_eq!(routes("rippled")[RIPPLE_DIAGONAL].heading, Some(45.0));
    }
}
