//! Refuses values that are allowed one by one but do not fit together, with file and line, before anything is computed.
//!
//! The schema has already checked keys, types and ranges. Three kinds of refusal come later: what depends on the content of a
//! terrain file, the timing of the steps (`trajectory::Gait::of`), and a given start (`check::ensure_start`).

use super::condition_checks;
use super::cyclic;
use super::ends;
use super::format::{Formulation, Scenario};
use super::gait_kind::GaitKind;
use super::map::MapMethod;
use super::motion::{Law, Legs};
use super::sagittal;
use super::sequence;
use super::terrain::TerrainSpec;
use super::way;
use crate::Result;
use crate::input::{Document, closest};
use crate::robot::Robot;

/// More time steps than this are taken for a mistake.
const MOST_STEPS: f64 = 20_000.0;
/// Shortest side of a terrain, m.
const LEAST_SIDE: f64 = 0.5;
/// Phase durations may miss the horizon by this, s.
const PHASE_TOLERANCE: f64 = 1e-6;

/// Refuses values that do not fit together. The scenario in a plan is checked without its robot, whose file may be gone.
pub(super) fn check(document: &Document, scenario: &Scenario, robot: Option<&Robot>) -> Result<()> {
    one_robot(document)?;
    way::check(document, scenario)?;
    cyclic::check(document, scenario)?;
    ends::check(document, scenario, robot)?;
    terrain(document, scenario)?;
    if let Some(extent) = scenario.terrain.extent() {
        inside(document, scenario, None, extent)?;
    }
    time_steps(document, scenario)?;
    law(document, scenario)?;
    if let Some(robot) = robot {
        legs(document, scenario, robot)?;
        sagittal::check(document, scenario, robot)?;
    }
    condition_checks::check(document, scenario, robot)?;
    map(document, scenario)?;
    sequence::check(document, &scenario.gait, scenario.horizon)?;
    durations(document, scenario)?;
    phases(document, scenario)?;
    if let Some(robot) = robot {
        linear_solver(document, scenario)?;
        adhesive_feet(document, scenario, robot)?;
        phases_by_foot(document, scenario, robot)?;
    }
    Ok(())
}

/// Refuses a linear solver that this Ipopt cannot use. A plan that was made with it elsewhere may be checked here all the same.
fn linear_solver(document: &Document, scenario: &Scenario) -> Result<()> {
    let chosen = scenario.solver.linear_solver;
    chosen.check().map_err(|e| document.error("solver.linear_solver", format!("given \"{chosen}\": {e}")))
}

fn one_robot(document: &Document) -> Result<()> {
    if document.has("robot.name") && document.has("robot.file") {
        return Err(document.error("robot.file", "given together with robot.name; give one of them"));
    }
    Ok(())
}

fn terrain(document: &Document, scenario: &Scenario) -> Result<()> {
    if let Some([x_min, x_max, y_min, y_max]) = scenario.terrain.extent()
        && !(x_max - x_min >= LEAST_SIDE && y_max - y_min >= LEAST_SIDE)
    {
        let what = format!(
            "given [{x_min}, {x_max}, {y_min}, {y_max}], allowed: [x_min, x_max, y_min, y_max] in m, each max at least {LEAST_SIDE} m above its min"
        );
        return Err(document.error("terrain.extent", what));
    }
    if let TerrainSpec::Heightmap(spec) = &scenario.terrain
        && let Some(what) = spec.spacing.and_then(|spacing| spec.excess_of_smoothing(spacing))
    {
        return Err(document.error("terrain.smoothing", what));
    }
    Ok(())
}

/// Refuses a start, goal or way-point at which the base or, where robot and heading are known, a foot at its nominal place is outside the ground.
pub(super) fn inside(
    document: &Document,
    scenario: &Scenario,
    robot: Option<&Robot>,
    [x_min, x_max, y_min, y_max]: [f64; 4],
) -> Result<()> {
    let rounded = |v: f64| (v * 1e6).round() / 1e6;
    let [left, right, near, far] = [x_min, x_max, y_min, y_max].map(rounded);
    let allowed = format!("allowed: x from {left} to {right}, y from {near} to {far} m");
    let beyond = |[x, y]: [f64; 2]| {
        let along = |v: f64, low: f64, high: f64| (low - v).max(v - high).max(0.0);
        along(x, x_min, x_max).hypot(along(y, y_min, y_max))
    };
    let extent = match &scenario.terrain {
        TerrainSpec::Heightmap(_) if !document.has("terrain.extent") => String::new(),
        _ => format!(" ({})", document.place("terrain.extent")),
    };
    let yaw = scenario.start_yaw();
    // Where the heading is known. A robot that follows a line arrives with another one.
    let goal_yaw = scenario.goal_yaw().or(scenario.stops().is_empty().then_some(yaw));
    let waypoints = scenario.goal.waypoints.iter().enumerate();
    let waypoints = waypoints.map(|(n, w)| (format!("goal.waypoints[{n}].position"), w.position, w.yaw));
    let circle = scenario.goal.circle.iter().flat_map(|_| scenario.stops());
    let circle = circle.map(|stop| ("goal.circle".to_owned(), stop.position, None));
    for (key, place, yaw) in [
        ("start.position".to_owned(), scenario.start.position, Some(yaw)),
        ("goal.position".to_owned(), scenario.goal.position, goal_yaw),
    ]
    .into_iter()
    .chain(waypoints)
    .chain(circle)
    {
        let [x, y] = place;
        let given = if key == "goal.circle" {
            format!("it leads over [{x:.2}, {y:.2}]")
        } else {
            format!("given [{x}, {y}]")
        };
        if beyond(place) > 0.0 {
            return Err(document.error(&key, format!("{given}, outside the terrain{extent}; {allowed}")));
        }
        let Some(yaw) = yaw else { continue };
        for foot in robot.iter().flat_map(|robot| &robot.feet) {
            let ([u, v, _], (sin, cos)) = (foot.nominal, yaw.sin_cos());
            let outside = beyond([x + cos * u - sin * v, y + sin * u + cos * v]);
            if outside > 0.0 {
                let what = format!(
                    "{given}, where foot {} would stand {outside:.3} m outside the terrain{extent}; for feet {allowed}",
                    foot.name
                );
                return Err(document.error(&key, what));
            }
        }
    }
    Ok(())
}

fn time_steps(document: &Document, scenario: &Scenario) -> Result<()> {
    let steps = scenario.horizon / scenario.time_step;
    if !(4.0..=MOST_STEPS).contains(&steps) {
        let what = format!(
            "given {}, which divides the horizon of {} s into {steps:.1} steps; allowed: 4 to {MOST_STEPS} steps",
            scenario.time_step, scenario.horizon
        );
        return Err(document.error("time_step", what));
    }
    Ok(())
}

fn legs(document: &Document, scenario: &Scenario, robot: &Robot) -> Result<()> {
    if scenario.physics.legs == Some(Legs::Massive) && robot.body().is_none() {
        let what = format!(
            "given \"massive\", but the file of robot {} has no links with masses ([[feet.leg.joints]] of every foot); use \"massless\" or leave it out",
            robot.name
        );
        return Err(document.error("physics.legs", what));
    }
    Ok(())
}

fn law(document: &Document, scenario: &Scenario) -> Result<()> {
    if scenario.physics.law == Law::NewtonEuler && scenario.formulation() == Formulation::Warped {
        let what = "given \"newton-euler\", which needs the orientation's second derivative in time; the map of formulation = \"warped\" is not smooth enough for it (third derivatives of its cubic splines jump from cell to cell); use law = \"pcdm\" (the default) or formulation = \"direct\" or \"hybrid\"";
        return Err(document.error("physics.law", what));
    }
    Ok(())
}

fn map(document: &Document, scenario: &Scenario) -> Result<()> {
    let used = matches!(scenario.map.method, MapMethod::AcapLocalGlobal | MapMethod::AcapNewton);
    if document.has("map.scale") && !used {
        let what = "only allowed with map.method = \"acap-local-global\" or \"acap-newton\"; remove it";
        return Err(document.error("map.scale", what));
    }
    Ok(())
}

fn durations(document: &Document, scenario: &Scenario) -> Result<()> {
    let gait = &scenario.gait;
    let [least, most] = gait.duration_bounds;
    if least >= most {
        let what = format!("given [{least}, {most}], allowed: [shortest, longest] in s, the first smaller");
        return Err(document.error("gait.duration_bounds", what));
    }
    let stands = gait.sections().iter().all(|section| section.kind == GaitKind::Stand);
    if gait.optimize_durations && stands {
        let what = "given true, but kind = \"stand\" has no steps whose durations could be optimized; set it to false";
        return Err(document.error("gait.optimize_durations", what));
    }
    if gait.optimize_durations && scenario.discretization.force_knots > 1 {
        let what = "given true, but discretization.force_knots is not 1; optimized durations change the forces sample by sample, so set force_knots to 1 or this to false";
        return Err(document.error("gait.optimize_durations", what));
    }
    Ok(())
}

fn phases(document: &Document, scenario: &Scenario) -> Result<()> {
    let Some(rows) = &scenario.gait.phases else {
        if scenario.gait.kind == GaitKind::Custom {
            let what = "missing; kind = \"custom\" needs a row of stance and swing durations for each foot, stance first";
            return Err(document.error("gait.phases", what));
        }
        return Ok(());
    };
    if scenario.gait.kind != GaitKind::Custom {
        let place = document.place("gait.kind");
        let what = format!("only allowed with kind = \"custom\", but {place} is \"{}\"", scenario.gait.kind);
        return Err(document.error("gait.phases", what));
    }
    for (foot, row) in rows.iter().enumerate() {
        let sum: f64 = row.iter().sum();
        if (sum - scenario.horizon).abs() > PHASE_TOLERANCE {
            let what = format!(
                "the durations sum to {sum} s, expected the horizon, {} s ({})",
                scenario.horizon,
                document.place("horizon")
            );
            return Err(document.error(&format!("gait.phases[{foot}]"), what));
        }
    }
    Ok(())
}

fn adhesive_feet(document: &Document, scenario: &Scenario, robot: &Robot) -> Result<()> {
    let names = robot.foot_names();
    let given = &scenario.robot.adhesive_feet;
    for (i, foot) in given.iter().enumerate() {
        let what = match () {
            () if !names.contains(&foot.as_str()) => format!("not a foot of {}", robot.name),
            () if given[..i].contains(foot) => "given twice".into(),
            () => continue,
        };
        let guess = match closest(foot, &names) {
            Some(name) if name != foot => format!("; did you mean \"{name}\"?"),
            _ => String::new(),
        };
        let what = format!("\"{foot}\" is {what}; its feet: {}{guess}", names.join(", "));
        return Err(document.error(&format!("robot.adhesive_feet[{i}]"), what));
    }
    Ok(())
}

fn phases_by_foot(document: &Document, scenario: &Scenario, robot: &Robot) -> Result<()> {
    match &scenario.gait.phases {
        Some(rows) if rows.len() != robot.feet.len() => {
            let names = robot.foot_names().join(", ");
            let what = format!("given {} rows, allowed: one for each foot: {names}", rows.len());
            Err(document.error("gait.phases", what))
        }
        _ => Ok(()),
    }
}
