//! Which cell each foot stands on, and when the base can be where: a beam search over all touch-downs.
//!
//! The base's way is given by its guess; when it is where is not. A foothold is a place on the foot's *track*: for each place s
//! of the base on its way, the steppable cell that is closest to the foot's nominal place, to the left or right. A beam search
//! goes through the touch-downs of all feet in order of time and keeps the cheapest partial plans. Each knows the interval of s in
//! which every standing foot is within reach; it grows with the base's largest speed and shrinks at each touch-down. So a
//! plan may wait before a gap and hurry afterward. A touch-down costs
//!
//! - the squared distance of the foothold from where the base will be in the middle of the stance;
//! - what is out of the reach box, sideways and in height, at touch-down, and what the interval lacks to have an inside;
//! - the squared difference of the step from the base's travel, so that steps are regular;
//! - what the step is longer or higher than the leg can take;
//! - the roughness of the ground under the foot, and a little for each direction in which the ground next to it cannot be stood on.

use std::collections::{HashMap, HashSet};

use nalgebra::{Vector2, Vector3};

use super::base_path::{BasePath, FootMotion, REACH_MARGIN};
use super::standing::Pose;
use crate::nlp::Model;
use crate::nlp::model::FixedFoothold;
use crate::terrain::{ContactGround, Patch};
use crate::{Error, Result};

/// Distance of the places on a track, as a fraction of the half length of the reach box.
const APART: f64 = 0.09;
/// Footholds further ahead or behind than this many half lengths of the reach box are not tried.
const WINDOW: f64 = 1.3;
/// Places on a track beyond each end of the way, at most.
const MOST_BEYOND: f64 = 100.0;
/// Partial plans that are kept.
const BEAM: usize = 300;
/// Weight of what is beyond a limit, against squared distances.
const BEYOND: f64 = 20.0;
/// Weight of irregular steps.
const REGULAR: f64 = 0.5;
/// Cost of each direction without room, m², for a robot of ANYmal's size.
const NO_ROOM: f64 = 2e-4;
/// Weight of the ground's squared difference from a plane under the foot: 5 mm are worth a step of 3 cm aside.
const ROUGH: f64 = 36.0;
/// Weight of the base's difference from steady travel.
const LATE: f64 = 0.2;
/// Fraction of that difference that is kept until the middle of a stance.
const KEPT_LAG: f64 = 0.6;
/// Largest speed of the base, as a multiple of its mean speed.
const FASTEST: f64 = 2.0;
/// Longest step, as a fraction of the length of the reach box, unless the base travels faster.
const LONGEST: f64 = 0.86;
/// Highest step up or down, in standing heights.
const HIGHEST: f64 = 0.58;

/// The key to which errors about the way refer.
pub const WAY: &str = "goal.position";

/// Where a foot can stand.
#[derive(Clone, Copy, Debug)]
pub struct Place {
    /// Of the base on its way when the foot is at its nominal place ahead or behind, m.
    s: f64,
    /// Its cell.
    pub cell: usize,
    /// On the plane of that cell, m.
    pub point: Vector3<f64>,
    /// Squared distance to the left or right, room and roughness.
    cost: f64,
}

/// A patch that a stance had, and that failed.
#[derive(Clone, Copy, Debug)]
pub struct Avoided {
    /// Whose stance.
    pub foot: usize,
    /// Its number.
    pub stance: usize,
    /// Around which places are not tried again.
    pub patch: Patch,
}

/// A partial plan.
#[derive(Clone, Debug)]
struct Partial {
    cost: f64,
    /// Where the base can be, m.
    interval: [f64; 2],
    /// By foot, where it is or was last.
    places: Vec<Place>,
    /// The last of its touch-downs.
    last: Option<usize>,
}

/// A touch-down in the history of a partial plan.
struct Touchdown {
    before: Option<usize>,
    foot: usize,
    place: Place,
}

/// A switch of a foot.
#[derive(Clone, Copy, Debug)]
struct Switch {
    /// In samples.
    time: f64,
    foot: usize,
    /// The stance that begins; none at lift-off.
    begins: Option<usize>,
}

/// The search for one motion.
pub struct Search<'a> {
    model: &'a Model,
    contact: &'a ContactGround,
    path: &'a BasePath<'a>,
    /// Poses along the way, `apart` m from each other, from s = `first` on.
    way: Vec<Pose>,
    first: f64,
    apart: f64,
    /// `[foot]`, for each pose of the way.
    motions: Vec<Vec<FootMotion>>,
    /// By foot, the longest and the highest step, m.
    largest_steps: Vec<[f64; 2]>,
    /// By foot, for each pose of the way.
    tracks: Vec<Vec<Option<Place>>>,
    /// Stances whose place is given, by foot and number.
    fixed: Vec<(usize, usize, Place)>,
    /// Patches that a stance must not have, where there are others.
    avoided: &'a [Avoided],
    history: Vec<Touchdown>,
}

impl<'a> Search<'a> {
    /// Prepares the tracks of all feet along a path.
    pub fn new(
        model: &'a Model,
        contact: &'a ContactGround,
        path: &'a BasePath<'a>,
        avoided: &'a [Avoided],
    ) -> Self {
        let half = model.reach.iter().map(|r| r.half_size[0]).fold(f64::INFINITY, f64::min);
        let length = path.length;
        let count = (length / (APART * half)).ceil().max(1.0);
        let apart = length / count;
        // Feet can be ahead of and behind the ends of the way by as much as they reach.
        let beyond = (WINDOW * half / apart).ceil().min(MOST_BEYOND);
        let numbers = 0..=(count + 2.0 * beyond) as usize;
        let fractions: Vec<f64> = numbers.map(|n| (n as f64 - beyond) / count).collect();
        let way = fractions.iter().map(|&u| path.pose_on_way(u)).collect();
        let first = -beyond * apart;
        let mut search = Self {
            model,
            contact,
            path,
            way,
            first,
            apart,
            motions: vec![],
            largest_steps: (0..model.feet()).map(|foot| largest_step(model, path, foot)).collect(),
            tracks: vec![],
            fixed: vec![],
            avoided,
            history: vec![],
        };
        search.motions = (0..model.feet())
            .map(|foot| fractions.iter().map(|&u| path.foot_motion(foot, u)).collect())
            .collect();
        search.tracks = (0..model.feet())
            .map(|foot| (0..search.way.len()).map(|n| search.place(foot, n)).collect())
            .collect();
        search
    }

    /// The best cell for a foot when the base is at pose n of the way: closest to the nominal place sideways.
    fn place(&self, foot: usize, n: usize) -> Option<Place> {
        let s = self.first + n as f64 * self.apart;
        let (pose, reach) = (&self.way[n], &self.model.reach[foot]);
        let nominal = pose.position + pose.rotation * self.model.nominal[foot];
        let motion = &self.motions[foot][n];
        let side = [-motion.in_world.y, motion.in_world.x];
        let spacing = self.contact.grid().spacing[0].min(self.contact.grid().spacing[1]);
        let steps = (WINDOW * motion.half_across(&reach.half_size) / spacing) as i64;
        let crowded = self.model.size * self.model.size * NO_ROOM;
        (-steps..=steps)
            .filter_map(|k| {
                let aside = k as f64 * spacing;
                let cell = self
                    .contact
                    .steppable_cell([nominal.x + aside * side[0], nominal.y + aside * side[1]])?;
                let no_room = f64::from(self.contact.closed_directions(cell));
                let rough = self.contact.roughness(cell);
                let point = Vector3::from(self.contact.point(cell));
                Some(Place {
                    s,
                    cell,
                    point,
                    cost: aside * aside + crowded * no_room + ROUGH * rough * rough,
                })
            })
            .min_by(|a, b| a.cost.total_cmp(&b.cost))
    }

    /// `[foot][stance]`, and the cost, m².
    ///
    /// # Errors
    /// Where a foot finds nothing to stand on.
    pub fn run(mut self) -> Result<(Vec<Vec<Place>>, f64)> {
        self.fixed = self.fixed_places()?;
        let start = self.at_rest()?;
        let mut beam = vec![start.clone()];
        let mut standing = vec![true; self.model.feet()];
        let mut now = 0.0;
        for switch in self.switches() {
            let elapsed = (switch.time - now) * self.model.layout.time_step;
            beam.iter_mut().for_each(|partial| self.travel(partial, &standing, elapsed));
            now = switch.time;
            if let Some(stance) = switch.begins {
                beam = self.touch_down(&beam, switch, stance)?;
            }
            standing[switch.foot] = switch.begins.is_some();
        }
        let length = self.path.length;
        let end = |partial: &Partial| partial.cost + BEYOND * distance(partial.interval, length).powi(2);
        let best = beam.iter().min_by(|a, b| end(a).total_cmp(&end(b)));
        Ok((self.footholds(&start, best.and_then(|best| best.last)), best.map_or(0.0, end)))
    }

    /// All feet at the start.
    fn at_rest(&self) -> Result<Partial> {
        let mut places = Vec::new();
        for foot in 0..self.model.feet() {
            let from = self.places_for(foot, 0, 0.0).into_iter().min_by(|a, b| {
                let cost = |p: &Place| p.cost + p.s * p.s;
                cost(a).total_cmp(&cost(b))
            });
            places.push(from.ok_or_else(|| self.nothing_to_stand_on(foot, 0.0, 0.0))?);
        }
        Ok(Partial { cost: 0.0, interval: [0.0, 0.0], places, last: None })
    }

    /// Touch-downs and lift-offs in order; at the same time, feet touch down first.
    fn switches(&self) -> Vec<Switch> {
        let mut switches = Vec::new();
        for (foot, variables) in self.model.layout.feet.iter().enumerate() {
            for (j, swing) in variables.swings.iter().enumerate() {
                switches.push(Switch { time: swing.swing.start, foot, begins: None });
                switches.push(Switch { time: swing.swing.end, foot, begins: Some(j + 1) });
            }
        }
        switches.sort_by(|a, b| a.time.total_cmp(&b.time).then(b.begins.is_some().cmp(&a.begins.is_some())));
        switches
    }

    /// Lets the base travel for some time, s, while some feet stand.
    fn travel(&self, partial: &mut Partial, standing: &[bool], elapsed: f64) {
        let [least, most] = partial.interval;
        let mut interval = [least, (most + self.fastest() * elapsed).min(self.path.length)];
        for (foot, place) in partial.places.iter().enumerate().filter(|(foot, _)| standing[*foot]) {
            partial.cost += BEYOND * narrow(&mut interval, self.within_reach(foot, place)).powi(2);
        }
        partial.interval = interval;
    }

    /// Where the base can be while a foot is at a place.
    fn within_reach(&self, foot: usize, place: &Place) -> [f64; 2] {
        let reach = &self.model.reach[foot];
        let (motion, nominal) = (&self.motions[foot][self.number(place.s)], &self.model.nominal[foot]);
        let half = (1.0 - REACH_MARGIN) * motion.half_chord(&reach.half_size);
        let ahead = motion.along(nominal.x - reach.center[0], nominal.y - reach.center[1]);
        [place.s + ahead - half, place.s + ahead + half]
    }

    fn fastest(&self) -> f64 {
        FASTEST * self.path.length / self.path.travel_time()
    }

    /// Extends all partial plans by all footholds, and keeps the best.
    fn touch_down(&mut self, beam: &[Partial], switch: Switch, stance: usize) -> Result<Vec<Partial>> {
        let foot = switch.foot;
        let layout = &self.model.layout;
        let last = layout.intervals as f64;
        let steady = |k: f64| self.path.steady(k * layout.time_step);
        let [before, this] = [stance - 1, stance].map(|j| &layout.feet[foot].stances[j].stance);
        let [begin, mid] = [this.start, this.middle(last)].map(steady);
        let travel = mid - steady(before.middle(last));
        let stays = this.end == last;
        let mut found: Vec<(f64, usize, Place, [f64; 2])> = Vec::new();
        let mut nearest = None;
        // Many partial plans step from the same cell.
        let mut excesses = HashMap::new();
        for (n, partial) in beam.iter().enumerate() {
            let at = begin.clamp(partial.interval[0], partial.interval[1]);
            let wanted = (mid + KEPT_LAG * (at - begin)).min(self.path.length);
            let late = LATE * (at - begin).powi(2);
            nearest.get_or_insert(wanted);
            let from = &partial.places[foot];
            for place in self.places_for(foot, stance, wanted) {
                let excess = *excesses
                    .entry([from.cell, place.cell])
                    .or_insert_with(|| self.excess(foot, from, &place));
                let mut interval = partial.interval;
                let within_reach = self.within_reach(foot, &place);
                let mut lacking = narrow(&mut interval, within_reach);
                if stays {
                    lacking += distance(within_reach, self.path.length);
                }
                let base = begin.clamp(interval[0], interval[1]);
                let cost = partial.cost
                    + late
                    + place.cost
                    + (place.s - wanted).powi(2)
                    + BEYOND * (lacking.powi(2) + self.out_of_reach(foot, &place, base))
                    + BEYOND * self.out_of_reach(foot, &place, 2.0 * place.s - base)
                    + REGULAR * (place.s - from.s - travel).powi(2)
                    + BEYOND * excess.powi(2);
                found.push((cost, n, place, interval));
            }
        }
        if found.is_empty() {
            return Err(self.nothing_to_stand_on(foot, nearest.unwrap_or(begin), switch.time));
        }
        let mut order: Vec<(f64, usize)> = found.iter().enumerate().map(|(k, found)| (found.0, k)).collect();
        order.sort_unstable_by(|a, b| a.0.total_cmp(&b.0).then(a.1.cmp(&b.1)));
        let mut seen = HashSet::new();
        let mut extended = Vec::with_capacity(BEAM);
        for (cost, n, place, interval) in order.into_iter().map(|(_, k)| found[k]) {
            let mut places = beam[n].places.clone();
            places[foot] = place;
            // Of plans whose feet are at the same places, the cheapest.
            if !seen.insert(places.iter().map(|p| p.cell).collect::<Vec<_>>()) {
                continue;
            }
            self.history.push(Touchdown { before: beam[n].last, foot, place });
            extended.push(Partial { cost, interval, places, last: Some(self.history.len() - 1) });
            if extended.len() == BEAM {
                break;
            }
        }
        Ok(extended)
    }

    /// The places of the stances that are given.
    fn fixed_places(&self) -> Result<Vec<(usize, usize, Place)>> {
        let place = |fixed: &FixedFoothold| {
            let [x, y] = fixed.position;
            let Some(cell) = self.contact.steppable_cell([x, y]) else {
                let what = format!(
                    "given [{x}, {y}], where {} cannot stand: the ground there is a gap, too rough, too steep, kept free, or was not measured",
                    self.model.foot_names[fixed.foot]
                );
                return Err(Error::key("foothold", what));
            };
            let nominal = |n: usize| {
                let pose = &self.way[n];
                (pose.position + pose.rotation * self.model.nominal[fixed.foot]).xy()
            };
            let off = |n: &usize| (nominal(*n) - Vector2::new(x, y)).norm();
            let nearest = (0..self.way.len()).min_by(|a, b| off(a).total_cmp(&off(b))).unwrap_or(0);
            let s = self.first + nearest as f64 * self.apart;
            let place = Place { s, cell, point: Vector3::from(self.contact.point(cell)), cost: 0.0 };
            Ok((fixed.foot, fixed.stance, place))
        };
        self.model.fixed.iter().map(place).collect()
    }

    /// The places that a stance of a foot may have around s.
    fn places_for(&self, foot: usize, stance: usize, s: f64) -> Vec<Place> {
        match self.fixed.iter().find(|fixed| (fixed.0, fixed.1) == (foot, stance)) {
            Some((.., place)) => vec![*place],
            None => {
                let mut places = self.places_around(foot, s);
                let avoids = |place: &Place, avoided: &Avoided| {
                    (avoided.foot, avoided.stance) == (foot, stance)
                        && avoided.patch.covers([place.point.x, place.point.y])
                };
                let is_other = |place: &Place| !self.avoided.iter().any(|avoided| avoids(place, avoided));
                if places.iter().any(is_other) {
                    places.retain(is_other);
                }
                places
            }
        }
    }

    /// The places of a foot's track around s.
    fn places_around(&self, foot: usize, s: f64) -> Vec<Place> {
        let half_size = &self.model.reach[foot].half_size;
        let window = WINDOW * self.motions[foot][self.number(s)].half_chord(half_size);
        self.tracks[foot].iter().flatten().filter(|place| (place.s - s).abs() <= window).copied().collect()
    }

    /// How far a foothold is out of the reach box sideways and in height, with the base at s, squared, m².
    fn out_of_reach(&self, foot: usize, place: &Place, s: f64) -> f64 {
        let reach = &self.model.reach[foot];
        let pose = &self.way[self.number(s)];
        let local = pose.rotation.tr_mul(&(place.point - pose.position));
        let beyond = |d: usize| {
            ((local[d] - reach.center[d]).abs() - (1.0 - REACH_MARGIN) * reach.half_size[d]).max(0.0)
        };
        beyond(1).powi(2) + beyond(2).powi(2)
    }

    /// The pose of the way that is nearest to s.
    fn number(&self, s: f64) -> usize {
        // The cast makes zero of what is negative. `round` would be a call.
        let n = ((s - self.first) / self.apart + 0.5) as usize;
        n.min(self.way.len() - 1)
    }

    /// What a step is longer and higher than the leg can take, m.
    fn excess(&self, foot: usize, from: &Place, to: &Place) -> f64 {
        let step = to.point - from.point;
        let [longest, highest] = self.largest_steps[foot];
        let rise = step.z.abs().max(obstacle(self.contact, from, to));
        (step.norm() - longest).max(0.0) + (rise - highest).max(0.0)
    }

    /// `[foot][stance]` of a whole plan, from its last touch-down back to the start.
    fn footholds(&self, start: &Partial, last: Option<usize>) -> Vec<Vec<Place>> {
        let mut footholds = vec![Vec::new(); self.model.feet()];
        let mut at = last.map(|n| &self.history[n]);
        while let Some(touchdown) = at {
            footholds[touchdown.foot].push(touchdown.place);
            at = touchdown.before.map(|n| &self.history[n]);
        }
        for (places, first) in footholds.iter_mut().zip(&start.places) {
            places.push(*first);
            places.reverse();
        }
        footholds
    }

    fn nothing_to_stand_on(&self, foot: usize, s: f64, sample: f64) -> Error {
        let pose = &self.way[self.number(s)];
        let place = pose.position + pose.rotation * self.model.nominal[foot];
        let reach = WINDOW * self.model.reach[foot].half_size[0];
        let [x_min, x_max, y_min, y_max] = self.contact.grid().extent();
        let inside = (x_min..=x_max).contains(&place.x) && (y_min..=y_max).contains(&place.y);
        let why = match (inside, self.contact.has_holes()) {
            (true, true) => "the ground there is a gap, too rough, too steep, or was not measured",
            (true, false) => "the ground there is a gap, too rough or too steep",
            (false, _) => "that is beyond the terrain",
        };
        let what = format!(
            "foot {} finds nothing to stand on within {reach:.2} m of x = {:.2}, y = {:.2} m at {:.1} s: {why}; {}",
            self.model.foot_names[foot],
            place.x,
            place.y,
            sample * self.model.layout.time_step,
            advice(self.contact)
        );
        Error::key(WAY, what)
    }
}

/// What to do where there are no footholds.
pub fn advice(contact: &ContactGround) -> &'static str {
    if contact.has_holes() {
        "choose another way (start, goal) or another gait; feet keep off ground without data unless contact.on_known_ground = false"
    } else {
        "choose another way (start, goal) or another gait"
    }
}

/// By how much the ground between two footholds is above the higher one, m.
pub fn obstacle(contact: &ContactGround, from: &Place, to: &Place) -> f64 {
    let way = [from, to].map(|place| [place.point.x, place.point.y]);
    (contact.highest_between(way) - from.point.z.max(to.point.z)).max(0.0)
}

/// The longest and the highest step of a foot, m.
pub fn largest_step(model: &Model, path: &BasePath, foot: usize) -> [f64; 2] {
    let travel = path.length / path.travel_time() * model.layout.longest_cycle(foot);
    let motion = path.foot_motion(foot, 0.5);
    let chord = 2.0 * motion.gain * motion.half_chord(&model.reach[foot].half_size);
    let longest = (LONGEST * chord).max(travel);
    [longest, HIGHEST * -model.nominal[foot].z]
}

/// How far a value is outside an interval.
fn distance([least, most]: [f64; 2], value: f64) -> f64 {
    (least - value).max(value - most).max(0.0)
}

/// Intersects an interval with another. If nothing is left, it becomes the middle between the two; returns what was lacking, m.
fn narrow(interval: &mut [f64; 2], other: [f64; 2]) -> f64 {
    let (least, most) = (interval[0].max(other[0]), interval[1].min(other[1]));
    if least <= most {
        *interval = [least, most];
        return 0.0;
    }
    *interval = [0.5 * (least + most); 2];
    least - most
}
