//! Delays, gains and feedforward weights from the positions of any program, jointly by least squares.
//!
//! With full velocity feedforward the lag at constant velocity is α, and β shows in accelerations. A shift of the
//! commanded position makes α continuous during the search. Position cycles that the recording permits are compared by
//! their residuals, so that the result does not depend on that of the machine file.

use nalgebra::{DMatrix, DVector};
use rayon::prelude::*;

use super::closed_loop::position_residuals;
use super::covariance::posterior_covariance;
use super::delays::correlation_inflation;
use super::experiment::{CurrentLogging, Experiment};
use super::feedforward_mode::FeedforwardMode;
use super::fit::{BoundedParameter, Effort, descend};
use super::loop_parameter::{LoopParameter, apply, prior};
use super::resample::interpolation_error;
use super::trace_experiments::trace_experiments;
use crate::recording::Signals;
use virtual_axes_core::config::{AxisConfig, Periods};
use virtual_axes_core::statistics::rms;
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
/// The same for the cycle at which the signals are renewed.
const RENEWED: f64 = 1.5;
/// Starts of each gain that are followed to their minimum.
const FOLLOWED: usize = 1;
/// Gains whose minimum is followed with a free gain; the best one can be a local minimum.
const FREED: usize = 4;
/// Minima with a free gain that are followed until they converge.
const FINISHED: usize = 2;
/// Longest difference of the lag from a whole number of position cycles, s.
const GRID_TOLERANCE: f64 = 0.1e-3;
/// Position cycles that are compared, ns; the search starts with the first one that the recordings permit.
const CYCLES: [Nanoseconds; 5] =
    [2 * MILLISECOND_NS, MILLISECOND_NS, 4 * MILLISECOND_NS, 6 * MILLISECOND_NS, MILLISECOND_NS / 2];
/// Relative tolerance of the longest position cycle.
const PERMITTED: f64 = 1e-3;
/// Relative change of the cost below which a minimum is reached, and largest number of searches for it.
const CONVERGED: f64 = 2e-3;
const SEARCHES: usize = 4;
/// Least step of an encoder, m or rad, above the rounding of positions; ratio of a difference to it up to which the
/// difference is compared, its tolerance, and the share of whole ratios of a quantized position.
const LEAST_STEP: f64 = 1e-11;
const MANY_STEPS: f64 = 100.0;
const WHOLE_STEPS: f64 = 0.05;
const QUANTIZED: f64 = 0.9;
/// Longest duration of a recording for the search, s.
const SEARCHED: f64 = 6.0;
/// Velocity cycles by which β and γ are moved, since they act at velocity cycles only.
const DELAY_STEPS: [f64; 2] = [-2.0, 2.0];

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
    /// Correlations of the fitted values, in their order.
    pub correlations: DMatrix<f64>,
    /// RMS position residual with the gain of the machine file, if the gain was fitted.
    pub rms_with_given_gain: Option<f64>,
    /// Axes with other position cycles that explain the positions about as well.
    pub alternatives: Vec<(AxisConfig, Periods)>,
    /// VFFW and lag (s) at both ends of the valley in which the residual hardly changes.
    pub valley: Option<[(f64, f64); 2]>,
}

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
}

/// Candidate of the search: parameters and their values.
#[derive(Debug, Clone)]
struct Candidate {
    values: Vec<f64>,
    cost: f64,
}

impl LoopFit {
    /// Returns true if the lag is no whole number of position cycles.
    pub fn is_between_cycles(&self) -> bool {
        let lag = self.values.iter().find(|value| value.parameter == LoopParameter::Lag);
        lag.is_some_and(|lag| !divides(self.periods.position, lag.value))
    }
}

impl LoopProblem<'_> {
    fn experiments(&self, periods: &Periods, shift: f64) -> Vec<Experiment> {
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
    fn has(&self, mode: FeedforwardMode) -> bool {
        self.recordings.iter().any(|(_, active)| *active >= mode)
    }

    /// Returns true if the velocity feedforward has an effect on a recording.
    fn has_velocity_feedforward(&self, axis: &AxisConfig) -> bool {
        self.has(FeedforwardMode::Velocity) && axis.feedforward.velocity != 0.0
    }

    /// Returns true if VFFW represents the part of the lag, s, that is no whole number of position cycles.
    fn is_between(&self, axis: &AxisConfig, periods: &Periods, lag: f64) -> bool {
        !divides(periods.position, lag) && self.has_velocity_feedforward(axis)
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
        let prior = prior(parameters, values, self.given_gain).into_iter().map(|row| self.noise * row);
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

    /// Follows a start until the cost hardly changes.
    fn converge(
        &self,
        axis: &AxisConfig,
        periods: &Periods,
        parameters: &[LoopParameter],
        from: &[f64],
    ) -> Option<Candidate> {
        let mut best = self.follow(axis, periods, parameters, from)?;
        for _ in 1..SEARCHES {
            let next = self.follow(axis, periods, parameters, &best.values)?;
            let is_reached = next.cost > (1.0 - CONVERGED) * best.cost;
            if next.cost < best.cost {
                best = next;
            }
            if is_reached {
                break;
            }
        }
        Some(best)
    }

    /// Moves β and γ by some velocity cycles, from each of which the others converge, until no move improves the minimum.
    fn polish(
        &self,
        axis: &AxisConfig,
        periods: &Periods,
        parameters: &[LoopParameter],
        mut best: Candidate,
    ) -> Candidate {
        let tsv = seconds(periods.velocity);
        let is_delay = |k: &usize| matches!(parameters[*k], LoopParameter::Beta | LoopParameter::Gamma);
        for _ in 1..SEARCHES {
            let moves = (0..parameters.len()).filter(is_delay).flat_map(|k| DELAY_STEPS.map(|by| (k, by)));
            let next = moves
                .filter_map(|(k, by)| {
                    let mut from = best.values.clone();
                    from[k] = (from[k] + by * tsv).max(0.0);
                    self.follow(axis, periods, parameters, &from)
                })
                .min_by(|a, b| a.cost.total_cmp(&b.cost));
            match next.filter(|next| next.cost < (1.0 - CONVERGED) * best.cost) {
                Some(next) => best = next,
                None => break,
            }
        }
        best
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
        let mut freed: Vec<Candidate> = freed.collect();
        freed.sort_by(|a, b| a.cost.total_cmp(&b.cost));
        let finished = freed.iter().take(FINISHED);
        let finished = finished.filter_map(|start| self.converge(axis, periods, parameters, &start.values));
        finished.min_by(|a, b| a.cost.total_cmp(&b.cost))
    }

    /// Returns the position cycles that the recordings permit, the first one to start with; that of the machine file last.
    fn cycles(&self, given: &Periods) -> Vec<Periods> {
        let (longest, is_certain) = self.longest_cycle;
        let certain = (longest / seconds(given.velocity)).round().max(1.0) as Nanoseconds * given.velocity;
        let is_permitted = |cycle: &Nanoseconds| {
            *cycle >= given.velocity
                && *cycle % given.velocity == 0
                && seconds(*cycle) <= longest * (1.0 + PERMITTED)
        };
        let mut cycles: Vec<Nanoseconds> = match is_certain {
            true => vec![certain],
            false => self
                .renewal(given)
                .into_iter()
                .chain(CYCLES)
                .chain([given.position])
                .filter(is_permitted)
                .collect(),
        };
        if cycles.is_empty() {
            cycles.push(given.velocity);
        }
        let mut known = Vec::new();
        cycles.retain(|cycle| {
            !known.contains(cycle) && {
                known.push(*cycle);
                true
            }
        });
        cycles.into_iter().map(|position| Periods { position, ..*given }).collect()
    }

    /// Returns the period at which the control renews its signals, rounded to velocity cycles, ns, if the recordings show it.
    fn renewal(&self, given: &Periods) -> Option<Nanoseconds> {
        let (signals, _) = self.recordings.iter().find(|(signals, _)| signals.is_renewal)?;
        Some((signals.period / seconds(given.velocity)).round() as Nanoseconds * given.velocity)
    }

    /// Returns the RMS residual of the best start, m or rad, without further search.
    pub fn rms_of_first(&self, axis: &AxisConfig, given: &Periods, lag: f64) -> Option<f64> {
        let (parameters, periods) = (self.parameters(axis), *self.cycles(given).first()?);
        let search = LoopProblem { duration: SEARCHED, ..*self };
        let found = search.best(axis, &periods, &parameters, lag)?;
        let count = search.residuals(axis, &periods, &parameters, &found.values)?.len().max(1);
        Some((found.cost / count as f64).sqrt())
    }

    /// Fits delays, gains and weights; `lag` is the best constant lag between commanded and actual position, s.
    pub fn fit(&self, axis: &AxisConfig, given: &Periods, lag: f64) -> Option<LoopFit> {
        let parameters = self.parameters(axis);
        let cycles = self.cycles(given);
        let start = cycles.first()?;
        // Long recordings are searched in part only.
        let search = LoopProblem { duration: SEARCHED, ..*self };
        let first = search.best(axis, start, &parameters, lag)?;
        let (periods, free, others) = search.best_cycle((axis, given), &cycles, &parameters, first);
        let others = others.iter().filter(|(other, _)| other.position != periods.position);
        let alternatives =
            others.map(|(other, found)| (apply(axis, other, &parameters, &found.values).0, *other));
        let alternatives = alternatives.collect();
        let free = search.polish(axis, &periods, &parameters, free);
        // A residual below that of usual encoders outweighs the prior.
        let noise = self.correlated_noise(axis, &periods, &parameters, &free.values)?;
        let problem = LoopProblem { noise: noise.min(self.noise), ..*self };
        let free = problem.converge(axis, &periods, &parameters, &free.values)?;
        let found = problem.finish((axis, &periods), parameters, free)?;
        Some(LoopFit { alternatives, ..found })
    }

    /// Returns the RMS error of a position by the coarsest encoder resolution of the recordings, m or rad.
    fn resolution(&self) -> f64 {
        let steps = self.recordings.iter().map(|(signals, _)| encoder_step(signals));
        steps.fold(0.0, f64::max) / 12.0_f64.sqrt()
    }

    /// Rounds the minimum `free` to the delays that a machine file can have, and determines its errors.
    fn finish(
        &self,
        (axis, periods): (&AxisConfig, &Periods),
        parameters: Vec<LoopParameter>,
        free: Candidate,
    ) -> Option<LoopFit> {
        let with_given = self.with_given_gain(axis, periods, &parameters, &free);
        let given_cost = with_given.as_ref().map(|(_, found)| found.cost);
        // Without feedforward the gain represents what is left of the lag between two cycles.
        let is_exact = divides(periods.position, free.values[0]) || self.has_velocity_feedforward(axis);
        // A gain that the motion hardly shows stays that of the machine file.
        let kept = with_given.filter(|(_, found)| is_exact && found.cost <= KEPT * KEPT * free.cost);
        let is_kept = kept.is_some();
        let (parameters, free) = kept.unwrap_or((parameters, free));
        // The delay of the machine file is a whole number of position cycles.
        let tsp = seconds(periods.position);
        let cycles = (free.values[0] / tsp).round().max(0.0);
        let is_between = self.is_between(axis, periods, free.values[0]);
        let mut between = axis.clone();
        if is_between {
            // The lag is α + (1 − VFFW) / Kp: VFFW represents what is left of it between two cycles, with the fitted gain.
            let gain = parameters.iter().zip(&free.values).find(|(p, _)| **p == LoopParameter::Gain);
            let gain = gain.map_or(self.given_gain, |(_, value)| *value);
            between.position_loop.gain = gain;
            between.feedforward.velocity -= (free.values[0] - cycles * tsp) * gain;
        }
        let (fixed, _) = apply(&between, periods, &[LoopParameter::Lag], &[cycles * tsp]);
        let pairs = parameters.iter().copied().zip(free.values.iter().copied());
        let (others, from): (Vec<LoopParameter>, Vec<f64>) =
            pairs.clone().filter(|(parameter, _)| is_rounded(*parameter, is_between)).unzip();
        let last = self.converge(&fixed, periods, &others, &from)?;
        let (found, _) = apply(&fixed, periods, &others, &last.values);
        let covariance = self.covariance(axis, periods, &parameters, &free.values)?;
        let errors = covariance.diagonal().map(|variance| variance.max(0.0).sqrt());
        let count = self.residuals(&fixed, periods, &others, &last.values)?.len().max(1) as f64;
        let values = pairs.enumerate().map(|(k, (parameter, value))| LoopValue {
            parameter,
            value: others.iter().position(|other| *other == parameter).map_or(value, |n| last.values[n]),
            error: errors[k],
        });
        let rms_with_given_gain = given_cost.filter(|_| !is_kept);
        Some(LoopFit {
            values: values.collect(),
            correlations: DMatrix::from_fn(parameters.len(), parameters.len(), |j, k| {
                covariance[(j, k)] / (errors[j] * errors[k])
            }),
            rms: (last.cost / count).sqrt(),
            rms_with_given_gain: rms_with_given_gain.map(|cost| (cost / count).sqrt()),
            alternatives: Vec::new(),
            valley: self.valley(&found, periods, free.values[0]),
            axis: found,
            periods: *periods,
        })
    }

    /// Fits the values of `known` again with the plant of `axis`.
    pub fn renew(&self, axis: &AxisConfig, known: &LoopFit) -> Option<LoopFit> {
        let lag = known.values.iter().find(|value| value.parameter == LoopParameter::Lag);
        let is_between = lag.is_some_and(|lag| self.is_between(axis, &known.periods, lag.value));
        let values = known.values.iter().filter(|value| is_rounded(value.parameter, is_between));
        let (parameters, from): (Vec<LoopParameter>, Vec<f64>) =
            values.map(|value| (value.parameter, value.value)).unzip();
        let found = self.converge(axis, &known.periods, &parameters, &from)?;
        let count = self.residuals(axis, &known.periods, &parameters, &found.values)?.len().max(1);
        let mut fit = known.clone();
        for (parameter, value) in parameters.iter().zip(&found.values) {
            let of_it = fit.values.iter_mut().filter(|known| known.parameter == *parameter);
            of_it.for_each(|known| known.value = *value);
        }
        fit.axis = apply(axis, &known.periods, &parameters, &found.values).0;
        fit.rms = (found.cost / count as f64).sqrt();
        Some(fit)
    }

    /// Returns the position cycle with the least residual, its minimum, and the cycles with about the same residual.
    /// Residuals below the resolution of the encoder or the error of interpolated setpoints count alike. Among cycles with
    /// about the same residual, the renewal of the signals is preferred, then that of the machine file if it divides the
    /// lag, then the first one.
    ///
    /// A motion shows β + Tsp, so the others start with β changed by the difference of the cycles.
    fn best_cycle(
        &self,
        (axis, given): (&AxisConfig, &Periods),
        cycles: &[Periods],
        parameters: &[LoopParameter],
        first: Candidate,
    ) -> (Periods, Candidate, Vec<(Periods, Candidate)>) {
        let Some(start) = cycles.first() else { return (*given, first, Vec::new()) };
        let others = cycles.iter().skip(1).filter_map(|periods| {
            let change = seconds(start.position) - seconds(periods.position);
            let from = parameters.iter().zip(&first.values).map(|(parameter, value)| match parameter {
                LoopParameter::Beta | LoopParameter::Gamma => (value + change).max(0.0),
                _ => *value,
            });
            let found = self.converge(axis, periods, parameters, &from.collect::<Vec<f64>>())?;
            Some((*periods, found))
        });
        let mut all: Vec<(Periods, Candidate)> = others.collect();
        all.push((*start, first.clone()));
        let count = self.experiments(start, 0.0).iter().map(|e| e.position.len()).sum::<usize>() as f64;
        let least = all.iter().map(|(_, found)| found.cost).fold(f64::INFINITY, f64::min);
        let interpolation = cycles.iter().map(|periods| self.interpolation(periods)).fold(0.0, f64::max);
        let floor = self.resolution().hypot(interpolation);
        let least = least.max(count * floor.powi(2));
        let renewal = self.renewal(given);
        let limit = |periods: &Periods| if Some(periods.position) == renewal { RENEWED } else { KEPT };
        all.retain(|(periods, found)| found.cost <= limit(periods).powi(2) * least);
        let preference = |(periods, found): &&(Periods, Candidate)| {
            let cycle = periods.position;
            let is_dividing = divides(cycle, found.values[0]);
            (
                Some(cycle) == self.renewal(given),
                is_dividing && cycle == given.position,
                cycle == start.position,
                is_dividing,
                cycle,
            )
        };
        let (periods, best) = all.iter().max_by_key(preference).cloned().unwrap_or((*start, first));
        (periods, best, all)
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
        let found = self.converge(axis, periods, &others, &values)?;
        Some((others, found))
    }

    /// Returns the standard deviation of a residual that counts as independent, m or rad.
    fn correlated_noise(
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
    fn interpolation(&self, periods: &Periods) -> f64 {
        let tsp = seconds(periods.position);
        let coarse = self.recordings.iter().filter(|(signals, _)| signals.period > (1.0 + PERMITTED) * tsp);
        let setpoints =
            coarse.flat_map(|(signals, _)| &signals.spans).filter_map(|span| span.psec.as_deref());
        setpoints.map(interpolation_error).fold(0.0, f64::hypot)
    }

    fn covariance(
        &self,
        axis: &AxisConfig,
        periods: &Periods,
        parameters: &[LoopParameter],
        values: &[f64],
    ) -> Option<DMatrix<f64>> {
        let bounded = self.bounded(periods, parameters, values);
        let noise = self.correlated_noise(axis, periods, parameters, values)?.max(f64::MIN_POSITIVE);
        let problem = LoopProblem { noise, ..*self };
        let residuals = |x: &[f64]| problem.residuals(axis, periods, parameters, x);
        let data = residuals(values)?.len().checked_sub(parameters.len())?;
        posterior_covariance(&bounded, values, residuals, &vec![None; data], noise)
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
        let left = lags(&[lag, weight])?;
        let data = left.len().checked_sub(1)?;
        let noise = self.correlated_noise(axis, periods, &[LoopParameter::Lag], &[lag])?;
        let covariance = posterior_covariance(&bounded, &[lag, weight], lags, &vec![None; data], noise)?;
        let half = 2.0 * covariance[(1, 1)].max(0.0).sqrt();
        let slope = covariance[(0, 1)] / covariance[(1, 1)];
        Some([-half, half].map(|change| (weight + change, lag + slope * change)))
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

/// Returns true if a parameter is fitted again with the rounded lag. The gain with which VFFW represents a part of the lag
/// stays that of the exact lag.
fn is_rounded(parameter: LoopParameter, is_between: bool) -> bool {
    parameter != LoopParameter::Lag && !(is_between && parameter == LoopParameter::Gain)
}

/// Returns true if the lag, s, is a whole number of cycles.
fn divides(cycle: Nanoseconds, lag: f64) -> bool {
    let tsp = seconds(cycle);
    (lag - (lag / tsp).round() * tsp).abs() <= GRID_TOLERANCE
}
