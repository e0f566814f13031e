//! Gravity torque of vertical and tilting axes.
//!
//! The angle changes little from tick to tick. A short polynomial around one angle gives the torque near it and removes
//! the sine from the dependency chain between ticks.

use std::f64::consts::FRAC_PI_2;

use super::elementary::sine;
use crate::config::GravityConfig;
use crate::simd::{SimdReal, soa_struct};

/// Largest |x| for which the polynomials approximate sine and cosine, rad.
const RANGE: f64 = 1.0 / 128.0;
/// Distance of the center of a new expansion from the angle that left the previous one, in units of [`RANGE`], in the
/// direction of the change.
const CENTER_OFFSET: f64 = 0.9;
/// Coefficients of cos x for |x| ≤ [`RANGE`] in powers of x²: Taylor series with x⁶ economized by Chebyshev polynomials;
/// error 2e-17.
const COSINE: [f64; 3] = {
    const X6: f64 = -1.0 / 720.0;
    const SQUARE: f64 = RANGE * RANGE;
    [1.0, -0.5 - X6 * 9.0 / 16.0 * SQUARE * SQUARE, 1.0 / 24.0 + X6 * 1.5 * SQUARE]
};
/// Coefficients of sin x/x for |x| ≤ [`RANGE`] in powers of x²: Taylor series; error 5e-17.
const SINE: [f64; 3] = [1.0, -1.0 / 6.0, 1.0 / 120.0];

soa_struct! {
    /// Gravity torque `C_gravity = r (W + k sin(SP + φ))`, N·m at the motor, positive against motion towards plus.
    #[derive(Debug, Clone, Copy, PartialEq)]
    pub struct Gravity {
        /// r W, N·m.
        weight: N,
        /// r k, N·m.
        tilt: N,
        /// φ, rad.
        phase: N,
        /// r for a tilting axis, else 0.
        angle_ratio: N,
        /// Distance from a motor angle that leaves an expansion to the center of the next one, rad.
        center_offset: N,
    }
}

soa_struct! {
    /// Polynomial of the gravity torque in the rotation of the axis from one motor angle.
    #[derive(Debug, Clone, Copy, PartialEq)]
    pub(crate) struct GravityExpansion {
        /// Motor angle of expansion, rad.
        center: N,
        c0: N,
        c1: N,
        c2: N,
        c3: N,
        c4: N,
        c5: N,
    }
}

impl Gravity {
    /// Creates the gravity of an axis with a transmission ratio r (m or rad per rad of the motor).
    pub fn new(gravity: &GravityConfig, transmission_ratio: f64) -> Self {
        let tilt = transmission_ratio * gravity.tilt;
        let tilting = tilt != 0.0;
        Gravity {
            weight: transmission_ratio * gravity.weight,
            tilt,
            phase: gravity.phase,
            angle_ratio: if tilting { transmission_ratio } else { 0.0 },
            center_offset: if tilting { CENTER_OFFSET * RANGE / transmission_ratio } else { 0.0 },
        }
    }

    /// Returns true if the torque depends on the position (tilting axis).
    pub fn is_position_dependent(&self) -> bool {
        self.tilt != 0.0
    }
}

impl<N: SimdReal> Gravity<N> {
    /// Returns the torque of an axis that does not tilt, N·m at the motor.
    #[inline(always)]
    pub(super) fn weight_torque(&self) -> N {
        self.weight
    }

    /// Returns the torque at the axis position `position` (m or rad), N·m at the motor.
    #[inline(always)]
    pub fn torque(&self, position: N) -> N {
        self.tilt.mul_add(sine(position + self.phase), self.weight)
    }

    /// Expands the torque near the motor angle `angle`, rad.
    #[inline(always)]
    pub(crate) fn expand(&self, angle: N) -> GravityExpansion<N> {
        let x = angle.mul_add(self.angle_ratio, self.phase);
        let (value, slope) = (self.tilt * sine(x), self.tilt * sine(x + x.splat(FRAC_PI_2)));
        let splat = |value: f64| x.splat(value);
        GravityExpansion {
            center: angle,
            c0: value + self.weight,
            c1: slope,
            c2: value * splat(COSINE[1]),
            c3: slope * splat(SINE[1]),
            c4: value * splat(COSINE[2]),
            c5: slope * splat(SINE[2]),
        }
    }

    /// Returns the torque at the motor angle `angle` (rad), N·m at the motor, from `expansion`.
    ///
    /// Renews the expansion in the lanes whose angle is out of its range, and only there.
    #[inline(always)]
    pub(crate) fn torque_with_expansion(&self, expansion: &mut GravityExpansion<N>, angle: N) -> N {
        let mut rotation = self.rotation(expansion, angle);
        if rotation.abs().any_gt(RANGE) {
            let zero = rotation.splat(0.0);
            let step = self.center_offset.select(zero.simd_lt(rotation), -self.center_offset);
            let out_of_range = rotation.splat(RANGE).simd_lt(rotation.abs());
            *expansion = self.expand(angle + step).select(out_of_range, *expansion);
            rotation = self.rotation(expansion, angle);
        }
        expansion.at(rotation)
    }

    /// Returns the rotation of the axis from the center of an expansion, rad.
    #[inline(always)]
    fn rotation(&self, expansion: &GravityExpansion<N>, angle: N) -> N {
        (angle - expansion.center) * self.angle_ratio
    }
}

impl<N: SimdReal> GravityExpansion<N> {
    /// Returns the torque at a rotation `x`, rad.
    #[inline(always)]
    fn at(&self, x: N) -> N {
        let x2 = x * x;
        let low = x.mul_add(self.c1, self.c0);
        let middle = x.mul_add(self.c3, self.c2);
        let high = x.mul_add(self.c5, self.c4);
        high.mul_add(x2, middle).mul_add(x2, low)
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    /// Returns the gravity of a tilting axis behind a gear, and its torque by the definition.
    fn tilting(ratio: f64, phase: f64) -> (Gravity, impl Fn(f64) -> f64) {
        let law = GravityConfig { weight: 300.0, tilt: 200.0, phase };
        let defined = move |angle: f64| ratio * (300.0 + 200.0 * (ratio * angle + phase).sin());
        (Gravity::new(&law, ratio), defined)
    }

    #[test]
    fn expanded_torque_equals_the_definition() {
        for (ratio, phase) in [(1.0, 0.0), (1.0 / 90.0, 0.4), (1.0 / 90.0, -3.0), (2e-3, 1.5)] {
            let (gravity, defined) = tilting(ratio, phase);
            let mut expansion = gravity.expand(0.0);
            // Over ±9 rad, in small and in large steps.
            let slow = (0..300_000).map(|k| 9.0 * (1e-4 * f64::from(k)).sin());
            let jumping = (0..10_000).map(|k| 9.0 * (0.37 * f64::from(k)).sin());
            for position in slow.chain(jumping) {
                let angle = position / ratio;
                let (found, exact) = (gravity.torque_with_expansion(&mut expansion, angle), defined(angle));
                // Half a unit in the last place of an angle of 12 rad, and a few of the torque.
                assert!((found - exact).abs() <= 2e-15 * 500.0 * ratio, "{found} at {position}, not {exact}");
            }
        }
    }

    #[test]
    fn gravity_without_tilt_is_constant() {
        let law = GravityConfig { weight: 300.0, tilt: 0.0, phase: 0.4 };
        let gravity = Gravity::new(&law, 0.01);
        let mut expansion = gravity.expand(0.0);
        for angle in [0.0, -3.0, 1e6, -1e300] {
            assert_eq!(gravity.torque_with_expansion(&mut expansion, angle), gravity.weight_torque());
            assert_eq!(expansion, gravity.expand(0.0));
        }
    }

    #[test]
    fn torque_at_huge_angles_is_bounded() {
        let (gravity, _) = tilting(0.01, 0.4);
        let mut expansion = gravity.expand(0.0);
        for angle in [1e12, -7.1e15, 3.7e18, 1e40, -1e300, f64::MAX] {
            let torque = gravity.torque_with_expansion(&mut expansion, angle);
            assert!((0.999..=5.001).contains(&torque), "{torque} at {angle}");
        }
    }
}
