//! Velocity, acceleration and jerk of setpoints compared with the limits of their axis.

use super::error::SetpointDerivative;
use crate::config::LimitsConfig;
use crate::trajectory::limits::SPEED_TOLERANCE;

/// Relative tolerance for acceleration and jerk, as documented at [`Program`](super::Program).
const TOLERANCE: f64 = 1e-6;
/// Relative tolerance for speed: half of the tolerance of trajectory validation.
const VELOCITY_TOLERANCE: f64 = 0.5 * SPEED_TOLERANCE;
/// Rounding errors of position and time, in units of ε, that a difference may accumulate.
const ROUNDINGS: f64 = 16.0;

/// Value of a derivative of the setpoints of an axis, and its limit.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct LimitUse {
    /// Derivative.
    pub quantity: SetpointDerivative,
    /// Least absolute value that the setpoints prove: their difference without `rounding`, m or rad per power of second.
    pub found: f64,
    /// Largest share of rounding errors in the difference, m or rad per power of second.
    pub rounding: f64,
    /// Limit, m or rad per power of second.
    pub allowed: f64,
}

impl LimitUse {
    /// Number of setpoints in the third difference.
    pub const WINDOW: usize = 4;

    /// Returns speed, acceleration and jerk at the last of four setpoints (m or rad, `period` seconds apart) as first,
    /// second and third difference. `time` is that of the last setpoint, s.
    pub fn of_setpoints(
        setpoints: [f64; Self::WINDOW],
        time: f64,
        period: f64,
        limits: &LimitsConfig,
    ) -> [Self; 3] {
        let [a, b, c, d] = setpoints;
        let rounding = ROUNDINGS * f64::EPSILON * (a.abs().max(d.abs()) + time * ((d - a) / period).abs());
        let of = |quantity, difference: f64, order| {
            let size = f64::powi(period, order);
            Self::new(quantity, difference / size, rounding / size, limits)
        };
        [
            of(SetpointDerivative::Speed, d - c, 1),
            of(SetpointDerivative::Acceleration, d - 2.0 * c + b, 2),
            of(SetpointDerivative::Jerk, d - 3.0 * (c - b) - a, 3),
        ]
    }

    /// Returns speed, acceleration and jerk at the last of four setpoints (time in s, position in m or rad) as divided
    /// differences: every smooth motion through the setpoints has these values somewhere between them. Times increase.
    /// `rounding` is the largest error of each position, m or rad, in addition to that of floating-point numbers.
    pub fn of_points(points: &[(f64, f64); Self::WINDOW], rounding: f64, limits: &LimitsConfig) -> [Self; 3] {
        let (last_time, last) = points[Self::WINDOW - 1];
        let largest = points.iter().map(|(_, position)| position.abs()).fold(0.0, f64::max);
        let travel = ((last - points[0].1) / (last_time - points[0].0)).abs() * last_time.abs();
        let rounding = rounding + ROUNDINGS * f64::EPSILON * (largest + travel);
        let of = |quantity, order: usize| {
            let points = &points[Self::WINDOW - 1 - order..];
            let factorial = (1..=order).product::<usize>() as f64;
            let (mut difference, mut share) = (0.0, 0.0);
            for (i, (time, position)) in points.iter().enumerate() {
                let others = points.iter().enumerate().filter(|(j, _)| *j != i);
                let factor = factorial / others.map(|(_, (other, _))| time - other).product::<f64>();
                difference += factor * (position - last);
                share += factor.abs() * rounding;
            }
            Self::new(quantity, difference, share, limits)
        };
        [
            of(SetpointDerivative::Speed, 1),
            of(SetpointDerivative::Acceleration, 2),
            of(SetpointDerivative::Jerk, 3),
        ]
    }

    fn new(quantity: SetpointDerivative, difference: f64, rounding: f64, limits: &LimitsConfig) -> Self {
        let allowed = match quantity {
            SetpointDerivative::Speed => limits.velocity,
            SetpointDerivative::Acceleration => limits.acceleration,
            SetpointDerivative::Jerk => limits.jerk,
        };
        Self { quantity, found: (difference.abs() - rounding).max(0.0), rounding, allowed }
    }

    /// Returns the value divided by its limit.
    pub fn ratio(&self) -> f64 {
        self.found / self.allowed
    }

    /// Returns true if the value exceeds its limit by more than the tolerance: 1e-6 of acceleration and jerk, half of
    /// the tolerance of trajectories for speed.
    pub fn is_exceeded(&self) -> bool {
        let tolerance = match self.quantity {
            SetpointDerivative::Speed => VELOCITY_TOLERANCE,
            SetpointDerivative::Acceleration | SetpointDerivative::Jerk => TOLERANCE,
        };
        self.ratio() > 1.0 + tolerance
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use proptest::prelude::*;

    fn limits() -> LimitsConfig {
        LimitsConfig {
            velocity: 1.0,
            acceleration: 2.0,
            jerk: 3.0,
            travel_min: f64::NEG_INFINITY,
            travel_max: f64::INFINITY,
        }
    }

    #[test]
    fn a_value_is_exceeded_beyond_its_tolerance() {
        let of = |acceleration: f64| {
            // Parabola through 0 at unequal steps.
            let points = [-0.3_f64, -0.2, 0.1, 0.15].map(|time| (time, 0.5 * acceleration * time * time));
            LimitUse::of_points(&points, 0.0, &limits())[1]
        };
        assert!(of(2.0 * (1.0 + 2e-6)).is_exceeded() && !of(2.0 * (1.0 + 5e-7)).is_exceeded());
        assert_eq!(of(1.0).allowed, 2.0);
    }

    proptest! {
        /// A cubic has a third derivative of 6 times its first coefficient, at any steps.
        #[test]
        fn the_jerk_of_a_cubic_is_found_at_unequal_steps(
            steps in [0.001..1.0f64, 0.001..1.0, 0.001..1.0], cubic in -5.0..5.0f64, square in -5.0..5.0f64
        ) {
            let times = [0.0, steps[0], steps[0] + steps[1], steps[0] + steps[1] + steps[2]];
            let points = times.map(|t| (t, cubic * t * t * t + square * t * t + 0.1));
            let jerk = LimitUse::of_points(&points, 0.0, &limits())[2];
            prop_assert!(jerk.found <= 6.0 * cubic.abs());
            prop_assert!(jerk.found + 2.0 * jerk.rounding >= 6.0 * cubic.abs());
        }

        /// Positions that are rounded never prove more than the exact ones.
        #[test]
        fn rounding_never_adds_to_a_value(
            from in -1.0..1.0f64, speed in -1.0..1.0f64, places in 2..7i32, step in 0.001..0.1f64
        ) {
            let unit = 10f64.powi(-places);
            let exact = [0.0, step, 2.0 * step, 3.0 * step].map(|time| (time, from + speed * time));
            let points = exact.map(|(time, position)| (time, (position / unit).round() * unit));
            let [velocity, acceleration, jerk] = LimitUse::of_points(&points, 0.5 * unit, &limits());
            prop_assert!(velocity.found <= speed.abs());
            prop_assert_eq!([acceleration.found, jerk.found], [0.0, 0.0]);
        }

        /// Equal steps: the same differences.
        #[test]
        fn both_forms_agree(setpoints in [-1.0..1.0f64, -1.0..1.0, -1.0..1.0, -1.0..1.0], period in 0.001..0.1f64) {
            let points = std::array::from_fn(|i| (i as f64 * period, setpoints[i]));
            let pairs = LimitUse::of_points(&points, 0.0, &limits());
            for (a, b) in pairs.into_iter().zip(LimitUse::of_setpoints(setpoints, 3.0 * period, period, &limits())) {
                prop_assert!((a.found - b.found).abs() <= 4.0 * (a.rounding + b.rounding));
                prop_assert_eq!(a.quantity, b.quantity);
            }
        }
    }
}
