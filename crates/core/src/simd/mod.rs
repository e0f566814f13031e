//! Numbers of several axes side by side, so that one instruction acts on many of them.
//!
//! What is reckoned in every tick is written once, over a [`Number`]: an `f64`, or a [`Vector`] that holds
//! those of several axes. A structure of numbers is declared by the macro `numbers`: `Motor` is that of one axis,
//! `Motor<[f64; L]>` are those of `L` axes as they stand in memory, `Motor<Vector<S>>` those of a few of them
//! as they are reckoned with. Each operation gives the same bits in all three.

mod numbers;
mod twice;
mod vector;

use std::fmt::Debug;
use std::ops::{Add, Mul, Neg, Sub};

pub(crate) use numbers::numbers;
pub use twice::Twice;
pub use vector::{Fetch, Vector};

/// What the recurrence of an axis is reckoned in.
pub trait Number:
    Copy + Debug + Add<Output = Self> + Sub<Output = Self> + Mul<Output = Self> + Neg<Output = Self>
{
    /// Where a comparison holds.
    type Mask: Copy;

    /// A constant.
    fn constant(self, value: f64) -> Self;

    /// `self · factor + addend`, rounded once.
    fn mul_add(self, factor: Self, addend: Self) -> Self;

    /// |self|.
    fn abs(self) -> Self;

    /// `self` where it is smaller, else `other`: also where one of the two is not a number.
    fn min(self, other: Self) -> Self;

    /// `self` where it is larger, else `other`: also where one of the two is not a number.
    fn max(self, other: Self) -> Self;

    /// Where `self` is smaller.
    fn less(self, other: Self) -> Self::Mask;

    /// Where `self` is smaller or equal.
    fn at_most(self, other: Self) -> Self::Mask;

    /// `self` where the mask holds, else `other`.
    fn select(self, mask: Self::Mask, other: Self) -> Self;

    /// Whether it is larger than `limit` anywhere.
    fn exceeds(self, limit: f64) -> bool;

    /// `self · 2^k`, where `integer` is 1.5·2⁵² + k: k stands in its lowest bits. The product must be a normal
    /// number.
    fn times_power_of_two(self, integer: Self) -> Self;
}

/// Bits of the fraction of an f64.
const FRACTION_BITS: u32 = 52;

impl Number for f64 {
    type Mask = bool;

    #[inline(always)]
    fn constant(self, value: f64) -> f64 {
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
    fn min(self, other: f64) -> f64 {
        if self < other { self } else { other }
    }

    #[inline(always)]
    fn max(self, other: f64) -> f64 {
        if self > other { self } else { other }
    }

    #[inline(always)]
    fn less(self, other: f64) -> bool {
        self < other
    }

    #[inline(always)]
    fn at_most(self, other: f64) -> bool {
        self <= other
    }

    #[inline(always)]
    fn select(self, mask: bool, other: f64) -> f64 {
        if mask { self } else { other }
    }

    #[inline(always)]
    fn exceeds(self, limit: f64) -> bool {
        self > limit
    }

    #[inline(always)]
    fn times_power_of_two(self, integer: f64) -> f64 {
        // k is added to the exponent.
        f64::from_bits(self.to_bits().wrapping_add(integer.to_bits() << FRACTION_BITS))
    }
}

/// `value` within ±`limit`; NaN stays what it is.
#[inline(always)]
pub fn limited<N: Number>(value: N, limit: N) -> N {
    (-limit).max(limit.min(value))
}

#[cfg(test)]
mod tests {
    use pulp::{Arch, Simd, WithSimd};

    use super::*;

    /// Values whose minimum, maximum and bounds have rules of their own.
    const ODD: [f64; 8] = [0.0, -0.0, 1.5, -2.5, f64::NAN, f64::INFINITY, f64::NEG_INFINITY, 1e-320];

    fn all<N: Number>(a: N, b: N) -> [N; 11] {
        let (chosen, kept) = (a.select(a.less(b), b + b), a.select(a.at_most(b), b + b));
        let product = a.mul_add(b, -a);
        let power = (a + a.constant(3.0)).times_power_of_two(a.constant(6_755_399_441_055_734.0));
        [a + b, a - b, a * b, product, a.abs(), a.min(b), a.max(b), chosen, kept, limited(a, b), power]
    }

    struct Everything;

    impl WithSimd for Everything {
        type Output = ();

        fn with_simd<S: Simd>(self, simd: S) {
            for turn in 0..ODD.len() {
                let mut turned = ODD;
                turned.rotate_left(turn);
                for place in 0..ODD.len() / Vector::<S>::LANES {
                    let (a, b) = (Vector::fetch(simd, &ODD, place), Vector::fetch(simd, &turned, place));
                    for (k, found) in all(a, b).into_iter().enumerate() {
                        let mut row = [0.0; 8];
                        found.put(&mut row, place);
                        for lane in (place * Vector::<S>::LANES..).take(Vector::<S>::LANES) {
                            let single = all(ODD[lane], turned[lane])[k];
                            let same = row[lane].to_bits() == single.to_bits()
                                || row[lane].is_nan() && single.is_nan();
                            assert!(same, "{k}: {} and not {single}", row[lane]);
                        }
                    }
                    let above = (0..Vector::<S>::LANES).any(|k| ODD[place * Vector::<S>::LANES + k] > 1.0);
                    assert_eq!(a.exceeds(1.0), above);
                }
            }
        }
    }

    #[test]
    fn vectors_reckon_as_single_numbers_do() {
        Arch::new().dispatch(Everything);
        // A processor that has vectors of eight has those of four, too.
        #[cfg(target_arch = "x86_64")]
        if let Some(four) = pulp::x86::V3::try_new() {
            Simd::vectorize(four, Everything);
        }
        Arch::Scalar.dispatch(Everything);
    }
}
