//! Which variables have bounds, and which rows a given start leaves nothing to do for.

use crate::nlp::Model;
use crate::nlp::sink::Pattern;
use crate::trajectory::base::RATES;

/// Rows of which a given start leaves no variable: nothing that the solver could do would change them. They are judged by the check.
pub(super) fn given_rows(
    model: &Model,
    jacobian: &Pattern,
    lower: &[f64],
    upper: &[f64],
    rows: usize,
) -> Vec<usize> {
    if model.start.is_none() {
        return Vec::new();
    }
    let mut fixed = vec![true; rows];
    for (row, column) in jacobian.rows.iter().zip(&jacobian.columns) {
        fixed[*row as usize] &= lower[*column as usize] == upper[*column as usize];
    }
    (0..rows).filter(|row| fixed[*row]).collect()
}

/// What is given of the start, and of the base's velocity at the end, is pinned; of a cyclic motion only place and heading at the start. Switches stay within their rooms. In F, the free control points of a swing stay
/// above the ground: a spline obeys z̄ ≥ 0 at every instant if its control points do (Eq. 8, second line). With edges, z̄ = 0
/// is the posture surface, which is not the ground.
pub(super) fn variable_bounds(model: &Model, initial: &[f64]) -> (Vec<f64>, Vec<f64>) {
    let mut lower = vec![f64::NEG_INFINITY; model.layout.variables];
    let mut upper = vec![f64::INFINITY; model.layout.variables];
    let spline = &model.layout.base_spline;
    let pinned: Vec<usize> = if model.cycle.is_some() {
        vec![0, 1, 5]
    } else {
        let rates = [spline.start, spline.end].into_iter().flatten().flat_map(|first| first..first + RATES);
        (0..6).chain(rates).collect()
    };
    let given =
        model.start.iter().flat_map(|start| start.variables(&model.layout)).flat_map(|(range, _)| range);
    for v in pinned.into_iter().chain(given) {
        (lower[v], upper[v]) = (initial[v], initial[v]);
    }
    for swing in model.layout.feet.iter().flat_map(|f| &f.swings) {
        if model.spaces.feet.is_warped() && !model.surfaces.have_edges() {
            for c in 0..model.layout.swing_shape.free() {
                lower[swing.control_points + 3 * c + 2] = 0.0;
            }
        }
        if let Some(lift_off) = swing.switches {
            let s = &swing.swing;
            for (n, nominal) in [s.start, s.end].into_iter().enumerate() {
                lower[lift_off + n] = nominal - s.room[n];
                upper[lift_off + n] = nominal + s.room[n];
            }
        }
    }
    (lower, upper)
}
