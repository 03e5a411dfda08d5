//! Refuses a start whose velocity or acceleration no forces of the standing feet go with, before anything is solved.
//!
//! On ground of slopes up to β, forces within the friction cones add up to one whose horizontal part is at most ν' times its vertical part,
//! ν' = tan(atan ν + β). While a foot stands, the base cannot be farther from it than r, the farthest corner of its reach box, so that it
//! rises by at most r − h from a height h over it. Newton's law, integrated twice, then bounds how far the base is ahead of the foot:
//!
//! ```text
//!   x(t) ≥ x(0) + v t − ν' (g t²/2 + r − h − v_z t),   x(t) ≤ r   until the foot lifts off
//! ```

use nalgebra::Vector3;

use super::standing::Pose;
use crate::nlp::model::GRAVITY;
use crate::scenario::{LoadedScenario, StartState};
use crate::terrain::Surfaces;
use crate::trajectory::Gait;
use crate::{Error, Result};

/// Places along x and y at which the slope of the ground around the start is looked up, on each side.
const SLOPES: i32 = 12;
/// What the check allows of Newton's law, m g.
const NEWTON: f64 = 0.03;
/// What the estimate leaves, m, for a robot of ANYmal's size.
const SLACK: f64 = 0.02;

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
    // Pulling feet, forces on the trunk and walls do what friction does not.
    if surfaces.have_edges() || !scenario.force.is_empty() || !scenario.robot.adhesive_feet.is_empty() {
        return Ok(());
    }
    let farthest = (0..loaded.robot.feet.len()).map(|e| reach(loaded, e)).fold(0.0, f64::max);
    let Some(grip) = grip(loaded, surfaces, start, 2.0 * farthest) else { return Ok(()) };
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

/// ν' within a distance of the start, if it is finite.
fn grip(loaded: &LoadedScenario, surfaces: &Surfaces, start: &Pose, distance: f64) -> Option<f64> {
    let contact = &loaded.scenario.contact;
    let slope = (-SLOPES..=SLOPES)
        .flat_map(|i| (-SLOPES..=SLOPES).map(move |j| [i, j]))
        .map(|place| {
            let [dx, dy] = place.map(|n| distance * f64::from(n) / f64::from(SLOPES));
            let [hx, hy] = surfaces.feet.gradient(start.position.x + dx, start.position.y + dy);
            hx.hypot(hy)
        })
        .fold(0.0, f64::max);
    let angle = (contact.friction * (1.0 - contact.friction_margin)).atan() + slope.atan();
    (angle < std::f64::consts::FRAC_PI_2).then(|| angle.tan())
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
        // x(0) + ν' h.
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
            begins + rate * t - grip * (0.5 * GRAVITY * t * t + r) - r - slack
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
