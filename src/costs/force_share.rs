//! How standing feet share the load: w ∫ ‖P f̄‖² dt in (m g)² s, for each component of the forces f̄ of the feet that stand.
//!
//! ```text
//!   P = 1 − Aᵀ(A Aᵀ)⁻¹A,   A = (1; x; y) at the nominal places of these feet, 3 × n
//! ```
//!
//! The laws of motion fix A f̄, roughly, and leave P f̄ open where more than three feet stand. The rate of the forces alone would put
//! most of the load on one diagonal, ready for the first step. Without P f̄ it is shared evenly. A base that leans moves the load too,
//! but hardly changes P f̄, so a robot that stands does not lean. By the trapezoidal rule.

use nalgebra::{DMatrix, Vector3};

use crate::nlp::curvature::NodeCurvature;
use crate::nlp::sink::{Differential, Gradient, Sink};
use crate::nlp::term::Cost;
use crate::nlp::{Model, State};

/// Penalizes forces between standing feet that bear nothing.
#[derive(Clone, Debug)]
pub struct ForceShare {
    samples: Vec<Shared>,
}

/// A sample at which more than three feet stand.
#[derive(Clone, Debug)]
struct Shared {
    sample: usize,
    feet: Vec<usize>,
    /// P, times the weight.
    projector: DMatrix<f64>,
}

impl ForceShare {
    /// Of all samples at which more than three feet stand.
    pub fn new(model: &Model, weight: f64) -> Self {
        let last = model.layout.intervals;
        let shared = |sample: usize| {
            let feet: Vec<usize> =
                (0..model.feet()).filter(|&i| model.layout.force(i, sample).is_some()).collect();
            let places = DMatrix::from_fn(3, feet.len(), |row, n| match row {
                0 => 1.0,
                row => model.nominal[feet[n]][row - 1],
            });
            // None where the feet are on one line.
            let inverse = (&places * places.transpose()).try_inverse().filter(|_| feet.len() > 3)?;
            let part = if sample == 0 || sample == last { 0.5 } else { 1.0 };
            let projector =
                DMatrix::identity(feet.len(), feet.len()) - places.transpose() * inverse * &places;
            Some(Shared {
                sample,
                feet,
                projector: projector * (2.0 * weight * model.layout.time_step * part),
            })
        };
        Self { samples: (0..=last).filter_map(shared).collect() }
    }
}

impl Shared {
    /// The derivatives of the cost with respect to f̄ of each foot; P is its own square.
    fn slopes(&self, state: &State) -> impl Iterator<Item = (usize, Vector3<f64>)> {
        self.feet.iter().enumerate().map(|(n, &i)| {
            let terms = self.feet.iter().enumerate();
            let sum = terms.map(|(m, &j)| state.warped_forces[j][self.sample] * self.projector[(n, m)]);
            (i, sum.sum())
        })
    }
}

impl Cost for ForceShare {
    fn name(&self) -> &'static str {
        "force share"
    }

    fn value(&self, _model: &Model, state: &State, _x: &[f64]) -> f64 {
        let of_sample = |shared: &Shared| {
            let terms = shared.slopes(state);
            0.5 * terms.map(|(i, slope)| slope.dot(&state.warped_forces[i][shared.sample])).sum::<f64>()
        };
        self.samples.iter().map(of_sample).sum()
    }

    fn gradient(&self, model: &Model, state: &State, _x: &[f64], gradient: &mut Gradient) {
        for shared in &self.samples {
            for (i, slope) in shared.slopes(state) {
                let Some((_, node)) = state.force_node(model, i, shared.sample) else { continue };
                for d in 0..3 {
                    gradient.node(node, d, slope[d]);
                }
            }
        }
    }

    fn hessian(
        &self,
        model: &Model,
        state: &State,
        _x: &[f64],
        factor: f64,
        curvature: &mut NodeCurvature,
        sink: &mut Sink,
    ) {
        for shared in &self.samples {
            for (i, slope) in shared.slopes(state) {
                curvature.warped_forces[i][shared.sample] += slope * factor;
            }
            let node = |i: usize| state.force_node(model, i, shared.sample);
            for (n, &i) in shared.feet.iter().enumerate() {
                let Some((_, row)) = node(i) else { continue };
                for d in 0..3 {
                    sink.own(row, d, d, factor * shared.projector[(n, n)]);
                }
                for (m, &j) in shared.feet[..n].iter().enumerate() {
                    let Some((_, column)) = node(j) else { continue };
                    for d in 0..3 {
                        sink.pair((row, d), (column, d), factor * shared.projector[(n, m)]);
                    }
                }
            }
        }
    }
}
