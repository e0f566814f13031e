//! Exponential and sine as straight lines of arithmetic, so that they fill vectors and give the same bits
//! on every processor.

use std::f64::consts::{FRAC_1_PI, LN_2, LOG2_E, PI};

/// 1.5·2⁵²: a number that is added to it is rounded to an integer, which then stands in its lowest bits.
const ROUNDER: f64 = 6_755_399_441_055_744.0;
/// Bits of the fraction of an f64.
const FRACTION_BITS: u32 = 52;

/// Largest |x| that [`exponential`] is for: its result is a normal number.
pub(super) const MAX_EXPONENT: f64 = 700.0;

/// e^{rate·v} where |rate·v| ≤ [`MAX_EXPONENT`]; `rate_log2` is [`log2_rate`] of the rate.
///
/// 2^k e^r with |r| ≤ ln 2/2; the polynomial for e^r is the one of degree 9 with the smallest largest
/// error, 1.4e-14. Relative error of the whole: 2e-14 for |rate·v| up to 20, and 1e-13 up to the end, where
/// the rounding of rate·v counts.
#[inline(always)]
pub(super) fn exponential(v: f64, rate: f64, rate_log2: f64) -> f64 {
    const C: [f64; 10] = [
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
    let shifted = v.mul_add(rate_log2, ROUNDER);
    let k = shifted - ROUNDER;
    let r = k.mul_add(-LN_2, v * rate);
    let r2 = r * r;
    let r4 = r2 * r2;
    let pair = |i: usize| r.mul_add(C[i + 1], C[i]);
    let low = pair(2).mul_add(r2, pair(0));
    let middle = pair(6).mul_add(r2, pair(4));
    let power = pair(8).mul_add(r4, middle).mul_add(r4, low);
    // Times 2^k: k is added to the exponent.
    f64::from_bits(power.to_bits().wrapping_add(shifted.to_bits() << FRACTION_BITS))
}

/// The second form of a rate that [`exponential`] takes.
pub(super) fn log2_rate(rate: f64) -> f64 {
    rate * LOG2_E
}

/// sin x, x in rad.
///
/// ±sin r with |r| ≤ π/2; the polynomial for sin(r)/r in r² is the one of degree 8 with the smallest largest
/// error, 2.1e-19. Error of the whole below 4e-16 for |x| up to 10⁶ rad.
#[inline(always)]
pub(super) fn sine(x: f64) -> f64 {
    /// π − [`PI`].
    const PI_REST: f64 = 1.224_646_799_147_353_2e-16;
    const C: [f64; 9] = [
        1.0,
        -0.166_666_666_666_666_66,
        0.008_333_333_333_333_186,
        -0.000_198_412_698_412_086_76,
        2.755_731_921_122_960_6e-6,
        -2.505_210_689_056_951e-8,
        1.605_894_087_848_959_9e-10,
        -7.643_026_557_956_378e-13,
        2.721_574_942_133_496_5e-15,
    ];
    let shifted = x.mul_add(FRAC_1_PI, ROUNDER);
    let k = shifted - ROUNDER;
    let r = k.mul_add(-PI_REST, k.mul_add(-PI, x));
    let y = r * r;
    let y2 = y * y;
    let y4 = y2 * y2;
    let pair = |i: usize| y.mul_add(C[i + 1], C[i]);
    let low = pair(2).mul_add(y2, pair(0));
    let high = pair(6).mul_add(y2, pair(4));
    let quotient = C[8].mul_add(y4, high).mul_add(y4, low);
    // sin(x) = (−1)^k sin(r): the lowest bit of k becomes the sign.
    f64::from_bits((r * quotient).to_bits() ^ (shifted.to_bits() << (u64::BITS - 1)))
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
                let (found, exact) = (exponential(x, 1.0, log2_rate(1.0)), x.exp());
                assert!((found - exact).abs() <= bound * exact, "e^{x} = {found:e}, not {exact:e}");
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
}
