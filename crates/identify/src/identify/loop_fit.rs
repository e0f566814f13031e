//! Delays, gains and feedforward weights from the positions of any program, jointly by least squares.
//!
//! With full velocity feedforward the lag at constant velocity is α, and β shows in accelerations. Position
//! cycles that the recording permits are compared, so that the result does not depend on that of the machine file.

use nalgebra::DMatrix;

use super::covariance::posterior_covariance;
use super::fit::BoundedParameter;
use super::loop_parameter::{LoopParameter, apply};
use super::loop_problem::{LONGEST, LoopProblem, divides};
use super::loop_search::LoopMinimum;
use super::loop_values::{LoopFit, LoopValue};
use super::position_cycles::{CycleMinimum, KEPT};
use virtual_axes_core::config::{AxisConfig, Periods};
use virtual_axes_core::statistics::rms;
use virtual_axes_core::units::seconds;

/// Longest duration of a recording for the search, s.
const SEARCHED: f64 = 6.0;
/// Largest number of passes with the noise of the residual before, and its change that ends them.
const NOISE_PASSES: usize = 6;
const SAME_NOISE: f64 = 0.8;
/// TFFW / Jeq from which the fit with torque feedforward starts at the minimum without it.
const TORQUE_START: f64 = 0.5;

impl LoopProblem<'_> {
    /// Returns the problem of a part of long recordings, for the search.
    fn searched(&self) -> Self {
        LoopProblem { duration: SEARCHED, ..*self }
    }

    /// Searches the least minimum with the first position cycle; `lag` is the best constant lag between commanded and
    /// actual position, s.
    pub fn search(&self, axis: &AxisConfig, given: &Periods, lag: f64) -> Option<LoopMinimum> {
        self.searched().best(axis, self.cycles(given).first()?, &self.parameters(axis), lag)
    }

    /// Follows the minimum `from` of a search, whose delays can be those of a local one and whose prior can outweigh the
    /// motion.
    pub fn polished(&self, axis: &AxisConfig, given: &Periods, from: LoopMinimum) -> Option<LoopMinimum> {
        let (search, parameters, cycles) = (self.searched(), self.parameters(axis), self.cycles(given));
        let from = search.polish(axis, cycles.first()?, &parameters, from);
        Some(search.with_noise_of(axis, cycles.first()?, &parameters, from)?.1)
    }

    /// Returns the RMS residual of a minimum of the search, m or rad.
    pub fn searched_rms(&self, axis: &AxisConfig, given: &Periods, found: &LoopMinimum) -> Option<f64> {
        let (search, parameters) = (self.searched(), self.parameters(axis));
        let left = search.residuals(axis, self.cycles(given).first()?, &parameters, &found.values)?;
        let data = left.len().saturating_sub(parameters.len());
        rms(left.iter().take(data).copied())
    }

    /// Returns the position-loop gain of a minimum, s⁻¹; that of `axis` if it is not fitted.
    pub fn gain_of(&self, axis: &AxisConfig, minimum: &LoopMinimum) -> f64 {
        let parameters = self.parameters(axis);
        let gain = parameters.iter().zip(&minimum.values).find(|(p, _)| **p == LoopParameter::Gain);
        gain.map_or(axis.position_loop.gain, |(_, gain)| *gain)
    }

    /// Returns the minimum with torque feedforward next to the minimum `from` without it.
    pub fn with_torque(
        &self,
        axis: &AxisConfig,
        given: &Periods,
        from: &[(LoopParameter, f64)],
    ) -> Option<LoopMinimum> {
        let (search, parameters, cycles) = (self.searched(), self.parameters(axis), self.cycles(given));
        let of =
            |wanted: LoopParameter| from.iter().find(|(known, _)| *known == wanted).map(|(_, value)| *value);
        let start = parameters.iter().map(|parameter| match parameter {
            LoopParameter::Gamma => of(LoopParameter::Beta),
            LoopParameter::TorqueRatio => Some(TORQUE_START),
            other => of(*other),
        });
        let start = start.collect::<Option<Vec<f64>>>()?;
        search.converge(axis, cycles.first()?, &parameters, &start)
    }

    /// Follows the minimum `from` with the noise of its residual, until the noise stays: a residual below that of usual
    /// encoders outweighs the prior. Returns the problem with that noise.
    fn with_noise_of(
        &self,
        axis: &AxisConfig,
        periods: &Periods,
        parameters: &[LoopParameter],
        mut from: LoopMinimum,
    ) -> Option<(Self, LoopMinimum)> {
        let mut problem = *self;
        for _ in 0..NOISE_PASSES {
            let noise = problem.correlated_noise(axis, periods, parameters, &from.values)?;
            if noise > SAME_NOISE * problem.noise {
                break;
            }
            problem.noise = noise;
            from = problem.converge(axis, periods, parameters, &from.values)?;
            from = problem.polish(axis, periods, parameters, from);
        }
        Some((problem, from))
    }

    /// Fits delays, gains and weights from the minimum `first` of a search.
    pub fn fit(&self, axis: &AxisConfig, given: &Periods, first: LoopMinimum) -> Option<LoopFit> {
        let parameters = self.parameters(axis);
        let cycles = self.cycles(given);
        // Long recordings are searched in part only.
        let (search, first) = self.searched().with_noise_of(axis, cycles.first()?, &parameters, first)?;
        let (best, all) = search.best_cycle((axis, given), &cycles, &parameters, first)?;
        let others = all.iter().filter(|other| other.periods.position != best.periods.position);
        let alternatives = others.map(|other| {
            (apply(&other.axis, &other.periods, &parameters, &other.minimum.values).0, other.periods)
        });
        let alternatives = alternatives.collect();
        let CycleMinimum { axis, periods, minimum, .. } = best;
        let axis = &axis;
        let free = search.polish(axis, &periods, &parameters, minimum);
        // A residual below that of usual encoders outweighs the prior.
        let noise = self.correlated_noise(axis, &periods, &parameters, &free.values)?;
        let problem = LoopProblem { noise: noise.min(self.noise), ..*self };
        let free = problem.converge(axis, &periods, &parameters, &free.values)?;
        let found = problem.finish((axis, &periods), parameters, free)?;
        Some(LoopFit { alternatives, ..found })
    }

    /// Rounds the minimum `free` to the delays that a machine file can have, and determines its errors.
    fn finish(
        &self,
        (axis, periods): (&AxisConfig, &Periods),
        parameters: Vec<LoopParameter>,
        free: LoopMinimum,
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
        let pairs = parameters.iter().copied().zip(free.values.iter().copied());
        let (fixed, _) = apply(&between, periods, &[LoopParameter::Lag], &[cycles * tsp]);
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
            exact_rms: (free.cost / count).sqrt(),
            exact_axis: apply(axis, periods, &parameters, &free.values).0,
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
        let noise = self.correlated_noise(axis, &known.periods, &parameters, &from)?;
        let problem = LoopProblem { noise: noise.min(self.noise), ..*self };
        let found = problem.converge(axis, &known.periods, &parameters, &from)?;
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

    /// Returns the minimum with the gain of the machine file, and its parameters; none if the gain is not fitted.
    fn with_given_gain(
        &self,
        axis: &AxisConfig,
        periods: &Periods,
        parameters: &[LoopParameter],
        free: &LoopMinimum,
    ) -> Option<(Vec<LoopParameter>, LoopMinimum)> {
        parameters.iter().find(|parameter| **parameter == LoopParameter::Gain)?;
        let pairs =
            parameters.iter().zip(&free.values).filter(|(parameter, _)| **parameter != LoopParameter::Gain);
        let (others, values): (Vec<LoopParameter>, Vec<f64>) = pairs.map(|(p, v)| (*p, *v)).unzip();
        let found = self.converge(axis, periods, &others, &values)?;
        Some((others, found))
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
        let residuals = problem.residuals_of(axis, periods, parameters);
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

/// Returns true if a parameter is fitted again with the rounded lag. The gain with which VFFW represents a part of the lag
/// stays that of the exact lag.
fn is_rounded(parameter: LoopParameter, is_between: bool) -> bool {
    parameter != LoopParameter::Lag && !(is_between && parameter == LoopParameter::Gain)
}
