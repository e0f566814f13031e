//! PI controller with feedforward, output limit and anti-windup.

use crate::config::PiConfig;
use crate::lanes::{lanes, limited};

lanes! {
    /// A sampled PI controller whose integral is in units of its output.
    ///
    /// ```text
    /// J = I + (K T/Ti) e          w = K e + J + feedforward          y = limit(w)
    /// I ← I  if w ≠ y and e has the sign of w − y,  else J
    /// ```
    ///
    /// The output of an instant that winds up is not recomputed.
    ///
    /// The output may be given in another unit: `w` is multiplied by `scale` then, and `y` limited in that
    /// unit (the velocity loop computes a torque and is limited in current, scale 1/Kt).
    #[derive(Debug, Clone, Copy, PartialEq)]
    pub struct Pi as PiLanes {
        gain: f64,
        integral_gain: f64,
        scale: f64,
        limit: f64,
    }
}

lanes! {
    /// Memory of a [`Pi`].
    #[derive(Debug, Clone, Copy, Default, PartialEq)]
    pub struct PiState as PiStateLanes {
        /// I, in units of the unscaled output.
        pub integral: f64,
        /// Whether the last output was limited.
        pub limited: bool,
    }
}

impl Pi {
    /// Controller with sampling period `period` (s), output multiplied by `scale` and limited to ±`limit`.
    pub fn new(config: &PiConfig, period: f64, scale: f64, limit: f64) -> Self {
        Pi { gain: config.gain, integral_gain: config.gain * period / config.integral_time, scale, limit }
    }

    /// One instant: error in, limited output back. The output is not scaled.
    #[inline(always)]
    pub fn update(&self, s: &mut PiState, error: f64) -> f64 {
        self.output(s, error, |wanted| wanted)
    }

    /// One instant: error and feedforward in, scaled and limited output back.
    #[inline(always)]
    pub fn update_with(&self, s: &mut PiState, error: f64, feedforward: f64) -> f64 {
        self.output(s, error, |wanted| (wanted + feedforward) * self.scale)
    }

    #[inline(always)]
    fn output(&self, s: &mut PiState, error: f64, scaled: impl Fn(f64) -> f64) -> f64 {
        let step = self.integral_gain * error;
        let wanted = scaled(self.gain.mul_add(error, s.integral + step));
        let y = limited(wanted, self.limit);
        let excess = wanted - y;
        s.limited = excess != 0.0;
        // Adding nothing, rather than not adding, keeps the loop over lanes free of conditional stores.
        s.integral += if error * excess > 0.0 { 0.0 } else { step };
        y
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    fn pi() -> Pi {
        // K = 2, K T/Ti = 2·0.5/4 = 0.25.
        Pi::new(&PiConfig { gain: 2.0, integral_time: 4.0 }, 0.5, 1.0, 10.0)
    }

    #[test]
    fn integral_is_used_at_the_instant_that_makes_it() {
        let mut s = PiState::default();
        assert_eq!(pi().update(&mut s, 1.0), 2.25);
        assert_eq!(pi().update_with(&mut s, 1.0, 0.5), 3.0);
    }

    #[test]
    fn limited_output_does_not_wind_the_integral_up() {
        let mut s = PiState::default();
        for _ in 0..100 {
            assert_eq!(pi().update(&mut s, 8.0), 10.0);
        }
        assert_eq!(s.integral, 0.0);
        assert!(s.limited);
    }

    #[test]
    fn error_against_the_excess_still_unwinds() {
        let mut s = PiState { integral: 30.0, limited: false };
        assert_eq!(pi().update(&mut s, -4.0), 10.0);
        assert_eq!(s.integral, 29.0);
    }
}
