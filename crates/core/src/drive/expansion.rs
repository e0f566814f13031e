//! A friction law near one speed: what takes its exponentials out of the chain from one tick to the next.
//!
//! From tick to tick a speed changes little. Exponentials that are known at one speed give those near it by a
//! short polynomial, `e^{b(v+δ)} = e^{bv} e^{bδ}`, and both exponentials of the law make one polynomial in δ.

use super::elementary::{Exponential, MAX_EXPONENT};
use crate::simd::{Number, limited, numbers};

/// Largest |x| for which [`POWERS`] is e^x.
const REACH: f64 = 0.125;
/// Where the middle of a new expansion is, in reaches from the speed that has left the one before: that speed
/// is likely to go on in its direction.
const AHEAD: f64 = 0.9;
/// Largest speed times scale: distances in it are known to 10⁻⁷ of what is left of the reach.
const FURTHEST: f64 = 1e8;

/// The polynomial of degree 7 whose largest relative error from e^x is smallest for |x| ≤ [`REACH`]: 1.2e-14.
const POWERS: [f64; 8] = [
    0.999_999_999_999_988_6,
    1.000_000_000_000_070_4,
    0.500_000_000_023_568_7,
    0.166_666_666_632_538_12,
    0.041_666_659_111_171_63,
    0.008_333_337_199_569_52,
    0.001_389_663_452_980_294_5,
    0.000_198_326_613_149_230_14,
];

numbers! {
    /// The sum of two exponentials of speed, in what both have in common.
    #[derive(Debug, Clone, Copy, PartialEq)]
    pub(super) struct Pair {
        first: Exponential<N>,
        second: Exponential<N>,
        /// The larger of the two |rates|, per rad/s.
        scale: N,
        /// The rates, in shares of that: within ±1, so that no power of them overflows.
        first_share: N,
        second_share: N,
        /// What lies between a speed that leaves an expansion and the middle of the next, rad/s.
        ahead: N,
    }
}

numbers! {
    /// The sum near one speed: a polynomial in the distance from it.
    #[derive(Debug, Clone, Copy, Default, PartialEq)]
    pub(crate) struct Expansion {
        /// That speed times the scale.
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

impl Pair {
    pub fn new(first: Exponential, second: Exponential) -> Self {
        let scale = first.rate.abs().max(second.rate.abs());
        let over_scale = |value: f64| if scale > 0.0 { value / scale } else { 0.0 };
        let (first_share, second_share) = (over_scale(first.rate), over_scale(second.rate));
        Pair { first, second, scale, first_share, second_share, ahead: over_scale(AHEAD * REACH) }
    }

    /// The largest speed at which the sum is expanded: beyond, a rising exponential would leave the range of numbers,
    /// or distances could not be told from one another.
    pub fn capped_from(&self) -> f64 {
        let rise = self.first.rate.max(self.second.rate).max(0.0);
        f64::min(MAX_EXPONENT / rise, FURTHEST / self.scale).min(f64::MAX)
    }

    /// The speed from which on the sum stays as it is: the end of that expansion.
    pub fn level_from(&self) -> f64 {
        (self.capped_from() + REACH / self.scale).min(f64::MAX)
    }
}

impl<N: Number> Pair<N> {
    /// The sum at `v`, by both exponentials.
    #[inline(always)]
    pub fn at(&self, v: N) -> N {
        self.first.at(v) + self.second.at(v)
    }

    /// The sum near `v`.
    #[inline(always)]
    pub fn near(&self, v: N) -> Expansion<N> {
        let (mut first, mut second) = (self.first.at(v), self.second.at(v));
        let mut c = [first; POWERS.len()];
        for (c, power) in c.iter_mut().zip(POWERS) {
            *c = v.constant(power) * (first + second);
            (first, second) = (first * self.first_share, second * self.second_share);
        }
        let [c0, c1, c2, c3, c4, c5, c6, c7] = c;
        Expansion { center: v * self.scale, c0, c1, c2, c3, c4, c5, c6, c7 }
    }

    /// Where to expand next when `v` has left an expansion, at a `distance` from its middle.
    #[inline(always)]
    pub fn ahead(&self, v: N, distance: N) -> N {
        let step = self.ahead.select(distance.constant(0.0).less(distance), -self.ahead);
        v + step
    }

    /// How far `v` is from the middle of an expansion.
    #[inline(always)]
    pub fn distance(&self, near: &Expansion<N>, v: N) -> N {
        v.mul_add(self.scale, -near.center)
    }
}

impl<N: Number> Expansion<N> {
    /// Whether one of them does not hold at its distance.
    #[inline(always)]
    pub fn is_left(distance: N) -> bool {
        distance.abs().exceeds(REACH)
    }

    /// A distance that one of them does hold at: there the sum stays as it is.
    #[inline(always)]
    pub fn within(distance: N) -> N {
        limited(distance, distance.constant(REACH))
    }

    /// Where one of them does not hold at its distance.
    #[inline(always)]
    pub fn left(distance: N) -> N::Mask {
        distance.constant(REACH).less(distance.abs())
    }

    /// The sum at a distance.
    #[inline(always)]
    pub fn at(&self, x: N) -> N {
        let x2 = x * x;
        let low = x.mul_add(self.c3, self.c2).mul_add(x2, x.mul_add(self.c1, self.c0));
        let high = x.mul_add(self.c7, self.c6).mul_add(x2, x.mul_add(self.c5, self.c4));
        high.mul_add(x2 * x2, low)
    }
}
