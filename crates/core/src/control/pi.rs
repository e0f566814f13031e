//! PI controller with feedforward, output limit and anti-windup.

use crate::config::PiConfig;
use crate::simd::{Number, limited, numbers};

numbers! {
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
    pub struct Pi {
        integral_gain: N,
        /// What an error makes of the scaled output at once: (K + K T/Ti) scale.
        gain: N,
        scale: N,
        limit: N,
    }
}

numbers! {
    /// Memory of a [`Pi`].
    #[derive(Debug, Clone, Copy, Default, PartialEq)]
    pub struct PiState {
        /// I, in units of the unscaled output.
        pub integral: N,
        /// By how much the last output was over its limit, in its unit; 0 where it was not.
        pub excess: N,
    }
}

impl Pi {
    /// Controller with sampling period `period` (s), output multiplied by `scale` and limited to ±`limit`.
    pub fn new(config: &PiConfig, period: f64, scale: f64, limit: f64) -> Self {
        let integral_gain = config.gain * period / config.integral_time;
        Pi { integral_gain, gain: (config.gain + integral_gain) * scale, scale, limit }
    }
}

impl<N: Number> Pi<N> {
    /// One instant: error in, limited output back. The output is not scaled.
    #[inline(always)]
    pub fn update(&self, s: &mut PiState<N>, error: N) -> N {
        self.output(s, error, s.integral)
    }

    /// One instant: error and feedforward in, scaled and limited output back.
    #[inline(always)]
    pub fn update_with(&self, s: &mut PiState<N>, error: N, feedforward: N) -> N {
        self.output(s, error, (s.integral + feedforward) * self.scale)
    }

    #[inline(always)]
    fn output(&self, s: &mut PiState<N>, error: N, rest: N) -> N {
        let step = self.integral_gain * error;
        let wanted = self.gain.mul_add(error, rest);
        let y = limited(wanted, self.limit);
        s.excess = wanted - y;
        let nothing = error.constant(0.0);
        s.integral = (s.integral + step).select((error * s.excess).at_most(nothing), s.integral);
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
        assert_eq!(s.excess, 8.0);
    }

    #[test]
    fn error_against_the_excess_still_unwinds() {
        let mut s = PiState { integral: 30.0, excess: 0.0 };
        assert_eq!(pi().update(&mut s, -4.0), 10.0);
        assert_eq!(s.integral, 29.0);
    }
}
