//! Exponential and sine as straight lines of arithmetic, so that they fill vectors and give the same bits
//! on every processor.

use std::f64::consts::{FRAC_1_PI, LN_2, LOG2_E, PI};

use crate::simd::{Number, limited, numbers};

/// 1.5·2⁵²: a number that is added to it is rounded to an integer, which then stands in its lowest bits.
const ROUNDER: f64 = 6_755_399_441_055_744.0;

/// Largest |x| that an [`Exponential`] is for: e^x times any size that it may have is a normal number.
pub(super) const MAX_EXPONENT: f64 = 600.0;
/// How much further an exponent may go where a law is expanded ahead of a speed.
const AHEAD: f64 = 1.0;
/// Size up to which an [`Exponential`] is nothing, far below that of any torque or change of speed that acts:
/// what decays from it would leave the normal numbers.
const NO_SIZE: f64 = 1e-40;

/// Largest |x| of which [`sine`] finds the half turns, rad: beyond, neighboring numbers are parts of a turn apart.
const FURTHEST_ANGLE: f64 = 1e15;

/// The polynomial of degree 9 that is nearest to e^r for |r| ≤ ln 2/2; its largest error is 1.4e-14.
const POWERS: [f64; 10] = [
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

numbers! {
    /// `size · e^{rate·v}`.
    ///
    /// 2^k e^r with |r| ≤ ln 2/2. Relative error: 2e-14 for |rate·v| up to 20, and 1e-13 up to
    /// [`MAX_EXPONENT`], where the rounding of rate·v counts.
    #[derive(Debug, Clone, Copy, PartialEq)]
    pub(super) struct Exponential {
        pub rate: N,
        rate_log2: N,
        /// |v| beyond which it stays as it is: one that decays is nothing there beside its size.
        last: N,
        // The polynomial times the size.
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
        // Nothing times 2^k would not be nothing: see the last line of `at`.
        let (size, rate) = if size.abs() < NO_SIZE { (0.0, 0.0) } else { (size, rate) };
        let last = f64::min((MAX_EXPONENT + AHEAD) / rate.abs(), f64::MAX);
        let [c0, c1, c2, c3, c4, c5, c6, c7, c8, c9] = POWERS.map(|c| size * c);
        Exponential { rate, rate_log2: rate * LOG2_E, last, c0, c1, c2, c3, c4, c5, c6, c7, c8, c9 }
    }
}

impl<N: Number> Exponential<N> {
    /// Its value where rate·v ≤ [`MAX_EXPONENT`].
    #[inline(always)]
    pub fn at(&self, v: N) -> N {
        let v = self.last.min(v);
        let rounder = v.constant(ROUNDER);
        let integer = v.mul_add(self.rate_log2, rounder);
        let k = integer - rounder;
        let r = k.mul_add(v.constant(-LN_2), v * self.rate);
        let r2 = r * r;
        let r4 = r2 * r2;
        let low = r.mul_add(self.c3, self.c2).mul_add(r2, r.mul_add(self.c1, self.c0));
        let middle = r.mul_add(self.c7, self.c6).mul_add(r2, r.mul_add(self.c5, self.c4));
        let power = r.mul_add(self.c9, self.c8).mul_add(r4, middle).mul_add(r4, low);
        power.times_power_of_two(integer)
    }
}

/// sin x, x in rad.
///
/// ±sin r with |r| ≤ π/2; the polynomial for sin(r)/r in r² is the one of degree 8 with the smallest largest
/// error, 2.1e-19. Error of the whole below 4e-16 for |x| up to 10⁶ rad; what is beyond [`FURTHEST_ANGLE`] counts
/// as that.
#[inline(always)]
pub(super) fn sine<N: Number>(x: N) -> N {
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
    let number = |value: f64| x.constant(value);
    let x = limited(x, number(FURTHEST_ANGLE));
    let rounder = number(ROUNDER);
    let k = x.mul_add(number(FRAC_1_PI), rounder) - rounder;
    let r = k.mul_add(number(-PI_REST), k.mul_add(number(-PI), x));
    let y = r * r;
    let y2 = y * y;
    let y4 = y2 * y2;
    let pair = |i: usize| y.mul_add(number(C[i + 1]), number(C[i]));
    let low = pair(2).mul_add(y2, pair(0));
    let high = pair(6).mul_add(y2, pair(4));
    let quotient = number(C[8]).mul_add(y4, high).mul_add(y4, low);
    // sin(x) = (−1)^k sin(r): half of an odd k is a half off the next integer.
    let half = number(0.5) * k;
    let off = (half - ((half + rounder) - rounder)).abs();
    let size = r * quotient;
    size.select(off.less(number(0.25)), -size)
}

#[cfg(test)]
mod tests {
    use super::*;

    /// Points of a range, dense and never at round numbers.
    fn range(from: f64, to: f64, points: u32) -> impl Iterator<Item = f64> {
        (0..=points).map(move |k| from + (to - from) * f64::from(k) / f64::from(points))
    }

    #[test]
    fn the_exponential_keeps_its_bounds() {
        for (limit, bound) in [(20.0, 2e-14), (MAX_EXPONENT, 1e-13)] {
            for x in range(-limit, limit, 1_000_003) {
                let (found, exact) = (Exponential::new(1.0, 1.0).at(x), x.exp());
                assert!((found - exact).abs() <= bound * exact, "e^{x} = {found:e}, not {exact:e}");
            }
        }
    }

    #[test]
    fn an_exponential_of_no_size_is_nothing() {
        for v in [0.0, 1.0, 100.0] {
            assert_eq!(Exponential::new(0.0, 7.0).at(v), 0.0);
        }
    }

    #[test]
    fn an_exponential_that_decays_below_the_normal_numbers_is_nothing_and_not_noise() {
        for size in [1e18, -1.0, 1e-39, -1e-41, 1e-300] {
            for v in [7.0, 7.2, 1e3, 1e300] {
                let found = Exponential::new(size, -100.0).at(v);
                assert!(found.abs() <= 1e-250 * f64::abs(size).max(1.0), "{size} e^(-100·{v}) = {found:e}");
            }
        }
    }

    #[test]
    fn the_sine_keeps_its_bound() {
        for limit in [4.0, 100.0, 1e6] {
            for x in range(-limit, limit, 1_000_003) {
                let (found, exact) = (sine(x), x.sin());
                assert!((found - exact).abs() <= 4e-16, "sin {x} = {found:e}, not {exact:e}");
            }
        }
        assert_eq!(sine(0.0), 0.0);
    }

    #[test]
    fn the_sine_of_an_axis_that_has_flown_off_is_no_larger_than_1() {
        for x in [1e12, 7.1e15, 1e16, 3.7e18, 1e40, 1e300, f64::MAX, f64::INFINITY] {
            assert!(sine(x).abs() <= 1.0 && sine(-x) == -sine(x), "sin {x} = {}", sine(x));
        }
    }
}
