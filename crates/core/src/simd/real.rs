//! Real numbers of the drive model: one scalar, or the lanes of a vector.

use std::fmt::Debug;
use std::ops::{Add, Div, Mul, Neg, Sub};

/// Real number type of the drive model: scalar or SIMD vector.
pub trait SimdReal:
    Copy
    + Debug
    + Add<Output = Self>
    + Sub<Output = Self>
    + Mul<Output = Self>
    + Div<Output = Self>
    + Neg<Output = Self>
{
    /// Result of a comparison, per lane.
    type Mask: Copy;

    /// Returns `value` in all lanes. `self` only supplies the instruction set.
    fn splat(self, value: f64) -> Self;

    /// Returns `self · factor + addend` with one rounding.
    fn mul_add(self, factor: Self, addend: Self) -> Self;

    /// Returns the absolute value.
    fn abs(self) -> Self;

    /// Returns the square root.
    fn sqrt(self) -> Self;

    /// Returns `self` where it is smaller than `other`, else `other`, including where one of them is NaN.
    fn min(self, other: Self) -> Self;

    /// Returns `self` where it is larger than `other`, else `other`, including where one of them is NaN.
    fn max(self, other: Self) -> Self;

    /// Compares lanes: `self < other`.
    fn simd_lt(self, other: Self) -> Self::Mask;

    /// Compares lanes: `self ≤ other`.
    fn simd_le(self, other: Self) -> Self::Mask;

    /// Returns `self` where `mask` holds, else `other`.
    fn select(self, mask: Self::Mask, other: Self) -> Self;

    /// Returns true if any lane is larger than `limit`.
    fn any_gt(self, limit: f64) -> bool;

    /// Returns `self · 2^k` for `integer` = 1.5·2⁵² + k, which has k in its lowest bits. The product must be a
    /// normal number.
    fn times_power_of_two(self, integer: Self) -> Self;
}

/// Number of fraction bits of an f64.
const FRACTION_BITS: u32 = 52;

impl SimdReal for f64 {
    type Mask = bool;

    #[inline(always)]
    fn splat(self, value: f64) -> f64 {
        value
    }

    #[inline(always)]
    fn mul_add(self, factor: f64, addend: f64) -> f64 {
        f64::mul_add(self, factor, addend)
    }

    #[inline(always)]
    fn abs(self) -> f64 {
        f64::abs(self)
    }

    #[inline(always)]
    fn sqrt(self) -> f64 {
        f64::sqrt(self)
    }

    #[inline(always)]
    fn min(self, other: f64) -> f64 {
        if self < other { self } else { other }
    }

    #[inline(always)]
    fn max(self, other: f64) -> f64 {
        if self > other { self } else { other }
    }

    #[inline(always)]
    fn simd_lt(self, other: f64) -> bool {
        self < other
    }

    #[inline(always)]
    fn simd_le(self, other: f64) -> bool {
        self <= other
    }

    #[inline(always)]
    fn select(self, mask: bool, other: f64) -> f64 {
        if mask { self } else { other }
    }

    #[inline(always)]
    fn any_gt(self, limit: f64) -> bool {
        self > limit
    }

    #[inline(always)]
    fn times_power_of_two(self, integer: f64) -> f64 {
        // Adds k to the exponent field.
        f64::from_bits(self.to_bits().wrapping_add(integer.to_bits() << FRACTION_BITS))
    }
}

/// Clamps `value` to ±`limit`; NaN stays NaN.
#[inline(always)]
pub fn clamp_abs<N: SimdReal>(value: N, limit: N) -> N {
    (-limit).max(limit.min(value))
}
