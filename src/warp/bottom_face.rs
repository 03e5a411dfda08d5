//! The bottom face of the box on the ground: φ₂ at z̄ = 0 as a function of φ₀ and φ₁ there.

use super::axis::MapAxis;
use super::bottom::Bottom;
use super::objective::dot;
use crate::heightfield::Heightfield;

/// The face that fits the ground best, and its derivative.
pub(super) struct BottomFace<'a> {
    field: &'a Heightfield,
    bottom: Bottom,
    /// Coefficients along z, from one coefficient of the face to the next.
    stride: usize,
    /// How far the ground is lowered below the terrain (face coefficients, m).
    lowered: Vec<f64>,
    /// The coefficients of φ₂: the L² projection of h(φ₀, φ₁), lowered.
    coefficients: Vec<f64>,
    /// ∂h/∂x and ∂h/∂y at the Gauss points.
    slopes: [Vec<f64>; 2],
    /// The error of the projection, φ₂ − h(φ₀, φ₁) at the Gauss points, m; and the same times the quadrature weights.
    misfit: Vec<f64>,
    weighted_misfit: Vec<f64>,
    /// φ₀ and φ₁ at the Gauss points.
    places: [Vec<f64>; 2],
    /// At the Gauss points.
    heights: Vec<f64>,
    /// Coefficients of the face.
    face: Vec<f64>,
}

impl<'a> BottomFace<'a> {
    /// The bottom face of a grid over a terrain.
    pub fn new(field: &'a Heightfield, axes: &[MapAxis; 3]) -> BottomFace<'a> {
        let bottom = Bottom::new(&axes[0], &axes[1]);
        let coefficients = vec![0.0; axes[0].len() * axes[1].len()];
        let points = vec![0.0; bottom.len()];
        BottomFace {
            field,
            bottom,
            stride: axes[2].len(),
            lowered: coefficients.clone(),
            coefficients: coefficients.clone(),
            slopes: [points.clone(), points.clone()],
            misfit: points.clone(),
            weighted_misfit: points.clone(),
            places: [points.clone(), points.clone()],
            heights: points,
            face: coefficients,
        }
    }

    /// Lowers the ground below the terrain by a fraction of `gap` (face coefficients, m).
    pub fn lower(&mut self, gap: &[f64], fraction: f64) {
        for (lowered, gap) in self.lowered.iter_mut().zip(gap) {
            *lowered = fraction * gap;
        }
    }

    /// Fits the face to the ground under the φ₀ and φ₁ of `u` (component, x, y, z in C order), and returns its coefficients.
    pub fn fit(&mut self, u: &[f64]) -> &[f64] {
        for c in 0..2 {
            gather(u, c, self.stride, &mut self.face);
            self.bottom.values(&self.face, &mut self.places[c]);
        }
        let [x, y] = &self.places;
        let [slopes_x, slopes_y] = &mut self.slopes;
        let slopes = slopes_x.iter_mut().zip(slopes_y);
        for (((height, slope), x), y) in self.heights.iter_mut().zip(slopes).zip(x).zip(y) {
            (*height, [*slope.0, *slope.1]) = self.field.height_and_gradient(*x, *y);
        }
        self.bottom.project(&self.heights, &mut self.coefficients);
        self.bottom.values(&self.coefficients, &mut self.misfit);
        for ((misfit, weighted), height) in
            self.misfit.iter_mut().zip(&mut self.weighted_misfit).zip(&self.heights)
        {
            *misfit -= height;
            *weighted = *misfit;
        }
        self.bottom.weigh(&mut self.weighted_misfit);
        for (f, lowered) in self.coefficients.iter_mut().zip(&self.lowered) {
            *f -= lowered;
        }
        &self.coefficients
    }

    /// ∫ (φ₂ − h(φ₀, φ₁))² da at the last fit, m⁴.
    pub fn squared_misfit(&self) -> f64 {
        dot(&self.misfit, &self.weighted_misfit)
    }

    /// Adds to the gradient for φ₀ and φ₁ what follows from a gradient `by_face` with respect to the face's coefficients, and that
    /// of [`BottomFace::squared_misfit`] times a weight.
    ///
    /// The misfit is orthogonal to the splines, so its square depends on φ₀ and φ₁ through h alone.
    pub fn add_adjoint(&mut self, by_face: &[f64], misfit_weight: f64, gradient: &mut [f64]) {
        self.bottom.project_adjoint(by_face, &mut self.heights);
        for (h, misfit) in self.heights.iter_mut().zip(&self.weighted_misfit) {
            *h -= 2.0 * misfit_weight * misfit;
        }
        self.scatter(gradient);
    }

    /// The change of the face's coefficients to first order when φ₀ and φ₁ change as in `direction`, with the slopes of the last
    /// fit. The misfit becomes its change, so that [`BottomFace::add_adjoint`] then belongs to the change.
    pub fn linear(&mut self, direction: &[f64]) -> &[f64] {
        for c in 0..2 {
            gather(direction, c, self.stride, &mut self.face);
            self.bottom.values(&self.face, &mut self.places[c]);
        }
        for (i, rise) in self.heights.iter_mut().enumerate() {
            *rise = self.slopes[0][i] * self.places[0][i] + self.slopes[1][i] * self.places[1][i];
        }
        self.bottom.project(&self.heights, &mut self.coefficients);
        self.bottom.values(&self.coefficients, &mut self.weighted_misfit);
        for (misfit, rise) in self.weighted_misfit.iter_mut().zip(&self.heights) {
            *misfit -= rise;
        }
        self.bottom.weigh(&mut self.weighted_misfit);
        &self.coefficients
    }

    /// Each point's gradient with respect to the height of the ground (`heights`) times the slopes there, added to that of φ₀ and φ₁.
    fn scatter(&mut self, gradient: &mut [f64]) {
        let n = gradient.len() / 3;
        for c in 0..2 {
            for ((place, h), slope) in self.places[c].iter_mut().zip(&self.heights).zip(&self.slopes[c]) {
                *place = h * slope;
            }
            self.bottom.values_adjoint(&self.places[c], &mut self.face);
            let bottom = gradient[c * n..][..n].iter_mut().step_by(self.stride);
            for (g, added) in bottom.zip(&self.face) {
                *g += added;
            }
        }
    }
}

/// The bottom-face coefficients of one component.
pub(super) fn gather(u: &[f64], component: usize, stride: usize, face: &mut [f64]) {
    let n = u.len() / 3;
    for (f, u) in face.iter_mut().zip(u[component * n..][..n].iter().step_by(stride)) {
        *f = *u;
    }
}
