//! The delays α, β and γ one after the other, by least squares on positions (Prévost section 3.5).
//!
//! A delay acts at the instants of a loop only: α where the position comparator samples (every Tsp), β and γ
//! where the velocity loop reads the feedforward (every Tsv). All delays between two such instants give the
//! same motion, so that what is found is an interval, open below and closed above.

use nalgebra::{DMatrix, DVector};
use rayon::prelude::*;

use super::closed_loop::{Experiment, deviations};
use super::mode::FeedforwardMode;
use virtual_axes_core::config::{AxisConfig, DelaysConfig, Periods};
use virtual_axes_core::units::{MILLISECOND_NS, Nanoseconds};

/// Longest delay, as in the schema of parameters.
const LONGEST: Nanoseconds = 100 * MILLISECOND_NS;
/// First pass over β and γ.
const COARSE: Nanoseconds = 2 * MILLISECOND_NS;
/// Change of the sum of squares that is noise, in units of the residuals' variance: three standard deviations.
const NOISE: f64 = 9.0;
/// Delays that are tried at once where an interval is followed.
const BLOCK: i64 = 8;
/// Longest correlation of residuals that is looked for, samples.
const CORRELATION: usize = 200;

/// Which delay.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum Delay {
    /// α, before the position comparator; seen without feedforward.
    Alpha,
    /// β, behind the velocity feedforward; seen with velocity feedforward only.
    Beta,
    /// γ, behind the torque feedforward; seen with both.
    Gamma,
}

impl Delay {
    /// Name in a machine file, without the unit.
    pub fn name(self) -> &'static str {
        match self {
            Delay::Alpha => "alpha",
            Delay::Beta => "beta",
            Delay::Gamma => "gamma",
        }
    }

    /// Recordings that show it.
    pub fn mode(self) -> FeedforwardMode {
        match self {
            Delay::Alpha => FeedforwardMode::Off,
            Delay::Beta => FeedforwardMode::Velocity,
            Delay::Gamma => FeedforwardMode::Both,
        }
    }

    /// Its value on an axis, ns.
    pub(super) fn of(self, delays: &DelaysConfig) -> Nanoseconds {
        match self {
            Delay::Alpha => delays.alpha,
            Delay::Beta => delays.beta,
            Delay::Gamma => delays.gamma,
        }
    }

    pub(super) fn set(self, axis: &mut AxisConfig, value: Nanoseconds) {
        match self {
            Delay::Alpha => axis.delays.alpha = value,
            Delay::Beta => axis.delays.beta = value,
            Delay::Gamma => axis.delays.gamma = value,
        }
    }

    /// Period of the loop that reads it, ns.
    fn grid(self, periods: &Periods) -> Nanoseconds {
        match self {
            Delay::Alpha => periods.position,
            Delay::Beta | Delay::Gamma => periods.velocity,
        }
    }
}

/// What a recording tells of a delay.
#[derive(Debug, Clone, PartialEq)]
pub struct DelayFit {
    /// Which one.
    pub delay: Delay,
    /// The data tell no difference between delays above the first and up to the second, ns.
    pub interval: (Nanoseconds, Nanoseconds),
    /// The delay to take, ns: that of the machine where it is in the interval, else the middle of the best part.
    pub value: Nanoseconds,
    /// Whether the data would bear longer delays than there are.
    pub at_end: bool,
    /// Whether the machine's own delay was left as it is.
    pub left: bool,
    /// Delays that were tried (ns), with the RMS of the deviations, m or rad.
    pub profile: Vec<(Nanoseconds, f64)>,
}

/// Finds a delay from the experiments with its feedforward; none if there are none.
///
/// `nuisance` moves other parameters a little: what a change of them explains is not counted for the delay.
/// `own` is the machine file's delay, which is kept if the data do not speak against it.
/// `around` looks near the axis's present delay only, for an axis that is known well.
pub(super) fn delay(
    which: Delay,
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
    // Part m holds the delays above (m − 1) and up to m instants.
    let middle = |m: i64| (m * grid - grid / 2).max(0);
    let residuals = |m: i64| {
        let mut axis = axis.clone();
        which.set(&mut axis, middle(m));
        deviations(&axis, periods, experiments)
    };
    let coarse = (COARSE / grid).max(1);
    let present = (which.of(&axis.delays) + grid - 1) / grid;
    let first = if around { present..=present } else { 0..=longest };
    let mut tried: Vec<(i64, DVector<f64>)> =
        tries(first.step_by(usize::try_from(coarse).unwrap_or(1)).collect(), &residuals);
    let best = |tried: &[(i64, DVector<f64>)]| {
        tried.iter().min_by(|a, b| a.1.norm_squared().total_cmp(&b.1.norm_squared())).map(|(m, _)| *m)
    };
    let near = best(&tried)?;
    let between =
        ((near - coarse).max(0)..=(near + coarse).min(longest)).filter(|m| m % coarse != 0).collect();
    tried.extend(tries(between, &residuals));
    let at_best = best(&tried)?;

    // Only what no other parameter explains is counted.
    let (_, at_minimum) = tried.iter().find(|(m, _)| *m == at_best)?.clone();
    let directions: Vec<DVector<f64>> = nuisance
        .iter()
        .filter_map(|moved| {
            let mut moved = moved.clone();
            which.set(&mut moved, middle(at_best));
            Some(deviations(&moved, periods, experiments)? - &at_minimum)
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
    // Residuals that are alike from sample to sample count less than their number.
    let limit = least * (1.0 + NOISE * inflation(at_minimum.as_slice()) / count) + count * f64::EPSILON;

    // The accepted neighborhood of the best, part by part; several are tried at once.
    let mut reach = |step: i64| {
        let mut end = at_best;
        loop {
            let next = end + step;
            if !(0..=longest).contains(&next) {
                return end;
            }
            if !tried.iter().any(|(known, _)| *known == next) {
                let block = (0..BLOCK).map(|k| next + k * step).filter(|m| (0..=longest).contains(m));
                tried.extend(tries(block.collect(), &residuals));
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
    let left = own > interval.0 && own <= interval.1;
    let mut profile: Vec<(Nanoseconds, f64)> =
        tried.iter().map(|(m, r)| (middle(*m), (r.norm_squared() / count).sqrt())).collect();
    profile.sort_by_key(|(delay, _)| *delay);
    Some(DelayFit {
        delay: which,
        interval: (interval.0.max(0), interval.1),
        value: if left { own } else { middle(at_best) },
        at_end: high == longest,
        left,
        profile,
    })
}

fn tries(
    parts: Vec<i64>,
    residuals: &(impl Fn(i64) -> Option<DVector<f64>> + Sync),
) -> Vec<(i64, DVector<f64>)> {
    parts.into_par_iter().filter_map(|m| Some((m, residuals(m)?))).collect()
}

/// How many samples count as one: 1 + 2 Σ ρ_k up to the first correlation that is not positive.
fn inflation(residuals: &[f64]) -> f64 {
    let mean = super::segments::mean(residuals);
    let covariance = |lag: usize| {
        let pairs = residuals.iter().zip(residuals.iter().skip(lag));
        pairs.map(|(a, b)| (a - mean) * (b - mean)).sum::<f64>()
    };
    let variance = covariance(0);
    let correlations = (1..CORRELATION.min(residuals.len())).map(|lag| covariance(lag) / variance);
    1.0 + 2.0 * correlations.take_while(|rho| *rho > 0.0).sum::<f64>()
}
