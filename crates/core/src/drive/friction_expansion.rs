//! Expansion of the friction law near one speed: removes its exponentials from the dependency chain between ticks.
//!
//! The speed changes little from tick to tick. Exponentials known at one speed give those near it by a short
//! polynomial, and both exponentials of the law give one polynomial in δ:
//!
//! ```text
//! e^{b(v+δ)} = e^{bv} e^{bδ}
//! ```

use super::elementary::{Exponential, MAX_EXPONENT};
use crate::simd::{SimdReal, clamp_abs, soa_struct};

/// Largest |x| for which [`EXP_COEFFICIENTS`] approximates e^x.
const RANGE: f64 = 0.125;
/// Distance of the center of a new expansion from the speed that left the previous one, in units of [`RANGE`], in the
/// direction of the change.
const CENTER_OFFSET: f64 = 0.9;
/// Largest speed times rate scale: distances are accurate to 10⁻⁷ of [`RANGE`].
const MAX_SCALED_SPEED: f64 = 1e8;

/// Minimax polynomial of degree 7 of e^x for |x| ≤ [`RANGE`]; largest relative error 1.2e-14.
const EXP_COEFFICIENTS: [f64; 8] = [
    0.999_999_999_999_988_6,
    1.000_000_000_000_070_4,
    0.500_000_000_023_568_7,
    0.166_666_666_632_538_12,
    0.041_666_659_111_171_63,
    0.008_333_337_199_569_52,
    0.001_389_663_452_980_294_5,
    0.000_198_326_613_149_230_14,
];

soa_struct! {
    /// Sum of two exponentials of speed, with a common scale of their rates.
    #[derive(Debug, Clone, Copy, PartialEq)]
    pub(super) struct SumOfExponentials {
        first: Exponential<N>,
        second: Exponential<N>,
        /// Larger |rate| of the two, per rad/s.
        scale: N,
        /// Rates relative to the scale, within ±1, so that their powers do not overflow.
        first_share: N,
        second_share: N,
        /// Distance from a speed that leaves an expansion to the center of the next one, rad/s.
        center_offset: N,
    }
}

soa_struct! {
    /// Polynomial of the sum of exponentials in the scaled distance from one speed.
    #[derive(Debug, Clone, Copy, Default, PartialEq)]
    pub(crate) struct FrictionExpansion {
        /// Speed of expansion times the rate scale.
        center: N,
        c0: N,
        c1: N,
        c2: N,
        c3: N,
        c4: N,
        c5: N,
        c6: N,
        c7: N,
    }
}

impl SumOfExponentials {
    pub fn new(first: Exponential, second: Exponential) -> Self {
        let scale = first.rate.abs().max(second.rate.abs());
        let over_scale = |value: f64| if scale > 0.0 { value / scale } else { 0.0 };
        let (first_share, second_share) = (over_scale(first.rate), over_scale(second.rate));
        SumOfExponentials {
            first,
            second,
            scale,
            first_share,
            second_share,
            center_offset: over_scale(CENTER_OFFSET * RANGE),
        }
    }

    /// Returns the largest speed of expansion: beyond it a rising exponential would overflow, or distances would lose
    /// their accuracy.
    pub fn max_expanded_speed(&self) -> f64 {
        let rise = self.first.rate.max(self.second.rate).max(0.0);
        f64::min(MAX_EXPONENT / rise, MAX_SCALED_SPEED / self.scale).min(f64::MAX)
    }

    /// Returns the speed from which on the sum is constant: the end of the last expansion.
    pub fn constant_from_speed(&self) -> f64 {
        (self.max_expanded_speed() + RANGE / self.scale).min(f64::MAX)
    }
}

impl<N: SimdReal> SumOfExponentials<N> {
    /// Returns the sum at `v`, from both exponentials.
    #[inline(always)]
    pub fn at(&self, v: N) -> N {
        self.first.at(v) + self.second.at(v)
    }

    /// Expands the sum near `v`.
    #[inline(always)]
    pub fn expand(&self, v: N) -> FrictionExpansion<N> {
        let (mut first, mut second) = (self.first.at(v), self.second.at(v));
        let mut c = [first; EXP_COEFFICIENTS.len()];
        for (c, power) in c.iter_mut().zip(EXP_COEFFICIENTS) {
            *c = v.splat(power) * (first + second);
            (first, second) = (first * self.first_share, second * self.second_share);
        }
        let [c0, c1, c2, c3, c4, c5, c6, c7] = c;
        FrictionExpansion { center: v * self.scale, c0, c1, c2, c3, c4, c5, c6, c7 }
    }

    /// Returns the center of the next expansion for a `v` that is out of range at scaled `distance`.
    #[inline(always)]
    pub fn next_center(&self, v: N, distance: N) -> N {
        let step = self.center_offset.select(distance.splat(0.0).simd_lt(distance), -self.center_offset);
        v + step
    }

    /// Returns the scaled distance of `v` from the center of an expansion.
    #[inline(always)]
    pub fn distance(&self, expansion: &FrictionExpansion<N>, v: N) -> N {
        v.mul_add(self.scale, -expansion.center)
    }
}

impl<N: SimdReal> FrictionExpansion<N> {
    /// Returns true if the distance of any lane is out of range.
    #[inline(always)]
    pub fn any_out_of_range(distance: N) -> bool {
        distance.abs().any_gt(RANGE)
    }

    /// Limits the distance to the range; the sum is constant beyond the last expansion.
    #[inline(always)]
    pub fn clamp_to_range(distance: N) -> N {
        clamp_abs(distance, distance.splat(RANGE))
    }

    /// Returns the mask of the lanes whose distance is out of range.
    #[inline(always)]
    pub fn out_of_range(distance: N) -> N::Mask {
        distance.splat(RANGE).simd_lt(distance.abs())
    }

    /// Returns the sum at a scaled distance.
    #[inline(always)]
    pub fn at(&self, x: N) -> N {
        let x2 = x * x;
        let low = x.mul_add(self.c3, self.c2).mul_add(x2, x.mul_add(self.c1, self.c0));
        let high = x.mul_add(self.c7, self.c6).mul_add(x2, x.mul_add(self.c5, self.c4));
        high.mul_add(x2 * x2, low)
    }
}
