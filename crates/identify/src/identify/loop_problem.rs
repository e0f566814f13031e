//! Residuals of the positions of a closed loop over delays, gains and feedforward weights.
//!
//! Actual values that are logged late make the lag continuous.

use std::sync::{Arc, Mutex, PoisonError};

use nalgebra::DVector;

use super::closed_loop::position_residuals;
use super::delays::correlation_inflation;
use super::experiment::{CurrentLogging, Experiment};
use super::feedforward_mode::FeedforwardMode;
use super::fit::BoundedParameter;
use super::loop_parameter::{LoopParameter, apply, prior};
use super::resample::interpolation_error;
use super::trace_experiments::trace_experiments;
use crate::recording::Signals;
use virtual_axes_core::config::{AxisConfig, Periods};
use virtual_axes_core::statistics::rms;
use virtual_axes_core::units::{Nanoseconds, POSITION_GAIN, seconds};

/// Longest delay, s.
pub(super) const LONGEST: f64 = 0.1;
/// Longest difference of the lag from a whole number of position cycles, s.
pub(super) const GRID_TOLERANCE: f64 = 0.1e-3;
/// Relative tolerance of the longest position cycle.
pub(super) const PERMITTED: f64 = 1e-3;
/// Least step of an encoder, m or rad, above the rounding of positions; ratio of a difference to it up to which the
/// difference is compared, its tolerance, and the share of whole ratios of a quantized position.
const LEAST_STEP: f64 = 1e-11;
const MANY_STEPS: f64 = 100.0;
const WHOLE_STEPS: f64 = 0.05;
const QUANTIZED: f64 = 0.9;

/// Recordings and options of the fit.
#[derive(Debug, Clone, Copy)]
pub(super) struct LoopProblem<'a> {
    pub recordings: &'a [(&'a Signals, FeedforwardMode)],
    /// Longest position cycle that the recordings permit, s, and true if it is certain.
    pub longest_cycle: (f64, bool),
    /// Residual of one standard deviation of the prior, m or rad.
    pub noise: f64,
    /// Duration of each recording that is simulated, from its first motion on, s.
    pub duration: f64,
    /// True if the position-loop gain is fitted.
    pub fits_gain: bool,
    /// Position-loop gain of the machine file, s⁻¹.
    pub given_gain: f64,
    /// True if the recordings show inertia, friction and gravity.
    pub has_plant: bool,
}

impl LoopProblem<'_> {
    pub fn experiments(&self, periods: &Periods, shift: f64) -> Vec<Experiment> {
        let all = self.recordings.iter().enumerate();
        let of = |(k, (signals, mode)): (usize, &(&Signals, FeedforwardMode))| {
            let mut left = self.duration;
            let mut experiments =
                trace_experiments(signals, k, periods, (*mode, shift, CurrentLogging::INSTANT));
            experiments.retain_mut(|experiment| {
                let is_used = left > 0.0;
                experiment.shorten(left.max(0.0));
                left -= experiment.position.len() as f64 * experiment.period;
                is_used && !experiment.position.is_empty()
            });
            experiments
        };
        all.flat_map(of).collect()
    }

    /// Returns true if a recording has the feedforward `mode`, or more.
    pub fn has(&self, mode: FeedforwardMode) -> bool {
        self.recordings.iter().any(|(_, active)| *active >= mode)
    }

    /// Returns true if the velocity feedforward has an effect on a recording.
    pub fn has_velocity_feedforward(&self, axis: &AxisConfig) -> bool {
        self.has(FeedforwardMode::Velocity) && axis.feedforward.velocity != 0.0
    }

    /// Returns true if VFFW represents the part of the lag, s, that is no whole number of position cycles.
    pub fn is_between(&self, axis: &AxisConfig, periods: &Periods, lag: f64) -> bool {
        !divides(periods.position, lag) && self.has_velocity_feedforward(axis)
    }

    pub fn parameters(&self, axis: &AxisConfig) -> Vec<LoopParameter> {
        let mut parameters = vec![LoopParameter::Lag];
        if self.has_velocity_feedforward(axis) {
            parameters.push(LoopParameter::Beta);
        }
        if self.has(FeedforwardMode::Both) && axis.feedforward.torque != 0.0 {
            parameters.extend([LoopParameter::Gamma, LoopParameter::TorqueRatio]);
        }
        if self.fits_gain {
            parameters.push(LoopParameter::Gain);
        }
        parameters.extend([LoopParameter::Bandwidth, LoopParameter::IntegralTime]);
        parameters
    }

    pub fn residuals(
        &self,
        axis: &AxisConfig,
        periods: &Periods,
        parameters: &[LoopParameter],
        values: &[f64],
    ) -> Option<DVector<f64>> {
        self.residuals_of(axis, periods, parameters)(values)
    }

    /// Returns the residuals as a function of the values. It keeps the experiments of the last shift, which most of the values
    /// of a Jacobian share.
    pub fn residuals_of<'b>(
        &'b self,
        axis: &'b AxisConfig,
        periods: &'b Periods,
        parameters: &'b [LoopParameter],
    ) -> impl Fn(&[f64]) -> Option<DVector<f64>> + Sync + 'b {
        let last: Mutex<Option<(f64, Arc<Vec<Experiment>>)>> = Mutex::new(None);
        let shifted = move |shift: f64| {
            let mut last = last.lock().unwrap_or_else(PoisonError::into_inner);
            let known =
                last.as_ref().filter(|(of, _)| *of == shift).map(|(_, experiments)| experiments.clone());
            known.unwrap_or_else(|| {
                let experiments = Arc::new(self.experiments(periods, shift));
                *last = Some((shift, experiments.clone()));
                experiments
            })
        };
        move |values| {
            let (moved, shift) = apply(axis, periods, parameters, values);
            let left = position_residuals(&moved, periods, &shifted(shift))?;
            let prior = prior(parameters, values, self.given_gain).into_iter().map(|row| self.noise * row);
            Some(DVector::from_iterator(left.len() + prior.len(), left.iter().copied().chain(prior)))
        }
    }

    pub fn bounded(
        &self,
        periods: &Periods,
        parameters: &[LoopParameter],
        values: &[f64],
    ) -> Vec<BoundedParameter> {
        let tsv = seconds(periods.velocity);
        let of = |(parameter, &start): (&LoopParameter, &f64)| {
            let (low, high, step) = match parameter {
                LoopParameter::Lag => ((start - 0.01).max(0.0), start + 0.01, 5e-5),
                LoopParameter::Beta | LoopParameter::Gamma => {
                    (0.0, LONGEST.min(start + 0.02), (2.0 * tsv).max(5e-4))
                }
                LoopParameter::Gain => (0.3 * POSITION_GAIN, 10.0 * POSITION_GAIN, 0.02 * start),
                LoopParameter::Bandwidth => (30.0, 2000.0, 0.03 * start),
                LoopParameter::IntegralTime => (5e-4, 0.1, 0.05 * start),
                LoopParameter::TorqueRatio => (0.0, 2.0, 0.03),
            };
            BoundedParameter { start: start.clamp(low, high), low, high, step }
        };
        parameters.iter().zip(values).map(of).collect()
    }

    /// Returns the RMS error of a position by the coarsest encoder resolution of the recordings, m or rad.
    pub fn resolution(&self) -> f64 {
        let steps = self.recordings.iter().map(|(signals, _)| encoder_step(signals));
        steps.fold(0.0, f64::max) / 12.0_f64.sqrt()
    }

    /// Returns the standard deviation of a residual that counts as independent, m or rad.
    pub fn correlated_noise(
        &self,
        axis: &AxisConfig,
        periods: &Periods,
        parameters: &[LoopParameter],
        values: &[f64],
    ) -> Option<f64> {
        let left = self.residuals(axis, periods, parameters, values)?;
        let data = left.as_slice().get(..left.len().checked_sub(parameters.len())?)?;
        let noise = rms(data.iter().copied())? * correlation_inflation(data).sqrt();
        Some(noise.hypot(self.interpolation(periods)))
    }

    /// Returns the error of the setpoints that are interpolated between samples, m or rad.
    pub fn interpolation(&self, periods: &Periods) -> f64 {
        let tsp = seconds(periods.position);
        let coarse = self.recordings.iter().filter(|(signals, _)| signals.period > (1.0 + PERMITTED) * tsp);
        let setpoints =
            coarse.flat_map(|(signals, _)| &signals.spans).filter_map(|span| span.psec.as_deref());
        setpoints.map(interpolation_error).fold(0.0, f64::hypot)
    }
}

/// Returns the step of a quantized position, m or rad; 0 if the differences of neighboring samples are no multiples of one.
fn encoder_step(signals: &Signals) -> f64 {
    let differences = || {
        let spans = signals.spans.iter().flat_map(|span| span.position.windows(2));
        spans.map(|pair| (pair[1] - pair[0]).abs()).filter(|step| *step > LEAST_STEP)
    };
    let step = differences().fold(f64::INFINITY, f64::min);
    let small: Vec<f64> = differences().map(|d| d / step).filter(|ratio| *ratio < MANY_STEPS).collect();
    let whole = small.iter().filter(|ratio| (*ratio - ratio.round()).abs() < WHOLE_STEPS).count();
    if whole as f64 >= QUANTIZED * small.len().max(1) as f64 { step } else { 0.0 }
}

/// Returns true if the lag, s, is a whole number of cycles.
pub(super) fn divides(cycle: Nanoseconds, lag: f64) -> bool {
    let tsp = seconds(cycle);
    (lag - (lag / tsp).round() * tsp).abs() <= GRID_TOLERANCE
}
