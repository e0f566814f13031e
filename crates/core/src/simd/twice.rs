//! Two numbers, or two vectors of them, as one.

use std::ops::{Add, Mul, Neg, Sub};

use pulp::Simd;

use super::{Fetch, Number};

/// Two at once: while one waits for itself, the other is worked on.
#[derive(Debug, Clone, Copy)]
pub struct Twice<N>(N, N);

impl<N: Number> Add for Twice<N> {
    type Output = Self;

    #[inline(always)]
    fn add(self, other: Self) -> Self {
        Twice(self.0 + other.0, self.1 + other.1)
    }
}

impl<N: Number> Sub for Twice<N> {
    type Output = Self;

    #[inline(always)]
    fn sub(self, other: Self) -> Self {
        Twice(self.0 - other.0, self.1 - other.1)
    }
}

impl<N: Number> Mul for Twice<N> {
    type Output = Self;

    #[inline(always)]
    fn mul(self, other: Self) -> Self {
        Twice(self.0 * other.0, self.1 * other.1)
    }
}

impl<N: Number> Neg for Twice<N> {
    type Output = Self;

    #[inline(always)]
    fn neg(self) -> Self {
        Twice(-self.0, -self.1)
    }
}

impl<N: Number> Number for Twice<N> {
    type Mask = (N::Mask, N::Mask);

    #[inline(always)]
    fn constant(self, value: f64) -> Self {
        Twice(self.0.constant(value), self.1.constant(value))
    }

    #[inline(always)]
    fn mul_add(self, factor: Self, addend: Self) -> Self {
        Twice(self.0.mul_add(factor.0, addend.0), self.1.mul_add(factor.1, addend.1))
    }

    #[inline(always)]
    fn abs(self) -> Self {
        Twice(self.0.abs(), self.1.abs())
    }

    #[inline(always)]
    fn min(self, other: Self) -> Self {
        Twice(self.0.min(other.0), self.1.min(other.1))
    }

    #[inline(always)]
    fn max(self, other: Self) -> Self {
        Twice(self.0.max(other.0), self.1.max(other.1))
    }

    #[inline(always)]
    fn less(self, other: Self) -> Self::Mask {
        (self.0.less(other.0), self.1.less(other.1))
    }

    #[inline(always)]
    fn at_most(self, other: Self) -> Self::Mask {
        (self.0.at_most(other.0), self.1.at_most(other.1))
    }

    #[inline(always)]
    fn select(self, mask: Self::Mask, other: Self) -> Self {
        Twice(self.0.select(mask.0, other.0), self.1.select(mask.1, other.1))
    }

    #[inline(always)]
    fn exceeds(self, limit: f64) -> bool {
        self.0.exceeds(limit) | self.1.exceeds(limit)
    }

    #[inline(always)]
    fn times_power_of_two(self, integer: Self) -> Self {
        Twice(self.0.times_power_of_two(integer.0), self.1.times_power_of_two(integer.1))
    }
}

impl<S: Simd, N: Fetch<S>> Fetch<S> for Twice<N> {
    const LANES: usize = 2 * N::LANES;

    #[inline(always)]
    fn fetch<const L: usize>(simd: S, row: &[f64; L], place: usize) -> Self {
        Twice(N::fetch(simd, row, 2 * place), N::fetch(simd, row, 2 * place + 1))
    }

    #[inline(always)]
    fn put<const L: usize>(self, row: &mut [f64; L], place: usize) {
        self.0.put(row, 2 * place);
        self.1.put(row, 2 * place + 1);
    }
}
