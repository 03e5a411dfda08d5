//! The given state at the start, from the scenario's `[start.state]`, in the variables.

use nalgebra::{Matrix3, Vector3};

use super::standing::{Pose, allowed, pulled_back, standing_pose};
use crate::nlp::model::GRAVITY;
use crate::nlp::{Model, Start};
use crate::scenario::{Scenario, StartState};
use crate::terrain::Surfaces;
use crate::trajectory::rotation::{euler, euler_angles};
use crate::trajectory::space::Space;
use crate::warp::Order;
use crate::{Error, Result};

/// The pose at the start: a standing one, but for what is given.
pub fn pose(scenario: &Scenario, standing: Pose) -> Pose {
    let mut pose = standing;
    let Some(state) = &scenario.start.state else { return pose };
    if let Some(height) = state.height {
        pose.position.z = height;
    }
    if let Some([roll, pitch]) = state.tilt {
        pose.rotation = euler(&Vector3::new(roll, pitch, scenario.start_yaw())).rotation;
    }
    pose
}

/// The same where there is no model yet: at rest at the nominal places of the feet, base frame, m, for a robot of a size.
pub fn given_pose(scenario: &Scenario, nominal: &[Vector3<f64>], size: f64, surfaces: &Surfaces) -> Pose {
    let (place, yaw) = (scenario.start.position, scenario.start_yaw());
    let standing = standing_pose(nominal, &surfaces.posture, place, yaw);
    pose(scenario, allowed(standing, nominal, size, &scenario.posture, None))
}

/// Gives a model the state at the start and the velocity at the end, where the scenario has them.
///
/// # Errors
/// Where a pose or a foothold has no preimage under the map.
pub fn set(scenario: &Scenario, model: &mut Model) -> Result<()> {
    model.start = start(scenario, model)?;
    model.goal_velocity = scenario.goal.velocity.map(|[x, y]| {
        // Along the ground.
        let [at_x, at_y] = scenario.goal.position;
        let [slope_x, slope_y] = model.surfaces.posture.jet(at_x, at_y).d1;
        Vector3::new(x, y, slope_x * x + slope_y * y)
    });
    Ok(())
}

/// The state at the start; none where the scenario gives none.
///
/// # Errors
/// Where a pose or a foothold has no preimage under the map.
fn start(scenario: &Scenario, model: &Model) -> Result<Option<Start>> {
    let Some(state) = &scenario.start.state else { return Ok(None) };
    let pose = given_pose(scenario, &model.nominal, model.size, &model.surfaces);
    let mut base = [pulled_back(&model.spaces.base, &pose)?, [0.0; 6], [0.0; 6]];
    if scenario.start.moves() {
        let [first, second] = euler_rates(&pose, state);
        for c in 0..3 {
            (base[1][c], base[2][c]) = (state.velocity[c], state.acceleration[c]);
            (base[1][3 + c], base[2][3 + c]) = (first[c], second[c]);
        }
    }
    let unit = model.mass * GRAVITY;
    let places = state.feet.as_ref().map(|feet| -> Result<Vec<Vector3<f64>>> {
        feet.iter()
            .enumerate()
            .map(|(i, foot)| match &model.spaces.feet {
                Space::Direct => Ok(Vector3::from(*foot)),
                Space::Warped(map) => map.inverse(*foot).map(Vector3::from).map_err(|e| {
                    Error::key(format!("start.state.feet[{i}]"), format!("given {foot:?}: {e}"))
                }),
            })
            .collect()
    });
    let footholds = places.transpose()?;
    let back = |place: &Vector3<f64>, vector: &[f64; 3]| {
        let jacobian = model.spaces.feet.jet(place, Order::First).jacobian;
        jacobian.try_inverse().unwrap_or_else(Matrix3::identity) * Vector3::from(*vector)
    };
    let of_feet = |vectors: &Option<Vec<[f64; 3]>>, scale: f64| -> Option<Vec<Vector3<f64>>> {
        let (vectors, places) = (vectors.as_ref()?, footholds.as_ref()?);
        Some(vectors.iter().zip(places).map(|(vector, place)| back(place, vector) * scale).collect())
    };
    let (forces, feet_velocity) = (of_feet(&state.forces, unit.recip()), of_feet(&state.feet_velocity, 1.0));
    Ok(Some(Start { base, rates: rates(model, &pose, state), footholds, feet_velocity, forces }))
}

/// The first and second derivatives of roll, pitch and yaw: ω = Σ w_d θ̇_d, ω̇ = Σ w_d θ̈_d + Σ ∂_e w_d θ̇_e θ̇_d.
fn euler_rates(pose: &Pose, state: &StartState) -> [Vector3<f64>; 2] {
    let jet = euler(&euler_angles(&pose.rotation));
    let inverse = Matrix3::from_columns(&jet.first).try_inverse().unwrap_or_else(Matrix3::zeros);
    let first = inverse * Vector3::from(state.angular_velocity);
    let mut rest = Vector3::from(state.angular_acceleration);
    for d in 0..3 {
        for e in 0..3 {
            rest -= jet.second[e][d] * (first[e] * first[d]);
        }
    }
    [first, inverse * rest]
}

/// m p̈ and L̇ = I ω̇ + ω × I ω.
fn rates(model: &Model, pose: &Pose, state: &StartState) -> [Vector3<f64>; 2] {
    let s = model.second_moment;
    let inertia = pose.rotation * (Matrix3::identity() * s.trace() - s) * pose.rotation.transpose();
    let [omega, change] = [state.angular_velocity, state.angular_acceleration].map(Vector3::from);
    let spin = inertia * change + omega.cross(&(inertia * omega));
    [Vector3::from(state.acceleration) / GRAVITY, spin / (model.mass * GRAVITY)]
}
