//! The state at the start that a scenario gives, by the laws that it decides alone: what fails them would fail after any solve.

use super::laws::{self, CheckLimits, CheckedLaw};
use super::vector::{Turn, add, apply, cross, dot, norm, product, scale, sub, transposed};
use crate::heightfield::Heightfield;
use crate::plan::MetaRobot;
use crate::scenario::{Footholds, Legs, LoadedScenario, StartState};
use crate::{Error, Result};

/// Lever arm by which torques are compared with the weight, m.
const LEVER: f64 = 0.3;
/// How far the center of mass is from its nominal place in the trunk at most, because of legs with mass, in standing heights.
const SHIFT: f64 = 0.05;

/// Refuses a state that fails a law at the start, with the key that contradicts the others.
///
/// `ground` is what feet stand on; the base is at `place`, m, turned by `turn`, both in the world frame.
///
/// # Errors
/// An input error at the key.
pub fn ensure_start(
    loaded: &LoadedScenario,
    ground: &Heightfield,
    place: [f64; 3],
    turn: [[f64; 3]; 3],
) -> Result<()> {
    let Some(state) = &loaded.scenario.start.state else { return Ok(()) };
    let start = Start { loaded, state, ground, place, turn, robot: MetaRobot::of(loaded) };
    start.tilt()?;
    start.feet()?;
    start.torso()?;
    start.forces()?;
    start.laws_of_motion()
}

struct Start<'a> {
    loaded: &'a LoadedScenario,
    state: &'a StartState,
    ground: &'a Heightfield,
    place: [f64; 3],
    turn: Turn,
    robot: MetaRobot,
}

impl Start<'_> {
    fn exceeds(&self, law: &CheckedLaw, value: f64) -> bool {
        CheckLimits::default().of(law, &self.robot).is_some_and(|limit| value > limit)
    }

    fn error(&self, key: &str, what: String) -> Error {
        self.loaded.error(&format!("start.state.{key}"), what)
    }

    fn where_set(&self, key: &str) -> String {
        self.loaded.place(key)
    }

    fn stands(&self, foot: usize) -> bool {
        !self.loaded.scenario.in_air(foot)[0]
    }

    /// Where it is set whether feet are in the air.
    fn swings(&self) -> String {
        let by_phases = self.state.swings.is_none() && self.loaded.scenario.gait.phases.is_some();
        let key = if by_phases { "gait.phases" } else { "start.state.swings" };
        self.where_set(key)
    }

    fn weight(&self) -> f64 {
        self.robot.mass * norm(self.robot.gravity)
    }

    /// What a law may miss because the legs have mass, mm.
    fn shift(&self) -> f64 {
        match self.loaded.scenario.legs() {
            Legs::Massive => 1e3 * SHIFT * self.loaded.robot.standing_height(),
            Legs::Massless => 0.0,
        }
    }

    fn tilt(&self) -> Result<()> {
        let posture = &self.loaded.scenario.posture;
        let Some([roll, pitch]) = self.state.tilt else { return Ok(()) };
        for (angle, range, name) in [(roll, posture.roll, "roll"), (pitch, posture.pitch, "pitch")] {
            let Some([least, most]) = range else { continue };
            if self.exceeds(laws::POSTURE_TILT, (least - angle).max(angle - most)) {
                let place = self.where_set(&format!("posture.{name}"));
                let what = format!("given a {name} of {angle} rad, outside [{least}, {most}] ({place})");
                return Err(self.error("tilt", what));
            }
        }
        Ok(())
    }

    fn feet(&self) -> Result<()> {
        for (e, &foot) in self.state.feet.iter().flatten().enumerate() {
            self.on_ground(e, foot)?;
            self.within_reach(e, foot)?;
            let velocity = self.state.feet_velocity.as_ref().map_or([0.0; 3], |velocities| velocities[e]);
            if self.stands(e) && self.exceeds(laws::STANCE_MOTION, norm(velocity)) {
                let what = format!(
                    "given {velocity:?} m/s for {}, which stands ({}); allowed: 0 for feet that stand, or a swing",
                    self.name(e),
                    self.swings()
                );
                return Err(self.error(&format!("feet_velocity[{e}]"), what));
            }
        }
        let Some(feet) = &self.state.feet else { return Ok(()) };
        let stand: Vec<f64> = (0..feet.len()).filter(|e| self.stands(*e)).map(|e| feet[e][2]).collect();
        if let Some([least, most]) = self.loaded.scenario.posture.height
            && stand.len() == feet.len()
        {
            let height = self.place[2] - stand.iter().sum::<f64>() / stand.len() as f64;
            if self.exceeds(laws::POSTURE_HEIGHT, 1e3 * (least - height).max(height - most)) {
                let place = self.where_set("posture.height");
                let what = format!(
                    "the base is {height:.3} m over the mean of the feet, outside [{least}, {most}] ({place})"
                );
                return Err(self.error("height", what));
            }
        }
        Ok(())
    }

    fn name(&self, foot: usize) -> &str {
        &self.loaded.robot.feet[foot].name
    }

    /// A foot that stands is on the ground, and one in the air is not in it.
    fn on_ground(&self, e: usize, foot: [f64; 3]) -> Result<()> {
        let key = format!("feet[{e}]");
        let [x, y, z] = foot;
        let shown = shown(foot);
        let [x_min, x_max, y_min, y_max] = self.ground.extent();
        let outside = (x_min - x).max(x - x_max).max(y_min - y).max(y - y_max);
        if self.stands(e) && self.exceeds(laws::INSIDE, 1e3 * outside) {
            let what = format!(
                "given {shown} for {}, outside the terrain; allowed: x from {x_min} to {x_max}, y from {y_min} to {y_max} m",
                self.name(e)
            );
            return Err(self.error(&key, what));
        }
        let over = 1e3 * (z - self.ground.height(x, y));
        let side = if over > 0.0 { "above" } else { "below" };
        if self.stands(e) && self.exceeds(laws::STANCE_GAP, over.abs()) {
            let remedy = if self.loaded.goes_on() {
                "plan on the same ground as that plan".to_owned()
            } else {
                format!(
                    "put it on the ground, at z = {:.4}, or in the air (start.state.swings)",
                    z - 1e-3 * over
                )
            };
            let what = format!(
                "given {shown}, where {} would stand {:.0} mm {side} the ground; {remedy}",
                self.name(e),
                over.abs()
            );
            return Err(self.error(&key, what));
        }
        if !self.stands(e) && self.exceeds(laws::SWING_PENETRATION, -over) {
            let what = format!(
                "given {shown}, where {}, which is in the air ({}), would be {:.1} mm below the ground",
                self.name(e),
                self.swings(),
                -over
            );
            return Err(self.error(&key, what));
        }
        Ok(())
    }

    fn within_reach(&self, e: usize, foot: [f64; 3]) -> Result<()> {
        let limits = &self.robot.reach[e];
        let back = transposed(&self.turn);
        let mut body = apply(&back, sub(foot, self.place));
        if let Some(Some(radius)) = self.robot.sagittal.get(e).filter(|_| self.stands(e)) {
            body[1] += radius * apply(&back, self.ground.normal(foot[0], foot[1]))[1];
        }
        let beyond =
            std::array::from_fn(|k| ((body[k] - limits.center[k]).abs() - limits.half_size[k]).max(0.0));
        let distance = 1e3 * norm(beyond);
        if !self.exceeds(laws::REACH, distance - self.shift()) {
            return Ok(());
        }
        let what = format!(
            "given {}, {distance:.0} mm outside the reach box of {}, as the base is at {} ({}; {})",
            shown(foot),
            self.name(e),
            shown(self.place),
            self.where_set("start.position"),
            self.where_set("start.state.height")
        );
        Err(self.error(&format!("feet[{e}]"), what))
    }

    /// The torso's corners keep their distance from the ground.
    fn torso(&self) -> Result<()> {
        let scenario = &self.loaded.scenario;
        let (Some(height), Footholds::Anywhere) = (self.state.height, scenario.footholds()) else {
            return Ok(());
        };
        let torso = &self.robot.torso;
        let wanted = scenario.motion.base_clearance;
        for [u, v] in [[-1.0, -1.0], [-1.0, 1.0], [1.0, -1.0], [1.0, 1.0]] {
            let corner = [u, v, -1.0];
            let corner = std::array::from_fn(|k| torso.center[k] + corner[k] * torso.half_size[k]);
            let [x, y, z] = add(self.place, apply(&self.turn, corner));
            let clearance = z - self.ground.height(x, y);
            if self.exceeds(laws::BASE_CLEARANCE, 1e3 * (wanted - clearance) - self.shift()) {
                let what = format!(
                    "given {height} m, where the torso's underside is {clearance:.3} m above the ground; allowed: at least {wanted} m ({})",
                    self.where_set("motion.base_clearance")
                );
                return Err(self.error("height", what));
            }
        }
        Ok(())
    }

    /// Forces on standing feet alone, within their cones and limits.
    fn forces(&self) -> Result<()> {
        let scenario = &self.loaded.scenario;
        let (motion, contact) = (&scenario.motion, &scenario.contact);
        let coefficient = (1.0 - contact.friction_margin) * contact.friction;
        let percent = 100.0 / self.weight();
        let feet = self.state.feet.iter().flatten();
        for (e, (&force, &[x, y, _])) in self.state.forces.iter().flatten().zip(feet).enumerate() {
            let name = self.name(e);
            let refuse = |why: String| {
                let what = format!("given {} N for {name}, {why}", shown(force));
                Err(self.error(&format!("forces[{e}]"), what))
            };
            if !self.stands(e) {
                if self.exceeds(laws::SWING_FORCE, percent * norm(force)) {
                    return refuse(format!("which is in the air ({})", self.swings()));
                }
                continue;
            }
            let normal = self.ground.normal(x, y);
            let along = dot(force, normal);
            let across = norm(sub(force, scale(along, normal)));
            if self.exceeds(laws::FORCE_LIMIT, percent * along - 100.0 * motion.force_limit) {
                let place = self.where_set("motion.force_limit");
                return refuse(format!(
                    "{:.2} m g along the normal; allowed: {} ({place})",
                    0.01 * percent * along,
                    motion.force_limit
                ));
            }
            let adhesive = scenario.robot.adhesive_feet.iter().any(|foot| foot == name);
            let pull = if adhesive { motion.pull_limit } else { 0.0 };
            let law = if adhesive { laws::PULL_LIMIT } else { laws::PULL };
            if self.exceeds(law, -percent * along - 100.0 * pull) {
                let what = if adhesive {
                    format!(
                        "{:.2} m g of pull; allowed: {pull} ({})",
                        -0.01 * percent * along,
                        self.where_set("motion.pull_limit")
                    )
                } else {
                    "which pulls on the ground; allowed for feet of robot.adhesive_feet".to_owned()
                };
                return refuse(what);
            }
            let excess = percent * (across - coefficient * (along + pull * self.weight()));
            if self.exceeds(if adhesive { laws::SHEAR } else { laws::FRICTION }, excess) {
                return refuse(format!(
                    "outside of its friction cone; allowed: {coefficient:.3} times the normal force of {along:.1} N ({}; {})",
                    self.where_set("contact.friction"),
                    self.where_set("contact.friction_margin")
                ));
            }
        }
        Ok(())
    }

    /// Forces and accelerations obey Newton and Euler.
    fn laws_of_motion(&self) -> Result<()> {
        let (Some(feet), Some(forces)) = (&self.state.feet, &self.state.forces) else { return Ok(()) };
        let (mass, inertia) = (self.robot.mass, self.robot.inertia);
        let inertia = product(&product(&self.turn, &inertia), &transposed(&self.turn));
        let omega = self.state.angular_velocity;
        let applied = self.loaded.scenario.force.iter().map(|force| {
            let acts = scale(force.fraction(0.0, self.loaded.scenario.time_step), force.vector);
            (apply(&self.turn, force.point), acts)
        });
        let at_feet = feet.iter().zip(forces).map(|(foot, force)| (sub(*foot, self.place), *force));
        let acting: Vec<([f64; 3], [f64; 3])> = at_feet.chain(applied).collect();
        let force = acting.iter().fold([0.0; 3], |sum, (_, force)| add(sum, *force));
        let torque = acting.iter().fold([0.0; 3], |sum, (arm, force)| add(sum, cross(*arm, *force)));
        let needed = scale(mass, sub(self.state.acceleration, self.robot.gravity));
        let spin =
            add(apply(&inertia, self.state.angular_acceleration), cross(omega, apply(&inertia, omega)));
        for (law, value, what, acts, asked, unit, key) in [
            (laws::NEWTON_MAX, norm(sub(needed, force)), "sum", force, needed, "N", "acceleration"),
            (
                laws::EULER_MAX,
                norm(sub(spin, torque)) / LEVER,
                "torque about the center of mass",
                torque,
                spin,
                "N m",
                "angular_acceleration",
            ),
        ] {
            if self.exceeds(law, 100.0 * value / self.weight()) {
                let what = format!(
                    "their {what} is {} {unit}, but the motion takes {} {unit} ({}; a mass of {mass} kg)",
                    shown(acts),
                    shown(asked),
                    self.where_set(&format!("start.state.{key}"))
                );
                return Err(self.error("forces", what));
            }
        }
        Ok(())
    }
}

/// Three numbers, to a tenth of a millimeter or of the unit's.
fn shown(values: [f64; 3]) -> String {
    let [x, y, z] = values.map(|v| (1e4 * v).round() / 1e4 + 0.0);
    format!("[{x}, {y}, {z}]")
}
