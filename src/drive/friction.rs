//! Friction as a function of velocity, and how it acts over one tick.

use super::elementary::{Exponential, MAX_EXPONENT};
use crate::config::{AxisKind, FrictionConfig};
use crate::lanes::lanes;
use crate::units::{METRE_PER_MINUTE, RPM};

/// Velocity up to which the law was fitted, m/min or rev/min (Prévost eq. 3).
const FITTED_RANGE: f64 = 20.0;

lanes! {
    /// Double-exponential friction law of one axis, seen from its motor.
    ///
    /// (Prévost eq. 3) `i_f(V) = a e^{bV} + c e^{dV}` for V > 0, odd in V; at standstill any value within
    /// ±i0. V is in m/min (linear axis) or rev/min (rotary axis). The torque is `Kt i_f`.
    #[derive(Debug, Clone, Copy, PartialEq)]
    pub struct Friction as FrictionLanes {
        first: Exponential,
        second: Exponential,
        /// Kt i0, N·m.
        breakaway: f64,
        /// Speed from which on the law stays as it is, rad/s: its exponentials leave the range of numbers.
        capped_from: f64,
        /// Speed up to which the law was fitted, rad/s.
        fitted_to: f64,
    }
}

impl Friction {
    /// Friction of an axis of `kind` behind a transmission of ratio r (m or rad per rad of the motor),
    /// whose motor has `torque_constant` Kt in N·m/A. (With another constant the bound is in its unit.)
    pub fn new(law: FrictionConfig, kind: AxisKind, transmission_ratio: f64, torque_constant: f64) -> Self {
        let unit = match kind {
            AxisKind::Linear => METRE_PER_MINUTE,
            AxisKind::Rotary => RPM,
        };
        // V per ω of the motor.
        let velocity = transmission_ratio / unit;
        let first = Exponential::new(torque_constant * law.a, law.b * velocity);
        let second = Exponential::new(torque_constant * law.c, law.d * velocity);
        Friction {
            first,
            second,
            breakaway: torque_constant * law.i0,
            capped_from: (MAX_EXPONENT / first.rate.abs().max(second.rate.abs())).min(f64::MAX),
            fitted_to: FITTED_RANGE / velocity,
        }
    }

    /// Largest friction torque at motor speed ω (rad/s), N·m; never negative.
    #[inline(always)]
    pub fn bound(&self, speed: f64) -> f64 {
        let size = speed.abs();
        let size = if size < self.capped_from { size } else { self.capped_from };
        let moving = self.first.at(size) + self.second.at(size);
        let torque = if speed == 0.0 { self.breakaway } else { moving };
        // Extrapolated, the law may change its sign.
        if torque > 0.0 { torque } else { 0.0 }
    }

    /// Whether the law is extrapolated at motor speed ω (rad/s).
    #[inline(always)]
    pub fn is_extrapolated(&self, speed: f64) -> bool {
        speed.abs() > self.fitted_to
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::config::Parameters;

    /// The law as it is printed, with the exponential of the standard library, A.
    fn printed(law: &FrictionConfig, v: f64) -> f64 {
        law.a * (law.b * v).exp() + law.c * (law.d * v).exp()
    }

    #[test]
    fn the_law_is_within_1e_12_a_of_what_is_printed() {
        let config = Parameters::embedded_default()
            .and_then(|p| p.machine_config())
            .expect("the embedded machine is valid");
        for axis in config.axes() {
            // Kt = 1 and one m/min or rev/min per rad/s.
            let unit = if axis.kind == AxisKind::Linear { METRE_PER_MINUTE } else { RPM };
            let friction = Friction::new(axis.friction, axis.kind, unit, 1.0);
            // Five times the range that the law was fitted for: as fast as any of the axes goes.
            for k in 1..=1_000_000 {
                let v = 5.0 * FITTED_RANGE * f64::from(k) * 1e-6;
                let (found, exact) = (friction.bound(v), printed(&axis.friction, v));
                assert!((found - exact).abs() <= 1e-12, "{}: {found} A at {v}, not {exact} A", axis.name);
                assert_eq!(found.to_bits(), friction.bound(-v).to_bits());
            }
            assert_eq!(friction.bound(0.0), axis.friction.i0);
        }
    }

    #[test]
    fn a_law_that_leaves_the_range_of_numbers_is_finite_and_never_drives() {
        let law = |a, c| FrictionConfig { a, b: 0.5, c, d: 0.7, i0: 1.0 };
        for speed in [1.0, 1e3, 1e9, f64::MAX, f64::INFINITY] {
            let strong = Friction::new(law(1.0, 1.0), AxisKind::Linear, 1.0, 1.0).bound(speed);
            assert!(strong.is_finite() && strong > 0.0, "{strong} at {speed}");
            let turned = Friction::new(law(1.0, -2.0), AxisKind::Linear, 1.0, 1.0).bound(speed);
            assert_eq!(turned, 0.0, "at {speed}");
        }
        let constant = FrictionConfig { b: 0.0, d: 0.0, ..law(2.0, -0.5) };
        let bound = Friction::new(constant, AxisKind::Linear, 1.0, 1.0).bound(1e300);
        assert!((bound - 1.5).abs() <= 1e-12, "{bound} A");
    }
}
