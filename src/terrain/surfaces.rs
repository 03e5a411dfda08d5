//! The surfaces that a plan refers to: one for all purposes where the ground is smooth, and one for each purpose where it has
//! edges.
//!
//! | surface | made from the raster | used for |
//! | --- | --- | --- |
//! | posture | cells on which no foot can stand are filled, then smoothed over a third of the robot's height | the map φ, the standing pose, the base's guess |
//! | contact | a plane at each cell, and where a foot can stand | footholds and friction |
//! | clearance | what a ball of the foot's or the knee's size rolls over, smoothed | swings; knees and shanks; the torso |

use std::sync::Arc;

use super::contact::{ContactGround, FootNeeds};
use super::detour::{Bends, bends};
use super::fill::fill_holes;
use super::ground::Ground;
use super::keep_out::KeepOut;
use super::morphology::{averaged, counted, disc, rolled_over};
use super::smooth::smooth;
use crate::error::Result;
use crate::heightfield::{Grid, Heightfield};
use crate::robot::Robot;
use crate::scenario::{ContactSpec, Footholds, Scenario};

// Lengths in radii of a foot.
/// The ground must be even this far around a contact point.
const EVEN: f64 = 1.1;
/// Differences from a plane that the foot and the controller absorb.
const ROUGHNESS: f64 = 0.4;
/// Radius of the ball that rolls over the ground: the foot's with half of it as a margin.
const BALL: f64 = 1.5;
/// Radius of the ball below whose path the averaged one is nowhere.
const LEAST_BALL: f64 = 1.2;
/// Standard deviation of what smooths the path of that ball.
const ENVELOPE: f64 = 0.4;
/// Distance of a contact point from a wall: beyond it, the smoothed path of the ball is on the ground.
const BESIDE: f64 = BALL + 2.5 * ENVELOPE;
/// The knee's margin beyond its own radius.
const KNEE_MARGIN: f64 = 1.0;

/// Cells times their neighbors for which the surfaces are made: 4096 x 4096 cells of 2 cm, half a minute.
const MOST_WORK: f64 = 1.1e9;
/// Standard deviation of the smoothing of the posture ground, in standing heights.
const POSTURE: f64 = 0.35;
/// Where less than this fraction of the cells around is steppable, a steppable cell is an outlier: a wall's top, a pole.
const LEAST_STEPPABLE: f64 = 0.2;
/// Fraction of the friction coefficient up to which slopes can be stood on; the rest holds the robot's motion.
const SLOPE: f64 = 0.8;
/// A gap that is deeper than this, in standing heights, cannot be stood in …
const DEPTH: f64 = 0.35;
/// … where it is narrower than this, as a fraction of the larger half size of the reach boxes: it is stepped over.
const GAP: f64 = 2.1;
/// How far a patch reaches to each side, as a fraction of the larger half size of the reach boxes.
const PATCH: f64 = 0.75;

/// The surfaces.
#[derive(Clone, Debug)]
pub struct Surfaces {
    /// Of the map and of the base's pose.
    pub posture: Arc<Heightfield>,
    /// For feet in the air and for the torso. Where there are no patches, feet also stand on it.
    pub feet: Arc<Heightfield>,
    /// For knees: where the lowest point of the knee's parts may be.
    pub knees: Arc<Heightfield>,
    /// Where feet can stand; none if they may stand anywhere.
    pub contact: Option<Arc<ContactGround>>,
    /// Where no foot may stand because the scenario says so.
    pub keep_out: Option<KeepOut>,
    /// Where the way bends around what cannot be walked.
    pub bends: Arc<Bends>,
}

impl Surfaces {
    /// One surface for all purposes.
    pub fn one(ground: Arc<Heightfield>) -> Self {
        Self {
            posture: ground.clone(),
            feet: ground.clone(),
            knees: ground,
            contact: None,
            keep_out: None,
            bends: Arc::default(),
        }
    }

    /// The surfaces of a scenario.
    ///
    /// # Errors
    /// If no foot can stand anywhere, or what is kept free leaves no way.
    pub fn of(scenario: &Scenario, robot: &Robot, ground: &Ground) -> Result<Self> {
        let field = &ground.field;
        let keep_out = KeepOut::of(scenario, field.extent(), robot.size(), robot.foot_radius())?;
        let surfaces = match scenario.footholds() {
            Footholds::Anywhere => Self::one(Arc::new(field.clone())),
            Footholds::Patches => Self::with_edges(&scenario.contact, robot, ground, keep_out.as_ref())?,
        };
        let bends = bends(scenario, robot, field, surfaces.contact.as_deref(), keep_out.as_ref())?;
        Ok(Self { keep_out, bends: Arc::new(bends), ..surfaces })
    }

    fn with_edges(
        contact: &ContactSpec,
        robot: &Robot,
        ground: &Ground,
        keep_out: Option<&KeepOut>,
    ) -> Result<Self> {
        let grid = ground.field.grid();
        let heights = ground.field.samples();
        let raw = ground.raw.as_deref().unwrap_or(heights);
        let surface = |heights: &[f64]| {
            let field = Heightfield::interpolate(grid.origin, grid.spacing, grid.columns, grid.rows, heights);
            Ok::<_, crate::Error>(Arc::new(field?))
        };
        let foot = robot.foot_radius();
        let half_size = robot.feet.iter().flat_map(|f| f.reach.half_size[..2].to_vec()).fold(0.0, f64::max);
        let needs = FootNeeds {
            hole: foot,
            even: EVEN * foot,
            roughness: ROUGHNESS * foot,
            beside: BESIDE * foot,
            depth: DEPTH * robot.standing_height(),
            gap: GAP * half_size,
            slope: contact.max_slope.unwrap_or(f64::INFINITY).min(SLOPE * contact.friction),
            patch: PATCH * half_size,
        };
        let deviation = POSTURE * robot.standing_height();
        ensure_coarse(grid, deviation.max(needs.beside))?;
        let unknown = ground.unknown.as_deref().filter(|_| contact.on_known_ground);
        let mut contact = ContactGround::new(grid, heights, unknown, needs);
        // At the top of an edge, the average lies below what the body itself rolls over.
        let envelope = |radius: f64, least: f64| {
            let averaged = averaged(grid, &rolled_over(grid, raw, radius), ENVELOPE * foot);
            let least = rolled_over(grid, raw, least);
            surface(&averaged.iter().zip(&least).map(|(a, b)| a.max(*b)).collect::<Vec<_>>())
        };
        // The ground of a kept-out place is as good as any for the posture.
        let posture = surface(&posture(&contact, heights, deviation)?)?;
        if let Some(keep_out) = keep_out {
            contact.keep_out(|place| keep_out.allows(place));
        }
        let knee = robot.knee_radius();
        Ok(Self {
            posture,
            feet: envelope(BALL * foot, LEAST_BALL * foot)?,
            knees: envelope(knee + KNEE_MARGIN * foot, knee + 0.5 * KNEE_MARGIN * foot)?,
            contact: Some(Arc::new(contact)),
            keep_out: None,
            bends: Arc::default(),
        })
    }

    /// Whether the ground has edges, so that the surfaces differ.
    pub fn have_edges(&self) -> bool {
        self.contact.is_some()
    }
}

/// Refuses rasters whose cells are so fine, or so many, that the surfaces would take minutes.
fn ensure_coarse(grid: &Grid, reach: f64) -> Result<()> {
    let [x, y] = grid.spacing;
    let work = grid.len() as f64 * reach * reach / (x * y);
    if work <= MOST_WORK {
        return Ok(());
    }
    let fine = x.min(y);
    let what = format!(
        "{} x {} cells of {fine} m are too fine for contact.footholds = \"patches\"; use a part of them (terrain.extent), or the same ground in cells of {} m",
        grid.columns,
        grid.rows,
        rounded_up(fine * (work / MOST_WORK).powf(0.25))
    );
    Err(crate::Error::key("terrain.spacing", what))
}

/// With two digits, and not less than the length, m.
fn rounded_up(length: f64) -> String {
    let digits = (1.0 - length.log10().floor()).max(0.0);
    let scale = 10f64.powf(digits);
    format!("{:.*}", digits as usize, (length * scale).ceil() / scale)
}

/// The ground on which the robot stands on average: what cannot be stood on is filled by a membrane, then all is smoothed.
fn posture(contact: &ContactGround, heights: &[f64], deviation: f64) -> Result<Vec<f64>> {
    let grid: &Grid = contact.grid();
    let around = disc(grid, deviation * 2.0 / 3.0);
    let mut filled = heights.to_vec();
    let steppable = contact.steppable();
    let enough = LEAST_STEPPABLE * around.len() as f64;
    let holes: Vec<bool> = (counted(grid, steppable, &around).into_iter().zip(steppable))
        .map(|(count, steppable)| !steppable || f64::from(count) < enough)
        .collect();
    for (height, hole) in filled.iter_mut().zip(&holes) {
        if *hole {
            *height = f64::NAN;
        }
    }
    fill_holes(grid.columns, &mut filled).map_err(|_| {
        let why = if contact.has_holes() {
            "too rough, too steep, or without data everywhere (see contact.footholds, contact.on_known_ground)"
        } else {
            "too rough or too steep everywhere (see contact.footholds)"
        };
        crate::Error::key("terrain", format!("there is no place where a foot can stand: the ground is {why}"))
    })?;
    Ok(smooth(grid.columns, &filled, &holes, deviation / grid.spacing[0]))
}
