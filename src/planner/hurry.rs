//! Refuses a start whose velocity or acceleration no forces of the standing feet go with, and one whose feet in the air cannot have left the
//! ground when they are said to, before anything is solved.
//!
//! On ground of slopes up to β, forces within the friction cones add up to one whose horizontal part is at most ν' times its vertical part,
//! ν' = tan(atan ν + β). Newton's law, integrated twice, then bounds how far the base is ahead of a foot that stands, where z is its height
//! over the foot; and it cannot be farther from the foot than r, the farthest corner of its reach box:
//!
//! ```text
//!   x(t) ≥ x(0) + v t − ν' (g t²/2 + z(t) − z(0) − v_z t),   x² + z² ≤ r²,   so that x + ν' z ≤ r √(1 + ν'²)   until the foot lifts off
//! ```
//!
//! A swing leaves its foothold c_0 at rest, as a spline Σ w_k(u) c_k. With the other control points within c of it, p(u) is within
//! (1 − w_0) c of the foothold, and |p'(u)| ≤ c Σ_{k ≠ 0} |w_k'|. So it is before the foot lands, with the next foothold.

use nalgebra::Vector3;

use super::standing::Pose;
use crate::nlp::model::GRAVITY;
use crate::scenario::{LoadedScenario, StartState};
use crate::terrain::Surfaces;
use crate::trajectory::Gait;
use crate::trajectory::spline::{SwingShape, swing_basis};
use crate::{Error, Result};

/// Places along x and y at which the slope of the ground around the start is looked up, on each side.
const SLOPES: i32 = 12;
/// What the check allows of Newton's law, m g.
const NEWTON: f64 = 0.03;
/// What the estimate leaves, m, for a robot of ANYmal's size.
const SLACK: f64 = 0.02;
/// How far control points of a swing are from its footholds at most, in r. The swing itself is within 2 r; to both sides of a short stretch of
/// it they can be farther away, ten times as far at the utmost (the condition of the basis).
const CONTROL_POINTS: f64 = 20.0;

/// Refuses what no forces go with.
///
/// # Errors
/// [`Error::Key`] for the velocity or the acceleration.
pub fn ensure_possible(
    loaded: &LoadedScenario,
    gait: &Gait,
    surfaces: &Surfaces,
    start: &Pose,
) -> Result<()> {
    let scenario = &loaded.scenario;
    let Some(state) = &scenario.start.state else { return Ok(()) };
    let farthest = (0..loaded.robot.feet.len()).map(|e| reach(loaded, e)).fold(0.0, f64::max);
    let slope = slope(surfaces, start, 2.0 * farthest);
    swings(loaded, state, surfaces, slope)?;
    // Pulling feet, forces on the trunk and walls do what friction does not.
    if surfaces.have_edges() || !scenario.force.is_empty() || !scenario.robot.adhesive_feet.is_empty() {
        return Ok(());
    }
    let Some(grip) = grip(loaded, slope) else { return Ok(()) };
    if state.forces.is_none() {
        acceleration(loaded, state, grip)?;
    }
    velocity(loaded, state, gait, start, grip)
}

/// The farthest corner of a reach box from the center of mass, m.
fn reach(loaded: &LoadedScenario, foot: usize) -> f64 {
    let reach = &loaded.robot.feet[foot].reach;
    Vector3::from_fn(|k, _| reach.center[k].abs() + reach.half_size[k]).norm()
}

/// The steepest slope within a distance of the start, m.
fn slope(surfaces: &Surfaces, start: &Pose, distance: f64) -> f64 {
    (-SLOPES..=SLOPES)
        .flat_map(|i| (-SLOPES..=SLOPES).map(move |j| [i, j]))
        .map(|place| {
            let [dx, dy] = place.map(|n| distance * f64::from(n) / f64::from(SLOPES));
            let [hx, hy] = surfaces.feet.gradient(start.position.x + dx, start.position.y + dy);
            hx.hypot(hy)
        })
        .fold(0.0, f64::max)
}

/// ν' on ground of a slope, if it is finite.
fn grip(loaded: &LoadedScenario, slope: f64) -> Option<f64> {
    let contact = &loaded.scenario.contact;
    let angle = (contact.friction * (1.0 - contact.friction_margin)).atan() + slope.atan();
    (angle < std::f64::consts::FRAC_PI_2).then(|| angle.tan())
}

/// Feet in the air are as near to the ground and as slow as they can be for so short a time.
fn swings(loaded: &LoadedScenario, state: &StartState, surfaces: &Surfaces, slope: f64) -> Result<()> {
    for (e, &[x, y, z]) in state.feet.iter().flatten().enumerate() {
        let Some([since, left]) = loaded.scenario.start.swing(e) else { continue };
        let duration = since + left;
        let [weights, rates, _] = swing_basis(SwingShape::Light, since / duration);
        let farthest = CONTROL_POINTS * reach(loaded, e);
        let height = (z - surfaces.feet.height(x, y)) / slope.hypot(1.0);
        let speed = state.feet_velocity.as_ref().map_or(0.0, |feet| Vector3::from(feet[e]).norm());
        let ends = [(since, "has left it at rest", "after"), (left, "lands at rest", "before")];
        for (m, (time, does, when)) in [0, weights.len() - 1].into_iter().zip(ends) {
            let rate: f64 = (0..rates.len()).filter(|k| *k != m).map(|k| rates[k].abs()).sum();
            let most = [farthest * (1.0 - weights[m]), farthest * rate / duration];
            let found = [(height, "feet", "m above the ground"), (speed, "feet_velocity", "m/s")];
            for ((value, key, unit), most) in found.into_iter().zip(most) {
                if value > most {
                    let what = format!(
                        "given {value:.3} {unit} {time} s {when} {foot} {does} ({place}); allowed: at most {most:.2e}, or a longer time",
                        foot = loaded.robot.feet[e].name,
                        place = loaded.place(&format!("start.state.swings[{e}]")),
                    );
                    return Err(loaded.error(&format!("start.state.{key}[{e}]"), what));
                }
            }
        }
    }
    Ok(())
}

fn acceleration(loaded: &LoadedScenario, state: &StartState, grip: f64) -> Result<()> {
    let scenario = &loaded.scenario;
    let standing = (0..loaded.robot.feet.len()).filter(|e| !scenario.in_air(*e)[0]).count();
    let [x, y, z] = state.acceleration.map(|a| a / GRAVITY);
    let (across, up) = (x.hypot(y), z + 1.0);
    let limit = scenario.motion.force_limit;
    let most = standing as f64 * limit * scenario.contact.friction.hypot(1.0);
    let why = if standing == 0 && across.hypot(up) > NEWTON {
        "but all feet are in the air; allowed: free fall, [0, 0, -9.81]".to_owned()
    } else if across > grip * up.max(0.0) + NEWTON || up < -NEWTON {
        format!("which takes a force outside of all friction cones ({})", loaded.place("contact.friction"))
    } else if across.hypot(up) > most + NEWTON {
        format!(
            "which takes {:.1} m g from {standing} feet; allowed: {limit} m g of each ({})",
            across.hypot(up),
            loaded.place("motion.force_limit")
        )
    } else {
        return Ok(());
    };
    Err(Error::key("start.state.acceleration", format!("given {:?} m/s², {why}", state.acceleration)))
}

fn velocity(loaded: &LoadedScenario, state: &StartState, gait: &Gait, start: &Pose, grip: f64) -> Result<()> {
    let scenario = &loaded.scenario;
    let velocity = Vector3::from(state.velocity);
    let speed = velocity.xy().norm();
    if speed == 0.0 {
        return Ok(());
    }
    let ahead = velocity.xy() / speed;
    let slack = SLACK * loaded.robot.size();
    for (e, foot) in loaded.robot.feet.iter().enumerate().filter(|(e, _)| !scenario.in_air(*e)[0]) {
        let lift_off =
            gait.swings[e].first().map_or(gait.intervals as f64, |swing| swing.start + swing.room[0]);
        let until = lift_off * scenario.time_step;
        // x(0) + ν' z(0).
        let from = |place: Vector3<f64>| -(place.xy().dot(&ahead) + grip * place.z);
        let begins = match &state.feet {
            Some(feet) => from(Vector3::from(feet[e]) - start.position),
            None => (0..8)
                .map(|corner| {
                    let side = |k: usize| if corner >> k & 1 == 0 { -1.0 } else { 1.0 };
                    let place =
                        Vector3::from_fn(|k, _| foot.reach.center[k] + side(k) * foot.reach.half_size[k]);
                    from(start.rotation * place)
                })
                .fold(f64::INFINITY, f64::min),
        };
        let r = reach(loaded, e);
        // By how much the base is too far ahead, at a fraction of the velocity.
        let excess = |fraction: f64| {
            let rate = fraction * (speed + grip * velocity.z);
            let t = (rate / (grip * GRAVITY)).clamp(0.0, until);
            begins + rate * t - 0.5 * grip * GRAVITY * t * t - r * grip.hypot(1.0) - slack
        };
        if excess(1.0) <= 0.0 {
            continue;
        }
        let (mut least, mut most) = (0.0, 1.0);
        for _ in 0..30 {
            let middle = 0.5 * (least + most);
            *(if excess(middle) > 0.0 { &mut most } else { &mut least }) = middle;
        }
        let what = format!(
            "given {:?} m/s, so fast that {} is out of its reach before it lifts off at {until:.2} s, whatever the forces ({}); allowed: less than {:.1} m/s in this direction, or a swing that begins earlier",
            state.velocity,
            foot.name,
            loaded.place("contact.friction"),
            least * velocity.norm()
        );
        return Err(Error::key("start.state.velocity", what));
    }
    Ok(())
}
