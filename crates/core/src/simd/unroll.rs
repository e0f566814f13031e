//! Two-fold unrolling: two scalars or two vectors behind one [`SimdReal`].

use std::ops::{Add, Div, Mul, Neg, Sub};

use pulp::Simd;

use super::real::SimdReal;
use super::vector::SimdLoad;

/// Pair of independent values; interleaving their operations hides instruction latency.
#[derive(Debug, Clone, Copy)]
pub struct Unroll2<N>(N, N);

macro_rules! operators {
    ($($trait:ident $method:ident),*) => {$(
        impl<N: SimdReal> $trait for Unroll2<N> {
            type Output = Self;

            #[inline(always)]
            fn $method(self, other: Self) -> Self {
                Unroll2(self.0.$method(other.0), self.1.$method(other.1))
            }
        }
    )*};
}

operators!(Add add, Sub sub, Mul mul, Div div);

impl<N: SimdReal> Neg for Unroll2<N> {
    type Output = Self;

    #[inline(always)]
    fn neg(self) -> Self {
        Unroll2(-self.0, -self.1)
    }
}

impl<N: SimdReal> SimdReal for Unroll2<N> {
    type Mask = (N::Mask, N::Mask);

    #[inline(always)]
    fn splat(self, value: f64) -> Self {
        Unroll2(self.0.splat(value), self.1.splat(value))
    }

    #[inline(always)]
    fn mul_add(self, factor: Self, addend: Self) -> Self {
        Unroll2(self.0.mul_add(factor.0, addend.0), self.1.mul_add(factor.1, addend.1))
    }

    #[inline(always)]
    fn abs(self) -> Self {
        Unroll2(self.0.abs(), self.1.abs())
    }

    #[inline(always)]
    fn sqrt(self) -> Self {
        Unroll2(self.0.sqrt(), self.1.sqrt())
    }

    #[inline(always)]
    fn min(self, other: Self) -> Self {
        Unroll2(self.0.min(other.0), self.1.min(other.1))
    }

    #[inline(always)]
    fn max(self, other: Self) -> Self {
        Unroll2(self.0.max(other.0), self.1.max(other.1))
    }

    #[inline(always)]
    fn simd_lt(self, other: Self) -> Self::Mask {
        (self.0.simd_lt(other.0), self.1.simd_lt(other.1))
    }

    #[inline(always)]
    fn simd_le(self, other: Self) -> Self::Mask {
        (self.0.simd_le(other.0), self.1.simd_le(other.1))
    }

    #[inline(always)]
    fn select(self, mask: Self::Mask, other: Self) -> Self {
        Unroll2(self.0.select(mask.0, other.0), self.1.select(mask.1, other.1))
    }

    #[inline(always)]
    fn any_gt(self, limit: f64) -> bool {
        self.0.any_gt(limit) | self.1.any_gt(limit)
    }

    #[inline(always)]
    fn times_power_of_two(self, integer: Self) -> Self {
        Unroll2(self.0.times_power_of_two(integer.0), self.1.times_power_of_two(integer.1))
    }
}

impl<S: Simd, N: SimdLoad<S>> SimdLoad<S> for Unroll2<N> {
    const LANES: usize = 2 * N::LANES;

    #[inline(always)]
    fn load<const L: usize>(simd: S, row: &[f64; L], index: usize) -> Self {
        Unroll2(N::load(simd, row, 2 * index), N::load(simd, row, 2 * index + 1))
    }

    #[inline(always)]
    fn store<const L: usize>(self, row: &mut [f64; L], index: usize) {
        self.0.store(row, 2 * index);
        self.1.store(row, 2 * index + 1);
    }
}
