//! PI controller with feedforward, output limit and anti-windup by conditional integration.
//!
//! The controllers of several axes run side by side: `Pi<N>` is a controller with numbers of the type N, an `f64` for one
//! axis or a SIMD vector with one axis in each lane, on which the same equations act ([`SimdReal`]). `soa_struct!` declares
//! such types. `a.select(mask, b)` is `if mask { a } else { b }`, decided in each lane.

use nalgebra::Complex;

use crate::config::PiConfig;
use crate::simd::{SimdReal, clamp_abs, soa_struct};

soa_struct! {
    /// Sampled PI controller with an output limit and anti-windup (Prévost fig. 3); the integral is in units of the
    /// output.
    ///
    /// ```text
    /// J = I + (K T/Ti) e          w = (K e + J + feedforward) scale          y = clamp(w, ±limit)
    /// I ← I  if (w − y) e > 0,  else J
    /// ```
    ///
    /// The anti-windup is conditional integration, not back-calculation: it keeps the integral while the output is
    /// limited and the error would increase the excess. The output of that cycle is not recomputed.
    ///
    /// `scale` converts the output: the velocity loop computes a torque and is limited in current, with scale 1/Kt.
    ///
    /// ```
    /// use virtual_axes_core::config::PiConfig;
    /// use virtual_axes_core::control::{Pi, PiState};
    ///
    /// // K = 2, Ti = 4 s, T = 0.5 s, scale 1, limit 10: K T/Ti = 0.25.
    /// let pi = Pi::new(&PiConfig { gain: 2.0, integral_time: 4.0 }, 0.5, 1.0, 10.0);
    /// let mut state = PiState::default();
    /// assert_eq!(pi.update(&mut state, 1.0), 2.25);
    /// assert_eq!(pi.update(&mut state, 1.0), 2.5);
    /// // 2.25 · 8 + 0.5 exceeds the limit by 8.5: the integral keeps its value.
    /// assert_eq!(pi.update(&mut state, 8.0), 10.0);
    /// assert_eq!((state.integral, state.excess), (0.5, 8.5));
    /// ```
    #[derive(Debug, Clone, Copy, PartialEq)]
    pub struct Pi {
        /// K T/Ti.
        integral_gain: N,
        /// (K + K T/Ti) scale: gain of the present error.
        gain: N,
        /// Factor of the output.
        scale: N,
        /// Limit of the output, after the factor.
        limit: N,
    }
}

soa_struct! {
    /// State of a [`Pi`].
    #[derive(Debug, Clone, Copy, Default, PartialEq)]
    pub struct PiState {
        /// I, in units of the unscaled output.
        pub integral: N,
        /// Amount w − y by which the last output exceeded its limit, in output units; 0 within the limit.
        pub excess: N,
    }
}

impl Pi {
    /// Creates a controller with sampling period `period` (s), output multiplied by `scale` and limited to ±`limit`.
    pub fn new(config: &PiConfig, period: f64, scale: f64, limit: f64) -> Self {
        let integral_gain = config.gain * period / config.integral_time;
        Pi { integral_gain, gain: (config.gain + integral_gain) * scale, scale, limit }
    }

    /// Returns the controller with another limit of its output.
    pub(crate) fn with_limit(self, limit: f64) -> Self {
        Pi { limit, ..self }
    }

    /// Returns the transfer function from error to output within the limit, (K + K T/Ti z/(z − 1)) scale, from
    /// `increment` z − 1.
    pub(crate) fn transfer(&self, increment: Complex<f64>) -> Complex<f64> {
        increment.inv() * (self.integral_gain * self.scale) + self.gain
    }
}

impl<N: SimdReal> Pi<N> {
    /// Steps the controller by one cycle with an error; returns the scaled and limited output.
    #[inline(always)]
    pub fn update(&self, s: &mut PiState<N>, error: N) -> N {
        self.output(s, error, s.integral * self.scale, |unlimited| unlimited)
    }

    /// Steps the controller by one cycle with an error and a feedforward; returns the scaled and limited output.
    #[inline(always)]
    pub fn update_with_feedforward(&self, s: &mut PiState<N>, error: N, feedforward: N) -> N {
        self.update_with_filter(s, error, feedforward, |unlimited| unlimited)
    }

    /// Steps the controller by one cycle with an error, a feedforward, and a filter of the scaled output before its
    /// limit; returns the limited output. The anti-windup compares the filtered output with its limit.
    #[inline(always)]
    pub fn update_with_filter(
        &self,
        s: &mut PiState<N>,
        error: N,
        feedforward: N,
        filter: impl FnOnce(N) -> N,
    ) -> N {
        self.output(s, error, (s.integral + feedforward) * self.scale, filter)
    }

    #[inline(always)]
    fn output(&self, s: &mut PiState<N>, error: N, offset: N, filter: impl FnOnce(N) -> N) -> N {
        let step = self.integral_gain * error;
        let unlimited = filter(self.gain.mul_add(error, offset));
        let y = clamp_abs(unlimited, self.limit);
        s.excess = unlimited - y;
        let zero = error.splat(0.0);
        s.integral = (s.integral + step).select((error * s.excess).simd_le(zero), s.integral);
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
    fn integral_is_updated_before_it_is_used() {
        let mut s = PiState::default();
        assert_eq!(pi().update(&mut s, 1.0), 2.25);
        assert_eq!(pi().update_with_feedforward(&mut s, 1.0, 0.5), 3.0);
    }

    #[test]
    fn anti_windup_keeps_the_integral_at_the_limit() {
        let mut s = PiState::default();
        for _ in 0..100 {
            assert_eq!(pi().update(&mut s, 8.0), 10.0);
        }
        assert_eq!(s.integral, 0.0);
        assert_eq!(s.excess, 8.0);
    }

    #[test]
    fn error_against_the_excess_still_integrates() {
        let mut s = PiState { integral: 30.0, excess: 0.0 };
        assert_eq!(pi().update(&mut s, -4.0), 10.0);
        assert_eq!(s.integral, 29.0);
    }
}
