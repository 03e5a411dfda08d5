//! The motion of a plan at any time, exactly: the splines that were optimized, not its samples.

use std::sync::Arc;

use super::{NamedArray, Plan};
use crate::heightfield::Heightfield;
use crate::trajectory::layout::Layout;
use crate::trajectory::sampling::{self, BaseMotion, FootMotion};
use crate::trajectory::spline::SwingShape;
use crate::trajectory::switches::snapped;
use crate::trajectory::{Gait, Spaces, Swing};
use crate::warp::WarpMap;
use crate::{Error, Result};

/// Times outside the plan by less than this, s, are moved to its ends.
const TIME_TOLERANCE: f64 = 1e-9;

/// A plan's splines, reassembled as the variables of the NLP, with forces in N.
#[derive(Clone, Debug)]
pub struct ExactMotion {
    layout: Layout,
    spaces: Spaces,
    x: Vec<f64>,
}

impl ExactMotion {
    /// The horizon, s.
    pub fn duration(&self) -> f64 {
        self.layout.intervals as f64 * self.layout.time_step
    }

    /// Number of feet.
    pub fn feet(&self) -> usize {
        self.layout.feet.len()
    }

    /// The base at `t` in s, world frame.
    ///
    /// # Errors
    /// For a time outside the plan.
    pub fn base(&self, t: f64) -> Result<BaseMotion> {
        Ok(sampling::base(&self.layout, &self.spaces.base, &self.x, self.sample(t)?))
    }

    /// Foot `i` at `t` in s, world frame, its forces in N.
    ///
    /// # Errors
    /// For a time outside the plan, and for a foot that it does not have.
    pub fn foot(&self, i: usize, t: f64) -> Result<FootMotion> {
        if i >= self.feet() {
            return Err(Error::input(format!("foot {i}: the plan has {} feet, counted from 0", self.feet())));
        }
        Ok(sampling::foot(&self.layout, &self.spaces.feet, &self.x, i, self.sample(t)?))
    }

    /// A time in samples of the NLP; near a sample it is that sample, where a foot's phase may switch.
    fn sample(&self, t: f64) -> Result<f64> {
        let end = self.duration();
        if !(-TIME_TOLERANCE..=end + TIME_TOLERANCE).contains(&t) {
            return Err(Error::input(format!("t = {t} s: the plan lasts from 0 to {end} s")));
        }
        let k = t / self.layout.time_step;
        let near = k.round();
        let k = if (k - near).abs() * self.layout.time_step < TIME_TOLERANCE { near } else { k };
        Ok(k.clamp(0.0, self.layout.intervals as f64))
    }
}

impl Plan {
    /// The exact motion, from the members `spline/…`, the phases and the map.
    ///
    /// # Errors
    /// When a spline is missing or they do not fit together.
    pub fn motion(&self) -> Result<ExactMotion> {
        let (shape, base) = self.spline("base_control_points")?;
        let &[points, 6] = shape else {
            return Err(wrong(
                "base_control_points",
                format!("shape {shape:?}, expected (knot intervals + 3, 6)"),
            ));
        };
        let (shape, knots) = self.spline("base_knots")?;
        if points < 5 || shape != [points + 4] {
            let what = format!(
                "shape {shape:?} with {points} control points, expected 4 more than these, at least 5"
            );
            return Err(wrong("base_knots", what));
        }
        let base_intervals = points - 3;
        let duration = knots[3 + base_intervals] - knots[3];
        let spacing = duration / base_intervals as f64;
        let uniform = |i: usize| (i as f64 - 3.0) * spacing;
        if !(spacing.is_finite() && spacing > 0.0)
            || (0..knots.len()).any(|i| (knots[i] - uniform(i)).abs() > 1e-6 * spacing)
        {
            return Err(wrong("base_knots", "not uniform with knot 3 at 0 s"));
        }
        let (shape, force_knots) = self.spline("force_knots")?;
        let &[samples] = shape else {
            return Err(wrong("force_knots", format!("shape {shape:?}, expected one row")));
        };
        if samples < 2 {
            return Err(wrong("force_knots", "at least two are needed"));
        }
        let intervals = samples - 1;
        let time_step = duration / intervals as f64;
        let off = |k: usize| (force_knots[k] - k as f64 * time_step).abs();
        if !(0..samples).all(|k| off(k) <= 1e-6 * time_step) {
            return Err(wrong("force_knots", "not uniform from 0 s to the end of base_knots"));
        }
        let swings = self
            .phase_durations
            .iter()
            .zip(&self.foot_names)
            .zip(&self.swing_beyond)
            .map(|((durations, foot), beyond)| swings(durations, *beyond, foot, time_step, intervals))
            .collect::<Result<Vec<_>>>()?;
        if swings.len() != self.foot_names.len() {
            return Err(Error::input("member phase_durations: needs one row for each of foot_names"));
        }
        let gait = Gait { intervals, swings };
        // An end at rest has three control points that coincide.
        let points = base.as_chunks::<6>().0;
        let moves = [0, base_intervals].map(|n| points[n] != points[n + 1] || points[n + 1] != points[n + 2]);
        let ends = (self.swing_shape()?, moves);
        let layout = Layout::with_base_intervals(&gait, time_step, base_intervals, 1, ends);
        let mut x = vec![0.0; layout.variables];
        layout.base_spline.set(points, &mut x);
        for foot in 0..self.foot_names.len() {
            self.fill_foot(&layout, foot, &mut x)?;
        }
        let map = self.map.as_ref().map(|grid| WarpMap::from_grid(grid).map(Arc::new)).transpose()?;
        let spaces = Spaces::of(self.meta.formulation, map)?;
        Ok(ExactMotion { layout, spaces, x })
    }

    /// The ground as planned on, as the spline it was.
    ///
    /// # Errors
    /// For a grid that is too small.
    pub fn heightfield(&self) -> Result<Heightfield> {
        let ground = &self.ground;
        Heightfield::interpolate(ground.origin, ground.spacing, ground.columns, ground.rows, &ground.height)
    }

    fn fill_foot(&self, layout: &Layout, foot: usize, x: &mut [f64]) -> Result<()> {
        let (name, variables) = (&self.foot_names[foot], &layout.feet[foot]);
        let member = |what: &str, expected: &[usize]| {
            let member = format!("{name}_{what}");
            let (shape, values) = self.spline(&member)?;
            if shape != expected {
                return Err(wrong(&member, format!("shape {shape:?}, the phases require {expected:?}")));
            }
            Ok(values)
        };
        let footholds = member("footholds", &[variables.stances.len(), 3])?;
        for (stance, foothold) in variables.stances.iter().zip(footholds.as_chunks::<3>().0) {
            x[stance.foothold.first()..][..3].copy_from_slice(foothold);
        }
        let free = layout.swing_shape.free();
        let swings = member("swing_control_points", &[variables.swings.len(), free, 3])?;
        for (swing, points) in variables.swings.iter().zip(swings.chunks_exact(3 * free)) {
            x[swing.control_points..][..3 * free].copy_from_slice(points);
        }
        let forces = member("force_nodes", &[layout.intervals + 1, 3])?;
        for (k, force) in forces.as_chunks::<3>().0.iter().enumerate() {
            match layout.force(foot, k) {
                Some((_, node)) => x[node.first()..][..3].copy_from_slice(force),
                None if *force == [0.0; 3] => {}
                None => {
                    let what = format!("a force at node {k}, where the foot moves or switches");
                    return Err(wrong(&format!("{name}_force_nodes"), what));
                }
            }
        }
        Ok(())
    }

    /// How the swings are made of control points: by their number.
    ///
    /// # Errors
    /// For a number that no swing has, and members that are missing.
    pub fn swing_shape(&self) -> Result<SwingShape> {
        let Some(foot) = self.foot_names.first() else { return Ok(SwingShape::Light) };
        let member = format!("{foot}_swing_control_points");
        let (shape, _) = self.spline(&member)?;
        let found = match shape {
            &[_, free, 3] => SwingShape::with_free(free),
            _ => None,
        };
        found.ok_or_else(|| {
            wrong(&member, format!("shape {shape:?}, expected (swings, 3, 3) or (swings, 5, 3)"))
        })
    }

    /// Shape and values of a member under `spline/`.
    fn spline(&self, name: &str) -> Result<(&[usize], &[f64])> {
        let found: Option<&NamedArray> = self.splines.iter().find(|(member, ..)| member == name);
        let (_, shape, values) = found.ok_or_else(|| {
            wrong(name, "is missing; without it the plan has only its samples, no motion between them")
        })?;
        if shape.iter().product::<usize>() != values.len() {
            return Err(wrong(name, format!("{} values for the shape {shape:?}", values.len())));
        }
        Ok((shape, values))
    }
}

/// The swings of a foot from its phase durations and those beyond the ends, s.
fn swings(
    durations: &[f64],
    beyond: [f64; 2],
    foot: &str,
    time_step: f64,
    intervals: usize,
) -> Result<Vec<Swing>> {
    let refuse = |what: String| Err(Error::input(format!("member phase_durations of {foot}: {what}")));
    if durations.len().is_multiple_of(2) {
        return refuse(format!(
            "{} phases; the number must be odd, because the first and the last one are stances",
            durations.len()
        ));
    }
    let mut edges = vec![0.0];
    let mut time = 0.0;
    for (n, duration) in durations.iter().enumerate() {
        time += duration;
        let k = snapped(time / time_step);
        // Only a stance beside a swing at an end has no duration.
        let none = *duration == 0.0 && durations.len() > 1 && (n == 0 || n + 1 == durations.len());
        if !((k > edges[edges.len() - 1] || none) && k <= intervals as f64) {
            return refuse(format!(
                "a switch at {time:?} s is not after the one before it and within the plan"
            ));
        }
        edges.push(k);
    }
    if edges[durations.len()] != intervals as f64 {
        return refuse(format!("they end at {time:?} s, the base at {} s", intervals as f64 * time_step));
    }
    let mut swings: Vec<Swing> =
        (1..durations.len()).step_by(2).map(|j| Swing::given(edges[j], edges[j + 1])).collect();
    let ends = [0, durations.len() - 1];
    if let Some(n) = (0..2).find(|&n| beyond[n] > 0.0 && (swings.is_empty() || durations[ends[n]] > 0.0)) {
        let end = ["start", "end"][n];
        return refuse(format!("the foot stands at the {end}, but swing_beyond has {:?} s there", beyond[n]));
    }
    if let Some(first) = swings.first_mut() {
        first.start -= beyond[0] / time_step;
    }
    if let Some(last) = swings.last_mut() {
        last.end += beyond[1] / time_step;
    }
    Ok(swings)
}

fn wrong(member: &str, what: impl std::fmt::Display) -> Error {
    Error::input(format!("member spline/{member}: {what}"))
}
