//! SIMD vector of f64 with the width of the selected instruction set.

use std::ops::{Add, Div, Mul, Neg, Sub};

use pulp::Simd;

use super::real::SimdReal;

/// Lanes of the widest supported vector.
const MAX_LANES: usize = 8;

/// SIMD register of f64. The alignment keeps a value within one cache line.
#[derive(Debug, Clone, Copy)]
#[repr(align(64))]
pub struct Vector<S: Simd> {
    simd: S,
    value: S::f64s,
}

/// Value that is loaded from and stored to arrays with one element per axis.
pub trait SimdLoad<S: Simd>: SimdReal {
    /// Number of f64 lanes of a value.
    const LANES: usize;

    /// Loads the `LANES` elements that start at element `index · LANES` of `row`; zeros beyond its end.
    fn load<const L: usize>(simd: S, row: &[f64; L], index: usize) -> Self;

    /// Stores into the `LANES` elements that start at element `index · LANES` of `row`; does nothing beyond its
    /// end.
    fn store<const L: usize>(self, row: &mut [f64; L], index: usize);
}

impl<S: Simd> SimdLoad<S> for Vector<S> {
    const LANES: usize = S::F64_LANES;

    #[inline(always)]
    fn load<const L: usize>(simd: S, row: &[f64; L], index: usize) -> Self {
        let (vectors, _) = S::as_simd_f64s(row);
        Vector { simd, value: vectors.get(index).copied().unwrap_or(simd.splat_f64s(0.0)) }
    }

    #[inline(always)]
    fn store<const L: usize>(self, row: &mut [f64; L], index: usize) {
        let (vectors, _) = S::as_mut_simd_f64s(row);
        if let Some(vector) = vectors.get_mut(index) {
            *vector = self.value;
        }
    }
}

impl<S: Simd> Vector<S> {
    #[inline(always)]
    fn with(self, value: S::f64s) -> Self {
        Vector { value, ..self }
    }
}

macro_rules! operators {
    ($($trait:ident $method:ident $lanes:ident),*) => {$(
        impl<S: Simd> $trait for Vector<S> {
            type Output = Self;

            #[inline(always)]
            fn $method(self, other: Self) -> Self {
                self.with(self.simd.$lanes(self.value, other.value))
            }
        }
    )*};
}

operators!(Add add add_f64s, Sub sub sub_f64s, Mul mul mul_f64s, Div div div_f64s);

impl<S: Simd> Neg for Vector<S> {
    type Output = Self;

    #[inline(always)]
    fn neg(self) -> Self {
        self.with(self.simd.neg_f64s(self.value))
    }
}

impl<S: Simd> SimdReal for Vector<S> {
    type Mask = S::m64s;

    #[inline(always)]
    fn splat(self, value: f64) -> Self {
        self.with(self.simd.splat_f64s(value))
    }

    #[inline(always)]
    fn mul_add(self, factor: Self, addend: Self) -> Self {
        self.with(self.simd.mul_add_f64s(self.value, factor.value, addend.value))
    }

    #[inline(always)]
    fn abs(self) -> Self {
        self.with(self.simd.abs_f64s(self.value))
    }

    #[inline(always)]
    fn sqrt(self) -> Self {
        self.with(self.simd.sqrt_f64s(self.value))
    }

    #[inline(always)]
    fn min(self, other: Self) -> Self {
        // x86 vectors follow these NaN and zero rules; the scalar fallback compares, since `f64::min` differs.
        if S::IS_SCALAR {
            return self.select(self.simd_lt(other), other);
        }
        self.with(self.simd.min_f64s(self.value, other.value))
    }

    #[inline(always)]
    fn max(self, other: Self) -> Self {
        if S::IS_SCALAR {
            return self.select(other.simd_lt(self), other);
        }
        self.with(self.simd.max_f64s(self.value, other.value))
    }

    #[inline(always)]
    fn simd_lt(self, other: Self) -> S::m64s {
        self.simd.less_than_f64s(self.value, other.value)
    }

    #[inline(always)]
    fn simd_le(self, other: Self) -> Self::Mask {
        self.simd.less_than_or_equal_f64s(self.value, other.value)
    }

    #[inline(always)]
    fn select(self, mask: S::m64s, other: Self) -> Self {
        self.with(self.simd.select_f64s(mask, self.value, other.value))
    }

    #[inline(always)]
    fn any_gt(self, limit: f64) -> bool {
        let above = self.splat(limit).simd_lt(self);
        self.simd.first_true_m64s(above) < Self::LANES
    }

    #[inline(always)]
    fn times_power_of_two(self, integer: Self) -> Self {
        let (mut powers, mut integers) = ([0.0; MAX_LANES], [0.0; MAX_LANES]);
        self.store(&mut powers, 0);
        integer.store(&mut integers, 0);
        for (power, integer) in powers.iter_mut().zip(integers) {
            *power = power.times_power_of_two(integer);
        }
        Self::load(self.simd, &powers, 0)
    }
}
