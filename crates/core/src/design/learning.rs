//! Iterative learning control of one axis: learning filter, low-pass filter and convergence condition.

use std::f64::consts::PI;

use nalgebra::Complex;

use super::DesignError;

/// Reach of the filters to either side, position cycles.
const REACH: i64 = 256;
/// Frequencies of the inverse Fourier transform that gives the coefficients, from 0 to twice the Nyquist frequency.
const TRANSFORM: usize = 2048;
/// Frequencies of the convergence condition, from 0 to the Nyquist frequency.
const POINTS: usize = 2048;
/// Regularization ρ of the inverse of T: |L| is at most gain / (2 √ρ).
const REGULARIZATION: f64 = 0.01;
/// Exponent of the low-pass filter Q.
const STEEPNESS: i32 = 6;
/// Smallest bandwidth of Q, Hz: its impulse response ends within the reach of the filters.
const LEAST_BANDWIDTH: f64 = 1.0;
/// Bandwidths per octave that are tried.
const BANDWIDTHS_PER_OCTAVE: i32 = 8;
/// Largest bandwidth that is tried, as a fraction of the Nyquist frequency. With larger ones the error grew on the ballbar
/// test and the five-axis S-path; the convergence condition contains neither friction nor the fade at standstill.
const LARGEST_BANDWIDTH: f64 = 0.2;
/// Largest contraction factor of a bandwidth that is chosen automatically.
const CHOSEN_FACTOR: f64 = 0.9;

/// Default learning gain.
pub const LEARNING_GAIN: f64 = 0.5;

/// Linear filter with a finite impulse response, which may begin before its impulse.
#[derive(Debug, Clone, PartialEq)]
pub struct ImpulseResponse {
    first: i64,
    values: Vec<f64>,
}

impl ImpulseResponse {
    /// Creates the response whose `values` begin `first` cycles after the impulse; negative before it.
    pub fn new(first: i64, values: Vec<f64>) -> Self {
        ImpulseResponse { first, values }
    }

    /// Returns the cycle of the first value after the impulse; negative before it.
    pub fn first(&self) -> i64 {
        self.first
    }

    /// Returns the values, one per cycle.
    pub fn values(&self) -> &[f64] {
        &self.values
    }

    /// Returns the response earlier by `cycles`.
    #[must_use]
    pub fn advanced(mut self, cycles: i64) -> Self {
        self.first -= cycles;
        self
    }

    /// Returns the frequency response at `angle`, rad per sample.
    pub fn at(&self, angle: f64) -> Complex<f64> {
        let delay = Complex::from_polar(1.0, -angle);
        let sum = self.values.iter().rev().fold(Complex::from(0.0), |sum, value| sum * delay + value);
        sum * Complex::from_polar(1.0, -angle * self.first as f64)
    }

    /// Returns `signal` filtered, of the same length; the signal is 0 before and after.
    pub fn apply(&self, signal: &[f64]) -> Vec<f64> {
        let length = signal.len() as i64;
        let at = |k: i64| {
            // 0 ≤ k − first − i < length
            let newest = k - self.first;
            let from = (newest - length + 1).clamp(0, self.values.len() as i64);
            let to = (newest + 1).clamp(from, self.values.len() as i64);
            let values = &self.values[from as usize..to as usize];
            values.iter().zip(from..).map(|(value, i)| value * signal[(newest - i) as usize]).sum()
        };
        (0..length).map(at).collect()
    }

    /// Computes the response of `REACH` cycles to either side with the frequency response `at`, rad per sample.
    fn from_frequency_response(at: impl Fn(f64) -> Complex<f64>) -> Self {
        let half = TRANSFORM / 2;
        let step = 2.0 * PI / TRANSFORM as f64;
        let samples: Vec<Complex<f64>> = (0..=half).map(|i| at(i as f64 * step)).collect();
        let rotations: Vec<Complex<f64>> =
            (0..TRANSFORM).map(|i| Complex::from_polar(1.0, i as f64 * step)).collect();
        let value = |k: i64| {
            let sum = samples.iter().enumerate().map(|(i, sample)| {
                let weight = if i == 0 || i == half { 1.0 } else { 2.0 };
                let index = (i as i64 * k).rem_euclid(TRANSFORM as i64) as usize;
                weight * (sample * rotations[index]).re
            });
            sum.sum::<f64>() / TRANSFORM as f64
        };
        ImpulseResponse { first: -REACH, values: (-REACH..=REACH).map(value).collect() }
    }
}

/// Largest contraction factor of an iteration over all frequencies.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Contraction {
    /// Largest |Q (1 − L T)|; the error converges if it is below 1.
    pub factor: f64,
    /// Its frequency, Hz.
    pub frequency: f64,
}

/// Requirements on the filters of a learning axis.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct LearningTuning {
    /// Learning gain: part of the error that an iteration compensates at frequencies with |T| = 1.
    pub gain: f64,
    /// Bandwidth of Q, Hz, at which it is 1/2; `None` selects the highest one up to a fifth of the Nyquist
    /// frequency with a contraction factor of at most 0.9 for all plants.
    pub bandwidth: Option<f64>,
}

impl Default for LearningTuning {
    fn default() -> Self {
        LearningTuning { gain: LEARNING_GAIN, bandwidth: None }
    }
}

/// Filters of iterative learning control for one axis (Bristow, Tharayil, Alleyne, "A survey of iterative learning
/// control", IEEE Control Systems 26(3), 2006).
///
/// With the programmed setpoints r, the error e(j) = r − y(j) of iteration j and the compensation v(j) that is added to r:
///
/// ```text
/// v(j+1) = Q [v(j) + L e(j)]        L = gain · conj(T) / (|T|² + ρ)        Q = 1 / (1 + (f / bandwidth)⁶)
/// e(j+1) = Q (1 − L T) e(j) + (1 − Q) (1 − T) r
/// ```
///
/// T is the closed loop from setpoint to position. Both filters have finite impulse responses of 256 cycles to either
/// side; L T and Q have no phase. Q acts on the compensation, so that it does not smooth the programmed setpoints.
#[derive(Debug, Clone, PartialEq)]
pub struct LearningFilter {
    learning: ImpulseResponse,
    low_pass: ImpulseResponse,
    bandwidth: f64,
    nominal: Contraction,
}

impl LearningFilter {
    /// Designs the filters for the closed loop `nominal`, sampled every `period` s; `deviating` are closed loops on other
    /// plants, for which the bandwidth is chosen to converge as well. If none does, it is chosen for `nominal` alone.
    ///
    /// # Errors
    /// [`DesignError::OutOfRange`] for a gain or bandwidth out of range, [`DesignError::NotContracting`] if the nominal
    /// loop does not fulfill the convergence condition |Q (1 − L T)| < 1.
    pub fn design(
        nominal: &ImpulseResponse,
        deviating: &[ImpulseResponse],
        period: f64,
        tuning: &LearningTuning,
    ) -> Result<Self, DesignError> {
        let LearningTuning { gain, bandwidth } = *tuning;
        if !(gain.is_finite() && gain > 0.0) {
            let allowed = "be finite and above 0".to_owned();
            return Err(DesignError::OutOfRange { name: "learning gain", value: gain, allowed });
        }
        let nyquist = 0.5 / period;
        if let Some(value) = bandwidth.filter(|f| !(LEAST_BANDWIDTH..=nyquist).contains(f)) {
            let allowed = format!(
                "lie in {LEAST_BANDWIDTH} … {nyquist:.4} Hz, the Nyquist frequency of the position cycle"
            );
            return Err(DesignError::OutOfRange { name: "bandwidth", value, allowed });
        }
        let learning = ImpulseResponse::from_frequency_response(|angle| {
            let t = nominal.at(angle);
            gain * t.conj() / (t.norm_sqr() + REGULARIZATION)
        });
        let unfiltered = |t: &ImpulseResponse| unfiltered(&learning, t);
        let (of_nominal, of_deviating) = (unfiltered(nominal), deviating.iter().map(unfiltered));
        let mut all: Vec<Vec<f64>> = of_deviating.collect();
        all.push(of_nominal.clone());
        let chosen = |plants: &[Vec<f64>]| {
            let is_slow = |f: &f64| {
                let q = LowPass::new(*f, period);
                plants.iter().all(|plant| contraction(plant, |a| q.at(a), period).factor <= CHOSEN_FACTOR)
            };
            bandwidths(nyquist).find(is_slow)
        };
        let bandwidth = bandwidth
            .or_else(|| chosen(&all))
            .or_else(|| chosen(std::slice::from_ref(&of_nominal)))
            .unwrap_or(LARGEST_BANDWIDTH * nyquist);
        let q = LowPass::new(bandwidth, period);
        let mut low_pass = ImpulseResponse::from_frequency_response(|angle| q.at(angle).into());
        // A constant compensation passes unchanged.
        let sum: f64 = low_pass.values.iter().sum();
        low_pass.values.iter_mut().for_each(|value| *value /= sum);
        let nominal = contraction(&of_nominal, |angle| low_pass.at(angle).norm(), period);
        if nominal.factor.is_nan() || nominal.factor >= 1.0 {
            let Contraction { factor, frequency } = nominal;
            return Err(DesignError::NotContracting { factor, frequency, bandwidth, gain });
        }
        Ok(LearningFilter { learning, low_pass, bandwidth, nominal })
    }

    /// Returns the learning filter L, from error to compensation.
    pub fn learning(&self) -> &ImpulseResponse {
        &self.learning
    }

    /// Returns the low-pass filter Q.
    pub fn low_pass(&self) -> &ImpulseResponse {
        &self.low_pass
    }

    /// Returns the bandwidth of Q, Hz.
    pub fn bandwidth(&self) -> f64 {
        self.bandwidth
    }

    /// Returns the contraction for the nominal closed loop.
    pub fn nominal(&self) -> Contraction {
        self.nominal
    }

    /// Computes the contraction for another closed loop, sampled every `period` s.
    pub fn contraction(&self, response: &ImpulseResponse, period: f64) -> Contraction {
        let low_pass = |angle| self.low_pass.at(angle).norm();
        contraction(&unfiltered(&self.learning, response), low_pass, period)
    }

    /// Returns the compensation of the next iteration from the present one and the error, one value per cycle.
    ///
    /// Both have the unit of the setpoints and the same length; they are 0 outside.
    pub fn next_compensation(&self, compensation: &[f64], error: &[f64]) -> Vec<f64> {
        let learned = self.learning.apply(error);
        let sum: Vec<f64> = compensation.iter().zip(learned).map(|(v, learned)| v + learned).collect();
        self.low_pass.apply(&sum)
    }
}

/// Ideal low-pass filter without phase.
struct LowPass {
    /// Bandwidth, rad per sample.
    cutoff: f64,
}

impl LowPass {
    fn new(bandwidth: f64, period: f64) -> Self {
        LowPass { cutoff: 2.0 * PI * bandwidth * period }
    }

    fn at(&self, angle: f64) -> f64 {
        1.0 / (1.0 + (angle / self.cutoff).powi(STEEPNESS))
    }
}

/// Returns the bandwidths that are tried, Hz, in falling order.
fn bandwidths(nyquist: f64) -> impl Iterator<Item = f64> {
    let largest = LARGEST_BANDWIDTH * nyquist;
    let at = move |i: i32| largest * 2.0_f64.powf(-f64::from(i) / f64::from(BANDWIDTHS_PER_OCTAVE));
    (0..).map(at).take_while(|f| *f >= LEAST_BANDWIDTH)
}

/// Returns |1 − L T| at the frequencies of the convergence condition.
fn unfiltered(learning: &ImpulseResponse, response: &ImpulseResponse) -> Vec<f64> {
    angles().map(|angle| (1.0 - learning.at(angle) * response.at(angle)).norm()).collect()
}

/// Returns the largest of |Q| |1 − L T|, the latter being `unfiltered`.
fn contraction(unfiltered: &[f64], low_pass: impl Fn(f64) -> f64, period: f64) -> Contraction {
    let mut largest = Contraction { factor: 0.0, frequency: 0.0 };
    for (angle, value) in angles().zip(unfiltered) {
        let factor = low_pass(angle) * value;
        if factor > largest.factor || factor.is_nan() {
            largest = Contraction { factor, frequency: angle / (2.0 * PI * period) };
        }
    }
    largest
}

/// Returns the frequencies of the convergence condition, rad per sample.
fn angles() -> impl Iterator<Item = f64> {
    (0..=POINTS).map(|i| PI * i as f64 / POINTS as f64)
}
