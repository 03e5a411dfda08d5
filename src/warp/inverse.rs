//! φ⁻¹ by a damped Newton method.

use nalgebra::{Matrix2, Matrix3, Vector2, Vector3};

use super::spline::{Order, WarpMap};
use crate::{Error, Result};

/// Residual of a solution, m.
const TOLERANCE: f64 = 1e-11;
/// Residual of a solution where rounding errors stall the method, m.
const STALLED_TOLERANCE: f64 = 100.0 * TOLERANCE;
/// Steps shorter than this fraction of Newton's do not decrease the residual, except by rounding errors.
const LEAST_SCALE: f64 = 1e-6;
/// Quadratic convergence takes far fewer; more would not help.
const MAX_ITERATIONS: usize = 60;
/// Numbers of continuation steps, tried in order where Newton's method fails from the guess.
const CONTINUATION_STEPS: [usize; 2] = [8, 64];

impl WarpMap {
    /// x̄ with φ(x̄) = p.
    ///
    /// # Errors
    /// If p is not finite or is further from the box than its longest edge, or if no such x̄ is found.
    pub fn inverse(&self, p: [f64; 3]) -> Result<[f64; 3]> {
        self.check_near(&[p[0], p[1]])?;
        // The guess has the same x, y and the same height above the ground, which can be anywhere.
        let ground = self.position([p[0], p[1], 0.0])[2];
        let guess = Vector3::new(p[0], p[1], p[2] - ground);
        self.check_near(&guess.into())?;
        let step = |x: &Vector3<f64>, target: &Vector3<f64>| {
            let jet = self.jet((*x).into(), Order::First);
            let residual = Vector3::from(jet.position) - target;
            let jacobian = Matrix3::from_fn(|r, c| jet.jacobian[r][c]);
            (residual.norm(), jacobian.try_inverse().map(|inverse| inverse * residual))
        };
        let value = |x: &Vector3<f64>| Vector3::from(self.position((*x).into()));
        let found = solve(guess, Vector3::from(p), value, step);
        self.checked(found.map(|x| x.into()), &p)
    }

    /// x̄, ȳ with φ_xy(x̄, ȳ, 0) = (x, y): the point of F that belongs to a point of the ground.
    ///
    /// # Errors
    /// Those of [`WarpMap::inverse`].
    pub fn ground_inverse(&self, xy: [f64; 2]) -> Result<[f64; 2]> {
        self.check_near(&xy)?;
        let step = |x: &Vector2<f64>, target: &Vector2<f64>| {
            let jet = self.jet([x[0], x[1], 0.0], Order::First);
            let residual = Vector2::new(jet.position[0], jet.position[1]) - target;
            let jacobian = Matrix2::from_fn(|r, c| jet.jacobian[r][c]);
            (residual.norm(), jacobian.try_inverse().map(|inverse| inverse * residual))
        };
        let value = |x: &Vector2<f64>| {
            let p = self.position([x[0], x[1], 0.0]);
            Vector2::new(p[0], p[1])
        };
        let found = solve(Vector2::from(xy), Vector2::from(xy), value, step);
        self.checked(found.map(|x| x.into()), &xy)
    }

    /// Rejects points that are further from the box than its longest edge.
    fn check_near<const D: usize>(&self, p: &[f64; D]) -> Result<()> {
        let (origin, size) = (self.origin(), self.size());
        let reach = size.iter().fold(0.0, |a: f64, b| a.max(*b));
        let near = |d: usize| (origin[d] - reach..=origin[d] + size[d] + reach).contains(&p[d]);
        if (0..D).all(near) {
            return Ok(());
        }
        Err(Error::input(format!(
            "the point {p:?} m is far outside the warp map, which covers x {:.2} … {:.2}, y {:.2} … {:.2} m; stay on the terrain or enlarge it",
            origin[0],
            origin[0] + size[0],
            origin[1],
            origin[1] + size[1]
        )))
    }

    /// Rejects a solution that is missing or far from the box.
    fn checked<const D: usize>(&self, found: Option<[f64; D]>, p: &[f64; D]) -> Result<[f64; D]> {
        let x = found.ok_or_else(|| {
            Error::input(format!(
                "no point of warped space was found that maps to {p:?} m; the warp map is folded there or does not cover it (see the map's report)"
            ))
        })?;
        self.check_near(&x)?;
        Ok(x)
    }
}

/// Newton's method from the guess; where it fails, by continuation along the straight line from the guess's image to the target.
fn solve<V: Point>(
    guess: V,
    target: V,
    value: impl Fn(&V) -> V,
    step: impl Fn(&V, &V) -> (f64, Option<V>),
) -> Option<V> {
    if let Some(x) = newton(guess, &target, &step) {
        return Some(x);
    }
    let start = value(&guess);
    CONTINUATION_STEPS.into_iter().find_map(|steps| {
        let mut x = guess;
        for i in 1..=steps {
            let a = i as f64 / steps as f64;
            x = newton(x, &(start * (1.0 - a) + target * a), &step)?;
        }
        Some(x)
    })
}

/// Damped Newton method: each step is halved until the residual decreases.
fn newton<V: Point>(mut x: V, target: &V, step: &impl Fn(&V, &V) -> (f64, Option<V>)) -> Option<V> {
    let (mut residual, mut direction) = step(&x, target);
    for _ in 0..MAX_ITERATIONS {
        if residual < TOLERANCE {
            return Some(x);
        }
        let full_step = direction?;
        let mut scale = 1.0;
        loop {
            let next = x - full_step * scale;
            let (next_residual, next_direction) = step(&next, target);
            if next_residual < residual {
                (x, residual, direction) = (next, next_residual, next_direction);
                break;
            }
            scale *= 0.5;
            if scale < LEAST_SCALE {
                return (residual < STALLED_TOLERANCE).then_some(x);
            }
        }
    }
    None
}

/// A vector in two or three dimensions.
trait Point:
    Copy + std::ops::Sub<Output = Self> + std::ops::Add<Output = Self> + std::ops::Mul<f64, Output = Self>
{
}
impl<T: Copy + std::ops::Sub<Output = T> + std::ops::Add<Output = T> + std::ops::Mul<f64, Output = T>> Point
    for T
{
}
