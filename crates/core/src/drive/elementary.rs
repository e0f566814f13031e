//! Exponential and sine as branch-free polynomial approximations: vectorizable (SIMD) and bit-identical on every
//! processor.

use std::f64::consts::{FRAC_1_PI, LN_2, LOG2_E, PI};

use crate::simd::{SimdReal, clamp_abs, soa_struct};

/// 1.5·2⁵²: adding a number to it rounds the number to an integer, stored in the lowest bits of the sum.
const ROUNDING_CONSTANT: f64 = 6_755_399_441_055_744.0;

/// Largest exponent x of an [`Exponential`]: e^x times any allowed size is a normal number.
pub(super) const MAX_EXPONENT: f64 = 600.0;
/// Margin of the exponent for expansions whose center is beyond the present speed.
const EXPANSION_MARGIN: f64 = 1.0;
/// Size up to which an [`Exponential`] is set to 0, far below any torque or speed change that has an effect: smaller ones
/// would decay to subnormal numbers.
const NEGLIGIBLE_SIZE: f64 = 1e-40;

/// Largest |x| for which [`sine`] reduces the range, rad: beyond it the spacing of f64 is a fraction of a turn.
const MAX_ANGLE: f64 = 1e15;

/// Minimax polynomial of degree 9 of e^r for |r| ≤ ln 2/2; largest error 1.4e-14.
const EXP_COEFFICIENTS: [f64; 10] = [
    1.000_000_000_000_013_5,
    1.000_000_000_000_001_3,
    0.499_999_999_994_385_8,
    0.166_666_666_666_156_45,
    0.041_666_667_040_554_05,
    0.008_333_333_367_311_799,
    0.001_388_880_174_932_380_8,
    0.000_198_411_906_472_418_9,
    2.488_445_991_005_164_3e-5,
    2.763_264_081_927_437_5e-6,
];

soa_struct! {
    /// Exponential function `size · e^{rate·v}` of a speed v.
    ///
    /// ```text
    /// e^{rate·v} = 2^k e^r          k = round(rate·v / ln 2)          |r| ≤ ln 2/2
    /// ```
    ///
    /// Relative error: 2e-14 for |rate·v| up to 20, and 1e-13 up to [`MAX_EXPONENT`] by the rounding of rate·v.
    #[derive(Debug, Clone, Copy, PartialEq)]
    pub(super) struct Exponential {
        pub rate: N,
        rate_log2: N,
        /// |v| beyond which the value is constant; a decaying exponential is negligible there.
        max_argument: N,
        // Coefficients of the polynomial, multiplied by the size.
        c0: N,
        c1: N,
        c2: N,
        c3: N,
        c4: N,
        c5: N,
        c6: N,
        c7: N,
        c8: N,
        c9: N,
    }
}

impl Exponential {
    pub fn new(size: f64, rate: f64) -> Self {
        // Size 0 needs rate 0: `times_power_of_two` would change the exponent bits of 0.
        let (size, rate) = if size.abs() < NEGLIGIBLE_SIZE { (0.0, 0.0) } else { (size, rate) };
        let max_argument = f64::min((MAX_EXPONENT + EXPANSION_MARGIN) / rate.abs(), f64::MAX);
        let [c0, c1, c2, c3, c4, c5, c6, c7, c8, c9] = EXP_COEFFICIENTS.map(|c| size * c);
        Exponential { rate, rate_log2: rate * LOG2_E, max_argument, c0, c1, c2, c3, c4, c5, c6, c7, c8, c9 }
    }
}

impl<N: SimdReal> Exponential<N> {
    /// Returns the value at `v`, for rate·v ≤ [`MAX_EXPONENT`].
    #[inline(always)]
    pub fn at(&self, v: N) -> N {
        let v = self.max_argument.min(v);
        let rounder = v.splat(ROUNDING_CONSTANT);
        let integer = v.mul_add(self.rate_log2, rounder);
        let k = integer - rounder;
        let r = k.mul_add(v.splat(-LN_2), v * self.rate);
        let r2 = r * r;
        let r4 = r2 * r2;
        let low = r.mul_add(self.c3, self.c2).mul_add(r2, r.mul_add(self.c1, self.c0));
        let middle = r.mul_add(self.c7, self.c6).mul_add(r2, r.mul_add(self.c5, self.c4));
        let power = r.mul_add(self.c9, self.c8).mul_add(r4, middle).mul_add(r4, low);
        power.times_power_of_two(integer)
    }
}

/// Returns sin x, x in rad.
///
/// ```text
/// sin x = (−1)^k sin r          k = round(x/π)          r = x − k π          |r| ≤ π/2
/// ```
///
/// sin(r)/r is the minimax polynomial of degree 8 in r² with error 2.1e-19. The total error is below 4e-16 for |x| up to
/// 10⁶ rad. |x| is limited to [`MAX_ANGLE`].
#[inline(always)]
pub(super) fn sine<N: SimdReal>(x: N) -> N {
    /// π − [`PI`].
    const PI_REST: f64 = 1.224_646_799_147_353_2e-16;
    const C: [f64; 9] = [
        1.0,
        -0.166_666_666_666_666_66,
        0.008_333_333_333_333_186,
        -0.000_198_412_698_412_086_76,
        2.755_731_921_122_960_6e-6,
        -2.505_210_689_056_951e-8,
        1.605_894_087_848_96e-10,
        -7.643_026_557_956_378e-13,
        2.721_574_942_133_496_5e-15,
    ];
    let splat = |value: f64| x.splat(value);
    let x = clamp_abs(x, splat(MAX_ANGLE));
    let rounder = splat(ROUNDING_CONSTANT);
    let k = x.mul_add(splat(FRAC_1_PI), rounder) - rounder;
    let r = k.mul_add(splat(-PI_REST), k.mul_add(splat(-PI), x));
    let y = r * r;
    let y2 = y * y;
    let y4 = y2 * y2;
    let pair = |i: usize| y.mul_add(splat(C[i + 1]), splat(C[i]));
    let low = pair(2).mul_add(y2, pair(0));
    let high = pair(6).mul_add(y2, pair(4));
    let quotient = splat(C[8]).mul_add(y4, high).mul_add(y4, low);
    // k is odd if k/2 is 0.5 away from an integer.
    let half = splat(0.5) * k;
    let distance = (half - ((half + rounder) - rounder)).abs();
    let size = r * quotient;
    size.select(distance.simd_lt(splat(0.25)), -size)
}

#[cfg(test)]
mod tests {
    use super::*;

    /// Returns equally spaced points of a range.
    fn range(from: f64, to: f64, points: u32) -> impl Iterator<Item = f64> {
        (0..=points).map(move |k| from + (to - from) * f64::from(k) / f64::from(points))
    }

    #[test]
    fn exponential_is_within_its_error_bounds() {
        for (limit, bound) in [(20.0, 2e-14), (MAX_EXPONENT, 1e-13)] {
            for x in range(-limit, limit, 1_000_003) {
                let (found, exact) = (Exponential::new(1.0, 1.0).at(x), x.exp());
                assert!((found - exact).abs() <= bound * exact, "e^{x} = {found:e}, not {exact:e}");
            }
        }
    }

    #[test]
    fn exponential_of_size_0_is_0() {
        for v in [0.0, 1.0, 100.0] {
            assert_eq!(Exponential::new(0.0, 7.0).at(v), 0.0);
        }
    }

    #[test]
    fn exponential_that_decays_below_normal_numbers_is_negligible() {
        for size in [1e18, -1.0, 1e-39, -1e-41, 1e-300] {
            for v in [7.0, 7.2, 1e3, 1e300] {
                let found = Exponential::new(size, -100.0).at(v);
                assert!(found.abs() <= 1e-250 * f64::abs(size).max(1.0), "{size} e^(-100·{v}) = {found:e}");
            }
        }
    }

    #[test]
    fn sine_is_within_its_error_bound() {
        for limit in [4.0, 100.0, 1e6] {
            for x in range(-limit, limit, 1_000_003) {
                let (found, exact) = (sine(x), x.sin());
                assert!((found - exact).abs() <= 4e-16, "sin {x} = {found:e}, not {exact:e}");
            }
        }
        assert_eq!(sine(0.0), 0.0);
    }

    #[test]
    fn sine_of_huge_angles_is_at_most_1_and_odd() {
        for x in [1e12, 7.1e15, 1e16, 3.7e18, 1e40, 1e300, f64::MAX, f64::INFINITY] {
            assert!(sine(x).abs() <= 1.0 && sine(-x) == -sine(x), "sin {x} = {}", sine(x));
        }
    }
}
