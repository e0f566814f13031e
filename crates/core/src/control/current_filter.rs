//! Filters of the current setpoint: low-pass and notch filters of second order.

use std::f64::consts::PI;

use nalgebra::Complex;

use crate::config::CurrentFilterConfig;
use crate::simd::{SimdReal, soa_struct};

soa_struct! {
    /// Discrete filter of second order with gain 1 at frequency 0, in transposed direct form II.
    ///
    /// ```text
    /// y = b0 x + s1          s1 ← b1 x − a1 y + s2          s2 ← b2 x − a2 y
    /// ```
    #[derive(Debug, Clone, Copy, PartialEq)]
    pub struct BiquadFilter {
        b0: N,
        b1: N,
        b2: N,
        a1: N,
        a2: N,
        /// 1 for a filter, 0 if the output is the input.
        enabled: N,
    }
}

soa_struct! {
    /// State of a [`BiquadFilter`], in units of its input.
    #[derive(Debug, Clone, Copy, Default, PartialEq)]
    pub struct BiquadState {
        /// s1.
        pub first: N,
        /// s2.
        pub second: N,
    }
}

soa_struct! {
    /// Filters of the current setpoint of one axis, in series.
    #[derive(Debug, Clone, Copy, PartialEq)]
    pub struct CurrentFilters {
        /// Filter of the unlimited current setpoint.
        first: BiquadFilter<N>,
        /// Filter of the output of the first one.
        second: BiquadFilter<N>,
    }
}

soa_struct! {
    /// State of [`CurrentFilters`].
    #[derive(Debug, Clone, Copy, Default, PartialEq)]
    pub struct CurrentFilterState {
        /// State of the first filter.
        pub first: BiquadState<N>,
        /// State of the second filter.
        pub second: BiquadState<N>,
    }
}

impl BiquadFilter {
    /// Discretizes a filter over `period` (s) by bilinear transformation with prewarping at its frequency; `None` is no
    /// filter.
    ///
    /// With c = tan(π f T), each polynomial s² + 2 D ω s + ω² becomes (z − 1)² + 2 D c (z² − 1) + c² (z + 1)², and the
    /// numerator ω² of a low-pass filter c² (z + 1)².
    pub fn new(config: Option<&CurrentFilterConfig>, period: f64) -> Self {
        let Some(config) = config else {
            return BiquadFilter { b0: 0.0, b1: 0.0, b2: 0.0, a1: 0.0, a2: 0.0, enabled: 0.0 };
        };
        let c = (PI * config.frequency() * period).tan();
        let square = c * c;
        let polynomial = |damping: f64| {
            let middle = 2.0 * damping * c;
            [1.0 + middle + square, 2.0 * (square - 1.0), 1.0 - middle + square]
        };
        let (numerator, denominator) = match *config {
            CurrentFilterConfig::LowPass { damping, .. } => {
                ([square, 2.0 * square, square], polynomial(damping))
            }
            CurrentFilterConfig::Notch { frequency, bandwidth, gain } => {
                let damping = bandwidth / (2.0 * frequency);
                (polynomial(damping * gain), polynomial(damping))
            }
        };
        let [b0, b1, b2] = numerator.map(|coefficient| coefficient / denominator[0]);
        let [_, a1, a2] = denominator.map(|coefficient| coefficient / denominator[0]);
        BiquadFilter { b0, b1, b2, a1, a2, enabled: 1.0 }
    }

    /// Returns the transfer function at q⁻¹ = `delay`.
    fn transfer(&self, delay: Complex<f64>) -> Complex<f64> {
        let polynomial = |first: f64, second: f64, third: f64| (delay * third + second) * delay + first;
        match self.enabled > 0.0 {
            true => polynomial(self.b0, self.b1, self.b2) / polynomial(1.0, self.a1, self.a2),
            false => 1.0.into(),
        }
    }

    /// Returns the pole in the upper half plane, or the larger of two real poles; `None` without a filter.
    fn pole(&self) -> Option<Complex<f64>> {
        let root = Complex::new(self.a1 * self.a1 / 4.0 - self.a2, 0.0).sqrt();
        (self.enabled > 0.0).then(|| root - self.a1 / 2.0)
    }

    /// Returns the state in which the input and output remain `value`.
    fn at_rest(&self, value: f64) -> BiquadState {
        let second = (self.b2 - self.a2) * value;
        BiquadState { first: (self.b1 - self.a1) * value + second, second }
    }
}

impl<N: SimdReal> BiquadFilter<N> {
    /// Steps the filter by one velocity cycle and returns its output.
    #[inline(always)]
    pub fn update(&self, s: &mut BiquadState<N>, input: N) -> N {
        let output = self.b0.mul_add(input, s.first);
        let next = BiquadState {
            first: self.b1.mul_add(input, (-self.a1).mul_add(output, s.second)),
            second: self.b2.mul_add(input, -(self.a2 * output)),
        };
        let is_enabled = input.splat(0.0).simd_lt(self.enabled);
        *s = next.select(is_enabled, *s);
        output.select(is_enabled, input)
    }
}

impl CurrentFilters {
    /// Discretizes the filters of an axis over `period`, the velocity period in s.
    pub fn new(filters: &[Option<CurrentFilterConfig>; 2], period: f64) -> Self {
        let [first, second] = filters.each_ref().map(|filter| BiquadFilter::new(filter.as_ref(), period));
        CurrentFilters { first, second }
    }

    /// Returns true if there is a filter.
    pub fn is_enabled(&self) -> bool {
        self.enabled().contains(&true)
    }

    /// Returns true for each filter that exists.
    pub(crate) fn enabled(&self) -> [bool; 2] {
        [&self.first, &self.second].map(|filter| filter.enabled > 0.0)
    }

    /// Returns the transfer function of both filters at q⁻¹ = `delay`.
    pub(crate) fn transfer(&self, delay: Complex<f64>) -> Complex<f64> {
        self.first.transfer(delay) * self.second.transfer(delay)
    }

    /// Returns one pole of each filter, in the upper half plane or real.
    pub(crate) fn poles(&self) -> impl Iterator<Item = Complex<f64>> {
        [&self.first, &self.second].into_iter().filter_map(BiquadFilter::pole)
    }

    /// Returns the state in which the setpoint remains `current`, A.
    pub fn at_rest(&self, current: f64) -> CurrentFilterState {
        CurrentFilterState { first: self.first.at_rest(current), second: self.second.at_rest(current) }
    }
}

impl<N: SimdReal> CurrentFilters<N> {
    /// Steps the filters by one velocity cycle and returns the filtered setpoint, A.
    #[inline(always)]
    pub fn update(&self, s: &mut CurrentFilterState<N>, setpoint: N) -> N {
        let between = self.first.update(&mut s.first, setpoint);
        self.second.update(&mut s.second, between)
    }
}
