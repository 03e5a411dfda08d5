//! Numbers with first and second derivatives in three variables (forward automatic differentiation).

use std::ops::{Add, Mul, Neg, Sub};

use nalgebra::{Matrix3, Vector3};

/// The number type of the kinematics: [`f64`] for values alone, [`Jet`] for values with derivatives.
pub trait Scalar:
    Copy
    + Add<Output = Self>
    + Sub<Output = Self>
    + Mul<Output = Self>
    + Neg<Output = Self>
    + Add<f64, Output = Self>
    + Mul<f64, Output = Self>
{
    /// √x for x > 0.
    fn sqrt(self) -> Self;
    /// 1/x for x ≠ 0.
    fn recip(self) -> Self;
    /// The polar angle of the point (x, self), which must not be the origin.
    fn atan2(self, x: Self) -> Self;
    /// Its sine and cosine.
    fn sin_cos(self) -> [Self; 2];
    /// It without its derivatives.
    fn value(self) -> f64;
}

impl Scalar for f64 {
    fn sqrt(self) -> Self {
        self.sqrt()
    }

    fn recip(self) -> Self {
        self.recip()
    }

    fn atan2(self, x: Self) -> Self {
        self.atan2(x)
    }

    fn sin_cos(self) -> [Self; 2] {
        self.sin_cos().into()
    }

    fn value(self) -> f64 {
        self
    }
}

/// A value with its gradient and Hessian.
#[derive(Clone, Copy, Debug)]
pub struct Jet {
    /// f.
    pub value: f64,
    /// ∇f.
    pub first: Vector3<f64>,
    /// ∇²f.
    pub second: Matrix3<f64>,
}

impl Jet {
    /// The coordinates of a point as functions of the point.
    pub fn variables(point: &Vector3<f64>) -> [Self; 3] {
        std::array::from_fn(|d| {
            let mut first = Vector3::zeros();
            first[d] = 1.0;
            Self { value: point[d], first, second: Matrix3::zeros() }
        })
    }

    /// g(f), given the value of g and its first and second derivatives, g1 and g2, at f.
    fn chain(self, value: f64, g1: f64, g2: f64) -> Self {
        let first = self.first * g1;
        Self { value, first, second: self.second * g1 + self.first * self.first.transpose() * g2 }
    }
}

impl Scalar for Jet {
    fn sqrt(self) -> Self {
        let root = self.value.sqrt();
        self.chain(root, 0.5 / root, -0.25 / (root * self.value))
    }

    fn recip(self) -> Self {
        let inverse = 1.0 / self.value;
        self.chain(inverse, -inverse * inverse, 2.0 * inverse * inverse * inverse)
    }

    fn atan2(self, x: Self) -> Self {
        let y = self;
        let square = x.value * x.value + y.value * y.value;
        // ∇θ = (x ∇y − y ∇x)/s and its derivative, s = x² + y².
        let turn = y.first * x.value - x.first * y.value;
        let growth = (x.first * x.value + y.first * y.value) * (2.0 / square);
        let bent = y.second * x.value - x.second * y.value;
        let mixed = y.first * x.first.transpose() - x.first * y.first.transpose();
        Self {
            value: y.value.atan2(x.value),
            first: turn / square,
            second: (bent + mixed - turn * growth.transpose()) / square,
        }
    }

    fn sin_cos(self) -> [Self; 2] {
        let (sin, cos) = self.value.sin_cos();
        [self.chain(sin, cos, -sin), self.chain(cos, -sin, -cos)]
    }

    fn value(self) -> f64 {
        self.value
    }
}

impl Add for Jet {
    type Output = Self;

    fn add(self, other: Self) -> Self {
        Self {
            value: self.value + other.value,
            first: self.first + other.first,
            second: self.second + other.second,
        }
    }
}

impl Sub for Jet {
    type Output = Self;

    fn sub(self, other: Self) -> Self {
        self + -other
    }
}

impl Mul for Jet {
    type Output = Self;

    fn mul(self, other: Self) -> Self {
        let mixed = self.first * other.first.transpose();
        Self {
            value: self.value * other.value,
            first: self.first * other.value + other.first * self.value,
            second: self.second * other.value + other.second * self.value + mixed + mixed.transpose(),
        }
    }
}

impl Neg for Jet {
    type Output = Self;

    fn neg(self) -> Self {
        self * -1.0
    }
}

impl Add<f64> for Jet {
    type Output = Self;

    fn add(self, other: f64) -> Self {
        Self { value: self.value + other, ..self }
    }
}

impl Mul<f64> for Jet {
    type Output = Self;

    fn mul(self, other: f64) -> Self {
        Self { value: self.value * other, first: self.first * other, second: self.second * other }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    /// A function that uses all operations.
    fn function<T: Scalar>([x, y, z]: [T; 3]) -> T {
        let [sin, cos] = (x * z + y).sin_cos();
        (x * y - z * 0.3 + 2.0).sqrt().atan2(y * z + 1.7) + (x * x + 0.5).recip() * -z + sin * cos * x
    }

    #[test]
    fn derivatives_match_differences() {
        let point = Vector3::new(0.4, -0.7, 0.9);
        let jet = function(Jet::variables(&point));
        assert!((jet.value - function([point.x, point.y, point.z])).abs() < 1e-15);
        let step = 1e-5;
        for d in 0..3 {
            let mut moved = [point, point];
            moved[0][d] += step;
            moved[1][d] -= step;
            let [up, down] = moved.map(|p| function(Jet::variables(&p)));
            assert!((jet.first[d] - (up.value - down.value) / (2.0 * step)).abs() < 1e-9);
            assert!((jet.second.column(d) - (up.first - down.first) / (2.0 * step)).norm() < 1e-8);
        }
        assert!((jet.second - jet.second.transpose()).norm() < 1e-15);
    }
}
