//! What weight asks of the motor.
//!
//! From tick to tick an axis turns little. The torque at one angle gives those near it by a short polynomial, which
//! takes the sine out of the chain from one tick to the next.

use std::f64::consts::FRAC_PI_2;

use super::elementary::sine;
use crate::config::GravityConfig;
use crate::simd::{Number, numbers};

/// Largest |x| for which the polynomials are sine and cosine, rad.
const REACH: f64 = 1.0 / 128.0;
/// Where the middle of a new one is, in reaches from the angle that has left the one before: an axis is likely to go
/// on in its direction.
const AHEAD: f64 = 0.9;
/// cos x for |x| ≤ [`REACH`], by powers of x²: the series with its x⁶ in the next lower polynomials of Chebyshev.
/// Error 2e-17.
const COSINE: [f64; 3] = {
    const X6: f64 = -1.0 / 720.0;
    const SQUARE: f64 = REACH * REACH;
    [1.0, -0.5 - X6 * 9.0 / 16.0 * SQUARE * SQUARE, 1.0 / 24.0 + X6 * 1.5 * SQUARE]
};
/// sin x/x there, by powers of x²: the series. Error 5e-17.
const SINE: [f64; 3] = [1.0, -1.0 / 6.0, 1.0 / 120.0];

numbers! {
    /// `C_gravity = r (W + k sin(SP + φ))`, N·m at the motor, positive against motion towards plus.
    #[derive(Debug, Clone, Copy, PartialEq)]
    pub struct Gravity {
        /// r W, N·m.
        weight: N,
        /// r k, N·m.
        tilt: N,
        phase: N,
        /// r of an axis that tilts; 0 of another, whose angle does not matter.
        turn: N,
        /// From an angle of the motor that leaves a polynomial to the middle of the next, rad.
        ahead: N,
    }
}

numbers! {
    /// The torque near one angle of the motor: a polynomial in how far the axis has turned from there.
    #[derive(Debug, Clone, Copy, PartialEq)]
    pub(crate) struct Incline {
        /// That angle, rad.
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
    /// Gravity of an axis behind a transmission of ratio r (m or rad per rad of the motor).
    pub fn new(gravity: &GravityConfig, transmission_ratio: f64) -> Self {
        let tilt = transmission_ratio * gravity.tilt;
        let tilting = tilt != 0.0;
        Gravity {
            weight: transmission_ratio * gravity.weight,
            tilt,
            phase: gravity.phase,
            turn: if tilting { transmission_ratio } else { 0.0 },
            ahead: if tilting { AHEAD * REACH / transmission_ratio } else { 0.0 },
        }
    }

    /// Whether the torque depends on where the axis stands.
    pub fn is_tilting(&self) -> bool {
        self.tilt != 0.0
    }
}

impl<N: Number> Gravity<N> {
    /// Torque of an axis that does not tilt, N·m at the motor.
    #[inline(always)]
    pub(super) fn weight(&self) -> N {
        self.weight
    }

    /// Torque at the axis position `position` (m or rad), N·m at the motor.
    #[inline(always)]
    pub fn torque(&self, position: N) -> N {
        self.tilt.mul_add(sine(position + self.phase), self.weight)
    }

    /// The torque near the motor angle `angle`, rad.
    #[inline(always)]
    pub(crate) fn near(&self, angle: N) -> Incline<N> {
        let x = angle.mul_add(self.turn, self.phase);
        let (along, across) = (self.tilt * sine(x), self.tilt * sine(x + x.constant(FRAC_PI_2)));
        let number = |value: f64| x.constant(value);
        Incline {
            center: angle,
            c0: along + self.weight,
            c1: across,
            c2: along * number(COSINE[1]),
            c3: across * number(SINE[1]),
            c4: along * number(COSINE[2]),
            c5: across * number(SINE[2]),
        }
    }

    /// Torque at the motor angle `angle` (rad), N·m at the motor. Where the polynomial at hand does not hold it is
    /// renewed, and nowhere else.
    #[inline(always)]
    pub(crate) fn torque_near(&self, near: &mut Incline<N>, angle: N) -> N {
        let mut turned = self.turned(near, angle);
        if turned.abs().exceeds(REACH) {
            let nothing = turned.constant(0.0);
            let step = self.ahead.select(nothing.less(turned), -self.ahead);
            let left = turned.constant(REACH).less(turned.abs());
            *near = near.or(self.near(angle + step), left);
            turned = self.turned(near, angle);
        }
        near.at(turned)
    }

    /// How far the axis has turned from the middle of a polynomial, rad.
    #[inline(always)]
    fn turned(&self, near: &Incline<N>, angle: N) -> N {
        (angle - near.center) * self.turn
    }
}

impl<N: Number> Incline<N> {
    /// The torque where the axis has turned by `x`, rad.
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

    /// An axis that tilts behind a gear, and its torque as it is printed.
    fn tilting(ratio: f64, phase: f64) -> (Gravity, impl Fn(f64) -> f64) {
        let law = GravityConfig { weight: 300.0, tilt: 200.0, phase };
        let printed = move |angle: f64| ratio * (300.0 + 200.0 * (ratio * angle + phase).sin());
        (Gravity::new(&law, ratio), printed)
    }

    #[test]
    fn the_torque_near_an_angle_is_the_one_that_is_printed() {
        for (ratio, phase) in [(1.0, 0.0), (1.0 / 90.0, 0.4), (1.0 / 90.0, -3.0), (2e-3, 1.5)] {
            let (gravity, printed) = tilting(ratio, phase);
            let mut near = gravity.near(0.0);
            // Over 9 rad to either side, in small steps and in large ones.
            let slow = (0..300_000).map(|k| 9.0 * (1e-4 * f64::from(k)).sin());
            let jumping = (0..10_000).map(|k| 9.0 * (0.37 * f64::from(k)).sin());
            for position in slow.chain(jumping) {
                let angle = position / ratio;
                let (found, exact) = (gravity.torque_near(&mut near, angle), printed(angle));
                // Half a unit in the last place of an angle of 12 rad, and a few of the torque.
                assert!((found - exact).abs() <= 2e-15 * 500.0 * ratio, "{found} at {position}, not {exact}");
            }
        }
    }

    #[test]
    fn an_axis_that_does_not_tilt_weighs_the_same_everywhere() {
        let law = GravityConfig { weight: 300.0, tilt: 0.0, phase: 0.4 };
        let gravity = Gravity::new(&law, 0.01);
        let mut near = gravity.near(0.0);
        for angle in [0.0, -3.0, 1e6, -1e300] {
            assert_eq!(gravity.torque_near(&mut near, angle), gravity.weight());
            assert_eq!(near, gravity.near(0.0));
        }
    }

    #[test]
    fn the_torque_of_an_axis_that_has_flown_off_is_no_larger_than_elsewhere() {
        let (gravity, _) = tilting(0.01, 0.4);
        let mut near = gravity.near(0.0);
        for angle in [1e12, -7.1e15, 3.7e18, 1e40, -1e300, f64::MAX] {
            let torque = gravity.torque_near(&mut near, angle);
            assert!((0.999..=5.001).contains(&torque), "{torque} at {angle}");
        }
    }
}
