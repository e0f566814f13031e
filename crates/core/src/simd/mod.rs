//! SIMD arithmetic over axes: several axes per instruction, one axis per lane.
//!
//! The code of a current cycle is written once, generic over [`SimdReal`]: an `f64` for one axis, or a [`Vector`]
//! with one lane per axis. The macro `soa_struct` declares structure-of-arrays types: `Motor` holds one axis,
//! `Motor<[f64; L]>` holds `L` axes in memory, `Motor<Vector<S>>` holds the lanes of one SIMD register. Each
//! operation gives bit-identical results in all three.

mod aligned;
mod dispatch;
mod soa;
mod unroll;
mod vector;

use std::fmt::Debug;
use std::ops::{Add, Div, Mul, Neg, Sub};

pub use aligned::{AlignedBuffer, LANES};
pub use dispatch::{SliceOperation, vectorize};
pub(crate) use soa::soa_struct;
pub use unroll::Unroll2;
pub use vector::{SimdLoad, Vector};

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

#[cfg(test)]
mod tests {
    use pulp::{Arch, Simd, WithSimd};

    use super::*;

    /// Values with special rules in comparison, minimum and maximum.
    const SPECIAL: [f64; 8] = [0.0, -0.0, 1.5, -2.5, f64::NAN, f64::INFINITY, f64::NEG_INFINITY, 1e-320];

    fn all_operations<N: SimdReal>(a: N, b: N) -> [N; 11] {
        let (below, not_above) = (a.select(a.simd_lt(b), b + b), a.select(a.simd_le(b), b + b));
        let product = a.mul_add(b, -a);
        let power = (a + a.splat(3.0)).times_power_of_two(a.splat(6_755_399_441_055_734.0));
        [a + b, a - b, a * b, product, a.abs(), a.min(b), a.max(b), below, not_above, clamp_abs(a, b), power]
    }

    struct CompareWithScalar;

    impl WithSimd for CompareWithScalar {
        type Output = ();

        fn with_simd<S: Simd>(self, simd: S) {
            for turn in 0..SPECIAL.len() {
                let mut turned = SPECIAL;
                turned.rotate_left(turn);
                for index in 0..SPECIAL.len() / Vector::<S>::LANES {
                    let (a, b) = (Vector::load(simd, &SPECIAL, index), Vector::load(simd, &turned, index));
                    for (k, found) in all_operations(a, b).into_iter().enumerate() {
                        let mut row = [0.0; 8];
                        found.store(&mut row, index);
                        for lane in (index * Vector::<S>::LANES..).take(Vector::<S>::LANES) {
                            let single = all_operations(SPECIAL[lane], turned[lane])[k];
                            let same = row[lane].to_bits() == single.to_bits()
                                || row[lane].is_nan() && single.is_nan();
                            assert!(same, "{k}: {} and not {single}", row[lane]);
                        }
                    }
                    let above =
                        (0..Vector::<S>::LANES).any(|k| SPECIAL[index * Vector::<S>::LANES + k] > 1.0);
                    assert_eq!(a.any_gt(1.0), above);
                }
            }
        }
    }

    #[test]
    fn vector_operations_are_bit_identical_to_scalar_operations() {
        Arch::new().dispatch(CompareWithScalar);
        // A processor with 8-lane vectors also has 4-lane vectors.
        #[cfg(target_arch = "x86_64")]
        if let Some(four) = pulp::x86::V3::try_new() {
            Simd::vectorize(four, CompareWithScalar);
        }
        Arch::Scalar.dispatch(CompareWithScalar);
    }
}
