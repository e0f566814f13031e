//! Delays, gains and feedforward weights from the positions of a production trace, jointly by least squares.
//!
//! With full velocity feedforward the lag at constant velocity is α, and β shows in accelerations. A shift of the
//! commanded position makes α continuous during the search; it vanishes if the position cycle of the machine file divides
//! the lag, otherwise a shorter cycle is chosen.

use nalgebra::{DMatrix, DVector};
use rayon::prelude::*;

use super::closed_loop::{Experiment, position_residuals};
use super::covariance::systematic_covariance;
use super::feedforward_mode::FeedforwardMode;
use super::fit::{BoundedParameter, Effort, descend};
use super::loop_parameter::{LoopParameter, apply, prior};
use super::trace_experiments::trace_experiments;
use crate::recording::Signals;
use virtual_axes_core::config::{AxisConfig, Periods};
use virtual_axes_core::units::{MILLISECOND_NS, Nanoseconds, POSITION_GAIN, seconds};

/// Longest delay, s.
const LONGEST: f64 = 0.1;
/// Start values of β and γ relative to the lag.
const DELAY_STARTS: [f64; 4] = [0.2, 0.45, 0.7, 0.95];
/// Start values of the position-loop gain, (m/min)/mm.
const GAIN_STARTS: [f64; 3] = [1.4, 2.2, 3.3];
/// Start values of the ratio of velocity-loop gain to inertia, s⁻¹.
const BANDWIDTH_STARTS: [f64; 2] = [180.0, 300.0];
/// Residual with the gain of the machine file, relative to the least one, up to which it is kept.
const KEPT: f64 = 1.1;
/// Starts of each gain that are followed to their minimum.
const FOLLOWED: usize = 1;
/// Gains whose minimum is followed with a free gain; the best one can be a local minimum.
const FREED: usize = 4;
/// Longest difference of the lag from a whole number of position cycles, s.
const GRID_TOLERANCE: f64 = 0.15e-3;
/// Position cycles that are tried if that of the machine file does not divide the lag, ns.
const CYCLES: [Nanoseconds; 2] = [2 * MILLISECOND_NS, MILLISECOND_NS];
/// Residual with a shorter position cycle, relative to that with a cycle that divides the lag, from which on it is taken.
const SHORTER: f64 = 0.7;
/// Value of β from which on it is certainly not limited by 0, s.
const FREE_DELAY: f64 = 1.5e-3;

/// Fitted value with an upper bound of its standard error.
#[derive(Debug, Clone, Copy, PartialEq)]
pub(super) struct LoopValue {
    pub parameter: LoopParameter,
    pub value: f64,
    pub error: f64,
}

/// Result of the fit.
#[derive(Debug, Clone, PartialEq)]
pub(super) struct LoopFit {
    /// Axis with fitted delays, gains and weights.
    pub axis: AxisConfig,
    /// Periods with the position cycle that divides the lag.
    pub periods: Periods,
    pub values: Vec<LoopValue>,
    /// RMS position residual, m or rad.
    pub rms: f64,
    /// RMS position residual with the gain of the machine file, if the gain was fitted.
    pub rms_with_given_gain: Option<f64>,
    /// VFFW and lag (s) at both ends of the valley in which the residual hardly changes.
    pub valley: Option<[(f64, f64); 2]>,
}

/// Recordings and options of the fit.
#[derive(Debug, Clone, Copy)]
pub(super) struct LoopProblem<'a> {
    pub recordings: &'a [(&'a Signals, FeedforwardMode)],
    /// True if the position-loop gain is fitted.
    pub fits_gain: bool,
    /// Position-loop gain of the machine file, s⁻¹.
    pub given_gain: f64,
}

/// Candidate of the search: parameters and their values.
#[derive(Debug, Clone)]
struct Candidate {
    values: Vec<f64>,
    cost: f64,
}

impl LoopProblem<'_> {
    fn experiments(&self, periods: &Periods, shift: f64) -> Vec<Experiment> {
        let all = self.recordings.iter().enumerate();
        all.flat_map(|(k, (signals, mode))| trace_experiments(signals, k, periods, *mode, shift)).collect()
    }

    /// Returns true if a recording has the feedforward `mode`, or more.
    fn has(&self, mode: FeedforwardMode) -> bool {
        self.recordings.iter().any(|(_, active)| *active >= mode)
    }

    /// Returns true if the velocity feedforward has an effect on a recording.
    fn has_velocity_feedforward(&self, axis: &AxisConfig) -> bool {
        self.has(FeedforwardMode::Velocity) && axis.feedforward.velocity != 0.0
    }

    fn parameters(&self, axis: &AxisConfig) -> Vec<LoopParameter> {
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

    fn residuals(
        &self,
        axis: &AxisConfig,
        periods: &Periods,
        parameters: &[LoopParameter],
        values: &[f64],
    ) -> Option<DVector<f64>> {
        let (moved, shift) = apply(axis, periods, parameters, values);
        let left = position_residuals(&moved, periods, &self.experiments(periods, shift))?;
        let prior = prior(parameters, values, self.given_gain);
        Some(DVector::from_iterator(left.len() + prior.len(), left.iter().copied().chain(prior)))
    }

    fn bounded(
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

    /// Returns the values from which the search starts with a position-loop gain, best first.
    fn starts(
        &self,
        axis: &AxisConfig,
        periods: &Periods,
        parameters: &[LoopParameter],
        lag: f64,
    ) -> Vec<Candidate> {
        let mut all = Vec::new();
        let pairs = || DELAY_STARTS.iter().flat_map(|beta| DELAY_STARTS.map(|gamma| (*beta, gamma)));
        for bandwidth in BANDWIDTH_STARTS {
            for (beta, gamma) in pairs() {
                let value = |parameter: &LoopParameter| match parameter {
                    LoopParameter::Lag => lag,
                    LoopParameter::Beta => beta * lag,
                    LoopParameter::Gamma => gamma * lag,
                    LoopParameter::Gain => axis.position_loop.gain,
                    LoopParameter::Bandwidth => bandwidth,
                    LoopParameter::IntegralTime => 1.5 / bandwidth,
                    LoopParameter::TorqueRatio => 1.0,
                };
                all.push(parameters.iter().map(value).collect::<Vec<f64>>());
            }
        }
        let tried = all.into_par_iter().filter_map(|values| {
            let cost = self.residuals(axis, periods, parameters, &values)?.norm_squared();
            Some(Candidate { values, cost })
        });
        let mut tried: Vec<Candidate> = tried.collect();
        tried.sort_by(|a, b| a.cost.total_cmp(&b.cost));
        tried
    }

    /// Follows a start to its minimum.
    fn follow(
        &self,
        axis: &AxisConfig,
        periods: &Periods,
        parameters: &[LoopParameter],
        from: &[f64],
    ) -> Option<Candidate> {
        let bounded = self.bounded(periods, parameters, from);
        let (values, cost) = descend(&bounded, Effort::Simulation, |values| {
            self.residuals(axis, periods, parameters, values)
        })?;
        Some(Candidate { values, cost })
    }

    /// Returns the least minimum: first with some gains held, since a search over all parameters ends in local minima, then
    /// with a free gain.
    fn best(
        &self,
        axis: &AxisConfig,
        periods: &Periods,
        parameters: &[LoopParameter],
        lag: f64,
    ) -> Option<Candidate> {
        let held: Vec<LoopParameter> =
            parameters.iter().copied().filter(|p| *p != LoopParameter::Gain).collect();
        let gains: Vec<f64> = match self.fits_gain {
            true => GAIN_STARTS.iter().map(|gain| gain * POSITION_GAIN).chain([self.given_gain]).collect(),
            false => vec![self.given_gain],
        };
        let mut minima: Vec<(f64, Candidate)> = Vec::new();
        for gain in gains {
            let mut with_gain = axis.clone();
            with_gain.position_loop.gain = gain;
            for start in self.starts(&with_gain, periods, &held, lag).iter().take(FOLLOWED) {
                let found = self.follow(&with_gain, periods, &held, &start.values);
                minima.extend(found.map(|found| (gain, found)));
            }
        }
        minima.sort_by(|a, b| a.1.cost.total_cmp(&b.1.cost));
        let freed = minima.into_iter().take(FREED).filter_map(|(gain, found)| {
            let mut values = found.values.into_iter();
            let from =
                parameters.iter().map(|p| if *p == LoopParameter::Gain { Some(gain) } else { values.next() });
            self.follow(axis, periods, parameters, &from.collect::<Option<Vec<f64>>>()?)
        });
        freed.min_by(|a, b| a.cost.total_cmp(&b.cost))
    }

    /// Fits delays, gains and weights; `lag` is the best constant lag between commanded and actual position, s.
    pub fn fit(&self, axis: &AxisConfig, given: &Periods, lag: f64) -> Option<LoopFit> {
        let parameters = self.parameters(axis);
        let first = self.best(axis, given, &parameters, lag)?;
        let (periods, free) = self.with_dividing_cycle(axis, given, &parameters, first);
        let with_given = self.with_given_gain(axis, &periods, &parameters, &free);
        let given_cost = with_given.as_ref().map(|(_, found)| found.cost);
        // A gain that the motion hardly shows stays that of the machine file.
        let kept = with_given.filter(|(_, found)| found.cost <= KEPT * KEPT * free.cost);
        let is_kept = kept.is_some();
        let (parameters, free) = kept.unwrap_or((parameters, free));
        // The delay of the machine file is a whole number of position cycles.
        let tsp = seconds(periods.position);
        let cycles = (free.values[0] / tsp).round().max(0.0);
        let mut between = axis.clone();
        if !divides(periods.position, free.values[0]) && self.has_velocity_feedforward(axis) {
            // The lag is α + (1 − VFFW) / Kp: VFFW represents what is left of it between two cycles.
            let gain = parameters.iter().zip(&free.values).find(|(p, _)| **p == LoopParameter::Gain);
            let gain = gain.map_or(self.given_gain, |(_, value)| *value);
            between.feedforward.velocity -= (free.values[0] - cycles * tsp) * gain;
        }
        let (fixed, _) = apply(&between, &periods, &[LoopParameter::Lag], &[cycles * tsp]);
        let others = &parameters[1..];
        let last = self.follow(&fixed, &periods, others, &free.values[1..])?;
        let (found, _) = apply(&fixed, &periods, others, &last.values);
        let errors = self.errors(axis, &periods, &parameters, &free.values)?;
        let count = self.residuals(&fixed, &periods, others, &last.values)?.len().max(1) as f64;
        let values = parameters.iter().enumerate().map(|(k, &parameter)| LoopValue {
            parameter,
            value: if k == 0 { free.values[0] } else { last.values[k - 1] },
            error: errors[(k, k)].max(0.0).sqrt(),
        });
        let rms_with_given_gain = given_cost.filter(|_| !is_kept);
        Some(LoopFit {
            values: values.collect(),
            rms: (last.cost / count).sqrt(),
            rms_with_given_gain: rms_with_given_gain.map(|cost| (cost / count).sqrt()),
            valley: self.valley(&found, &periods, free.values[0]),
            axis: found,
            periods,
        })
    }

    /// Returns the minimum with the longest position cycle that divides its lag: that of the machine file or a shorter one;
    /// the shortest if none does. A wrong cycle shifts the lag, so it is found anew with each.
    ///
    /// Since a motion shows β + Tsp, β at 0 can mean that the cycle is too long: then a shorter one is taken if it leaves a
    /// clearly smaller residual.
    fn with_dividing_cycle(
        &self,
        axis: &AxisConfig,
        given: &Periods,
        parameters: &[LoopParameter],
        first: Candidate,
    ) -> (Periods, Candidate) {
        let mut best = (*given, first);
        for cycle in CYCLES.iter().filter(|cycle| **cycle < given.position && **cycle % given.velocity == 0) {
            let (before, candidate) = &best;
            let is_dividing = divides(before.position, candidate.values[0]);
            if is_dividing && !is_at_least_delay(parameters, &candidate.values) {
                break;
            }
            let periods = Periods { position: *cycle, ..*given };
            // The velocity feedforward is a difference over the position cycle: β + Tsp is what the motion shows.
            let change = seconds(before.position) - seconds(*cycle);
            let from = parameters.iter().zip(&candidate.values).map(|(parameter, value)| match parameter {
                LoopParameter::Beta | LoopParameter::Gamma => value + change,
                _ => *value,
            });
            let from: Vec<f64> = from.collect();
            let followed = if is_dividing {
                self.best(axis, &periods, parameters, candidate.values[0])
            } else {
                self.follow(axis, &periods, parameters, &from)
            };
            let Some(found) = followed else { continue };
            if !is_dividing || found.cost < SHORTER * SHORTER * candidate.cost {
                best = (periods, found);
            }
        }
        best
    }

    /// Returns the minimum with the gain of the machine file, and its parameters; none if the gain is not fitted.
    fn with_given_gain(
        &self,
        axis: &AxisConfig,
        periods: &Periods,
        parameters: &[LoopParameter],
        free: &Candidate,
    ) -> Option<(Vec<LoopParameter>, Candidate)> {
        parameters.iter().find(|parameter| **parameter == LoopParameter::Gain)?;
        let pairs =
            parameters.iter().zip(&free.values).filter(|(parameter, _)| **parameter != LoopParameter::Gain);
        let (others, values): (Vec<LoopParameter>, Vec<f64>) = pairs.map(|(p, v)| (*p, *v)).unzip();
        let found = self.follow(axis, periods, &others, &values)?;
        Some((others, found))
    }

    fn errors(
        &self,
        axis: &AxisConfig,
        periods: &Periods,
        parameters: &[LoopParameter],
        values: &[f64],
    ) -> Option<DMatrix<f64>> {
        let bounded = self.bounded(periods, parameters, values);
        systematic_covariance(&bounded, values, |x| self.residuals(axis, periods, parameters, x))
    }

    /// Returns VFFW and lag at two standard errors from the fit, with VFFW as a further parameter.
    ///
    /// The lag at constant velocity is α + (1 − VFFW) / Kp, so both compensate each other.
    fn valley(&self, axis: &AxisConfig, periods: &Periods, lag: f64) -> Option<[(f64, f64); 2]> {
        let weight = axis.feedforward.velocity;
        if !self.has_velocity_feedforward(axis) {
            return None;
        }
        let lags = |x: &[f64]| {
            let mut moved = axis.clone();
            moved.feedforward.velocity = x[1];
            self.residuals(&moved, periods, &[LoopParameter::Lag], &x[..1])
        };
        let bounded = [
            BoundedParameter { start: lag, low: 0.0, high: LONGEST, step: 5e-5 },
            BoundedParameter { start: weight, low: 0.0, high: 2.0, step: 2e-3 },
        ];
        let covariance = systematic_covariance(&bounded, &[lag, weight], lags)?;
        let half = 2.0 * covariance[(1, 1)].max(0.0).sqrt();
        let slope = covariance[(0, 1)] / covariance[(1, 1)];
        Some([-half, half].map(|change| (weight + change, lag + slope * change)))
    }
}

/// Returns true if β is at its lower bound.
fn is_at_least_delay(parameters: &[LoopParameter], values: &[f64]) -> bool {
    parameters.iter().zip(values).any(|(p, value)| *p == LoopParameter::Beta && *value < FREE_DELAY)
}

/// Returns true if the lag, s, is a whole number of cycles.
fn divides(cycle: Nanoseconds, lag: f64) -> bool {
    let tsp = seconds(cycle);
    (lag - (lag / tsp).round() * tsp).abs() <= GRID_TOLERANCE
}
