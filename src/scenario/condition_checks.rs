//! Refuses conditions that contradict themselves, the robot or the way.

use super::format::Scenario;
use crate::Result;
use crate::input::{Document, closest};
use crate::robot::{Foot, Robot};

/// Refuses ranges of the posture, forces and footholds that no motion can have.
pub(super) fn check(document: &Document, scenario: &Scenario, robot: Option<&Robot>) -> Result<()> {
    posture(document, scenario)?;
    if let Some(robot) = robot {
        heights(document, scenario, robot)?;
        feet(document, scenario, robot)?;
    }
    forces(document, scenario)?;
    footholds(document, scenario)?;
    keep_out(document, scenario)?;
    robot.map_or(Ok(()), |robot| kept_free(document, scenario, robot))
}

fn posture(document: &Document, scenario: &Scenario) -> Result<()> {
    let spec = &scenario.posture;
    for (key, range) in [("height", spec.height), ("roll", spec.roll), ("pitch", spec.pitch)] {
        if let Some([least, greatest]) = range.filter(|[least, greatest]| least >= greatest) {
            let what = format!("given [{least}, {greatest}], allowed: [least, greatest], the first smaller");
            return Err(document.error(&format!("posture.{key}"), what));
        }
    }
    Ok(())
}

/// The keys that give heights over the feet, with the least and the greatest.
fn given_heights(scenario: &Scenario) -> Vec<(String, [f64; 2])> {
    let goal = scenario.goal.height.map(|height| ("goal.height".to_owned(), [height; 2]));
    let waypoints = scenario.goal.waypoints.iter().enumerate();
    let waypoints =
        waypoints.filter_map(|(n, w)| Some((format!("goal.waypoints[{n}].height"), [w.height?; 2])));
    goal.into_iter().chain(waypoints).collect()
}

/// Heights must be within the limits of the posture, and within what the legs reach on level ground.
fn heights(document: &Document, scenario: &Scenario, robot: &Robot) -> Result<()> {
    let given = given_heights(scenario);
    if let Some([least, greatest]) = scenario.posture.height {
        for (key, [height, _]) in &given {
            if !(least..=greatest).contains(height) {
                let place = document.place("posture.height");
                let what = format!("given {height} m, outside [{least}, {greatest}] ({place})");
                return Err(document.error(key, what));
            }
        }
    }
    let mean = robot.standing_height();
    // On level ground, every foot is as far below the center of mass as the height says; stances of unequal legs differ a little.
    let reach = |sign: f64| {
        robot.feet.iter().map(move |foot| {
            let deepest = foot.nominal[2] + mean;
            deepest - foot.reach.center[2] + sign * foot.reach.half_size[2]
        })
    };
    let [low, high] = [reach(-1.0).fold(0.0, f64::max), reach(1.0).fold(f64::INFINITY, f64::min)];
    let posture = scenario.posture.height.map(|range| ("posture.height".to_owned(), range));
    for (key, [least, greatest]) in posture.into_iter().chain(given) {
        if greatest < low || least > high {
            let words = if least == greatest { format!("{least}") } else { format!("[{least}, {greatest}]") };
            let what = format!(
                "given {words} m, which excludes every stance of {}: its legs carry the center of mass {low:.3} to {high:.3} m above the feet (it stands at {mean:.3} m)",
                robot.name
            );
            return Err(document.error(&key, what));
        }
    }
    Ok(())
}

fn forces(document: &Document, scenario: &Scenario) -> Result<()> {
    for (n, force) in scenario.force.iter().enumerate() {
        if force.until <= force.from {
            let place = document.place(&format!("force[{n}].from"));
            let what = format!("given {} s, allowed: after {} s ({place})", force.until, force.from);
            return Err(document.error(&format!("force[{n}].until"), what));
        }
        if force.from >= scenario.horizon {
            let place = document.place("horizon");
            let what = format!(
                "given {} s, allowed: before the end at {} s ({place})",
                force.from, scenario.horizon
            );
            return Err(document.error(&format!("force[{n}].from"), what));
        }
    }
    Ok(())
}

/// The feet of footholds are the robot's.
fn feet(document: &Document, scenario: &Scenario, robot: &Robot) -> Result<()> {
    let names = robot.foot_names();
    for (n, spec) in scenario.foothold.iter().enumerate() {
        if !names.contains(&spec.foot.as_str()) {
            let guess = closest(&spec.foot, &names)
                .map_or(String::new(), |name| format!("did you mean \"{name}\"? "));
            let what = format!(
                "given \"{}\"; {guess}allowed: the feet of {}: {}",
                spec.foot,
                robot.name,
                names.join(", ")
            );
            return Err(document.error(&format!("foothold[{n}].foot"), what));
        }
    }
    Ok(())
}

/// The key of a place that is kept free.
fn keep_out_key(scenario: &Scenario, n: usize) -> String {
    format!("keep_out[{n}].{}", scenario.keep_out[n].key())
}

/// Places along each side of a reach box at which a foot may stand.
const BOX_SAMPLES: i32 = 8;

/// Headings that are tried where none is given.
const HEADINGS: usize = 16;

/// Every foot has a place to stand outside of the polygons: at the start, at way-points and at the goal, with some heading where none is given.
fn kept_free<'r>(document: &Document, scenario: &Scenario, robot: &'r Robot) -> Result<()> {
    let radius = robot.foot_radius();
    let within = |place: [f64; 2]| scenario.keep_out.iter().position(|spec| spec.distance(place) < radius);
    for (e, [x, y, _]) in
        scenario.start.state.iter().flat_map(|state| state.feet.iter().flatten()).enumerate()
    {
        let stands = !scenario.in_air(e)[0];
        if let Some(n) = within([*x, *y]).filter(|_| stands) {
            let polygon = document.place(&keep_out_key(scenario, n));
            let what = format!("given [{x}, {y}], which is kept free of feet ({polygon})");
            return Err(document.error(&format!("start.state.feet[{e}]"), what));
        }
    }
    let goal_yaw = scenario.goal_yaw().or(scenario.stops().is_empty().then(|| scenario.start_yaw()));
    let all = robot.feet.len();
    let mut places = vec![
        ("start.position".to_owned(), scenario.start.position, Some(scenario.start_yaw()), 0.0, all),
        ("goal.position".to_owned(), scenario.goal.position, goal_yaw, 0.0, all),
    ];
    // Half of the feet may be in the air on the way.
    places.extend(scenario.goal.waypoints.iter().enumerate().map(|(n, waypoint)| {
        let beside = if waypoint.time.is_some() { 0.0 } else { scenario.goal.waypoint_distance };
        (format!("goal.waypoints[{n}].position"), waypoint.position, waypoint.yaw, beside, all.div_ceil(2))
    }));
    for (key, [x, y], yaw, beside, standing) in places {
        // The base may pass this far beside the place, and its feet as much.
        let within = |place: [f64; 2]| {
            scenario.keep_out.iter().position(|spec| spec.distance(place) < radius - beside)
        };
        let samples = || -BOX_SAMPLES..=BOX_SAMPLES;
        // What is in the way of a foot that finds no place.
        let blocked = |foot: &Foot, heading: f64| {
            let (sin, cos) = heading.sin_cos();
            let along = |c: usize, n: i32| {
                foot.reach.center[c] + foot.reach.half_size[c] * f64::from(n) / f64::from(BOX_SAMPLES)
            };
            let places = samples().flat_map(|i| samples().map(move |j| (i, j))).map(|(i, j)| {
                let (u, v) = (along(0, i), along(1, j));
                [x + cos * u - sin * v, y + sin * u + cos * v]
            });
            let polygons: Option<Vec<usize>> = places.map(within).collect();
            polygons?.first().copied()
        };
        // The first of the feet that find no place, if too few find one.
        let too_few = |heading: f64| {
            let blocked = |foot: &'r Foot| Some((foot, blocked(foot, heading)?));
            let blocked: Vec<_> = robot.feet.iter().filter_map(blocked).collect();
            blocked.first().copied().filter(|_| all - blocked.len() < standing)
        };
        let any = (0..HEADINGS).map(|n| n as f64 / HEADINGS as f64 * std::f64::consts::TAU);
        let headings: Vec<f64> = yaw.map_or_else(|| any.collect(), |yaw| vec![yaw]);
        let refused: Option<Vec<_>> = headings.into_iter().map(too_few).collect();
        if let Some((foot, n)) = refused.and_then(|refused| refused.first().copied()) {
            let polygon = document.place(&keep_out_key(scenario, n));
            let what = format!(
                "given [{x}, {y}], where foot {} finds no place to stand: all that it reaches is kept free of feet ({polygon})",
                foot.name
            );
            return Err(document.error(&key, what));
        }
    }
    Ok(())
}

/// Polygons have an area, and what must be stepped on is not inside of them.
fn keep_out(document: &Document, scenario: &Scenario) -> Result<()> {
    for (n, spec) in scenario.keep_out.iter().enumerate() {
        let key = keep_out_key(scenario, n);
        if spec.loops().next().is_none() {
            let what = "gives neither a polygon nor a mask with something in it; give one of them";
            return Err(document.error(&format!("keep_out[{n}]"), what));
        }
        if spec.doubled_area() < 1e-6 {
            let what =
                "its corners are on a line, or its parts cancel; allowed: corners in order around an area";
            return Err(document.error(&key, what));
        }
        let footholds = scenario.foothold.iter().enumerate();
        if let Some((m, fixed)) = footholds.clone().find(|(_, fixed)| spec.distance(fixed.position) < 0.0) {
            let [x, y] = fixed.position;
            let what = format!("given [{x}, {y}], which is kept free of feet ({})", document.place(&key));
            return Err(document.error(&format!("foothold[{m}].position"), what));
        }
    }
    Ok(())
}

fn footholds(document: &Document, scenario: &Scenario) -> Result<()> {
    for (n, spec) in scenario.foothold.iter().enumerate() {
        let key = |last: &str| format!("foothold[{n}].{last}");
        if spec.step.is_some() == spec.time.is_some() {
            let what = "give the number of a step or a time, and not both";
            return Err(document.error(&key(if spec.step.is_some() { "time" } else { "step" }), what));
        }
        if let Some(time) = spec.time.filter(|time| *time > scenario.horizon) {
            let place = document.place("horizon");
            let what =
                format!("given {time} s, allowed: at most the horizon of {} s ({place})", scenario.horizon);
            return Err(document.error(&key("time"), what));
        }
        if let Some([x_min, x_max, y_min, y_max]) = scenario.terrain.extent() {
            let [x, y] = spec.position;
            if !((x_min..=x_max).contains(&x) && (y_min..=y_max).contains(&y)) {
                let place = document.place("terrain.extent");
                let what = format!(
                    "given [{x}, {y}], outside the terrain ({place}); allowed: x from {x_min} to {x_max}, y from {y_min} to {y_max} m"
                );
                return Err(document.error(&key("position"), what));
            }
        }
        let same = |other: &&super::FootholdSpec| {
            other.foot == spec.foot && other.step.is_some() && other.step == spec.step
        };
        if let Some(m) = scenario.foothold[..n].iter().position(|other| same(&other)) {
            let place = document.place(&format!("foothold[{m}].step"));
            let what = format!(
                "given {} for {}, which already has a place ({place})",
                spec.step.unwrap_or(0),
                spec.foot
            );
            return Err(document.error(&key("step"), what));
        }
    }
    Ok(())
}
