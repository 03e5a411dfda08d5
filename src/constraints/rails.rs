//! Feet that move in planes of the base, as those of legs of two joints do, hold the base while they stand: it moves ahead like a train on
//! rails, and to the side only as it rolls.
//!
//! ```text
//!   Σ_i w_i (y_i(t₂) − y_i(t₁)) = 0,   Σ_i w_i (x_i − x̄) (y_i(t₂) − y_i(t₁)) = 0
//! ```
//!
//! over the feet i that stand from t₁ to t₂, between which none lifts off or touches down; y_i is the foot's place across the base, x_i
//! the nominal one along it, and w_i the load on it in the nominal stance, since feet slip that bear little. Without these rows, the play
//! of the reach boxes ([`super::reach`]) would let the base move and turn a little in every step, which the robot cannot do: it would leave
//! the plan by their sum. What the rows leave free is how far left and right feet are apart, which a roll changes by slipping.
//!
//! y_i is that of the contact point: while the base rolls, the foot rolls with it, and moves its center by as much as the turn takes off.
//!
//! Rows: two for each such span of time, or one where all feet have the same x, in cm.

use nalgebra::{Matrix3, Vector3};

use crate::nlp::curvature::NodeCurvature;
use crate::nlp::foot_in_base;
use crate::nlp::sink::Sink;
use crate::nlp::term::{Constraint, RowPlace};
use crate::nlp::{Model, State};
use crate::trajectory::Instant;
use crate::trajectory::layout::Phase;

/// Rows are in cm.
const SCALE: f64 = 100.0;
/// Of the weight, what a standing foot counts as bearing at least.
const LEAST_LOAD: f64 = 0.05;
/// Added to the squares of the feet's places, in standing heights, where these are on a line.
const REGULAR: f64 = 1e-6;
/// How far feet are ahead of their middle where they can hold the base's heading, in standing heights.
const LEAST_LEVER: f64 = 0.1;

/// The base on its rails.
#[derive(Clone, Debug)]
pub struct Rails {
    rows: Vec<Row>,
}

/// Feet with their weights, from one sample to another.
#[derive(Clone, Debug)]
struct Row {
    feet: Vec<(usize, f64)>,
    samples: [usize; 2],
}

impl Row {
    /// The places of the row, (foot, sample), with their weights.
    fn terms(&self) -> impl Iterator<Item = ((usize, Instant), f64)> + '_ {
        let ends = [(self.samples[0], -SCALE), (self.samples[1], SCALE)];
        ends.into_iter().flat_map(|(k, sign)| {
            self.feet.iter().map(move |&(i, weight)| ((i, Instant::Sample(k)), sign * weight))
        })
    }
}

/// A span of samples in which the same feet stand, and which stance of each this is.
struct Span {
    samples: [usize; 2],
    holding: Vec<Option<usize>>,
}

impl Rails {
    /// While the same feet stand.
    pub fn new(model: &Model) -> Self {
        let spans = spans(model);
        let loads: Vec<Vec<f64>> = spans.iter().map(|span| loads(model, &span.holding)).collect();
        let mut rows = Vec::new();
        for (n, span) in spans.iter().enumerate() {
            // A foot that has just touched down or is about to lift off bears less than one that stands on.
            let around = &loads[n.saturating_sub(1)..(n + 2).min(loads.len())];
            let load = |i: usize| around.iter().map(|loads| loads[i]).sum::<f64>();
            let feet = (0..model.feet()).filter(|i| span.holding[*i].is_some());
            rows.extend(rows_of(model, &feet.map(|i| (i, load(i))).collect::<Vec<_>>(), span.samples));
        }
        Self { rows }
    }
}

fn spans(model: &Model) -> Vec<Span> {
    // The stance of each foot that goes on from sample k to the next.
    let holding = |k: usize| -> Vec<Option<usize>> {
        let phases = model.layout.phase.iter();
        let stands = phases.map(|phase| match (phase[k], phase[k + 1]) {
            (Phase::Stance(j), Phase::Stance(next)) if j == next => Some(j),
            _ => None,
        });
        stands.zip(&model.sagittal).map(|(stance, sagittal)| stance.filter(|_| sagittal.is_some())).collect()
    };
    let mut spans: Vec<Span> = Vec::new();
    for k in 0..model.layout.intervals {
        match spans.last_mut().filter(|span| span.holding == holding(k)) {
            Some(span) => span.samples[1] = k + 1,
            None => spans.push(Span { samples: [k, k + 1], holding: holding(k) }),
        }
    }
    spans
}

/// The fractions of the weight that the feet bear while some stand at their nominal places, under a center of mass at its own: of all
/// that balance it, the most even. None is below [`LEAST_LOAD`] where the foot stands.
fn loads(model: &Model, holding: &[Option<usize>]) -> Vec<f64> {
    let place = |i: usize| {
        let at = model.nominal[i] / model.standing_height;
        Vector3::new(1.0, at.x, at.y)
    };
    let standing: Vec<usize> = (0..holding.len()).filter(|i| holding[*i].is_some()).collect();
    let square: Matrix3<f64> = standing.iter().map(|i| place(*i) * place(*i).transpose()).sum();
    let by_place = (square + Matrix3::identity() * REGULAR).try_inverse().unwrap_or_default() * Vector3::x();
    (0..holding.len())
        .map(|i| if holding[i].is_some() { by_place.dot(&place(i)).max(LEAST_LOAD) } else { 0.0 })
        .collect()
}

/// The rows of a span of samples over which feet stand, given with their loads.
fn rows_of(model: &Model, feet: &[(usize, f64)], samples: [usize; 2]) -> Vec<Row> {
    let total: f64 = feet.iter().map(|(_, load)| load).sum();
    let middle = feet.iter().map(|(i, load)| load * model.nominal[*i].x).sum::<f64>() / total;
    let ahead = |i: usize| model.nominal[i].x - middle;
    let lever: f64 = feet.iter().map(|(i, load)| load * ahead(*i).abs()).sum();
    let weighted = |weight: &dyn Fn(usize) -> f64| Row {
        feet: feet.iter().map(|(i, load)| (*i, load * weight(*i))).collect(),
        samples,
    };
    let mut rows = Vec::new();
    if !feet.is_empty() {
        rows.push(weighted(&|_| 1.0 / total));
    }
    if lever > LEAST_LEVER * model.standing_height * total {
        rows.push(weighted(&|i| ahead(i) / lever));
    }
    rows
}

impl Constraint for Rails {
    fn name(&self) -> &'static str {
        "rails"
    }

    fn rows(&self) -> usize {
        self.rows.len()
    }

    fn bounds(&self, _model: &Model, lower: &mut [f64], upper: &mut [f64]) {
        lower.fill(0.0);
        upper.fill(0.0);
    }

    fn values(&self, model: &Model, state: &State, out: &mut [f64]) {
        for (value, row) in out.iter_mut().zip(&self.rows) {
            *value = row.terms().map(|(place, by)| by * foot_in_base::value(model, state, place).y).sum();
        }
    }

    fn jacobian(&self, model: &Model, state: &State, first: usize, sink: &mut Sink) {
        for (r, row) in self.rows.iter().enumerate() {
            for (place, by) in row.terms() {
                let across = Vector3::y() * by;
                foot_in_base::add_derivative(model, state, place, &across, &mut sink.row(first + r));
            }
        }
    }

    fn hessian(
        &self,
        model: &Model,
        state: &State,
        multipliers: &[f64],
        curvature: &mut NodeCurvature,
        _sink: &mut Sink,
    ) {
        for (lambda, row) in multipliers.iter().zip(&self.rows) {
            for (place, by) in row.terms() {
                foot_in_base::add_curvature(model, state, place, &(Vector3::y() * (lambda * by)), curvature);
            }
        }
    }

    fn place(&self, row: usize) -> RowPlace {
        let [first, last] = self.rows[row].samples;
        RowPlace { foot: None, sample: 0.5 * (first + last) as f64 }
    }
}
