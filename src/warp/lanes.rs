//! Several numbers at once, so that the compiler vectorizes arithmetic on quadrature points.

use std::ops::{Add, AddAssign, Div, Mul, Sub};

use pulp::{Arch, NullaryFnOnce};

/// How many: one vector register of AVX, two of SSE2. (Loops are used below because, unlike array functions, they reliably vectorize.)
pub(super) const LANES: usize = 4;

/// Does `work` with the widest registers that this processor has. What it calls must be inlined to profit. The results are the
/// same on every processor, because the compiler neither fuses nor reorders arithmetic.
#[inline(always)]
pub(super) fn vectorized<W: NullaryFnOnce>(work: W) -> W::Output {
    Arch::new().dispatch(work)
}

/// One number for each of several points.
#[derive(Clone, Copy, Debug, PartialEq)]
pub(super) struct Lanes(pub [f64; LANES]);

impl Lanes {
    pub const ZERO: Lanes = Lanes([0.0; LANES]);

    /// The same number for all points.
    #[inline(always)]
    pub fn splat(value: f64) -> Lanes {
        Lanes([value; LANES])
    }

    /// A function of each number.
    #[inline(always)]
    pub fn map(mut self, f: impl Fn(f64) -> f64) -> Lanes {
        for value in &mut self.0 {
            *value = f(*value);
        }
        self
    }

    /// The sum over the points.
    #[inline(always)]
    pub fn sum(self) -> f64 {
        self.0.iter().sum()
    }
}

macro_rules! elementwise {
    ($trait:ident, $method:ident, $op:tt) => {
        impl $trait for Lanes {
            type Output = Lanes;
            #[inline(always)]
            fn $method(mut self, other: Lanes) -> Lanes {
                for l in 0..LANES {
                    self.0[l] $op other.0[l];
                }
                self
            }
        }
    };
}
elementwise!(Add, add, +=);
elementwise!(Sub, sub, -=);
elementwise!(Mul, mul, *=);
elementwise!(Div, div, /=);

impl Mul<Lanes> for f64 {
    type Output = Lanes;
    #[inline(always)]
    fn mul(self, lanes: Lanes) -> Lanes {
        lanes.map(|v| self * v)
    }
}

impl AddAssign for Lanes {
    #[inline(always)]
    fn add_assign(&mut self, other: Lanes) {
        *self = *self + other;
    }
}
