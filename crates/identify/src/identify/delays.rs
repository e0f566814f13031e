//! Identification of the delays α, β and γ by least squares on positions (Prévost section 3.5).
//!
//! A delay takes effect at the cycles of a loop only: α where the position comparator samples (every Tsp), β
//! and γ where the velocity loop reads the feedforward (every Tsv). All delays between two such cycles cause
//! the same motion. The result is therefore an interval, open below and closed above.

use nalgebra::{DMatrix, DVector};
use rayon::prelude::*;
use serde::Serialize;

use super::closed_loop::position_residuals;
use super::experiment::Experiment;
use super::feedforward_mode::FeedforwardMode;
use virtual_axes_core::config::{AxisConfig, DelaysConfig, Periods};
use virtual_axes_core::statistics::mean;
use virtual_axes_core::units::{MILLISECOND_NS, Nanoseconds};

/// Longest delay, as in the parameter schema.
const LONGEST: Nanoseconds = 100 * MILLISECOND_NS;
/// Step of the first pass over β and γ.
const COARSE: Nanoseconds = 2 * MILLISECOND_NS;
/// Significant change of the sum of squares, in units of the residual variance: three standard deviations.
const NOISE: f64 = 9.0;
/// Residual of the delay of the machine file, relative to the least one, up to which it is kept.
const KEPT: f64 = 1.1;
/// Delays evaluated in parallel while the interval is extended.
const BLOCK: i64 = 8;
/// Longest lag of the residual autocorrelation, samples.
const CORRELATION: usize = 200;

/// Delay parameter of an axis.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Serialize)]
#[serde(rename_all = "lowercase")]
pub enum DelayParameter {
    /// α, before the position comparator; identified without feedforward.
    Alpha,
    /// β, behind the velocity feedforward; identified with velocity feedforward only.
    Beta,
    /// γ, behind the torque feedforward; identified with both.
    Gamma,
}

impl DelayParameter {
    /// Returns the name in a machine file, without unit.
    pub fn name(self) -> &'static str {
        match self {
            DelayParameter::Alpha => "alpha",
            DelayParameter::Beta => "beta",
            DelayParameter::Gamma => "gamma",
        }
    }

    /// Returns the feedforward mode of the recordings that identify the delay.
    pub fn feedforward_mode(self) -> FeedforwardMode {
        match self {
            DelayParameter::Alpha => FeedforwardMode::Off,
            DelayParameter::Beta => FeedforwardMode::Velocity,
            DelayParameter::Gamma => FeedforwardMode::Both,
        }
    }

    /// Returns the value of the delay on an axis, ns.
    pub(super) fn of(self, delays: &DelaysConfig) -> Nanoseconds {
        match self {
            DelayParameter::Alpha => delays.alpha,
            DelayParameter::Beta => delays.beta,
            DelayParameter::Gamma => delays.gamma,
        }
    }

    pub(super) fn set(self, axis: &mut AxisConfig, value: Nanoseconds) {
        match self {
            DelayParameter::Alpha => axis.delays.alpha = value,
            DelayParameter::Beta => axis.delays.beta = value,
            DelayParameter::Gamma => axis.delays.gamma = value,
        }
    }

    /// Returns the period of the loop that reads the delay, ns.
    fn grid(self, periods: &Periods) -> Nanoseconds {
        match self {
            DelayParameter::Alpha => periods.position,
            DelayParameter::Beta | DelayParameter::Gamma => periods.velocity,
        }
    }
}

/// Identified delay.
#[derive(Debug, Clone, PartialEq)]
pub struct DelayFit {
    /// Delay parameter.
    pub delay: DelayParameter,
    /// Interval of equivalent delays: above the first and up to the second value, ns.
    pub interval: (Nanoseconds, Nanoseconds),
    /// Identified delay, ns: the value of the machine file if it is in the interval, otherwise the center of
    /// the best part.
    pub value: Nanoseconds,
    /// True if the interval ends at the longest delay.
    pub is_at_end: bool,
    /// True if the value of the machine file was kept.
    pub is_unchanged: bool,
    /// True if the delay was identified jointly with gains and weights, with feedforward active.
    pub is_joint: bool,
    /// Evaluated delays, ns, and RMS position residual, m or rad.
    pub profile: Vec<(Nanoseconds, f64)>,
}

/// Identifies a delay from the experiments with its feedforward mode. Returns none without experiments.
///
/// `nuisance` contains axes with slightly changed other parameters; residuals that these changes explain do
/// not count. `own` is the delay of the machine file, which is kept if it is in the interval. `around` limits
/// the search to the neighborhood of the present delay.
pub(super) fn fit_delay(
    which: DelayParameter,
    axis: &AxisConfig,
    periods: &Periods,
    experiments: &[Experiment],
    nuisance: &[AxisConfig],
    own: Nanoseconds,
    around: bool,
) -> Option<DelayFit> {
    if experiments.is_empty() {
        return None;
    }
    let grid = which.grid(periods);
    let longest = LONGEST / grid;
    // Part m contains the delays above (m − 1) and up to m cycles.
    let middle = |m: i64| (m * grid - grid / 2).max(0);
    let residuals = |m: i64| {
        let mut axis = axis.clone();
        which.set(&mut axis, middle(m));
        position_residuals(&axis, periods, experiments)
    };
    let coarse = (COARSE / grid).max(1);
    let present = (which.of(&axis.delays) + grid - 1) / grid;
    let first = if around { present..=present } else { 0..=longest };
    let mut tried: Vec<(i64, DVector<f64>)> =
        evaluate(first.step_by(usize::try_from(coarse).unwrap_or(1)).collect(), &residuals);
    let best = |tried: &[(i64, DVector<f64>)]| {
        tried.iter().min_by(|a, b| a.1.norm_squared().total_cmp(&b.1.norm_squared())).map(|(m, _)| *m)
    };
    let is_tried = |tried: &[(i64, DVector<f64>)], m: i64| tried.iter().any(|(known, _)| *known == m);
    let near = best(&tried)?;
    let between =
        ((near - coarse).max(0)..=(near + coarse).min(longest)).filter(|m| !is_tried(&tried, *m)).collect();
    tried.extend(evaluate(between, &residuals));
    let at_best = best(&tried)?;

    // Only residuals that no other parameter explains count.
    let (_, at_minimum) = tried.iter().find(|(m, _)| *m == at_best)?.clone();
    let directions: Vec<DVector<f64>> = nuisance
        .iter()
        .filter_map(|moved| {
            let mut moved = moved.clone();
            which.set(&mut moved, middle(at_best));
            Some(position_residuals(&moved, periods, experiments)? - &at_minimum)
        })
        .filter(|direction| direction.norm() > 0.0)
        .collect();
    let basis = (!directions.is_empty()).then(|| DMatrix::from_columns(&directions).qr().q());
    let squares = |r: &DVector<f64>| match &basis {
        Some(q) => r.norm_squared() - (q.transpose() * r).norm_squared(),
        None => r.norm_squared(),
    };
    let least = squares(&at_minimum);
    let count = at_minimum.len() as f64;
    // Autocorrelated residuals count less than their number.
    let limit =
        least * (1.0 + NOISE * correlation_inflation(at_minimum.as_slice()) / count) + count * f64::EPSILON;

    // Extends the accepted interval from the best part; several parts are evaluated in parallel.
    let mut reach = |step: i64| {
        let mut end = at_best;
        loop {
            let next = end + step;
            if !(0..=longest).contains(&next) {
                return end;
            }
            if !is_tried(&tried, next) {
                let block = (0..BLOCK).map(|k| next + k * step).filter(|m| (0..=longest).contains(m));
                tried.extend(evaluate(block.collect(), &residuals));
            }
            let accepted = tried.iter().find(|(m, _)| *m == next).is_some_and(|(_, r)| squares(r) <= limit);
            if !accepted {
                return end;
            }
            end = next;
        }
    };
    let (low, high) = (reach(-1), reach(1));
    let interval = (if low == 0 { -1 } else { (low - 1) * grid }, high * grid);
    // A delay whose residual is clearly above the best one of the profile is not kept, whatever other parameters could
    // explain.
    let own_part = (own + grid - 1) / grid;
    let own_squares =
        tried.iter().find(|(m, _)| *m == own_part).map_or(f64::INFINITY, |(_, r)| r.norm_squared());
    let is_close = own_squares <= KEPT * KEPT * at_minimum.norm_squared() + count * f64::EPSILON;
    let left = own > interval.0 && own <= interval.1 && is_close;
    let mut profile: Vec<(Nanoseconds, f64)> =
        tried.iter().map(|(m, r)| (middle(*m), (r.norm_squared() / count).sqrt())).collect();
    profile.sort_by_key(|(delay, _)| *delay);
    Some(DelayFit {
        delay: which,
        interval: (interval.0.max(0), interval.1),
        value: if left { own } else { middle(at_best) },
        is_at_end: high == longest,
        is_unchanged: left,
        is_joint: false,
        profile,
    })
}

fn evaluate(
    parts: Vec<i64>,
    residuals: &(impl Fn(i64) -> Option<DVector<f64>> + Sync),
) -> Vec<(i64, DVector<f64>)> {
    parts.into_par_iter().filter_map(|m| Some((m, residuals(m)?))).collect()
}

/// Returns the number of samples that count as one independent sample: 1 + 2 Σ ρ_k up to the first
/// non-positive correlation.
pub(super) fn correlation_inflation(residuals: &[f64]) -> f64 {
    let mean = mean(residuals).unwrap_or(f64::NAN);
    let covariance = |lag: usize| {
        let pairs = residuals.iter().zip(residuals.iter().skip(lag));
        pairs.map(|(a, b)| (a - mean) * (b - mean)).sum::<f64>()
    };
    let variance = covariance(0);
    let correlations = (1..CORRELATION.min(residuals.len())).map(|lag| covariance(lag) / variance);
    1.0 + 2.0 * correlations.take_while(|rho| *rho > 0.0).sum::<f64>()
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::identify::closed_loop::simulate;
    use crate::identify::experiment::CurrentLogging;
    use virtual_axes_core::config::Parameters;
    use virtual_axes_core::units::seconds;

    /// Returns 2 s of moves there and back, sampled every position cycle, on `axis`; the positions have an error of 5 µm.
    fn recorded(axis: &AxisConfig, periods: &Periods) -> Experiment {
        let tsp = seconds(periods.position);
        let count = (2.0 / tsp) as usize;
        let psec = |k: usize| 0.05 * (1.0 - (std::f64::consts::TAU * (k as f64 * tsp - 0.2).max(0.0)).cos());
        let mut experiment = Experiment {
            recording: 0,
            span: 0,
            sample: 0,
            mode: FeedforwardMode::Both,
            cycle: tsp,
            psec: (0..count).map(psec).collect(),
            first: 0.0,
            period: tsp,
            trace_filter: None,
            logging: CurrentLogging::INSTANT,
            start: 0.0,
            position: vec![0.0; count],
            velocity: vec![0.0; count],
            current: None,
        };
        let simulated = simulate(axis, periods, &experiment).expect("a simulation");
        let noise = |i: usize| 5e-6 * (i as f64 * 2.4).sin();
        experiment.position = simulated.position.iter().enumerate().map(|(i, x)| x + noise(i)).collect();
        experiment
    }

    #[test]
    fn a_delay_far_above_the_least_residual_is_not_kept_although_other_parameters_could_explain_it() {
        let machine = Parameters::embedded_default().and_then(|all| all.machine_config()).expect("a machine");
        let (periods, mut axis) = (machine.periods(), machine.axes()[0].clone());
        axis.delays.beta = 4 * MILLISECOND_NS;
        let experiments = [recorded(&axis, &periods)];
        let own = 7 * MILLISECOND_NS / 2;
        axis.delays.beta = own;
        let changed = |change: fn(&mut AxisConfig)| {
            let mut axis = axis.clone();
            change(&mut axis);
            axis
        };
        // Changes that move the axis like β.
        let nuisance = [
            changed(|axis| axis.feedforward.torque *= 1.5),
            changed(|axis| axis.feedforward.velocity *= 1.01),
            changed(|axis| axis.velocity_loop.gain *= 1.05),
            changed(|axis| axis.velocity_loop.integral_time *= 1.05),
            changed(|axis| axis.position_loop.gain *= 1.05),
            changed(|axis| axis.delays.alpha += 6 * MILLISECOND_NS),
        ];
        let fit = |nuisance: &[AxisConfig]| {
            fit_delay(DelayParameter::Beta, &axis, &periods, &experiments, nuisance, own, false)
                .expect("a fit")
        };
        let found = fit(&nuisance);
        let rms = |delay: Nanoseconds| {
            let nearest = found.profile.iter().min_by_key(|(tried, _)| (tried - delay).abs());
            nearest.map(|(_, rms)| *rms).expect("a profile")
        };
        assert!(
            found.interval.0 <= own && own <= found.interval.1,
            "explained by others: {:?}",
            found.interval
        );
        assert!(rms(own) > KEPT * rms(found.value), "{} {}", rms(own), rms(found.value));
        assert!(
            !found.is_unchanged && (found.value - 4 * MILLISECOND_NS).abs() <= periods.velocity,
            "{found:?}"
        );
    }
}
