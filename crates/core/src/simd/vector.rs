//! As many numbers as the processor reckons with at a time.

use std::ops::{Add, Mul, Neg, Sub};

use pulp::Simd;

use super::Number;

/// Numbers in the largest vector that there is.
const MAX_LANES: usize = 8;

/// As many numbers as a register of the processor holds; none of them lies across two lines of its cache.
#[derive(Debug, Clone, Copy)]
#[repr(align(64))]
pub struct Vector<S: Simd> {
    simd: S,
    value: S::f64s,
}

/// Numbers that stand side by side in memory.
pub trait Fetch<S: Simd>: Number {
    /// How many they are.
    const LANES: usize;

    /// Those at `place` of a row, counted in as many; zeros beyond its end.
    fn fetch<const L: usize>(simd: S, row: &[f64; L], place: usize) -> Self;

    /// Puts them there; nowhere beyond the end.
    fn put<const L: usize>(self, row: &mut [f64; L], place: usize);
}

impl<S: Simd> Fetch<S> for Vector<S> {
    const LANES: usize = S::F64_LANES;

    #[inline(always)]
    fn fetch<const L: usize>(simd: S, row: &[f64; L], place: usize) -> Self {
        let (vectors, _) = S::as_simd_f64s(row);
        Vector { simd, value: vectors.get(place).copied().unwrap_or(simd.splat_f64s(0.0)) }
    }

    #[inline(always)]
    fn put<const L: usize>(self, row: &mut [f64; L], place: usize) {
        let (vectors, _) = S::as_mut_simd_f64s(row);
        if let Some(vector) = vectors.get_mut(place) {
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

impl<S: Simd> Add for Vector<S> {
    type Output = Self;

    #[inline(always)]
    fn add(self, other: Self) -> Self {
        self.with(self.simd.add_f64s(self.value, other.value))
    }
}

impl<S: Simd> Sub for Vector<S> {
    type Output = Self;

    #[inline(always)]
    fn sub(self, other: Self) -> Self {
        self.with(self.simd.sub_f64s(self.value, other.value))
    }
}

impl<S: Simd> Mul for Vector<S> {
    type Output = Self;

    #[inline(always)]
    fn mul(self, other: Self) -> Self {
        self.with(self.simd.mul_f64s(self.value, other.value))
    }
}

impl<S: Simd> Neg for Vector<S> {
    type Output = Self;

    #[inline(always)]
    fn neg(self) -> Self {
        self.with(self.simd.neg_f64s(self.value))
    }
}

impl<S: Simd> Number for Vector<S> {
    type Mask = S::m64s;

    #[inline(always)]
    fn constant(self, value: f64) -> Self {
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
    fn min(self, other: Self) -> Self {
        // Vectors of x86 do just this; a single number is compared, since `f64::min` has other rules.
        if S::IS_SCALAR {
            return self.select(self.less(other), other);
        }
        self.with(self.simd.min_f64s(self.value, other.value))
    }

    #[inline(always)]
    fn max(self, other: Self) -> Self {
        if S::IS_SCALAR {
            return self.select(other.less(self), other);
        }
        self.with(self.simd.max_f64s(self.value, other.value))
    }

    #[inline(always)]
    fn less(self, other: Self) -> S::m64s {
        self.simd.less_than_f64s(self.value, other.value)
    }

    #[inline(always)]
    fn at_most(self, other: Self) -> Self::Mask {
        self.simd.less_than_or_equal_f64s(self.value, other.value)
    }

    #[inline(always)]
    fn select(self, mask: S::m64s, other: Self) -> Self {
        self.with(self.simd.select_f64s(mask, self.value, other.value))
    }

    #[inline(always)]
    fn exceeds(self, limit: f64) -> bool {
        let above = self.constant(limit).less(self);
        self.simd.first_true_m64s(above) < Self::LANES
    }

    #[inline(always)]
    fn times_power_of_two(self, integer: Self) -> Self {
        let (mut powers, mut integers) = ([0.0; MAX_LANES], [0.0; MAX_LANES]);
        self.put(&mut powers, 0);
        integer.put(&mut integers, 0);
        for (power, integer) in powers.iter_mut().zip(integers) {
            *power = power.times_power_of_two(integer);
        }
        Self::fetch(self.simd, &powers, 0)
    }
}
